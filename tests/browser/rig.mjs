// rig.mjs - what the browser tests share: a daemon with the viewer, Chromium, a page of it.
import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import puppeteer from "puppeteer-core";

export const source = process.env.HELIO_SOURCE_DIR ?? fileURLToPath(new URL("../..", import.meta.url));
export const build = process.env.HELIO_BUILD_DIR ?? join(source, "build");
export const models = join(build, "tests/models");
// For conditions; it passes only where something is wrong.
export const WAIT_MS = Number(process.env.HELIO_TEST_WAIT_MS ?? 300000);

const run = promisify(execFile);
const chromium = ["/usr/bin/chromium", "/usr/bin/chromium-browser"].find(existsSync);
const TOKENS = { edit: "browser-edit-token", view: "browser-view-token", tools: "browser-tools-token",
    admin: "browser-admin-token" };

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

export async function until(condition, what) {
    for (const end = Date.now() + WAIT_MS; Date.now() < end; await pause(50)) {
        const value = await condition();
        if (value)
            return value;
    }
    throw new Error(`never came true: ${what}`);
}

// ---- the daemon ----------------------------------------------------------------------------------

export class Daemon {
    constructor() {
        this.folder = mkdtempSync(join(tmpdir(), "helio-browser-"));
        this.tokens = TOKENS;
        this.options = []; // more of heliod's
        this.port = 0;
        writeFileSync(join(this.folder, "tokens"), Object.entries(TOKENS).map(([role, token]) =>
            `${token} ${role === "tools" ? "edit" : role} ${role} tenant=tests\n`).join(""),
        { mode: 0o600 });
    }

    async start() {
        const ports = join(this.folder, "ports");
        rmSync(ports, { force: true });
        this.process = spawn(join(build, "bin/heliod"), ["--listen", `tcp:127.0.0.1:${this.port}`,
            "--port-file", ports, "--tokens", join(this.folder, "tokens"), "--asset-root", models,
            "--state-dir", join(this.folder, "state"), "--cache-dir", join(this.folder, "cache"),
            "--isolation", "shared", "--sandbox", "best-effort", "--no-seed-shaders", "--hang-timeout", "3600",
            "--start-timeout", "600", "--worker-timeout", "600", "--log", "warn", ...this.options], { stdio: ["ignore", "inherit", "inherit"] });
        this.ended = new Promise((done) => this.process.on("exit", done));
        await until(() => existsSync(ports) && readFileSync(ports, "utf8").trim(), "the daemon listens");
        this.port = Number(readFileSync(ports, "utf8").trim().split(/\D+/)[0]);
        this.origin = `http://127.0.0.1:${this.port}`;
    }

    async kill(signal = "SIGKILL") {
        this.process.kill(signal);
        await this.ended;
    }

    // Numbers of the worker processes below the daemon.
    workers() {
        const parents = new Map();
        for (const name of readdirSync("/proc").filter((n) => /^\d+$/.test(n))) {
            try {
                const stat = readFileSync(`/proc/${name}/stat`, "utf8");
                const [, comm, rest] = /^\d+ \((.*)\) (.*)$/s.exec(stat);
                parents.set(Number(name), { comm, parent: Number(rest.split(" ")[1]) });
            } catch {
                // it has ended meanwhile
            }
        }
        const isBelow = (pid) => {
            for (let p = pid; p; p = parents.get(p)?.parent ?? 0)
                if (p === this.process.pid)
                    return true;
            return false;
        };
        return [...parents].filter(([pid, p]) => p.comm.startsWith("helio-worker") && isBelow(pid))
            .map(([pid]) => pid);
    }

    async finish() {
        await this.kill("SIGKILL");
        rmSync(this.folder, { recursive: true, force: true });
    }

    // A command of administrators.
    manage(...words) {
        return run(join(build, "bin/helio"), [...words, "--connect", `tcp:127.0.0.1:${this.port}`,
            "--token", TOKENS.admin]);
    }

    // A settled picture by the command line client: path of a PNG file.
    async render(model, { width, height, camera, samples, options = [] }) {
        const out = join(this.folder, "render.png");
        const exact = (v) => v.map((n) => Math.fround(n)).join(",");
        await run(join(build, "bin/helio"), ["render", join(models, model), "-o", out,
            "--connect", `tcp:127.0.0.1:${this.port}`, "--token", TOKENS.tools,
            "--size", `${width}x${height}`, "--eye", exact(camera.eye), "--target",
            exact(camera.target), "--fov", String(camera.vfov_rad * 180 / Math.PI),
            "--spp", String(samples), ...options]);
        return readFileSync(out);
    }
}

// ---- the page ------------------------------------------------------------------------------------

export async function openBrowser() {
    assert.ok(chromium, "chromium is missing");
    return puppeteer.launch({ executablePath: chromium, protocolTimeout: WAIT_MS,
        args: ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--hide-scrollbars"] });
}

// A page that keeps what it complains about and what it asks for from where.
export async function openPage(browser, url, { width = 360, height = 300 } = {}) {
    const page = await browser.newPage();
    page.complaints = [];
    page.requests = [];
    page.on("pageerror", (error) => page.complaints.push(`error: ${error.message}`));
    page.on("console", (m) => {
        if (m.type() === "error" && !/ERR_CONNECTION_REFUSED|WebSocket connection/.test(m.text()))
            page.complaints.push(`console: ${m.text()}`);
    });
    page.on("request", (r) => page.requests.push(r.url()));
    page.setDefaultTimeout(WAIT_MS);
    await page.setViewport({ width, height, deviceScaleFactor: 1 });
    await page.goto(url);
    return page;
}

export const picture = (page) => page.$eval("#picture", (c) =>
    ({ ...c.dataset, width: c.width, height: c.height }));

// Waits until a function is true in the page. (Puppeteer's own waiting makes functions of text there,
// which the page's policy forbids.)
export const waitFor = (page, condition, ...args) =>
    until(() => page.evaluate(condition, ...args), `${condition}`);

// Waits for a picture that passes a test, a function of the canvas' data set.
export const waitPicture = (page, condition) =>
    until(async () => condition(await picture(page)), `${condition}`);

// Settled, with pixels on the canvas that have the hash which the server states, for the newest camera.
export const waitExact = (page) => waitFor(page, () => {
    const { exact, seq, settled } = document.querySelector("#picture").dataset;
    return settled === "true" && exact === "true" && Number(seq) === window.helio.view.seq;
});

// Pixels that the canvas shows, as base64, and those of an image file.
export const shownPixels = (page) => page.evaluate(() => {
    const canvas = document.querySelector("#picture");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let text = "";
    for (let i = 0; i < data.length; i += 8192)
        text += String.fromCharCode(...data.subarray(i, i + 8192));
    return btoa(text);
}).then((text) => Buffer.from(text, "base64"));

export const filePixels = (page, file) => page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }),
        { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let text = "";
    for (let i = 0; i < data.length; i += 8192)
        text += String.fromCharCode(...data.subarray(i, i + 8192));
    return btoa(text);
}, file.toString("base64")).then((text) => Buffer.from(text, "base64"));

// Where a picture is flat, squares of it hold nearly one colour: the greatest difference of the means of
// such squares between it and another picture, per channel in 1/255, and how many squares are flat.
export function flatDifference(exact, other, width, height) {
    assert.equal(exact.length, other.length, "pictures of different sizes");
    const SIDE = 16, EVEN = 6;
    let worst = 0, count = 0;
    for (let top = 0; top + SIDE <= height; top += SIDE)
        for (let left = 0; left + SIDE <= width; left += SIDE) {
            const squares = [exact, other].map((p) => squareOf(p, width, left, top, SIDE));
            if (squares[0].some((c) => c.most - c.least > EVEN))
                continue;
            count++;
            squares[0].forEach((c, i) => {
                worst = Math.max(worst, Math.abs(c.mean - squares[1][i].mean));
            });
        }
    return { worst, count };
}

// [{ mean, least, most }] of R, G and B.
function squareOf(pixels, width, left, top, side) {
    const channels = [0, 1, 2].map(() => ({ mean: 0, least: 255, most: 0 }));
    for (let y = top; y < top + side; y++)
        for (let x = left; x < left + side; x++)
            channels.forEach((c, i) => {
                const v = pixels[(y * width + x) * 4 + i];
                c.mean += v / (side * side);
                c.least = Math.min(c.least, v);
                c.most = Math.max(c.most, v);
            });
    return channels;
}

// Mean difference of the RGB of two pictures, in 1/255.
export function meanDifference(a, b) {
    assert.equal(a.length, b.length, "pictures of different sizes");
    let sum = 0;
    for (let i = 0; i < a.length; i++)
        sum += i % 4 === 3 ? 0 : Math.abs(a[i] - b[i]);
    return sum / (a.length * 0.75);
}

// Of the RGB of two pictures, in dB; equal ones have 999.
export function psnr(a, b) {
    assert.equal(a.length, b.length, "pictures of different sizes");
    let sum = 0;
    for (let i = 0; i < a.length; i++)
        sum += i % 4 === 3 ? 0 : (a[i] - b[i]) ** 2;
    return sum === 0 ? 999 : 10 * Math.log10(255 * 255 / (sum / (a.length * 0.75)));
}

// ---- files ---------------------------------------------------------------------------------------

// A square that one variant makes red, the other one blue, and a camera before it.
export function makeVariants() {
    const floats = new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0]);
    const material = (...color) => ({ emissiveFactor: color, pbrMetallicRoughness: { baseColorFactor: [0, 0, 0, 1] } });
    const bytes = Buffer.from(floats.buffer);
    return JSON.stringify({ asset: { version: "2.0" }, extensionsUsed: ["KHR_materials_variants"],
        extensions: { KHR_materials_variants: { variants: [{ name: "red" }, { name: "blue" }] } },
        buffers: [{ byteLength: bytes.length, uri: `data:application/octet-stream;base64,${bytes.toString("base64")}` }],
        bufferViews: [{ buffer: 0, byteLength: bytes.length }],
        accessors: [{ bufferView: 0, componentType: 5126, count: 6, type: "VEC3", min: [-1, -1, 0], max: [1, 1, 0] }],
        materials: [material(0, 1, 0), material(1, 0, 0), material(0, 0, 1)],
        meshes: [{ primitives: [{ attributes: { POSITION: 0 }, material: 0, extensions: { KHR_materials_variants: { mappings: [
            { material: 1, variants: [0] }, { material: 2, variants: [1] }] } } }] }],
        cameras: [{ type: "perspective", perspective: { yfov: 0.5, znear: 0.1 } }],
        nodes: [{ mesh: 0 }, { name: "near", camera: 0, translation: [0, 0, 3] }, { name: "far", camera: 0, translation: [0, 0, 30] }],
        scenes: [{ nodes: [0, 1, 2] }], scene: 0 });
}
