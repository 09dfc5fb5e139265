// The JavaScript codec against the same stored vectors as the C codec.
// Run: node tests/wire/hgp.test.mjs   (environment: HELIO_SOURCE_DIR, default: here)
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";

const root = process.env.HELIO_SOURCE_DIR ?? fileURLToPath(new URL("../..", import.meta.url));
const hgp = await import(pathToFileURL(`${root}/client/web/hgp.js`));
const VERSION = 1;

function load(name) {
    const text = readFileSync(`${root}/tests/wire/vectors/${name}`, "utf8");
    return text.trimEnd().split("\n").map((line) => JSON.parse(line));
}

const unhex = (text) => Uint8Array.from(text.match(/../g) ?? [], (byte) => parseInt(byte, 16));
const hex = (bytes) => Buffer.from(bytes).toString("hex");
const good = load("v1.jsonl");
const bad = load("v1-bad.jsonl");
const full = new Map(good.filter((v) => v.variant === "full").map((v) => [v.message, v]));

// Decoded values in the notation of the stored file.
function plain(value) {
    if (value instanceof Uint8Array)
        return hex(value);
    if (typeof value === "bigint")
        return value.toString();
    if (Array.isArray(value))
        return value.map(plain);
    if (typeof value === "object")
        return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, plain(v)]));
    return value;
}

// JSON holds the shortest decimal of an f32; decoded values are the f32 itself.
function rounded(fields, stored) {
    return Object.fromEntries(Object.entries(stored).map(([name, value]) => {
        const field = fields.find((f) => f.name === name);
        if (field.kind === "f32")
            return [name, Math.fround(value)];
        if (field.kind.startsWith("vec") || field.kind === "mat4")
            return [name, value.map(Math.fround)];
        if (field.kind === "list")
            return [name, value.map((item) => rounded(hgp.structs[field.items], item))];
        return [name, value];
    }));
}

function decodeError(type, payload) {
    try {
        hgp.decode(VERSION, type, payload);
    } catch (error) {
        assert.ok(error instanceof hgp.HgpError, String(error));
        return error;
    }
    return null;
}

test("every message has its three vectors", () => {
    assert.equal(good.length, 3 * Object.keys(hgp.messages).length);
    for (const name of Object.keys(hgp.messages))
        assert.equal(good.filter((v) => v.message === name).length, 3, name);
});

test("stored payloads decode to their values", () => {
    for (const vector of good) {
        const info = hgp.messages[vector.message];
        const got = hgp.decode(VERSION, info.type, unhex(vector.payload));
        assert.deepEqual(plain(got), rounded(info.fields, vector.value), vector.message);
    }
});

test("decoded values encode to the stored bytes", () => {
    for (const vector of good) {
        const info = hgp.messages[vector.message];
        const message = hgp.decode(VERSION, info.type, unhex(vector.payload));
        const bytes = hgp.encode(VERSION, vector.message, message, { request: 9, channel: 3 });
        const header = hgp.decodeHeader(bytes, 1 << 20);
        assert.deepEqual(header, {
            length: vector.payload.length / 2, type: info.type, flags: 0, request: 9, channel: 3,
        });
        assert.equal(hex(bytes.subarray(hgp.HEADER_BYTES)), vector.payload, vector.message);
    }
});

// Where a second bitmap begins: it and the fields behind it are left out together.
function secondBitmap(vector) {
    const { fields } = hgp.messages[vector.message];
    const later = fields.filter((f) => f.optional).slice(32).map((f) => f.name);
    const without = Object.entries(vector.value).filter(([name]) => !later.includes(name));
    return hgp.encodeLayout(fields, VERSION, Object.fromEntries(without.map(([name, value]) => {
        const field = fields.find((f) => f.name === name);
        return [name, field.kind === "hash" || field.kind === "bytes" ? unhex(value)
            : field.kind === "u64" ? BigInt(value) : value];
    }))).length;
}

test("a message ends before its second bitmap or has a field of it", () => {
    const vector = full.get("view_set");
    const payload = unhex(vector.payload);
    const second = secondBitmap(vector);
    const { type } = hgp.messages.view_set;
    assert.ok(second < payload.length);
    assert.equal(decodeError(type, payload.slice(0, second)), null);
    for (let size = second + 1; size < second + 4; size++)
        assert.equal(decodeError(type, payload.slice(0, size))?.status, "format");
    const empty = payload.slice(0, second + 4).fill(0, second);
    assert.equal(decodeError(type, empty)?.field, "has");
    assert.equal(hex(hgp.encode(VERSION, "view_set", { view: 1 }).subarray(16)),
        "0000000001000000");
});

test("every prefix and one byte more are refused", () => {
    for (const vector of good) {
        const type = hgp.messages[vector.message].type;
        const payload = unhex(vector.payload);
        const second = vector.message === "view_set" ? secondBitmap(vector) : payload.length;
        for (let size = 0; size < payload.length; size++) {
            if (size >= second && size < second + 4)
                continue;
            const error = decodeError(type, payload.slice(0, size));
            assert.equal(error?.status, "truncated", `${vector.message} ${size}`);
            assert.equal(error.field, "");
        }
        const longer = new Uint8Array(payload.length + 1);
        longer.set(payload);
        const error = decodeError(type, longer);
        assert.equal(error?.status, "format", vector.message);
        assert.equal(error.offset, payload.length);
    }
});

test("stored edits are refused with status, field and place", () => {
    for (const edit of bad) {
        const payload = unhex(full.get(edit.message).payload);
        payload.set(unhex(edit.put), edit.at);
        const error = decodeError(hgp.messages[edit.message].type, payload);
        const what = JSON.stringify(edit);
        assert.equal(error?.status, edit.status, what);
        assert.equal(error.field, edit.field, what);
        assert.equal(error.offset, edit.at, what);
    }
    assert.ok(bad.length >= 500);
});

test("payloads inside a larger buffer are decoded in place", () => {
    const bytes = new Uint8Array(20);
    bytes.set([5], 6);
    const ping = hgp.decode(VERSION, hgp.messages.ping.type, bytes.subarray(6, 14));
    assert.deepEqual(ping, { nonce: 5n });
});

test("headers", () => {
    const header = { length: 0x01020304, type: 0x0307, flags: 1, request: 0x05060708,
        channel: 0x090a0b0c };
    const bytes = hgp.encodeHeader(header);
    assert.equal(hex(bytes), "0403020107030100080706050c0b0a09");
    assert.deepEqual(hgp.decodeHeader(bytes, 0x01020304), header);
    const refused = (fn, status) => assert.throws(fn, (e) => e.status === status);
    refused(() => hgp.decodeHeader(bytes, 0x01020303), "limit");
    for (let size = 0; size < 16; size++)
        refused(() => hgp.decodeHeader(bytes.slice(0, size), 2 ** 32), "truncated");
    for (let bit = 1; bit < 16; bit++)
        refused(() => hgp.decodeHeader(hgp.encodeHeader({ ...header, flags: 1 << bit }), 2 ** 32),
            "format");
    assert.equal(hex(hgp.PREFACE), "4847500d0a1a0a01");
});

test("unknown types and versions", () => {
    const refused = (fn) => assert.throws(fn, (e) => e.status === "unsupported");
    assert.equal(hgp.findMessage(0xffff), undefined);
    refused(() => hgp.decode(VERSION, 0xffff, new Uint8Array()));
    refused(() => hgp.decode(0, hgp.messages.ping.type, new Uint8Array(8)));
    refused(() => hgp.encode(VERSION, "nothing", {}));
    refused(() => hgp.encode(VERSION, "toString", {}));
    refused(() => hgp.encode(0, "ping", { nonce: 1n }));
});

test("fields of later versions are not on the wire", () => {
    const fields = [
        { name: "a", kind: "u32", least: 0, most: 4294967295, since: 1 },
        { name: "o", kind: "u8", least: 0, most: 255, since: 1, optional: true },
        { name: "b", kind: "u16", least: 0, most: 65535, since: 2 },
        { name: "c", kind: "u8", least: 0, most: 255, since: 2, optional: true },
    ];
    const message = { a: 1, o: 2, b: 3, c: 4 };
    assert.equal(hex(hgp.encodeLayout(fields, 1, message)), "010000000100000002");
    assert.equal(hex(hgp.encodeLayout(fields, 2, message)), "030000000100000002030004");
    assert.deepEqual(hgp.decodeLayout(fields, 1, unhex("010000000100000002")), { a: 1, o: 2 });
    assert.deepEqual(hgp.decodeLayout(fields, 2, unhex("030000000100000002030004")), message);
    assert.throws(() => hgp.decodeLayout(fields, 1, unhex("030000000100000002030004")),
        (e) => e.status === "format" && e.field === "has");
});

test("the encoder refuses what breaks a rule", () => {
    const refused = (name, message, field) => assert.throws(() => hgp.encode(1, name, message),
        (e) => e instanceof hgp.HgpError && e.status === "invalid" && e.field === field,
        `${name} ${field}`);
    const hello = { version_min: 1, version_max: 1, client: "x", capabilities: [] };
    refused("hello", { ...hello, version_min: 0 }, "version_min");
    refused("hello", { ...hello, version_min: 65536 }, "version_min");
    refused("hello", { ...hello, version_min: 1.5 }, "version_min");
    refused("hello", { ...hello, version_min: "1" }, "version_min");
    refused("hello", { ...hello, client: "x".repeat(129) }, "client");
    refused("hello", { ...hello, client: "\u00e9".repeat(65) }, "client");
    refused("hello", { ...hello, client: "a\0b" }, "client");
    refused("hello", { ...hello, client: "\ud800" }, "client");
    refused("hello", { ...hello, capabilities: Array(65).fill({ value: "" }) }, "capabilities");
    refused("hello", { ...hello, capabilities: [{ value: "" }, {}] }, "capabilities[1].value");
    refused("hello", { ...hello, typo: 1 }, "typo");
    const { client, ...without } = hello;
    refused("hello", without, "client");
    refused("ping", { nonce: -1n }, "nonce");
    refused("ping", { nonce: 2n ** 64n }, "nonce");
    refused("ping", { nonce: 2 ** 60 }, "nonce");
    refused("view_set", { view: 1, tonemap: "NICE" }, "tonemap");
    refused("view_set", { view: 1, tonemap: "toString" }, "tonemap");
    refused("view_set", { view: 1, exposure_ev: NaN }, "exposure_ev");
    refused("view_set", { view: 1, exposure_ev: 33 }, "exposure_ev");
    refused("view_set", { view: 1, background_color: [1, 2] }, "background_color");
    refused("view_set", { view: 1, background_color: [1, 2, Infinity] }, "background_color");
    refused("node_set", { node: 1n, visible: 1 }, "visible");
    refused("environment_set", { hash: new Uint8Array(31) }, "hash");
    refused("json", { text: null }, "text");
});

test("whole numbers stand for u64, greatest f32 limits pass", () => {
    assert.equal(hex(hgp.encode(1, "ping", { nonce: 5 }).subarray(16)), "0500000000000000");
    const bytes = hgp.encode(1, "view_set", { view: 1, max_fps: 0.01 });
    assert.equal(hgp.decode(1, hgp.messages.view_set.type, bytes.subarray(16)).max_fps,
        Math.fround(0.01));
});

test("large payloads grow the buffer", () => {
    const data = Uint8Array.from({ length: 100000 }, (_, i) => i & 255);
    const message = { hash: new Uint8Array(32), total: 100000n, offset: 0n, data };
    const bytes = hgp.encode(1, "upload", message);
    assert.deepEqual(hgp.decode(1, hgp.messages.upload.type, bytes.subarray(16)), message);
});
