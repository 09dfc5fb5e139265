// websocket.mjs URL - the daemon's WebSocket by npm's ws, which knows nothing of this project. Standard
// input: { broken: [{ what, data, code }], hello, auth } of tests/system/websocket_ws.py, bytes in base64.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import WebSocket from "ws";

const [url] = process.argv.slice(2);
const { broken, hello, auth } = JSON.parse(readFileSync(0, "utf8"));
const bytes = (base64) => Buffer.from(base64, "base64");
const port = new URL(url).port;
const WAIT_MS = 60000;

const next = (ws, event) => new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error(`${event} never came`)), WAIT_MS);
    ws.once(event, (...args) => {
        clearTimeout(timer);
        resolve(args);
    });
});

async function open(options = {}) {
    const ws = new WebSocket(url, "hgp.1", options);
    await next(ws, "open");
    return ws;
}

// Types of HGP messages, as many as are asked for.
function receive(ws, count) {
    let data = Buffer.alloc(0);
    const types = [];
    return new Promise((resolve) => ws.on("message", (part, isBinary) => {
        assert.ok(isBinary);
        data = Buffer.concat([data, part]);
        while (data.length >= 16 && data.length >= 16 + data.readUInt32LE(0)) {
            types.push(data.readUInt16LE(4));
            data = data.subarray(16 + data.readUInt32LE(0));
        }
        if (types.length >= count)
            resolve(types);
    }));
}

// A session: it offers permessage-deflate, which is not taken; fragments with pings between them.
const ws = await open({ origin: `http://127.0.0.1:${port}` });
assert.equal(ws.protocol, "hgp.1");
assert.equal(ws.extensions, "");
const opened = receive(ws, 2);
const both = Buffer.concat([bytes(hello), bytes(auth)]);
for (const [from, to] of [[0, 5], [5, 30], [30, both.length]]) {
    ws.send(both.subarray(from, to), { fin: to === both.length, compress: false });
    const ponged = next(ws, "pong");
    ws.ping(`p${from}`);
    assert.equal(String((await ponged)[0]), `p${from}`);
}
assert.deepEqual(await opened, [0x0102, 0x0104]);
ws.close(4001, "done");
assert.equal((await next(ws, "close"))[0], 4001);

// Upgrades that are refused.
for (const [protocol, options, status] of [["hgp.1", { origin: "http://evil.example" }, 403],
    ["chat", {}, 400], ["hgp.1", { protocolVersion: 8 }, 426]]) {
    const refused = new WebSocket(url, protocol, options);
    refused.on("error", () => {});
    const [, response] = await next(refused, "unexpected-response");
    assert.equal(response.statusCode, status, JSON.stringify(options));
    response.destroy();
}

// Each rule that is broken, on a connection that ws has opened; ws reads the answer.
for (const { what, data, code } of broken) {
    const bad = await open();
    const closed = next(bad, "close");
    bad._socket.write(bytes(data));
    assert.equal((await closed)[0], code, what);
}
console.log(`${broken.length} broken rules, ws ${JSON.parse(readFileSync(
    new URL("node_modules/ws/package.json", import.meta.url), "utf8")).version}`);
