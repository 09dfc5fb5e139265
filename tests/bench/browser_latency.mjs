// browser_latency.mjs - from input to picture inside Chromium: an orbit of the viewer's camera against a
// daemon on loopback. The next pose is sent in the animation frame after the picture of the one before was
// drawn, as `helio bench latency` does, or with --every-frame 1 in each. Poses that warm it up come first
// (kernels are compiled with the first pictures in motion). Prints one JSON object.
//
//   node tests/bench/browser_latency.mjs [--scene demo:] [--size 1280x720] [--poses 300] [--codec JPEG]
//       [--settings gi=NONE] [--warm-up 20] [--every-frame 0]   (HELIO_BUILD_DIR; npm ci --prefix tests/browser first)
//
// latency_ms: from the camera's change to the animation frame after the picture that shows it was
// drawn. overhead_ms: the same less rendering. stages: by the frames' own times (docs/protocol.md).
// stale_frames: pictures that show an older camera than one before them.
import { parseArgs } from "node:util";
import { Daemon, openBrowser, openPage, waitFor } from "../browser/rig.mjs";

const { values } = parseArgs({ options: { scene: { type: "string", default: "demo:" },
    size: { type: "string", default: "1280x720" }, poses: { type: "string", default: "300" },
    codec: { type: "string", default: "JPEG" }, settings: { type: "string", default: "" },
    "warm-up": { type: "string", default: "20" }, "every-frame": { type: "string", default: "0" } } });
const BAR_PX = 48; // above the picture

function percentiles(list) {
    const sorted = list.toSorted((a, b) => a - b);
    const at = (p) => Number((sorted[Math.min(sorted.length - 1, Math.floor(p * sorted.length))] ?? NaN)
        .toFixed(2));
    return { p50: at(0.5), p95: at(0.95), p99: at(0.99) };
}

// In the page: flies the orbit and collects what the frames say.
async function fly({ poses, everyFrame }) {
    const LONGEST_MS = 60000; // for the picture of one pose
    const { orbit } = await import("./camera.js");
    const { view } = window.helio;
    const shown = [];
    let newest = -1;
    const listener = ({ detail }) => requestAnimationFrame((drawn_ms) => {
        const seq = Number(detail.frame.input_seq);
        shown.push({ seq, isStale: seq < newest, bytes: detail.frame.data.length,
            latency_ms: detail.latency_ms === null ? null
                : detail.latency_ms + Math.max(0, performance.now() - detail.frame.times.shown_ms),
            split: detail.split, drawn_ms });
        newest = Math.max(newest, seq);
        onShown?.(seq);
    });
    let onShown = null;
    const isShown = (wanted) => new Promise((done, failed) => {
        const late = setTimeout(() => failed(new Error(`no picture of pose ${wanted}`)), LONGEST_MS);
        onShown = (seq) => {
            if (seq < wanted)
                return;
            clearTimeout(late);
            onShown = null;
            done();
        };
    });
    view.addEventListener("shown", (e) => { e.detail.frame.times.shown_ms = performance.now(); });
    view.addEventListener("shown", listener);
    const begun_ms = performance.now();
    for (let i = 0; i < poses; i++) {
        await new Promise(requestAnimationFrame);
        orbit(view.camera, 2 * Math.PI / poses, 0);
        view.sendCamera();
        if (!everyFrame)
            await isShown(view.seq);
    }
    const seconds = (performance.now() - begun_ms) / 1000;
    view.removeEventListener("shown", listener);
    return { seconds, shown };
}

const [width, height] = values.size.split("x").map(Number);
const daemon = new Daemon();
let browser;
try {
    await daemon.start();
    browser = await openBrowser();
    const words = `load=${values.scene}&ticket=${daemon.tokens.edit}&${values.settings}`;
    const page = await openPage(browser, `${daemon.origin}/#${words}`,
        { width, height: height + BAR_PX });
    await waitFor(page, () => document.querySelector("#picture").dataset.settled === "true");
    await page.evaluate((codec) => window.helio.view.setCodec(codec), values.codec);
    const everyFrame = Number(values["every-frame"]) > 0;
    await page.evaluate(fly, { poses: Number(values["warm-up"]), everyFrame: false });
    const { seconds, shown } = await page.evaluate(fly, { poses: Number(values.poses), everyFrame });
    const timed = shown.filter((s) => s.latency_ms !== null && s.split);
    const stages = Object.fromEntries(Object.keys(timed[0]?.split ?? {}).map((name) =>
        [name, percentiles(timed.map((s) => s.split[name]))]));
    console.log(JSON.stringify({ scene: values.scene, size: values.size, codec: values.codec,
        browser: await browser.version(), poses: Number(values.poses), frames: shown.length,
        fps: Number((shown.length / seconds).toFixed(2)),
        stale_frames: shown.filter((s) => s.isStale).length,
        bytes_per_frame: Math.round(shown.reduce((sum, s) => sum + s.bytes, 0) / shown.length),
        latency_ms: percentiles(timed.map((s) => s.latency_ms)),
        overhead_ms: percentiles(timed.map((s) => s.latency_ms - s.split.render)), stages }, null, 2));
} finally {
    await browser?.close();
    await daemon.finish();
}
