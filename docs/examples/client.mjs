// A client of heliod in 40 lines: loads a scene and writes its picture, with the codec of hgp.js.
//
//     node client.mjs unix:/run/heliod.sock|tcp:HOST:PORT SCENE OUT.png     (a token comes from HELIO_TOKEN)
import { writeFileSync } from "node:fs";
import net from "node:net";
import * as hgp from "../../client/web/hgp.js";

const [url, scene, out] = process.argv.slice(2);
const [, kind, place] = /^(unix|tcp):(.*)$/.exec(url ?? "") ?? [];
if (!kind || !out) {
    console.error("usage: node client.mjs unix:PATH|tcp:HOST:PORT SCENE OUT.png");
    process.exit(2);
}
const [host, port] = place.split(/:(?=\d+$)/);
const socket = net.connect(kind === "unix" ? { path: place } : { host, port: Number(port) });
socket.write(hgp.PREFACE);

// Whole messages as they come, each as { name, request, body }.
async function* messages() {
    let bytes = Buffer.alloc(0);
    for await (const piece of socket) {
        bytes = Buffer.concat([bytes, piece]);
        while (bytes.length >= hgp.HEADER_BYTES) {
            const { length, type, request } = hgp.decodeHeader(bytes, 2 ** 30), end = hgp.HEADER_BYTES + length;
            if (bytes.length < end) break;
            const body = hgp.decode(1, type, bytes.subarray(hgp.HEADER_BYTES, end));
            bytes = bytes.subarray(end);
            yield { name: hgp.findMessage(type).name, request, body };
        }
    }
}

const incoming = messages();
let requests = 0;

async function call(name, message) {
    socket.write(hgp.encode(1, name, message, { request: ++requests }));
    for (;;) {
        const { value: answer } = await incoming.next();
        if (!answer) throw new Error("closed");
        if (answer.name === "error") throw new Error(`${answer.body.what}: ${answer.body.reason}`);
        if (answer.name !== "progress" && answer.name !== "notice") return answer.body;
    }
}

const welcome = await call("hello", { version_min: 1, version_max: 1, client: "example/1.0", capabilities: [] });
if (welcome.auth_required) await call("auth", { token: process.env.HELIO_TOKEN });
const { first_id } = await call("scene_open", { name: "" });
await call("asset_load", { asset: first_id, path: scene, files: [] });
await call("view_set", { view: 1, width: 320, height: 180 });
const frame = await call("frame_request", { view: 1, settled: true, encoding: "PNG8" });
writeFileSync(out, frame.data);
socket.end();
