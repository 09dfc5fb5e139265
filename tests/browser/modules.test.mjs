// modules.test.mjs - the viewer's modules that need no browser, its size, and what it asks for.
// Run: node --test tests/browser/modules.test.mjs   (environment: HELIO_SOURCE_DIR, default: here)
import assert from "node:assert/strict";
import { readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";
import { fileURLToPath, pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

const root = process.env.HELIO_SOURCE_DIR ?? fileURLToPath(new URL("../..", import.meta.url));
const web = join(root, "client/web");
const load = (name) => import(pathToFileURL(join(web, name)));
const camera = await load("camera.js");
const { parseLink, formatLink } = await load("link.js");
const { choose, urisOf } = await load("upload.js");
const { describeError, describeProgress, RequestError } = await load("connection.js");

const close = (a, b, e = 1e-9) => a.every((v, i) => Math.abs(v - b[i]) <= e);
const make = () => camera.makeCamera({ eye: [1, 2, 5], target: [0.5, 1, -1] });
const files = readdirSync(web).filter((n) => /\.(html|js|css|svg)$/.test(n));

test("all of it is under 100 KiB, compressed file by file", () => {
    const bytes = files.reduce((sum, n) => sum + gzipSync(readFileSync(join(web, n)), { level: 9 }).length, 0);
    assert.ok(bytes < 100 * 1024, `${bytes} bytes`);
});

test("no file names another place, and no script or style stands in the page", () => {
    for (const name of files) {
        const text = readFileSync(join(web, name), "utf8").replaceAll("http://www.w3.org/", "");
        assert.ok(!/https?:\/\//.test(text), name);
    }
    const page = readFileSync(join(web, "index.html"), "utf8");
    assert.ok(!/<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)/.test(page));
});

test("an orbit keeps the distance, and full turns come back", () => {
    const c = make(), before = camera.distance(c);
    for (let i = 0; i < 8; i++)
        camera.orbit(c, Math.PI / 4, 0);
    assert.ok(close(c.eye, [1, 2, 5], 1e-9));
    camera.orbit(c, 0.3, 10);
    assert.ok(Math.abs(camera.distance(c) - before) < 1e-9);
    assert.ok(c.eye.every(Number.isFinite), "straight above");
});

test("looking around keeps the eye", () => {
    const c = make();
    camera.look(c, 0.7, -0.2);
    assert.deepEqual(c.eye, [1, 2, 5]);
    assert.ok(Math.abs(camera.distance(c) - camera.distance(make())) < 1e-9);
});

test("what lies under the pointer stays under it when zooming and panning", () => {
    for (const kind of ["PERSPECTIVE", "ORTHOGRAPHIC"]) {
        const c = { ...make(), kind, half_height: 2 };
        const { right, up } = camera.axes(c);
        const half = camera.halfHeight(c);
        const point = c.target.map((v, i) => v + 0.5 * half * 1.5 * right[i] - 0.25 * half * up[i]);
        const at = camera.project(c, point, 300, 200);
        camera.dolly(c, 0.4, 0.5, -0.25, 1.5);
        const then = camera.project(c, point, 300, 200);
        assert.ok(close([at.x, at.y], [then.x, then.y], 1e-6), kind);
        camera.pan(c, 10, -7, 200);
        const moved = camera.project(c, point, 300, 200);
        assert.ok(close([moved.x, moved.y], [then.x + 10, then.y - 7], 1e-6), kind);
    }
});

test("the target is in the middle, and what is behind the eye is nowhere", () => {
    const c = make();
    const at = camera.project(c, c.target, 640, 360);
    assert.ok(close([at.x, at.y], [320, 180]));
    assert.equal(camera.project(c, [2, 4, 12], 640, 360), null);
});

test("walking stays level, flying goes where it looks", () => {
    const c = make();
    camera.move(c, 0, 0, 3, true);
    assert.ok(Math.abs(c.eye[1] - 2) < 1e-12);
    const f = make();
    camera.move(f, 0, 0, 3, false);
    assert.ok(f.eye[1] < 2);
});

test("cameras that are the same in a message are the same", () => {
    const a = make(), b = make();
    b.eye[0] += 1e-12;
    assert.equal(camera.isSame(a, b), true);
    b.eye[0] += 1e-6;
    assert.equal(camera.isSame(a, b), false);
});

test("a flight begins and ends where it says", () => {
    const a = make(), b = camera.makeCamera({ eye: [-4, 0, 1], target: [0, 0, 0] });
    assert.ok(close(camera.blend(a, b, 0).eye, a.eye, 1e-6));
    assert.deepEqual(camera.blend(a, b, 1).eye, b.eye);
});

test("links keep camera, settings and names; nonsense is left out", () => {
    const link = { scene: "hall & roof", load: "demo:", ticket: "abc", camera: make(),
        params: { mode: "PATH", tonemap: "AGX", exposure_ev: 1.5, exposure_mode: "AUTO" } };
    const back = parseLink(formatLink(link));
    assert.equal(back.scene, link.scene);
    assert.equal(back.load, "demo:");
    assert.equal(back.ticket, "abc");
    assert.deepEqual(back.params, link.params);
    assert.ok(close(back.camera.eye, link.camera.eye, 1e-5));
    const bad = parseLink("#mode=FAST&ev=99&camera=1,2,3&tonemap=__proto__&scene=%ff");
    assert.deepEqual(bad.params, {});
    assert.equal(bad.camera, null);
    for (const text of ["", "1,2,3,1,2,3,1", "1,2,3,4,5,6,0", "a,b,c,d,e,f,g", "1,2,3,4,5,6,7,8"])
        assert.equal(camera.cameraFromText(text), null, text);
});

test("a long name of a scene is not cut to that of another one", () => {
    const scene = "n".repeat(128);
    assert.equal(parseLink(formatLink({ scene })).scene, scene);
});

test("an orthographic camera survives a link", () => {
    const c = { ...make(), kind: "ORTHOGRAPHIC", half_height: 3 };
    const back = camera.cameraFromText(camera.cameraToText(c));
    assert.equal(back.kind, "ORTHOGRAPHIC");
    assert.equal(back.half_height, 3);
});

test("SHA-256 without the browser's help is the same", async () => {
    const { sha256, ownSha256 } = await load("sha256.js");
    const bytes = Uint8Array.from({ length: 5000000 }, (_, i) => i * i >> 3 & 255);
    const hex = (b) => Buffer.from(b).toString("hex");
    assert.equal(hex(await ownSha256(new TextEncoder().encode("abc"))),
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"); // FIPS 180-4
    for (const [at, size] of [[0, 0], [1, 1], [3, 55], [0, 56], [5, 63], [0, 64], [7, 119], [0, 120], [1, 4096],
        [0, bytes.length]]) {
        const part = bytes.subarray(at, at + size);
        assert.equal(hex(await ownSha256(part)), hex(await sha256(part)), `${size} bytes`);
    }
    const { crypto } = globalThis;
    Object.defineProperty(globalThis, "crypto", { value: {}, configurable: true });
    try {
        assert.equal(hex(await sha256(bytes.subarray(0, 100))), hex(await ownSha256(bytes.subarray(0, 100))));
    } finally {
        Object.defineProperty(globalThis, "crypto", { value: crypto, configurable: true });
    }
});

test("statistics have what the server's controller has chosen", async () => {
    const { flowRows } = await load("stats.js");
    assert.deepEqual(flowRows(null), []);
    const rows = Object.fromEntries(flowRows({ target_fps: 30, target_ms: 12.34, quality: 71, bitrate: 4200000, rate_mbit_s: 4.66,
        rtt_ms: 20, delay_ms: 0, under_way: 2, bytes_under_way: 3000, held: 5 }));
    assert.equal(rows["· quality"], "71 %");
    assert.equal(rows["· bit rate"], "4.2 Mbit/s");
    assert.equal(rows["Network: rate"], "4.7 Mbit/s");
    assert.equal(rows["· until delivered"], "–"); // not known
    assert.equal(rows["· frames held back"], "5");
});

test("the chosen variant is told apart from others", async () => {
    const { Scene } = await load("scene.js");
    const asked = [];
    const connection = { async call(name, message) {
        asked.push([name, message]);
        if (message.variant === "missing")
            throw new RequestError({ code: 4, reason: "no such variant" });
        return { revision: 2n };
    } };
    const scene = new Scene(connection);
    scene.assets = [{ number: 1, variants: ["red", "blue"], variant: "red" }, { number: 2, variants: ["a"] }];
    let changes = 0;
    scene.addEventListener("changed", () => changes++);
    await scene.setVariant(1, "blue");
    assert.deepEqual(scene.assets.map((a) => a.variant), ["blue", undefined]);
    await assert.rejects(scene.setVariant(1, "missing"));
    assert.equal(scene.assets[0].variant, "blue");
    assert.equal(changes, 2); // what the panel shows is put right
    assert.deepEqual(asked[0], ["variant_set", { asset: 1, variant: "blue" }]);
});

const gltf = (document) => new File([JSON.stringify(document)], "a.gltf");
const model = { buffers: [{ uri: "data%20one.bin" }, { uri: "data:application/octet-stream;base64,AA==" }],
    images: [{ uri: "../tex/b.png" }, { bufferView: 0 }] };

test("a glTF file brings the files that it names", async () => {
    assert.deepEqual(urisOf(model), ["data one.bin", "../tex/b.png"]);
    const chosen = await choose([{ path: "m/geo/a.gltf", file: gltf(model) },
        { path: "m/geo/data one.bin", file: new File(["1"], "data one.bin") },
        { path: "m/tex/b.png", file: new File(["2"], "b.png") },
        { path: "m/tex/unused.png", file: new File(["3"], "unused.png") }]);
    assert.equal(chosen.name, "a.gltf");
    assert.deepEqual(chosen.files.map((f) => f.uri), ["a.gltf", "data one.bin", "../tex/b.png"]);
});

test("every format that the server reads can be dropped", async () => {
    const dropped = (...names) => choose(names.map((n) => ({ path: `m/${n}`, file: new File([""], n) })));
    for (const name of ["a.obj", "a.fbx", "a.dae", "a.ply", "a.stl", "a.off", "cloud.PLY.gz", "part.stl.gz",
        "N46E007.hgt", "N46E007.hgt.gz", "dem.tif", "dem.png"]) {
        const chosen = await dropped(name);
        assert.deepEqual([chosen.kind, chosen.name, chosen.files.length], ["scene", name, 1]);
    }
    const parts = await dropped("wood.png", "chair.mtl", "chair.obj.gz");
    assert.deepEqual(parts.files.map((f) => f.uri), ["chair.obj.gz", "wood.png", "chair.mtl"]);
    assert.equal((await dropped("grey.png", "studio.hdr")).kind, "environment");
    assert.deepEqual(parts.others, []);
    const two = await dropped("b.stl", "a.ply.gz", "a.txt");
    assert.deepEqual([two.name, two.others], ["a.ply.gz", ["b.stl"]]);
    assert.match((await dropped("a.zip").catch((e) => e)).message, /neither a scene/);
});

test("missing, foreign and broken files are refused by name", async () => {
    await assert.rejects(choose([{ path: "a.gltf", file: gltf(model) }]),
        (e) => e.status === "not-found" && /data one\.bin/.test(e.message));
    await assert.rejects(choose([{ path: "a.txt", file: new File([""], "a.txt") }]),
        (e) => e.status === "unsupported");
    await assert.rejects(choose([{ path: "a.gltf", file: new File(["{"], "a.gltf") }]),
        (e) => e.status === "format");
    const gone = { text: () => Promise.reject(new DOMException("", "NotFoundError")) };
    await assert.rejects(choose([{ path: "a.gltf", file: gone }]),
        (e) => e.status === "not-found" && /cannot read it/.test(e.message));
    await assert.rejects(choose([{ path: "a.glb", file: new File(["short"], "a.glb") }]),
        (e) => e.status === "unsupported");
});

test("of files that are sent one is held at a time, and pieces of it while it goes", async () => {
    const { upload } = await load("upload.js");
    const MIB = 1 << 20;
    let whole = 0;
    const make = (uri, bytes) => {
        const file = new File([bytes], uri), read = file.arrayBuffer;
        file.arrayBuffer = () => { whole++; return read.call(file); };
        return { uri, file };
    };
    const large = Uint8Array.from({ length: 2.5 * MIB }, (_, i) => i * i >> 4 & 255);
    const parts = [make("large", large), make("same", large), make("empty", new Uint8Array()), make("known", new Uint8Array(9))];
    const sent = new Map();
    const connection = { backlog_bytes: 0, send: (name, { hash, offset, total, data }) => {
        const key = hash.join(), before = sent.get(key) ?? Buffer.alloc(0);
        sent.set(key, Buffer.concat([before, data]));
        assert.ok(data.length <= MIB && Number(offset) === before.length && total === BigInt(total ? large.length : 0));
        return true;
    }, call: async (name, message) => {
        if (name === "upload")
            return connection.send(name, message);
        const held = parts.flatMap((p) => Object.values(p)).filter((v) => v?.byteLength > 32);
        assert.deepEqual(held, []);
        return { have: message.contents.map((_, i) => ({ value: i === 2 })) };
    } };
    const progress = [];
    const files = await upload(connection, parts, (text, share) => progress.push(share));
    assert.deepEqual(files.map((f) => f.uri), ["large", "same", "empty", "known"]);
    assert.deepEqual(files[0].hash, files[1].hash);
    assert.equal(whole, parts.length);
    assert.deepEqual([...sent.values()].map((s) => s.length), [large.length, 0]);
    assert.ok(sent.get(files[0].hash.join()).equals(large));
    assert.equal(progress.at(-1), 1);
    const gone = { size: 9, arrayBuffer: () => Promise.reject(new DOMException("", "NotReadableError")) };
    await assert.rejects(upload(connection, [{ uri: "gone", file: gone }], () => {}),
        (e) => e.status === "not-found" && /cannot read it/.test(e.message));
});

test("glTF that is gzipped is unpacked, as the server reads it as it is only", async () => {
    const packed = (path, bytes) => ({ path, file: new File([gzipSync(bytes)], path) });
    const text = JSON.stringify({ buffers: [{ uri: "a.bin" }] });
    const bin = { path: "m/a.bin", file: new File(["1"], "a.bin") };
    const chosen = await choose([packed("m/a.gltf.GZ", text), bin]);
    assert.deepEqual([chosen.name, ...chosen.files.map((f) => f.uri)], ["a.gltf", "a.gltf", "a.bin"]);
    assert.equal(await chosen.files[0].file.text(), text);
    const glb = Buffer.alloc(20);
    [0x46546c67, 2, 20 + text.length, text.length, 0x4e4f534a].forEach((v, i) => glb.writeUInt32LE(v, 4 * i));
    const binary = await choose([packed("m/a.glb.gz", Buffer.concat([glb, Buffer.from(text)])), bin]);
    assert.deepEqual(binary.files.map((f) => f.uri), ["a.glb", "a.bin"]);
    assert.equal(binary.files[0].file.size, 20 + text.length);
    for (const name of ["a.gltf.gz", "a.glb.gz"])
        await assert.rejects(choose([{ path: name, file: new File(["not gzip"], name) }]),
            (e) => e.status === "format" && e.what === name && /not a gzip file/.test(e.message));
    const { DecompressionStream } = globalThis;
    globalThis.DecompressionStream = undefined;
    try {
        await assert.rejects(choose([packed("a.gltf.gz", "{}")]), (e) => /unpack it first/.test(e.message));
    } finally {
        globalThis.DecompressionStream = DecompressionStream;
    }
});

test("errors say which limit it was and when to try again", () => {
    const text = describeError(new RequestError({ code: 3, what: "view 1", where: "width",
        reason: "too many pixels", limit: "max-pixels", retry_after_ms: 2500 }));
    for (const part of ["max-pixels", "view 1", "too many pixels", "3 s"])
        assert.ok(text.includes(part), text);
    const session = new RequestError({ code: 3, what: "session", reason: "as many as it may (max-sessions)",
        limit: "max-sessions", retry_after_ms: 600000 });
    assert.equal(describeError(session).split("max-sessions").length, 2, "the limit is said once");
    assert.ok(describeError(session).endsWith("Try again in 10 min."));
    assert.ok(!describeError(session, false).includes("Try again"));
});

test("what is fitted for a part of the picture is shown in the middle of what is free", () => {
    const box = { min: [-1, -1, -1], max: [1, 1, 1] }, aspect = 0.6;
    for (const kind of ["PERSPECTIVE", "ORTHOGRAPHIC"])
        for (const free of [{ x: [0, 1], y: [0, 0.6] }, { x: [0.4, 1], y: [0, 1] }, { x: [0, 0.5], y: [0.2, 0.9] }]) {
            const [nearer, share] = [Math.max, Math.min].map((of) => of(free.x[1] - free.x[0], free.y[1] - free.y[0]));
            assert.deepEqual(camera.sharesOf(free), [nearer, share]);
            const fitted = camera.makeCamera({ eye: [0, 0, 18], kind, vfov_rad: camera.narrowed(0.5, share), half_height: 2 });
            const made = camera.intoFree(fitted, share, free, aspect);
            assert.ok(Math.abs(made.vfov_rad - 0.5) < 1e-12);
            const centre = camera.project(made, [0, 0, 0], aspect, 1);
            assert.ok(Math.abs(centre.x / aspect - (free.x[0] + free.x[1]) / 2) < 1e-9, `${centre.x}`);
            assert.ok(Math.abs(centre.y - (free.y[0] + free.y[1]) / 2) < 1e-9, `${centre.y}`);
            assert.equal(camera.isFree(made, box, free, aspect), true);
            assert.equal(camera.isFree(made, { min: [-1, -9, -1], max: [1, 1, 1] }, free, aspect), false);
        }
});

test("a list of nodes goes with the list of assets, whatever is loaded or removed meanwhile", async () => {
    const { Scene } = await load("scene.js");
    const node = (id) => ({ node: BigInt(id) << 32n, parent: 0n, name: "" });
    const answers = [ // another session replaces asset 1 by asset 2: between the answers 1 goes
        { text: JSON.stringify({ assets: [{ file: "one" }, { file: "two" }] }) }, { nodes: [node(2)], total: 1 },
        { text: JSON.stringify({ assets: [{ file: "two" }] }) }, { nodes: [node(2)], total: 1 }];
    const scene = new Scene({ session: 1n, call: async () => {
        if (answers.length === 3)
            scene.noteEdit({ message: 0x0209, session: 2n, revision: 5n, number: 1n }); // asset_unload
        return answers.shift();
    } });
    await scene.refresh();
    clearTimeout(scene.timer);
    assert.deepEqual(scene.assets.map((a) => [a.number, a.file]), [[2, "two"]]);
});

test("lengths have a unit that fits, and no sign without a digit", async () => {
    const { metresText } = await load("dom.js");
    assert.deepEqual([-2.7e-8, 0, 0.0123, -2, 1500].map(metresText),
        ["0.000 m", "0.000 m", "1.23 cm", "-2.000 m", "1.500 km"]);
});

test("progress has numbers where they are known", () => {
    assert.deepEqual(describeProgress({ stage: "samples", done: 8n, total: 32n }), ["8 of 32 samples", 0.25]);
    assert.deepEqual(describeProgress({ stage: "streaming", done: 2n, total: 3n }), ["streaming, 66 %", 2 / 3]);
    assert.deepEqual(describeProgress({ stage: "parsing", done: 0n, total: 0n }), ["parsing", null]);
});

test("tickets of a link that was not copied are revoked when another one takes their place", async () => {
    const { LinkTicket } = await load("share.js");
    const calls = [], shown = [];
    let made = 0, refused = "";
    const connection = { async call(name, message) {
        calls.push(name === "join_make" ? `make ${message.role}` : `revoke ${message.ticket}`);
        if (refused === name)
            throw new RequestError({ code: 3, reason: "as many as it may" });
        return name === "join_make" ? { ticket: ++made, secret: `secret ${made}` } : {};
    } };
    const ticket = new LinkTicket(connection, (access) => shown.push([access, ticket.secret]));
    await ticket.change("view");
    await ticket.change("edit");
    assert.deepEqual(calls.splice(0), ["make VIEW", "revoke 1", "make EDIT"]);
    assert.deepEqual(shown.splice(0), [["none", ""], ["view", "secret 1"], ["none", ""], ["edit", "secret 2"]]);
    ticket.keep();
    await ticket.change("view");
    ticket.change("edit"); // the dialog is closed before the answer
    await ticket.change("none");
    assert.deepEqual(calls.splice(0), ["make VIEW", "revoke 3", "make EDIT", "revoke 4"]);
    assert.equal(ticket.secret, "");
    refused = "join_make";
    await assert.rejects(ticket.change("view"), /as many/);
    assert.equal(shown.at(-1)[0], "none");
    refused = "join_revoke"; // by an administrator before
    await ticket.change("view");
    await ticket.change("none");
    assert.deepEqual(calls, ["make VIEW", "make VIEW", "revoke 5"]);
});

// ---- reprojection --------------------------------------------------------------------------------

const { decodeDepth, warpMatrix, warpPoint } = await load("warp.js");
const framed = (c) => ({ ...c, ...camera.axes(c) });

// Where a camera sees a point, -1..1 and y up.
function seen(c, point, aspect) {
    const at = camera.project(c, point, 2 * aspect, 2);
    return [at.x / aspect - 1, 1 - at.y];
}

test("a picture is warped to where another camera sees its surfaces", () => {
    const aspect = 1.6;
    for (const kind of ["PERSPECTIVE", "ORTHOGRAPHIC"]) {
        const from = { ...make(), kind, half_height: 2.5 };
        const around = structuredClone(from), aside = structuredClone(from), wider = structuredClone(from);
        camera.orbit(around, 0.2, -0.1);
        camera.move(aside, 0.3, -0.1, 0.5, false);
        Object.assign(wider, { vfov_rad: 1.1, half_height: 3 });
        for (const to of [around, aside, wider])
            for (const [x, y, depth] of [[0, 0, 4], [0.7, -0.3, 2.5], [-0.9, 0.8, 9]]) {
                const { right, up, forward } = camera.axes(from);
                const half = kind === "PERSPECTIVE" ? depth * Math.tan(from.vfov_rad / 2) : 2.5;
                const point = from.eye.map((v, i) =>
                    v + depth * forward[i] + half * (x * aspect * right[i] + y * up[i]));
                const matrix = warpMatrix(framed(from), framed(to), aspect, 1);
                const at = warpPoint(matrix, x, y, kind === "PERSPECTIVE" ? 1 / depth : depth);
                assert.ok(close(at, seen(to, point, aspect), 1e-9), `${kind} ${at}`);
            }
    }
});

test("what is infinitely far only turns, and an unmoved camera changes nothing", () => {
    const from = make(), turned = make(), gone = make();
    camera.look(turned, 0.15, 0.05);
    camera.move(gone, 3, 1, 2, false);
    const at = (to, x, y, d) => warpPoint(warpMatrix(framed(from), framed(to), 1.5, 2), x, y, d);
    for (const [x, y] of [[0, 0], [0.4, 0.9], [-1, -1]]) {
        for (const d of [0, 0.1, 2])
            assert.ok(close(at(from, x, y, d), [x, y], 1e-12));
        assert.ok(close(at(gone, x, y, 0), [x, y], 1e-12));
        const { right, up, forward } = camera.axes(from), t = Math.tan(from.vfov_rad / 2);
        const point = from.eye.map((v, i) => v + forward[i] + t * (x * 1.5 * right[i] + y * up[i]));
        for (const d of [0, 0.1, 2]) // turning about the eye does not depend on depth
            assert.ok(close(at(turned, x, y, d), seen(turned, point, 1.5), 1e-9));
    }
    const back = make();
    camera.look(back, Math.PI, 0);
    assert.equal(at(back, 0, 0, 0.1), null);
});

test("what is nearer lies in front, by the depth that the matrix gives", () => {
    const to = make();
    camera.move(to, 0.1, 0, 0.5, false);
    const matrix = warpMatrix(framed(make()), framed(to), 1, 0.5);
    const z = (d) => (matrix[10] + matrix[14] * d) / (matrix[11] + matrix[15] * d);
    assert.ok(z(0.5) < z(0.4) && z(0.4) < z(0.01) && z(0.01) < z(0) && z(0.5) > -1 && z(0) <= 1);
});

test("depth is read as it was packed", async () => {
    const planes = Uint8Array.from([2, 0, 0, 0, 0, 1, /* high: */ 0, 0, 0, 0, 0, 0]); // 1 1 1 / 1 1 0
    const data = new Uint8Array(14);
    const view = new DataView(data.buffer);
    [3, 2].forEach((v, i) => view.setUint16(2 * i, v, true));
    [0.25, 0.5].forEach((v, i) => view.setFloat32(4 + 4 * i, v, true));
    const { columns, rows, values } = await decodeDepth(data, async () => planes);
    assert.deepEqual([columns, rows, ...values], [3, 2, 0.25, 0.25, 0.25, 0.25, 0.25, NaN]);
    await assert.rejects(decodeDepth(data, async () => planes.subarray(1)), /another size/);
});

// ---- frames that cannot be decoded ---------------------------------------------------------------

// A decoder that holds what it gets, to show it or to fail.
class HeldDecoder {
    constructor({ output, error }) {
        Object.assign(this, { output, error, state: "unconfigured", held: [] });
        HeldDecoder.newest = this;
    }
    configure() {
        this.state = "configured";
    }
    decode(chunk) {
        this.held.push(chunk);
    }
    close() {
        this.state = "closed";
    }
    show() {
        for (const { timestamp } of this.held.splice(0))
            this.output({ timestamp, close() {} });
    }
}

async function makeView() {
    const context = { drawImage() {}, putImageData() {} };
    globalThis.OffscreenCanvas = class {
        getContext() {
            return context;
        }
    };
    globalThis.location = new URL("http://127.0.0.1:8080/");
    globalThis.VideoDecoder = HeldDecoder;
    globalThis.ImageData ??= class {};
    globalThis.EncodedVideoChunk = class {
        constructor(chunk) {
            Object.assign(this, chunk);
        }
    };
    const { View } = await load("view.js");
    const connection = Object.assign(new EventTarget(), { sent: [], toPageTime: () => null,
        send: (name, fields) => connection.sent.push({ name, ...fields }) });
    const view = new View(connection, { getContext: () => context, dataset: {}, width: 64, height: 64 });
    const frame = (number, depends, other = {}) => view.onFrame({ begun_ms: 0, received_ms: 1, frame: { view: 1, number,
        depends, encoding: "H264", codec: "avc1.42E01F", width: 64, height: 64, data: new Uint8Array(4), input_seq: 0n,
        ...other } });
    const keys = () => connection.sent.filter((m) => m.name === "key_frame");
    const taken = () => connection.sent.filter((m) => m.name === "taken").map((m) => m.number);
    const queue = () => new Promise((done) => setTimeout(done)).then(() => view.painter.queue);
    const shown = [];
    view.addEventListener("shown", (e) => shown.push(e.detail.frame.number));
    return { view, frame, keys, taken, queue, shown };
}

test("one hiccup of a decoder asks for one key frame and keeps the codec", async () => {
    const { frame, keys, taken, queue } = await makeView();
    for (let n = 1; n <= 6; n++)
        frame(n, n === 1 ? undefined : 1);
    HeldDecoder.newest.error(new Error("hiccup"));
    frame(7, 1); // was under way
    await queue();
    assert.deepEqual(keys(), [{ name: "key_frame", view: 1 }]);
    assert.deepEqual(taken(), [1, 2, 3, 4, 5, 6, 7]);
    frame(8);
    HeldDecoder.newest.show();
    await queue();
    frame(9, 1);
    HeldDecoder.newest.error(new Error("another one, later"));
    await queue();
    assert.equal(keys().length, 2);
    assert.ok(keys().every((m) => m.failed === undefined));
});

test("a codec of which three key frames fail is left", async () => {
    const { view, frame, keys, queue } = await makeView();
    let troubles = 0;
    view.addEventListener("trouble", () => troubles++);
    for (let n = 1; n <= 6; n += 2) {
        frame(n);
        frame(n + 1, 1);
        HeldDecoder.newest.error(new Error("cannot"));
        await queue();
    }
    assert.deepEqual(keys().map((m) => m.failed), [undefined, undefined, 9]);
    assert.equal(troubles, 1);
});

test("a view has the samples that the panel shows, whether its link says them or not", async () => {
    const { view } = await makeView();
    const { samplesOf } = await load("view.js");
    for (const [params, samples] of [[{}, 32], [{ mode: "PATH" }, 256], [{ mode: "PATH", samples: 5 }, 5]]) {
        view.params = params;
        assert.deepEqual([view.settings().samples, samplesOf(params)], [samples, samples]);
    }
    assert.doesNotMatch(readFileSync(join(web, "panels.js"), "utf8"), /params\.samples/);
});

test("measures and notes ask for the frame that is shown, and for the newest one where that is gone", async () => {
    const { view } = await makeView();
    const calls = [];
    let refusal = 0, node = 7n;
    view.connection.call = async (name, message) => {
        calls.push([name, message.frame]);
        if (name === "pick")
            return { hit: true, node: 9n };
        if (refusal)
            throw new RequestError({ code: refusal, reason: "refused" });
        const data = new DataView(new ArrayBuffer(33), 1); // as it stands in a message: anywhere
        [0, 0.5, -1, 1.25, 2, -3].forEach((v, i) => data.setFloat32(4 * i, v, true));
        data.setBigUint64(24, node, true);
        const { x, y, width, height, what } = message;
        assert.deepEqual([x, y, width, height, what], [32, 16, 1, 1, 14]);
        return { what, data: new Uint8Array(data.buffer, 1) };
    };
    assert.equal((await view.surface(0.5, 0.25)).node, 9n); // there is no frame yet
    view.frame = { number: 41n };
    assert.deepEqual(await view.surface(0.5, 0.25), { normal: [0, 0.5, -1], position: [1.25, 2, -3], node: 7n });
    node = 0n;
    assert.equal(await view.surface(0.5, 0.25), null);
    const { status } = await load("hgp.js");
    refusal = status.state;
    assert.equal((await view.surface(0.5, 0.25)).node, 9n);
    refusal = status.limit;
    await assert.rejects(view.surface(0.5, 0.25), (e) => e.status === "limit");
    view.isReprojected = true; // what is seen is no frame
    await view.surface(0.5, 0.25);
    assert.deepEqual(calls.map((c) => c.join(" ").trim()), ["pick", "surface_query 41", "surface_query 41", "surface_query 41", "pick",
        "surface_query 41", "pick"]);
});

// ---- key frames that come while others are in the decoder ------------------------------------------

const turns = async (count = 20) => {
    for (let i = 0; i < count; i++)
        await new Promise((done) => setImmediate(done));
};

test("frames in a decoder that one of another size or codec replaces hold nothing up", async (t) => {
    t.mock.timers.enable({ apis: ["setTimeout"] });
    const { view, frame, keys, taken, shown } = await makeView();
    let troubles = 0;
    view.addEventListener("trouble", () => troubles++);
    const small = {}, large = { width: 80, height: 80 };
    const av1 = { ...large, encoding: "AV1", codec: "av01.0.08M.08" };
    let n = 0;
    for (const other of [large, av1, large, small, large, av1]) { // more often than a codec may fail
        if (n === 0)
            frame(++n, undefined, small);
        const old = HeldDecoder.newest;
        frame(++n, 1, { ...other }); // stays in the decoder
        frame(++n, undefined, other);
        assert.notEqual(HeldDecoder.newest, old);
        assert.equal(old.state, "closed");
        old.error(new Error("of a decoder that is closed"));
        old.show(); // too late as well
    }
    frame(++n, 1, av1);
    HeldDecoder.newest.show();
    await turns();
    assert.deepEqual(shown, [n - 1, n]);
    assert.deepEqual(taken(), Array.from({ length: n }, (_, i) => i + 1));
    const { newest } = HeldDecoder;
    t.mock.timers.tick(10000); // of those that were replaced
    assert.equal(newest.state, "configured");
    frame(++n, 1, av1);
    newest.show();
    await turns();
    assert.equal(shown.at(-1), n);
    assert.deepEqual([keys(), troubles], [[], 0]);
});

test("a decoder that refuses a frame is replaced, and the next one has time of its own", async (t) => {
    t.mock.timers.enable({ apis: ["setTimeout"] });
    const { frame, keys, taken, shown } = await makeView();
    frame(1);
    frame(2, 1);
    HeldDecoder.newest.state = "closed"; // by the browser
    HeldDecoder.newest.decode = () => { throw new Error("closed"); };
    frame(3, 1);
    await turns();
    assert.deepEqual(taken(), [1, 2, 3]);
    assert.deepEqual(keys(), [{ name: "key_frame", view: 1 }]);
    t.mock.timers.tick(2000);
    frame(4);
    const { newest } = HeldDecoder;
    t.mock.timers.tick(2000);
    assert.equal(newest.state, "configured");
    newest.show();
    await turns();
    assert.deepEqual(shown, [4]);
    frame(5, 1);
    t.mock.timers.tick(3000);
    await turns();
    assert.equal(newest.state, "closed", "one that is stuck is given up");
    assert.deepEqual(taken(), [1, 2, 3, 4, 5]);
});

test("frames of another session, whose numbers begin again, are told apart in a decoder", async () => {
    const { frame, shown, queue } = await makeView();
    frame(1);
    frame(1); // the same size: the decoder goes on
    HeldDecoder.newest.show();
    await queue();
    assert.deepEqual(shown, [1, 1]);
});
