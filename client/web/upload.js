// upload.js - files dropped on the page, or chosen, to contents of the daemon: which file is the
// scene, which others it names, what the daemon has already, and the rest piece by piece.
import { RequestError } from "./connection.js";
import { sha256 } from "./sha256.js";

const PIECE_BYTES = 1 << 20;
const BACKLOG_BYTES = 8 << 20;
const FILE_LIMIT_BYTES = 2 ** 31;
const FILES_LIMIT = 4096;
const QUERY_CONTENTS = 1024;

const SCENES = ["glb", "gltf", "obj", "fbx", "dae", "ply", "stl", "off"];
const ENVIRONMENTS = ["hdr", "exr"];
const HEIGHTS = ["hgt", "tif", "tiff", "png"]; // height maps, where there is neither of both

const ending = (path) => path.slice(path.lastIndexOf(".") + 1).toLowerCase();
const unpackedEnding = (path) => ending(path.replace(/\.gz$/i, "")); // the server unpacks scenes
const folderOf = (path) => path.slice(0, path.lastIndexOf("/") + 1);
const baseOf = (path) => path.slice(path.lastIndexOf("/") + 1);

const refuse = (what, reason) =>
    new RequestError({ status: "unsupported", what, reason });
const unreadable = (what) => new RequestError({ status: "not-found", what,
    reason: "the browser cannot read it; it may have been moved or changed since it was chosen" });

// ---- files of a drop ---------------------------------------------------------------------------

function readEntries(reader) {
    return new Promise((resolve, reject) => reader.readEntries(resolve, reject));
}

async function walk(entry, path, out) {
    if (out.length >= FILES_LIMIT)
        throw refuse(entry.name, `more than ${FILES_LIMIT} files were dropped`);
    if (entry.isFile) {
        const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
        out.push({ path: path + entry.name, file });
        return;
    }
    const reader = entry.createReader();
    for (;;) {
        const entries = await readEntries(reader);
        if (!entries.length)
            return;
        for (const child of entries)
            await walk(child, `${path}${entry.name}/`, out);
    }
}

// [{ path, file }] of a drop or of an <input type=file>, folders included.
export async function filesOf(transfer) {
    const entries = [...transfer.items ?? []].map((i) => i.webkitGetAsEntry?.()).filter(Boolean);
    if (!entries.length)
        return [...transfer.files].map((file) =>
            ({ path: file.webkitRelativePath || file.name, file }));
    const out = [];
    for (const entry of entries)
        await walk(entry, "", out);
    return out;
}

// ---- what belongs together ---------------------------------------------------------------------

// Uris of files that a glTF document names, percent-decoded.
export function urisOf(document) {
    const named = [...document.buffers ?? [], ...document.images ?? []].map((o) => o.uri)
        .filter((uri) => typeof uri === "string" && !uri.startsWith("data:"));
    return [...new Set(named.map((uri) => {
        try {
            return decodeURIComponent(uri);
        } catch {
            return uri;
        }
    }))];
}

const resolve = (folder, uri) => {
    const parts = [];
    for (const part of (folder + uri).split("/"))
        if (part === "..")
            parts.pop();
        else if (part !== "." && part !== "")
            parts.push(part);
    return parts.join("/");
};

async function glbDocument({ path, file }) {
    const head = new DataView(await file.slice(0, 20).arrayBuffer());
    if (head.byteLength < 20 || head.getUint32(0, true) !== 0x46546c67)
        throw refuse(path, "this is not a GLB file");
    const size = head.getUint32(12, true);
    return JSON.parse(await file.slice(20, 20 + Math.min(size, file.size)).text());
}

// The server unpacks all but glTF.
async function unpack({ path, file }) {
    if (ending(path) !== "gz")
        return { path, file };
    if (typeof DecompressionStream !== "function")
        throw refuse(path, "unpack it first: this browser cannot");
    try {
        const stream = file.stream().pipeThrough(new DecompressionStream("gzip"));
        return { path: path.slice(0, -3), file: await new Response(stream).blob() };
    } catch (error) {
        throw error instanceof DOMException ? unreadable(path)
            : new RequestError({ status: "format", what: path, reason: "damaged, or not a gzip file" });
    }
}

async function gltfParts(main, files) {
    let document;
    try {
        document = ending(main.path) === "glb" ? await glbDocument(main)
            : JSON.parse(await main.file.text());
    } catch (error) {
        if (error instanceof RequestError)
            throw error;
        if (error instanceof DOMException)
            throw unreadable(main.path);
        throw new RequestError({ status: "format", what: main.path, reason: "not JSON" });
    }
    const missing = [], parts = [];
    for (const uri of urisOf(document)) {
        const path = resolve(folderOf(main.path), uri);
        const found = files.find((f) => f.path === path)
            ?? files.find((f) => baseOf(f.path) === baseOf(uri));
        if (found)
            parts.push({ uri, file: found.file });
        else
            missing.push(uri);
    }
    if (missing.length)
        throw new RequestError({ status: "not-found", what: main.path, reason:
            `it needs ${missing.slice(0, 4).join(", ")}${missing.length > 4 ? ", …" : ""}; `
            + "drop these files or their folder together with it" });
    return parts;
}

// { kind: "scene" or "environment", name, files: [{ uri, file }], others }, the main file first; others: names of
// further scenes, which are not opened.
export async function choose(files) {
    const first = (endings, of) => endings.map((e) => files.find((f) => of(f.path) === e)).find(Boolean);
    const scene = first(SCENES, unpackedEnding);
    const env = scene ? null : first(ENVIRONMENTS, ending);
    if (env)
        return { kind: "environment", name: env.path, files: [{ uri: env.path, file: env.file }] };
    const heights = scene ? null : first(HEIGHTS, unpackedEnding);
    if (heights)
        return { kind: "scene", name: baseOf(heights.path),
            files: [{ uri: baseOf(heights.path), file: heights.file }] };
    if (!scene)
        throw refuse(files[0]?.path ?? "drop",
            `this is neither a scene (${SCENES.join(", ")}) nor a height map (${HEIGHTS.join(", ")})`);
    const isGltf = ["glb", "gltf"].includes(unpackedEnding(scene.path));
    const main = isGltf ? await unpack(scene) : scene;
    const folder = folderOf(main.path);
    const parts = isGltf ? await gltfParts(main, files)
        : files.filter((f) => f !== scene && f.path.startsWith(folder))
            .map((f) => ({ uri: f.path.slice(folder.length), file: f.file }));
    const others = files.filter((f) => f !== scene && SCENES.includes(unpackedEnding(f.path))).map((f) => baseOf(f.path));
    return { kind: "scene", name: baseOf(main.path), others,
        files: [{ uri: baseOf(main.path), file: main.file }, ...parts] };
}

// ---- to the daemon -----------------------------------------------------------------------------

// Of a file, or of a piece of one.
async function bytesOf(blob, what) {
    try {
        return new Uint8Array(await blob.arrayBuffer());
    } catch {
        throw unreadable(what);
    }
}

// Its bytes are read again to be sent: those of all files together may be more than a page may have.
async function hashFile({ uri, file }) {
    if (file.size > FILE_LIMIT_BYTES)
        throw new RequestError({ status: "limit", what: uri, limit: "2 GiB for each file",
            reason: "a browser cannot read more at once; "
                + "load it from an asset folder of the server" });
    return sha256(await bytesOf(file, uri));
}

const pause = () => new Promise((done) => setTimeout(done, 10));

async function send(connection, part, onBytes) {
    const total = part.file.size;
    let answer;
    for (let offset = 0; offset === 0 || offset < total; offset += PIECE_BYTES) {
        const data = await bytesOf(part.file.slice(offset, offset + PIECE_BYTES), part.uri);
        const message = { hash: part.hash, total: BigInt(total), offset: BigInt(offset), data };
        const isLast = offset + PIECE_BYTES >= total;
        while (connection.backlog_bytes > BACKLOG_BYTES)
            await pause();
        if (isLast)
            answer = connection.call("upload", message);
        else if (!connection.send("upload", message))
            throw new RequestError({ status: "closed", reason: "the connection was lost" });
        onBytes(data.length);
    }
    await answer;
}

async function missing(connection, parts) {
    const unique = [...new Map(parts.map((p) => [p.hash.join(), p])).values()];
    const out = [];
    for (let i = 0; i < unique.length; i += QUERY_CONTENTS) {
        const some = unique.slice(i, i + QUERY_CONTENTS);
        const { have } = await connection.call("upload_query",
            { contents: some.map((p) => ({ hash: p.hash })) });
        out.push(...some.filter((_, k) => !have[k].value));
    }
    return out;
}

// Sends what the daemon does not have; the answer is the `files` of asset_load.
// onProgress(text, share 0..1 or null).
export async function upload(connection, parts, onProgress) {
    onProgress("Reading files", null);
    for (const part of parts)
        part.hash = await hashFile(part);
    const unknown = await missing(connection, parts);
    const total = unknown.reduce((sum, p) => sum + p.file.size, 0);
    let done = 0;
    for (const part of unknown)
        await send(connection, part, (bytes) => {
            done += bytes;
            onProgress("Sending files", total ? done / total : null);
        });
    return parts.map(({ uri, hash }) => ({ uri, hash }));
}
