// browser_latency.mjs - from input to picture inside Chromium: an orbit of the viewer's camera, one pose
// per animation frame, against a daemon on loopback. Prints one JSON object.
//
//   node tests/bench/browser_latency.mjs [--scene demo:] [--size 1280x720] [--poses 300] [--codec JPEG]
//       [--settings gi=NONE]   (HELIO_BUILD_DIR; npm ci --prefix tests/browser first)
//
// latency_ms: from the camera's change to the animation frame after the picture that shows it was
// drawn. overhead_ms: the same less rendering. stages: by the frames' own times (docs/protocol.md).
// stale_frames: pictures that show an older camera than one before them.
import { parseArgs } from "node:util";
import { Daemon, openBrowser, openPage, waitFor } from "../browser/rig.mjs";

const { values } = parseArgs({ options: { scene: { type: "string", default: "demo:" },
    size: { type: "string", default: "1280x720" }, poses: { type: "string", default: "300" },
    codec: { type: "string", default: "JPEG" }, settings: { type: "string", default: "" } } });
const BAR_PX = 48; // above the picture

function percentiles(list) {
    const sorted = list.toSorted((a, b) => a - b);
    const at = (p) => Number((sorted[Math.min(sorted.length - 1, Math.floor(p * sorted.length))] ?? NaN)
        .toFixed(2));
    return { p50: at(0.5), p95: at(0.95), p99: at(0.99) };
}

// In the page: flies the orbit and collects what the frames say.
async function fly(poses) {
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
    });
    view.addEventListener("shown", (e) => { e.detail.frame.times.shown_ms = performance.now(); });
    view.addEventListener("shown", listener);
    const begun_ms = performance.now();
    await new Promise((done) => {
        let left = poses;
        const step = () => {
            orbit(view.camera, 2 * Math.PI / poses, 0);
            view.sendCamera();
            if (--left > 0)
                requestAnimationFrame(step);
            else
                done();
        };
        requestAnimationFrame(step);
    });
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
    const { seconds, shown } = await page.evaluate(fly, Number(values.poses));
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
