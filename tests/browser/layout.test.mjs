// layout.test.mjs - the viewer's page in Chromium at many sizes: what covers what, what is reached, what
// axe-core finds, what it says of its session.
// Run: node --test tests/browser/layout.test.mjs   (HELIO_BUILD_DIR; docs/testing.md)
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { Daemon, WAIT_MS, models, openBrowser, openPage, until, waitExact, waitFor, waitPicture } from "./rig.mjs";

const MODEL = "morph.glb"; // it has an animation, so its bar is there
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

const daemon = new Daemon();
let browser, page;

const evaluate = (...args) => page.evaluate(...args);

before(async () => {
    await daemon.start();
    browser = await openBrowser();
    page = await openPage(browser, `${daemon.origin}/#scene=tests&load=${join(models, MODEL)}`
        + `&ticket=${daemon.tokens.edit}&gi=NONE&samples=1`);
    await waitPicture(page, (d) => d.frame);
}, { timeout: WAIT_MS });

after(async () => {
    await browser?.close();
    await daemon.finish();
});

for (const scheme of ["dark", "light"])
    test(`axe-core finds nothing: ${scheme}`, async () => {
        await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
        for (const [width, panels] of [[1000, ["scene", "view", "stats"]], [360, ["view"]], [360, ["scene"]]]) {
            await page.setViewport({ width, height: 640 });
            await evaluate((open) => ["scene", "view", "stats"].forEach((name) =>
                window.helio.panels.set(name, open.includes(name))), panels);
            await evaluate(() => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
            await evaluate(`${axe}; window.axe.run({ resultTypes: ["violations"] })`)
                .then(({ violations }) => assert.deepEqual(violations.map((v) =>
                    `${v.id}: ${v.nodes.map((n) => n.target.join(" ")).slice(0, 3).join("; ")}`), []));
        }
        await evaluate(() => ["scene", "view", "stats"].forEach((n) => window.helio.panels.set(n, false)));
    });

// 320 px are what is left of 1280 px in a page at 400 %.
for (const width of [360, 320])
    test(`fits into ${width} px`, () => fits(width));

async function fits(width) {
    await page.setViewport({ width, height: 640 });
    for (const panel of [null, "scene", "view", "stats"]) {
        if (panel)
            await evaluate((name) => window.helio.panels.set(name, true), panel);
        const outside = await evaluate((most) => [...document.querySelectorAll("button, select, input, h2, #status")]
            .filter((e) => e.offsetParent && !e.closest(".hidden")).filter((e) => {
                const box = e.getBoundingClientRect();
                return box.width > 1 && (box.left < -1 || box.right > most + 1);
            }).map((e) => e.outerHTML.slice(0, 80)), width);
        assert.deepEqual(outside, [], `beyond the edge with ${panel}`);
        assert.ok(await evaluate((most) => document.documentElement.scrollWidth <= most, width));
    }
    await evaluate(() => window.helio.panels.set("stats", false));
    const [bar, tools] = await evaluate(() => {
        const box = (name) => document.querySelector(name).getBoundingClientRect();
        const last = document.querySelector("#tools").lastElementChild.getBoundingClientRect();
        return [[box(".mark").right, box("#status").left, box("#status").right, box("#menu").left],
            [last.right, box("#tools").right]];
    });
    assert.deepEqual(bar, bar.toSorted((a, b) => a - b), "what is in the bar lies side by side");
    assert.ok(tools[0] <= tools[1], "the tools fit into their bar");
}

// Pairs of panels and of what is at the bottom that cover each other.
const overlaps = () => evaluate(() => {
    const shown = [...document.querySelectorAll(".panel, #dock > *")].filter((e) =>
        e.checkVisibility({ visibilityProperty: true })).map((e) => [e.id, e.getBoundingClientRect()]);
    const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    return shown.flatMap(([a, box], i) => shown.slice(i + 1).filter(([, other]) => meet(box, other))
        .map(([b]) => `${a} ${b}`));
});

test("panels never cover each other, and keep their titles", async () => {
    const names = ["scene", "stats", "people", "view"];
    const setAll = (isOpen) => evaluate((all, is) =>
        all.forEach((name) => window.helio.panels.set(name, is)), names, isOpen);
    await evaluate(() => window.helio.inspector.select([...window.helio.scene.nodes.keys()][0]));
    for (const width of [1280, 1024, 900, 768, 720, 600, 360]) {
        await page.setViewport({ width, height: 600 });
        await setAll(true);
        await waitFor(page, () => !document.querySelector("#panel-view").hidden);
        assert.deepEqual(await overlaps(), [], `at ${width} px`);
        const moved = await evaluate(() => {
            const panel = document.querySelector("#panel-view");
            const at = () => panel.querySelector("h2").getBoundingClientRect().top;
            panel.scrollTop = 0;
            const before = at();
            panel.scrollTop = 100;
            return panel.scrollTop > 0 && at() - before;
        });
        assert.equal(moved, 0, `the title at ${width} px`);
    }
    await page.setViewport({ width: 1280, height: 600 });
    await setAll(true);
    await page.setViewport({ width: 768, height: 600 });
    await waitFor(page, () => document.querySelector("#panel-scene").hidden);
    assert.deepEqual(await overlaps(), [], "in a window that was made smaller");
    await setAll(false);
    await evaluate(() => window.helio.inspector.clear());
});

test("messages cover no panel, and where there is no room beside them not their titles", async () => {
    const covered = (what) => evaluate((names) => {
        const toasts = [...document.querySelectorAll(".toast")].map((t) => t.getBoundingClientRect());
        return [...document.querySelectorAll(names)].filter((e) => e.checkVisibility()).map((e) => [e, e.getBoundingClientRect()])
            .filter(([, box]) => toasts.some((t) => t.left < box.right && box.left < t.right && t.top < box.bottom
                && box.top < t.bottom)).map(([e]) => e.id || e.textContent);
    }, what);
    await evaluate(async () => {
        const { toast } = await import("./dom.js");
        toast("Sessions end within 10 min: an administrator says so.", "error");
        toast("restart at noon", "error");
    });
    for (const [width, panels, what] of [[1280, ["scene", "stats", "view"], ".panel"], [1024, ["scene", "view"], ".panel"],
        [900, ["scene", "view"], ".panel"], [900, ["view"], ".panel"], [900, ["scene", "stats"], ".panel"],
        [740, ["scene", "view"], ".panel header"], [360, ["view"], ".panel"]]) {
        await page.setViewport({ width, height: 640 });
        await evaluate((open) => ["scene", "stats", "people", "view"].forEach((name) =>
            window.helio.panels.set(name, open.includes(name))), panels);
        await waitFor(page, (all) => all.every((name) => window.helio.panels.isOpen(name)), panels);
        assert.deepEqual(await covered(what), [], `at ${width} px with ${panels}`);
        const [toast] = await evaluate(() => [...document.querySelectorAll(".toast")].map((t) => t.offsetWidth));
        assert.ok(toast >= 230, `${toast} px wide at ${width} px`);
    }
    await evaluate(() => document.querySelectorAll(".toast").forEach((t) => t.remove()));
    await evaluate(() => ["scene", "stats", "view"].forEach((n) => window.helio.panels.set(n, false)));
});

test("messages end with what they tell of", async () => {
    const texts = () => evaluate(() => [...document.querySelectorAll(".toast > span")].map((t) => t.textContent));
    const tell = (name, body) => evaluate((n, b) => window.helio.connection.tell(n, b), name, body);
    const gone = (text) => until(async () => !(await texts()).some((t) => t.includes(text)), `no longer said: ${text}`);
    const said = async (text) => assert.ok((await texts()).some((t) => t.includes(text)), `${await texts()}`);
    const self = await evaluate(() => Number(window.helio.connection.session));
    // Toasts expire as well, so that this would pass too late: each ends while one that is left to expire is there.
    await evaluate(() => { window.setTimeout = ((set) => (f, ms, ...a) => set(f, ms >= 6000 ? 1e8 : ms, ...a))(window.setTimeout); });
    await tell("drain", { deadline_ms: 60000, reason: "new disks" });
    await said("Sessions end within 60 s: new disks");
    await tell("drain_cancelled", {});
    await gone("Sessions end");
    await said("Sessions go on");
    await tell("idle_warning", { remaining_ms: 60000 });
    await said("This session ends");
    await evaluate(() => window.helio.setParams({ samples: 2 }));
    await gone("This session ends");
    await tell("notice", { what: "worker", reason: "" });
    await said("restarted");
    await evaluate(() => window.helio.setParams({ samples: 1 }));
    await gone("restarted");
    const camera = (waiting, holder) => evaluate((w, h) => window.helio.connection.tell("camera_state", { holder: BigInt(h),
        waiting: w.map((s) => ({ session: BigInt(s) })), locked: false, change: "NONE" }), waiting, holder);
    await camera([], self);
    await camera([99], self);
    await said("session 99 asks");
    await camera([], self);
    await gone("session 99 asks");
    await camera([], 0);
    await evaluate(async () => {
        await window.helio.people.setFollow(true);
        window.helio.people.shared.holder = 98n;
        window.helio.explainFollowing();
    });
    await said("follows the shared camera of session 98");
    await evaluate(() => window.helio.people.setFollow(false));
    await gone("follows the shared camera");
    await tell("drain", { deadline_ms: 60000, reason: "" });
    await evaluate(() => {
        window.helio.connection.connect();
        return window.helio.attempt(() => window.helio.connection.call("info_query", {})); // there is no connection
    });
    await gone("Sessions end");
    await waitFor(page, () => window.helio.connection.isOpen);
    await gone("No connection");
    await evaluate(() => document.querySelectorAll(".toast").forEach((t) => t.remove()));
});

test("what is fitted is covered by nothing", async () => {
    const one = await openPage(browser, `${daemon.origin}/#load=${join(models, "panes.glb")}&ticket=${daemon.tokens.edit}&gi=NONE&samples=1`);
    await waitPicture(one, (d) => d.frame);
    await waitFor(one, () => window.helio.scene.nodes.size);
    const shown = (node) => one.evaluate(async (id) => {
        const { camera: at, canvas, connection } = { ...window.helio, camera: window.helio.view.camera };
        const { min, max } = await connection.call("bounds_query", { node: BigInt(id) });
        const { project } = await import("./camera.js");
        const box = canvas.getBoundingClientRect();
        const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => project(at, min.map((v, k) => i >> k & 1 ? max[k] : v), box.width, box.height));
        const least = (f) => Math.min(...corners.map(f)), most = (f) => Math.max(...corners.map(f));
        const dock = [...document.querySelectorAll("#dock > *, .panel")].filter((e) => e.checkVisibility({ visibilityProperty: true }))
            .map((e) => e.getBoundingClientRect());
        const edges = { left: least((p) => p.x) + box.left, right: most((p) => p.x) + box.left, top: least((p) => p.y) + box.top,
            bottom: most((p) => p.y) + box.top };
        return { edges, box: { ...box.toJSON() }, covered: dock.filter((d) => edges.left < d.right && edges.right > d.left
            && edges.top < d.bottom && edges.bottom > d.top).length };
    }, String(node));
    const node = await one.evaluate(() => String([...window.helio.scene.nodes.values()].find((n) => n.mesh).node));
    for (const [width, height, panels] of [[360, 640, []], [360, 420, []], [1280, 600, []], [1280, 600, ["scene", "view"]], [360, 640, ["view"]]])
        for (const selected of [false, true]) {
            await one.setViewport({ width, height });
            await one.evaluate((open) => ["scene", "stats", "people", "view"].forEach((name) =>
                window.helio.panels.set(name, open.includes(name))), panels);
            await one.evaluate((id) => id ? window.helio.inspector.select(BigInt(id)) : window.helio.inspector.clear(), selected ? node : "");
            await waitFor(one, (w, h) => window.innerWidth === w && window.innerHeight === h && [window.helio.view.width, window.helio.view.height]
                .join() === [window.helio.canvas.clientWidth, window.helio.canvas.clientHeight].join(), width, height);
            await one.evaluate((id) => window.helio.fit(BigInt(id)), selected ? node : "0");
            await waitFor(one, () => !window.helio.flight && !window.helio.isAwake);
            const { edges, box, covered } = await shown(selected ? node : 0);
            const what = `${width}x${height} ${panels} ${selected} ${JSON.stringify(edges)}`;
            assert.equal(covered, 0, what);
            assert.ok(edges.left >= box.left && edges.right <= box.right && edges.top >= box.top, what);
            assert.ok(edges.right - edges.left > box.width / 6 || edges.bottom - edges.top > box.height / 6, `too small: ${what}`);
        }
    assert.deepEqual(one.complaints, []);
    await one.close();
    await page.bringToFront();
});

test("the picture has the pixels of the screen that it is on", async () => {
    const devtools = await page.createCDPSession();
    // Its size in the page is kept, so that the ratio alone says it; headless Chromium tells of it with a new width only.
    const stage = (width) => evaluate((w) => { document.querySelector("#stage").style.width = w; }, width);
    await page.setViewport({ width: 400, height: 300 });
    await stage("320px");
    const height = await evaluate(() => document.querySelector("#picture").clientHeight);
    for (const ratio of [2, 1.5, 3, 1]) { // each change is seen, not the first alone
        await devtools.send("Emulation.setDeviceMetricsOverride", { width: 400 + 2 * ratio, height: 300, deviceScaleFactor: ratio, mobile: false });
        await waitPicture(page, (d) => d.width === Math.round(320 * ratio) && d.height === Math.round(height * ratio));
    }
    await devtools.detach();
    await stage("");
});

// Each key frame comes while frames of the size before are still in the decoder.
test("goes on after a storm of sizes in H.264, with a slow decoder", async () => {
    await evaluate(async () => {
        const { VideoDecoder, helio } = window;
        window.VideoDecoder = class extends VideoDecoder {
            constructor({ output, error }) {
                super({ output: (picture) => setTimeout(output, 1000, picture), error });
            }
        };
        window.came = new Set();
        const note = ({ detail: { frame } }) => frame.encoding === "H264" && window.came.add(frame.width);
        helio.connection.addEventListener("frame", note);
        window.endStorm = () => {
            window.VideoDecoder = VideoDecoder;
            helio.connection.removeEventListener("frame", note);
        };
        await helio.setParams({ samples: 64 }); // with few of them the first frame is settled, and has no loss
        await helio.view.setCodec("H264");
    });
    await page.focus("#picture");
    await page.keyboard.down("ArrowLeft");
    try {
        for (let i = 1; i <= 8; i++) {
            const width = 360 + 37 * (i * 7 % 11);
            await page.setViewport({ width, height: 280 + 23 * (i * 5 % 9) });
            await waitFor(page, (px) => window.came.has(px), width);
        }
    } finally {
        await page.keyboard.up("ArrowLeft");
    }
    await evaluate(() => window.endStorm());
    await page.setViewport({ width: 361, height: 301 });
    await waitPicture(page, (d) => d.width === 361);
    await waitExact(page);
    assert.equal(await evaluate(() => window.helio.view.failures.size), 0);
    await evaluate(async () => {
        await window.helio.view.setCodec("auto");
        await window.helio.setParams({ samples: 1 });
    });
    assert.deepEqual(page.complaints, []);
});

test("a place that is measured is that of the frame that is shown, until the view has left it", async () => {
    await page.setViewport({ width: 360, height: 300 });
    await evaluate(() => window.helio.fit(0n, [0.5, 0.45]));
    await waitFor(page, () => !window.helio.flight && !window.helio.isAwake);
    await waitExact(page);
    const [same, older] = await evaluate(async () => {
        const { view, inspector, overlay } = window.helio, { call } = view.connection;
        const places = [0.2, 0.35, 0.5, 0.65, 0.8].flatMap((x) => [0.3, 0.4, 0.5, 0.6, 0.7].map((y) => [x, y]));
        const hits = await Promise.all(places.map((place) => view.pick(...place)));
        const at = places[hits.findIndex(Boolean)];
        const ask = async () => {
            const asked = [];
            view.connection.call = (name, ...rest) => { asked.push(name); return call.call(view.connection, name, ...rest); };
            inspector.setTool("measure");
            await inspector.pick(...at);
            const [found] = overlay.points;
            inspector.setTool("select");
            delete view.connection.call;
            const { position, normal, node } = await view.pick(...at);
            const far = Math.hypot(...position.map((v, i) => v - found.position[i])) + Math.hypot(...normal.map((v, i) => v - found.normal[i]));
            return { asked, far, sameNode: node === found.node };
        };
        const first = await ask();
        view.frame = { ...view.frame, number: 0n }; // of no state that the view still has
        return [first, await ask()];
    });
    assert.deepEqual([same.asked, older.asked], [["surface_query"], ["surface_query", "pick"]]);
    assert.ok(same.sameNode && older.sameNode && same.far < 1e-4 && older.far === 0, JSON.stringify([same, older]));
});

test("nodes are not listed again for an animation, and are for what is shown of them", async () => {
    await page.setViewport({ width: 360, height: 300 });
    await evaluate(() => {
        const { connection } = window.helio;
        window.asked = { nodes_query: 0, animation_set: 0 };
        const { call } = connection;
        connection.call = (name, ...rest) => {
            window.asked[name] = (window.asked[name] ?? 0) + 1;
            return call.call(connection, name, ...rest);
        };
    });
    await waitFor(page, () => window.helio.scene.due_ms === Infinity);
    const before = await evaluate(() => { window.helio.timeline.toggle(); return { at: performance.now(), ...window.asked }; });
    await waitFor(page, (from) => performance.now() > from + 3500 && window.asked.animation_set > 3, before.at);
    await evaluate(async () => {
        const { asked } = window;
        window.helio.timeline.pause();
        for (let before = -1; asked.animation_set !== before; await new Promise((r) => setTimeout(r, 300)))
            before = asked.animation_set;
        await window.helio.view.pick(0, 0); // behind the last pose: its edit has been told
    });
    assert.equal(await evaluate(() => window.asked.nodes_query), before.nodes_query, "lists while it plays");
    // Edits of another session (animation_set, node_set): poses change nothing that is listed; names do, and so may an edit that was not told.
    for (const [message, missing, lists] of [[0x0211, 0, 0], [0x020d, 0, 1], [0x0211, 1, 1]]) {
        const count = await evaluate(() => window.asked.nodes_query);
        await evaluate((number, gap) => {
            const { scene, connection } = window.helio;
            connection.tell("edited", { message: number, session: 98n, revision: scene.revision + 1n, number: (scene.edits ?? 0n) + 1n + BigInt(gap) });
        }, message, missing);
        assert.equal(await evaluate(() => window.helio.scene.due_ms < Infinity), lists > 0, `${message}, ${missing} missing`);
        await waitFor(page, (n) => window.asked.nodes_query === n, count + lists);
        await waitFor(page, () => window.helio.scene.due_ms === Infinity);
    }
});

test("what a curtain offers can be pressed, whatever is open", async () => {
    const reached = () => evaluate(() => {
        const box = document.querySelector("#curtain button").getBoundingClientRect();
        return document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2).textContent;
    });
    const show = () => evaluate(() => window.helio.curtain.show("Connection lost", "The server does not answer.",
        ["Try now", () => {}]));
    for (const [width, height] of [[360, 300], [360, 640], [740, 360]])
        for (const isOpen of [false, true]) {
            await page.setViewport({ width, height });
            await evaluate((is) => window.helio.panels.set("view", is), isOpen);
            await show();
            assert.equal(await reached(), "Try now", `at ${width} x ${height} px`);
            await evaluate(() => window.helio.curtain.hide());
        }
    await evaluate(() => window.helio.panels.set("view", false));
});

test("a dialog keeps its title and its buttons in sight", async () => {
    for (const [width, height] of [[1000, 480], [360, 480]]) {
        await page.setViewport({ width, height });
        await page.focus("#picture");
        await page.keyboard.type("?");
        await page.waitForSelector(".dialog[open]");
        const outside = await evaluate(() => [...document.querySelectorAll(".dialog h2, .dialog .choices button")]
            .map((e) => [e.textContent, e.getBoundingClientRect()])
            .filter(([, box]) => box.top < 0 || box.bottom > innerHeight).map(([text]) => text));
        assert.deepEqual(outside, [], `at ${width} x ${height} px`);
        await page.keyboard.press("Escape");
        await page.waitForSelector(".dialog", { hidden: true });
    }
});

test("animations that move the same things are not offered together", async () => {
    const names = await evaluate(() => {
        const { timeline } = window.helio;
        const before = timeline.list.filter((a) => a.animation >= 0);
        const shown = (conflicts) => {
            timeline.setAnimations(["walk", "run", "door"].map((name, i) =>
                ({ asset: 99, animation: i, name, duration_s: i + 1, conflicts: conflicts.includes(i) })), true);
            return timeline.list.map((a) => `${a.name} ${a.duration_s}`).join();
        };
        const found = [shown([1]), shown([1, 2])];
        timeline.setAnimations(before, true);
        return found;
    });
    assert.deepEqual(names, ["All together 3,walk 1,run 2,door 3", "walk 1,run 2,door 3"]);
});

test("the animation bar keeps what is chosen, and is not there for who may not move it", async () => {
    await page.waitForSelector("#timeline:not([hidden])");
    const found = await evaluate(() => {
        const { timeline } = window.helio;
        const before = timeline.list;
        timeline.seek(0.5);
        timeline.setAnimations([{ asset: 99, animation: 0, name: "other", duration_s: 1 }, ...before], true);
        const after = [timeline.current.asset === before[0].asset, timeline.time_s];
        timeline.setAnimations(before, false);
        const { hidden } = document.querySelector("#timeline");
        timeline.setAnimations(before, true);
        return [...after, hidden, document.querySelector("#timeline").hidden];
    });
    assert.deepEqual(found, [true, 0.5, true, false]);
});

test("opens with as many pixels as its session may have", async () => {
    daemon.options = ["--max-pixels", "100000"];
    await daemon.kill();
    await daemon.start();
    const other = await openPage(browser, `${daemon.origin}/#scene=few&load=${join(models, MODEL)}`
        + `&ticket=${daemon.tokens.edit}&gi=NONE&samples=1`, { width: 900, height: 600 });
    await waitPicture(other, (d) => d.frame && d.width * d.height <= 100000);
    assert.deepEqual(other.complaints, []);
    await other.close();
    daemon.options = [];
    await daemon.kill();
    await daemon.start();
    await page.bringToFront();
    await page.waitForSelector("#curtain", { hidden: true });
});

test("goes on when the browser comes back to the page", async () => {
    const camera = await evaluate(() => window.helio.cameraText());
    await page.goto(`${daemon.origin}/index.html?other`);
    await page.goBack();
    await waitFor(page, () => document.body.dataset.state === "open"
        && document.querySelector("#picture").dataset.settled === "true");
    assert.equal(await evaluate(() => window.helio.cameraText()), camera);
});

test("who follows a camera is told so once, by input and by nothing else", async () => {
    const told = () => evaluate(() => [...document.querySelectorAll(".toast")].filter((t) =>
        /follows the shared/.test(t.textContent)).map((t) => t.dataset.seen ??= String(performance.now())));
    await evaluate(() => {
        window.helio.people.isFollowing = true;
        window.helio.timeline.toggle();
    });
    await evaluate(() => new Promise((done) => setTimeout(done, 300)));
    assert.deepEqual(await told(), [], "an animation that plays");
    await page.focus("#picture");
    await page.keyboard.down("ArrowRight");
    await page.waitForSelector(".toast");
    const first = await told();
    await evaluate(() => new Promise((done) => setTimeout(done, 300)));
    assert.deepEqual(await told(), first);
    await page.keyboard.up("ArrowRight");
    await evaluate(() => {
        window.helio.people.isFollowing = false;
        window.helio.timeline.pause();
        document.querySelectorAll(".toast").forEach((t) => t.remove());
    });
});

test("a held key acts once", async () => {
    await page.focus("#picture");
    for (let i = 0; i < 4; i++) // the browser takes all but the first for repeats
        await page.keyboard.down("Space");
    await page.keyboard.up("Space");
    assert.equal(await evaluate(() => window.helio.timeline.isPlaying), true);
    await evaluate(() => window.helio.timeline.pause());
});

test("a tab that is opened in the background takes no pictures before it is looked at", async () => {
    const cdp = await browser.target().createCDPSession();
    const { targetId } = await cdp.send("Target.createTarget", { background: true,
        url: `${daemon.origin}/#scene=tests&ticket=${daemon.tokens.edit}&gi=NONE&samples=1` });
    const target = await browser.waitForTarget((t) => t._targetId === targetId, { timeout: WAIT_MS });
    const tab = await target.page();
    await waitFor(tab, () => window.helio?.view.isStarted && window.helio.scene.total);
    assert.deepEqual(await tab.evaluate(() => [document.hidden, window.helio.view.isIdle]), [true, true]);
    // An answer that comes behind all that came before it: no frame was among them.
    await tab.evaluate(() => window.helio.connection.call("stats_query", { view: 1 }));
    assert.equal((await tab.$eval("#picture", (c) => c.dataset.frame)), undefined);
    await tab.bringToFront();
    await waitExact(tab);
    await tab.close();
    await page.bringToFront();
});

test("a gamepad moves the camera and presses buttons", async () => {
    // A gamepad as the browser describes it; each change of it counts until the condition holds.
    await evaluate(() => {
        const none = () => Array.from({ length: 17 }, () => ({ value: 0, pressed: false }));
        window.pad = { connected: true, axes: [0, 0, 0, 0], buttons: none() };
        navigator.getGamepads = () => [null, window.pad];
        window.dispatchEvent(new Event("gamepadconnected"));
    });
    const look = () => evaluate(() => structuredClone(window.helio.view.camera));
    const hold = async (name, index, value, condition) => {
        const before = await look();
        await evaluate((n, i, v) => {
            window.pad[n][i] = n === "axes" ? v : { value: v, pressed: true };
        }, name, index, value);
        await until(async () => condition(before, await look()), `${name} ${index}`);
        await evaluate((n, i) => { window.pad[n][i] = n === "axes" ? 0 : { value: 0, pressed: false }; }, name, index);
    };
    const apart = (a, b) => Math.hypot(...a.map((v, i) => v - b[i]));
    await hold("axes", 2, 1, (a, b) => apart(a.eye, b.eye) > 0.1 && apart(a.target, b.target) === 0);
    await hold("axes", 1, -1, (a, b) => apart(a.target, b.target) > 0.1);
    await hold("buttons", 7, 1, (a, b) => b.eye[1] - a.eye[1] > 0.1);
    const press = async (index, condition) => {
        await evaluate((i) => { window.pad.buttons[i] = { value: 1, pressed: true }; }, index);
        await waitFor(page, condition);
        await evaluate((i) => { window.pad.buttons[i] = { value: 0, pressed: false }; }, index);
        await waitFor(page, () => !window.helio.controls.padHeld.size);
    };
    await press(1, () => window.helio.controls.mode === "fly");
    await press(1, () => window.helio.controls.mode === "walk");
    const level = (await look()).eye[1];
    await hold("axes", 1, -1, (a, b) => apart(a.eye, b.eye) > 0.1);
    assert.ok(Math.abs((await look()).eye[1] - level) < 1e-6, "walking stays level");
    await press(1, () => window.helio.controls.mode === "orbit");
    await press(0, () => window.helio.flight);
    await waitFor(page, () => !window.helio.flight);
    await evaluate(() => { window.pad.connected = false; });
    await waitExact(page);
});

test("a screenshot that takes long can be cancelled, and so it is at the server", async () => {
    await page.setViewport({ width: 1000, height: 600 });
    // With an answer that never comes, for it may come before the click.
    await evaluate(() => {
        const { connection } = window.helio;
        window.sent = {};
        connection.send = (name, message, request) => {
            window.sent[name] = { of: message.request, id: request };
            return name === "frame_request"
                || Object.getPrototypeOf(connection).send.call(connection, name, message, request);
        };
    });
    await page.click('#menu [title="Screenshot"]');
    await page.waitForSelector(".toast.task button");
    await page.click(".toast.task button");
    await page.waitForSelector(".toast.task", { hidden: true });
    const sent = await evaluate(() => {
        delete window.helio.connection.send;
        return window.sent;
    });
    assert.equal(sent.frame_cancel.of, sent.frame_request.id);
});

test("says that its session was ended, and opens another one only when told to", async () => {
    const session = await evaluate(() => String(window.helio.connection.session));
    await daemon.manage("kick", session, "--reason", "too loud");
    await waitFor(page, () => document.body.dataset.state === "ended");
    assert.match(await page.$eval("#curtain", (c) => c.textContent), /was ended.*too loud/);
    await evaluate(() => new Promise((done) => setTimeout(done, 1000)));
    assert.equal(await evaluate(() => document.body.dataset.state), "ended");
    await page.click("#curtain button");
    await page.waitForSelector("#curtain", { hidden: true });
    await waitFor(page, () => document.querySelector("#picture").dataset.settled === "true");
});

test("complained about nothing", () => assert.deepEqual(page.complaints, []));
