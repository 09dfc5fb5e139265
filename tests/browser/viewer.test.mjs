// viewer.test.mjs - the viewer in Chromium against a real daemon and its renderer. One browser and
// one daemon for all cases, small pictures, waiting for conditions only.
// Run: node --test tests/browser/viewer.test.mjs   (HELIO_BUILD_DIR; docs/testing.md)
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { after, before, test } from "node:test";
import {
    Daemon, WAIT_MS, build, filePixels, flatDifference, makeVariants, meanDifference, models, openBrowser, openPage,
    picture, psnr, shownPixels, until, waitExact, waitFor, waitPicture,
} from "./rig.mjs";

const MODEL = "morph.glb"; // a plate with an animation
const SAMPLES = 4;
const SETTINGS = `gi=NONE&samples=${SAMPLES}`;
// A picture of few samples is settled by its first frame, and then comes without loss in motion too.
const MOTION_SAMPLES = 64;

const daemon = new Daemon();
let browser, page;

const link = (words, role = "edit") =>
    `${daemon.origin}/#${words}&ticket=${daemon.tokens[role]}&${SETTINGS}`;
const status = () => page.$eval("#status", (s) => s.textContent.trim());
const evaluate = (...args) => page.evaluate(...args);

// A key that moves the camera, until the picture of it is there to the last bit.
async function turn(key) {
    const seq = await evaluate(() => window.helio.view.seq);
    await page.focus("#picture");
    await page.keyboard.press(key);
    await waitFor(page, (before) => window.helio.view.seq > before, seq);
    await waitExact(page);
}

before(async () => {
    await daemon.start();
    browser = await openBrowser();
    page = await openPage(browser, link(`scene=tests&load=${join(models, MODEL)}`));
}, { timeout: WAIT_MS });

after(async () => {
    await browser?.close();
    await daemon.finish();
});

test("loads a scene, and takes the access out of the address", async () => {
    await waitPicture(page, (d) => d.frame);
    assert.equal(new URL(page.url()).hash.includes("ticket"), false);
    await waitFor(page, () => document.title.includes("tests"));
});

test("settles to the pixels that the server hashed", async () => {
    await waitExact(page);
    const { hash } = await picture(page);
    assert.match(hash, /^[0-9a-f]{64}$/);
    await waitFor(page, () => document.querySelector("#status").textContent.includes("Exact"));
});

// Browsers keep a canvas that is read in main memory, and warn of it.
test("never reads the canvas that it draws on", async () => {
    await evaluate(() => {
        const { getImageData } = CanvasRenderingContext2D.prototype;
        window.canvasReads = 0;
        CanvasRenderingContext2D.prototype.getImageData = function (...args) {
            window.canvasReads++;
            return getImageData.apply(this, args);
        };
        window.endCount = () => { CanvasRenderingContext2D.prototype.getImageData = getImageData; };
    });
    await turn("ArrowLeft");
    await evaluate(() => window.endCount());
    assert.equal(await evaluate(() => window.canvasReads), 0);
});

test("shows the pixels that helio renders", async () => {
    const { width, height } = await picture(page);
    const camera = await evaluate(() => window.helio.view.camera);
    const file = await daemon.render(MODEL, { width, height, camera, samples: 4,
        options: ["--gi", "none", "--exposure", "auto"] });
    const expected = await filePixels(page, file);
    assert.ok(psnr(await shownPixels(page), expected) > 55, "settled pixels differ");
    // The same picture with loss, through the decoder that pictures in motion take.
    await evaluate(async () => {
        const frame = await window.helio.connection.call("frame_request",
            { view: 1, settled: true, encoding: "JPEG", quality: 90 });
        window.helio.view.painter.push(frame);
        await window.helio.view.painter.queue;
    });
    const lossy = psnr(await shownPixels(page), expected);
    assert.ok(lossy > 28 && lossy < 900, `JPEG: ${lossy} dB`);
});

test("moves with the mouse, and the newest camera is shown in the end", async () => {
    const before = await shownPixels(page);
    const seq = await evaluate(() => window.helio.view.seq);
    await page.mouse.move(180, 160);
    await page.mouse.down();
    for (let i = 1; i <= 10; i++)
        await page.mouse.move(180 + 6 * i, 160 + 2 * i);
    await page.mouse.up();
    await waitExact(page);
    assert.ok(await evaluate(() => window.helio.view.seq) > seq, "no camera was sent");
    assert.ok(psnr(before, await shownPixels(page)) < 40, "the picture has not changed");
});

// Keeps the newest frame of an encoding that is shown: its pixels, the camera that it shows.
const catchFrames = (encoding) => evaluate((wanted) => {
    const { view } = window.helio;
    view.removeEventListener("shown", window.catcher);
    window.caught = null;
    window.catcher = ({ detail: { frame } }) => {
        if (frame.encoding !== wanted)
            return;
        const { width, height } = view.canvas;
        const { data } = view.canvas.getContext("2d").getImageData(0, 0, width, height);
        window.caught = { data, width, height, camera: structuredClone(view.shown),
            isDelta: frame.depends !== undefined || window.caught?.isDelta };
    };
    view.addEventListener("shown", window.catcher);
}, encoding);

const caughtPixels = () => evaluate(() => {
    const { data, width, height } = window.caught;
    let text = "";
    for (let i = 0; i < data.length; i += 8192)
        text += String.fromCharCode(...data.subarray(i, i + 8192));
    return { base64: btoa(text), width, height };
}).then(({ base64, ...size }) => ({ pixels: Buffer.from(base64, "base64"), ...size }));

// How far keys have turned the camera depends on time: the scene again, from where it is seen well, in the whole picture.
async function fitView() {
    await evaluate(() => { window.helio.view.free = () => ({ x: [0, 1], y: [0, 1] }); });
    await evaluate(() => window.helio.fit(0n, [0.5, 0.45]));
    await waitFor(page, () => !window.helio.flight && !window.helio.isAwake);
    await waitExact(page);
}

// A frame of a codec in motion, and the exact picture of the same camera.
async function compareInMotion(codec, isStream) {
    await fitView();
    await evaluate((name) => window.helio.view.setCodec(name), codec);
    await catchFrames(codec);
    await page.focus("#picture");
    await page.keyboard.down("ArrowLeft");
    try {
        await waitFor(page, (isDelta) => window.caught && (window.caught.isDelta || !isDelta),
            isStream);
    } finally {
        await page.keyboard.up("ArrowLeft");
    }
    await waitFor(page, () => !window.helio.isAwake);
    await evaluate(() => {
        const { view } = window.helio;
        view.removeEventListener("shown", window.catcher);
        view.camera = structuredClone(window.caught.camera);
        view.sendCamera(true);
    });
    await waitExact(page);
    const { pixels, width, height } = await caughtPixels();
    return flatDifference(await shownPixels(page), pixels, width, height);
}

test("every codec that browser and server share shows the same picture", async () => {
    const known = await evaluate(async () =>
        (await import("./decode.js")).FramePainter.motionEncodings());
    for (const codec of ["H264", "AV1", "TILES_JPEG", "JPEG"])
        assert.ok(known.includes(codec), `this browser does not decode ${codec}`);
    await evaluate((samples) => window.helio.setParams({ exposure_mode: "FIXED", exposure_ev: 0, samples }),
        MOTION_SAMPLES);
    for (const codec of ["H264", "AV1", "TILES", "TILES_JPEG", "JPEG", "JPEG_444"]) {
        const isStream = !codec.startsWith("JPEG");
        const { worst, count } = await compareInMotion(codec, isStream);
        assert.ok(count >= 20, `${codec}: only ${count} flat squares`);
        // What coding may lose in motion (AV1 5.6 on a busy machine); another matrix or range: more than 8.
        assert.ok(worst <= 6, `${codec}: flat squares differ by ${worst} of 255`);
    }
    await evaluate((samples) => window.helio.setParams({ exposure_mode: "AUTO", samples }), SAMPLES);
    await evaluate(() => window.helio.view.setCodec("auto"));
    await fitView();
});

// Frames come to the page, and wait there: what a long way to the server does, for as long as wanted.
const holdFrames = () => evaluate(() => {
    const { view } = window.helio;
    window.held = [];
    view.onFrame = (detail) => window.held.push(detail);
});

const releaseFrames = () => evaluate(() => {
    const { view } = window.helio;
    delete view.onFrame;
    window.held.splice(0).forEach((detail) => view.onFrame(detail));
});

// What lies over the picture, drawn for the camera as it is now.
const warpedPixels = () => evaluate(() => {
    const { view } = window.helio;
    view.reproject();
    const { canvas } = view.warp, { width, height } = canvas;
    const context = new OffscreenCanvas(width, height).getContext("2d");
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    let text = "";
    for (let i = 0; i < data.length; i += 8192)
        text += String.fromCharCode(...data.subarray(i, i + 8192));
    return btoa(text);
}).then((text) => Buffer.from(text, "base64"));

test("between frames the last one is shown as the camera sees it by now", async () => {
    const hidden = () => page.$eval("#warp", (c) => c.hidden);
    await evaluate(() => window.helio.setParams({ exposure_mode: "FIXED", exposure_ev: 0 }));
    await fitView();
    await evaluate(() => window.helio.setReprojection(true));
    await waitFor(page, () => Boolean(window.helio.view.warp.state));
    await waitExact(page);
    const before = await shownPixels(page);
    const { frame } = await picture(page);
    await holdFrames();
    await evaluate(async () => {
        const { orbit, dolly } = await import("./camera.js");
        orbit(window.helio.takeCamera(), 0.3, 0.1);
        dolly(window.helio.view.camera, 0.8);
        window.helio.wake();
    });
    await waitFor(page, () => !document.querySelector("#warp").hidden && !window.helio.isAwake);
    const warped = await warpedPixels();
    assert.ok(await evaluate(() => window.helio.view.age_ms > 0));
    assert.ok(await evaluate(() => window.helio.stats.rows().some((row) => row[1].startsWith("Reprojected"))));
    assert.equal((await picture(page)).frame, frame, "a frame came");
    assert.equal(meanDifference(before, await shownPixels(page)), 0, "the frame itself has changed");
    await releaseFrames();
    await waitExact(page);
    assert.equal(await hidden(), true);
    const after = await shownPixels(page);
    const stale = meanDifference(before, after), left = meanDifference(warped, after);
    // Cells of 4 px, what comes into sight, and one more interpolation leave about half.
    assert.ok(left < 0.75 * stale, `${left} of 255 from the frame that follows, the one before ${stale}`);
    await evaluate(() => window.helio.setReprojection(false));
    await evaluate(() => window.helio.setParams({ exposure_mode: "AUTO" }));
    await waitExact(page);
    await turn("ArrowLeft");
    assert.equal(await evaluate(() => window.helio.view.frame.grid), null);
});

test("a picture at rest brings only the tiles that an edit has changed, to the last bit", async () => {
    await waitExact(page);
    const settings = { still_encoding: "TILES", exposure_mode: "FIXED", exposure_ev: 0 };
    const before = await evaluate(() => window.helio.view.params.still_encoding);
    await evaluate((s) => window.helio.setParams(s), settings);
    const still = () => evaluate(() => {
        const { encoding, depends, data, lossless } = window.helio.view.frame;
        const isNew = window.helio.view.frame !== window.frameBefore;
        return { isNew, encoding, isPart: depends !== undefined, bytes: data.length, lossless };
    });
    const stills = [];
    // A whole one first. At rest the answer to key_frame is the picture once more.
    await turn("ArrowRight");
    await evaluate(() => {
        window.frameBefore = window.helio.view.frame;
        window.helio.connection.send("key_frame", { view: 1 });
    });
    const first = await until(async () => {
        const now = await still();
        return now.isNew && now.encoding === "TILES" && !now.isPart && now;
    }, "a whole picture in tiles");
    for (const isVisible of [false, true]) {
        await settleAfter(() => evaluate(async (is) => {
            const { scene } = window.helio;
            const [id] = [...scene.nodes].find(([, node]) => node.mesh);
            await scene.setVisible(id, is);
        }, isVisible));
        stills.push(await still());
    }
    await evaluate((s) => window.helio.setParams(s), { still_encoding: before, exposure_mode: "AUTO" });
    for (const s of stills)
        assert.ok(s.encoding === "TILES" && s.isPart && s.lossless && s.bytes < first.bytes, JSON.stringify([first, s]));
});

test("is usable by keyboard alone", async () => {
    await page.setViewport({ width: 900, height: 480 });
    await evaluate(() => document.activeElement.blur());
    const reached = new Set();
    for (let i = 0; i < 40; i++) {
        await page.keyboard.press("Tab");
        reached.add(await evaluate(() => document.activeElement.getAttribute("aria-label")));
    }
    const wanted = await evaluate(() => [...document.querySelectorAll("#menu button, #tools button")]
        .filter((b) => b.offsetParent).map((b) => b.getAttribute("aria-label")));
    for (const label of [...wanted, "Picture of the scene"])
        assert.ok(reached.has(label), `Tab does not reach: ${label}`);
    await page.focus("#picture");
    await page.keyboard.press("KeyF");
    await waitExact(page);
    await until(async () => { // picks what is in the middle, once the picture is that of KeyF
        await page.keyboard.press("Enter");
        return page.waitForSelector("#card:not([hidden])", { timeout: 3000 }).catch(() => null);
    }, "a card of what is picked");
    await page.keyboard.press("Escape");
    await page.waitForSelector("#card", { hidden: true });
    await page.keyboard.press("KeyC");
    await page.waitForSelector("#panel-scene:not([hidden]) .node");
    await page.keyboard.press("Escape");
    await page.waitForSelector("#panel-scene", { hidden: true });
    assert.equal(await evaluate(() => document.activeElement.getAttribute("aria-label")), "Scene");
    await page.focus("#picture");
    await page.keyboard.type("?");
    await page.waitForSelector("dialog[open]");
    await page.keyboard.press("Escape");
    await page.waitForSelector("dialog", { hidden: true });
    await page.setViewport({ width: 360, height: 300 });
});

// Does something, and waits for the exact picture that comes of it: the server says which it is.
async function settleAfter(action, isDone = () => true) {
    await action();
    await waitFor(page, isDone);
    await waitFor(page, async () => {
        const { hash } = await window.helio.connection.call("frame_request",
            { view: 1, settled: true, encoding: "PNG8" });
        const stated = [...hash].map((b) => b.toString(16).padStart(2, "0")).join("");
        const shown = document.querySelector("#picture").dataset;
        return shown.exact === "true" && shown.hash === stated;
    });
    return shownPixels(page);
}

test("outlines what is selected", async () => {
    await page.focus("#picture");
    const before = await settleAfter(() => {}, () => window.helio.looks.selected === null);
    const outlined = await settleAfter(() => page.keyboard.press("Enter"),
        () => window.helio.looks.selected !== null);
    assert.ok(psnr(before, outlined) < 60, "the selection is not seen");
    const after = await settleAfter(() => page.keyboard.press("Escape"),
        () => window.helio.looks.selected === null);
    assert.ok(psnr(before, after) > 55, "the selection is still seen");
});

test("clipping planes cut what this view shows", async () => {
    const hits = () => evaluate(() => Promise.all([0.25, 0.4, 0.6, 0.75].map(async (x) =>
        Boolean(await window.helio.view.pick(x, 0.5)))));
    await evaluate(() => window.helio.fit(0n, [0, 0.3]));
    await waitFor(page, () => !window.helio.flight && !window.helio.isAwake);
    await waitExact(page);
    const before = await shownPixels(page);
    assert.deepEqual((await hits()).slice(1, 3), [true, true]);
    await evaluate(() => window.helio.panels.set("view", true));
    const flip = (label) => evaluate((text) => {
        const found = [...document.querySelectorAll("#panel-view label")]
            .find((l) => l.textContent === text);
        document.getElementById(found.htmlFor).click();
    }, label);
    const isSent = () => !window.helio.looks.timer;
    await settleAfter(() => flip("Cut along X"), isSent);
    assert.deepEqual((await hits()).slice(1, 3), [true, false]);
    await settleAfter(() => flip("Other side of X"), isSent);
    assert.deepEqual((await hits()).slice(1, 3), [false, true]);
    const after = await settleAfter(() => flip("Cut along X"), isSent);
    assert.ok(psnr(before, after) > 55, "something is still cut");
    await evaluate(() => window.helio.panels.set("view", false));
});

// ---- what is in the scene, and how it is shown ---------------------------------------------------

const panel = (name, isOpen) => evaluate((n, is) => window.helio.panels.set(n, is), name, isOpen);

test("the animation bar sets the time, plays and pauses", async () => {
    await page.waitForSelector("#timeline:not([hidden])");
    const seek = (share) => evaluate((part) => {
        const slider = document.querySelector("#timeline input[type=range]");
        slider.value = String(Number(slider.max) * part);
        slider.dispatchEvent(new Event("input"));
    }, share);
    const isSet = () => !window.helio.timeline.isPending && !window.helio.timeline.isBusy;
    const before = await settleAfter(() => seek(0), isSet);
    const after = await settleAfter(() => seek(0.5), isSet);
    assert.ok(psnr(before, after) < 50, "the time changes nothing");
    await page.click("#timeline button");
    await waitFor(page, () => window.helio.timeline.isPlaying);
    const revision = await evaluate(() => String(window.helio.view.frame.scene_revision));
    await waitFor(page, (old) => window.helio.view.frame.scene_revision > BigInt(old) + 2n, revision);
    await page.click("#timeline button");
    await waitFor(page, () => !window.helio.timeline.isPlaying);
    await settleAfter(() => seek(0), isSet);
});

// Choosing a mode asks for as many samples as it has by default: of a small picture here, and the others stay quick.
test("switches to path tracing and back", async () => {
    await page.setViewport({ width: 160, height: 120 });
    await panel("view", true);
    for (const [text, mode] of [["Path traced", "PATH"], ["Real time", "REALTIME"]]) {
        await settleAfter(() => evaluate((label) => {
            [...document.querySelectorAll("#panel-view button, #panel-view label")]
                .find((e) => e.textContent === label).click();
        }, text), () => window.helio.view.frame?.settled);
        assert.equal(await evaluate(() => window.helio.view.params.mode), mode);
        await waitFor(page, (wanted) => (window.helio.view.frame.mode ?? "REALTIME") === wanted, mode);
    }
    await panel("view", false);
    await evaluate(() => window.helio.setParams({ samples: 4 }));
});

test("an exposure that is fixed is the metered one", async () => {
    await panel("view", true);
    await settleAfter(() => evaluate(() => window.helio.setMetered(true)));
    const metered = await evaluate(() => window.helio.view.frame.exposure_ev);
    assert.equal(await page.$eval("#panel-view", (p) => p.textContent.includes("Exposure is metered")), true);
    await settleAfter(() => evaluate(() => window.helio.viewPanel.meterHint.querySelector("button").click()),
        () => window.helio.view.params.exposure_mode === "FIXED");
    const { exposure_mode, exposure_ev } = await evaluate(() => window.helio.view.params);
    assert.equal(exposure_mode, "FIXED");
    assert.ok(Math.abs(exposure_ev - metered) < 0.01, `${exposure_ev} for ${metered}`);
    assert.equal(await evaluate(() => window.helio.viewPanel.meterHint.hidden), true);
    await settleAfter(() => evaluate(() => window.helio.setMetered(true)));
    await panel("view", false);
});

test("takes a picture of what is shown", async () => {
    await page.setViewport({ width: 900, height: 480 });
    await settleAfter(() => {});
    const session = await page.createCDPSession();
    await session.send("Browser.setDownloadBehavior", { behavior: "deny" });
    await evaluate(() => {
        const make = URL.createObjectURL;
        URL.createObjectURL = (blob) => {
            URL.createObjectURL = make;
            window.saved = blob;
            return make.call(URL, blob);
        };
    });
    await page.click("#menu button[aria-label=Screenshot]");
    await waitFor(page, () => window.saved);
    const base64 = await evaluate(async () => {
        const bytes = new Uint8Array(await window.saved.arrayBuffer());
        return btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(""));
    });
    const taken = await filePixels(page, Buffer.from(base64, "base64"));
    const same = psnr(await shownPixels(page), taken);
    assert.ok(same > 40, `the picture is another one: ${same} dB`); // its exposure is metered anew
});

test("a link that is shared lets others see the same", async () => {
    await page.click("#menu button[aria-label=Share]");
    await page.waitForSelector("dialog[open] input[aria-label=Link]");
    await page.select("dialog[open] select", "view");
    await waitFor(page, () => document.querySelector("dialog[open] input.text").value.includes("ticket="));
    const shared = await page.$eval("dialog[open] input.text", (e) => e.value);
    const guest = await openPage(await browser.createBrowserContext(), shared);
    await waitPicture(guest, (d) => d.frame);
    assert.equal(await guest.evaluate(() => window.helio.connection.canEdit), false);
    const [mine, theirs] = await Promise.all([page, guest].map((p) => p.evaluate(() => window.helio.view.camera.eye)));
    assert.ok(mine.every((v, i) => Math.abs(v - theirs[i]) < 1e-4), `${mine} and ${theirs}`);
    await guest.browserContext().close();
    // Without a clipboard, as over plain HTTP, the link is there to be copied by hand.
    await evaluate(() => Object.defineProperty(navigator, "clipboard", { value: undefined, configurable: true }));
    await page.click("dialog[open] button[value=copy]");
    await page.waitForSelector("dialog[open] textarea");
    assert.equal(await page.$eval("dialog[open] textarea", (e) => e.value), shared);
    await evaluate(() => delete navigator.clipboard);
    await page.keyboard.press("Escape");
    await page.waitForSelector("dialog", { hidden: true });
});

test("one finger turns, two zoom", async () => {
    const session = await page.createCDPSession();
    const touch = (type, ...points) => session.send("Input.dispatchTouchEvent",
        { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
    const at = () => evaluate(() => {
        const { eye, target } = window.helio.view.camera;
        return { eye, far: Math.hypot(...eye.map((v, i) => v - target[i])) };
    });
    const before = await at();
    await touch("touchStart", [450, 240]);
    for (let i = 1; i <= 6; i++)
        await touch("touchMove", [450 + 10 * i, 240]);
    await touch("touchEnd");
    const turned = await at();
    assert.ok(Math.abs(turned.far - before.far) < 1e-3 * before.far, "the distance is another one");
    assert.ok(turned.eye.some((v, i) => Math.abs(v - before.eye[i]) > 1e-2 * before.far), "nothing turned");
    await touch("touchStart", [440, 240], [460, 240]);
    for (let i = 1; i <= 6; i++)
        await touch("touchMove", [440 - 10 * i, 240], [460 + 10 * i, 240]);
    await touch("touchEnd");
    assert.ok((await at()).far < 0.8 * turned.far, "fingers that part come nearer");
    await waitExact(page);
});

test("a page that is loaded again shows the scene from where it was seen", async () => {
    await turn("ArrowLeft");
    const camera = await evaluate(() => window.helio.cameraText());
    await page.reload();
    await waitExact(page);
    assert.equal(await evaluate(() => window.helio.cameraText()), camera);
});

test("a codec that fails is left for the next one", async () => {
    await evaluate(() => {
        window.ownDecoder = VideoDecoder;
        window.VideoDecoder = class {
            constructor({ error }) {
                this.error = error;
                this.state = "unconfigured";
            }
            configure() {
                this.state = "configured";
            }
            decode() {
                queueMicrotask(() => this.error(new Error("this decoder always fails")));
            }
            close() {
                this.state = "closed";
            }
        };
        window.VideoDecoder.isConfigSupported = async () => ({ supported: true });
        return window.helio.view.setCodec("H264");
    });
    await evaluate(() => window.helio.view.addEventListener("trouble",
        (e) => { window.codecTrouble = e.detail.message; }, { once: true }));
    await evaluate((samples) => window.helio.setParams({ samples }), MOTION_SAMPLES);
    await catchFrames("JPEG");
    await page.focus("#picture");
    await page.keyboard.down("ArrowLeft");
    try {
        await waitFor(page, () => window.caught);
    } finally {
        await page.keyboard.up("ArrowLeft");
    }
    assert.equal(await evaluate(() => window.codecTrouble), "this decoder always fails");
    await evaluate((samples) => {
        window.VideoDecoder = window.ownDecoder;
        window.helio.view.removeEventListener("shown", window.catcher);
        window.helio.setParams({ samples });
        return window.helio.view.setCodec("auto");
    }, SAMPLES);
    await fitView();
});

test("measures between two picks", async () => {
    await page.focus("#picture");
    await page.keyboard.press("KeyM");
    await page.keyboard.press("Enter");
    await waitFor(page, () => window.helio.overlay.points.length === 1);
    await page.keyboard.press("Enter");
    await waitFor(page, () => document.querySelector("#card").textContent.includes("0.000 m"));
    await page.keyboard.press("Escape");
});

test("survives a storm of sizes", async () => {
    for (let i = 0; i < 20; i++)
        await page.setViewport({ width: 330 + 37 * (i * 7 % 11), height: 280 + 23 * (i * 5 % 9) });
    await page.setViewport({ width: 361, height: 301 });
    await waitFor(page, () => document.querySelector("#picture").width === 361);
    await waitExact(page);
    assert.deepEqual(page.complaints, []);
});

test("goes on when the worker is killed", async () => {
    const [pid] = daemon.workers();
    assert.ok(pid, "no worker found");
    process.kill(pid, "SIGKILL");
    await until(() => daemon.workers().some((p) => p !== pid), "another worker starts");
    await turn("ArrowRight");
});

test("resumes its session when the daemon is killed and started again", async () => {
    const { session } = await evaluate(() => ({ session: String(window.helio.connection.session) }));
    await daemon.kill();
    await page.waitForSelector("#curtain:not([hidden])");
    await evaluate(() => {
        window.helio.connection.addEventListener("opened", (e) => {
            window.resumedSession = e.detail.resumed ? String(e.detail.resumed.session) : "a new one";
        });
    });
    await daemon.start();
    await waitFor(page, () => window.resumedSession);
    assert.equal(await evaluate(() => window.resumedSession), session);
    await page.waitForSelector("#curtain", { hidden: true });
    await turn("ArrowRight");
});

// What the browser does when files are dropped on the page.
const drop = (files) => evaluate((list) => {
    const transfer = new DataTransfer();
    for (const [name, base64] of list)
        transfer.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], name));
    window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true }));
}, files.map(([name, bytes]) => [name, Buffer.from(bytes).toString("base64")]));

test("opens a file that is dropped on it", async () => {
    await drop([["panes.glb", readFileSync(join(models, "panes.glb"))]]);
    await page.waitForSelector("dialog[open] button[value=replace]");
    await page.click("dialog[open] button[value=replace]");
    await waitFor(page, () => document.title.includes("panes.glb"));
    await waitExact(page);
    await waitFor(page, () => window.helio.scene.assets.length === 1);
});

test("chooses variants and cameras of a file", async () => {
    await drop([["variants.gltf", makeVariants()]]);
    await page.waitForSelector("dialog[open] button[value=replace]");
    await page.click("dialog[open] button[value=replace]");
    await waitFor(page, () => document.title.includes("variants.gltf"));
    await panel("scene", true);
    // The value of a selector, after an option was chosen; rows are made anew whenever the scene changes.
    const choose = (label, option = null) => evaluate((text, wanted) => {
        const found = [...document.querySelectorAll("#panel-scene label")].find((l) => l.textContent === text);
        const select = found && document.getElementById(found.htmlFor);
        if (select && wanted !== null) {
            select.value = [...select.options].find((o) => o.textContent === wanted).value;
            select.dispatchEvent(new Event("change"));
        }
        return select?.value;
    }, label, option);
    const shown = () => choose("Variant");
    await until(async () => await shown() !== undefined, "a selector of variants");
    const middle = async () => {
        const { width, height } = await picture(page);
        const at = 4 * (Math.floor(height / 2) * width + Math.floor(width / 2));
        return [...(await shownPixels(page)).subarray(at, at + 3)];
    };
    assert.equal(await shown(), "");
    await settleAfter(() => choose("Camera", "near"), () => window.helio.view.node !== 0n);
    for (const [name, most] of [["red", 0], ["blue", 2]]) {
        await settleAfter(() => choose("Variant", name), () => window.helio.scene.assets[0].variant !== undefined);
        await until(async () => await shown() === name, `${name} is shown as chosen`);
        const color = await middle();
        assert.ok(color[most] > 2 * Math.max(...color.filter((_, i) => i !== most)), `${name}: ${color}`);
    }
    await evaluate(() => window.helio.scene.refresh()); // as the server has it
    assert.equal(await shown(), "blue");
    const near = await evaluate(() => window.helio.view.camera.eye[2]);
    await settleAfter(() => choose("Camera", "far"), () => window.helio.view.camera.eye[2] > 20);
    assert.ok(Math.abs(near - 3) < 1e-3, `${near}`);
    await panel("scene", false);
});

test("says plainly which file is missing", async () => {
    const document = { asset: { version: "2.0" }, buffers: [{ uri: "far.bin", byteLength: 4 }] };
    await drop([["near.gltf", JSON.stringify(document)]]);
    await waitFor(page, () => [...document.querySelectorAll(".toast.error")]
        .some((t) => t.textContent.includes("far.bin")));
    await drop([["letter.txt", "nothing"]]);
    await waitFor(page, () => [...document.querySelectorAll(".toast.error")]
        .some((t) => t.textContent.includes("neither a scene")));
});

test("two people see one scene; who may only look cannot change it", async () => {
    const second = await openPage(browser, link("scene=tests", "view"));
    await waitExact(second);
    const sees = await second.evaluate(() => window.helio.scene.total);
    assert.equal(sees, await evaluate(() => window.helio.scene.total));
    const refused = await second.evaluate(() => window.helio.scene.setEnvironment({ kind: "NONE" })
        .then(() => "done", (error) => error.status));
    assert.equal(refused, "not-allowed");
    assert.deepEqual(second.complaints, []);
    await second.close();
});

test("asks for a token where it has none, and for another where it is wrong", async () => {
    const third = await (await browser.createBrowserContext()).newPage();
    third.setDefaultTimeout(WAIT_MS);
    await third.goto(`${daemon.origin}/#scene=tests`);
    await third.waitForSelector("dialog[open] #token");
    await third.type("#token", "not-the-token");
    await third.keyboard.press("Enter");
    await waitFor(third, () => document.querySelector("#token-error")?.textContent.length > 0);
    await third.type("#token", daemon.tokens.view);
    await third.keyboard.press("Enter");
    await waitPicture(third, (d) => d.frame);
    await third.browserContext().close();
});

test("makes no requests to other hosts", () => {
    const others = page.requests.filter((url) => !url.startsWith(daemon.origin)
        && !url.startsWith(`blob:${daemon.origin}`));
    assert.deepEqual(others, []);
    assert.deepEqual(page.complaints, []);
});

test("helio serve: one command, one address, Ctrl-C ends it", async () => {
    const child = spawn(join(build, "bin/helio"), ["serve", join(models, MODEL), "--cache-dir",
        join(daemon.folder, "serve-cache")], { stdio: ["ignore", "pipe", "inherit"] });
    const ended = new Promise((done) => child.on("exit", done));
    const [url] = await new Promise((done) =>
        createInterface({ input: child.stdout }).once("line", (...line) => done(line)));
    assert.match(url, /^http:\/\/127\.0\.0\.1:\d+\/#scene=morph\.glb&ticket=[0-9a-f]{48}$/);
    const served = await openPage(browser, `${url}&${SETTINGS}`);
    await waitPicture(served, (d) => d.frame);
    await served.close();
    child.kill("SIGINT");
    assert.equal(await ended, 0);
    await assert.rejects(fetch(new URL(url).origin), "the daemon still runs");
});

test("the status tells what the picture is", async () => {
    assert.match(await status(), /Settled|Exact|Refining|Moving/);
    assert.ok(existsSync(join(models, MODEL)));
});
