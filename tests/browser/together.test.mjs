// together.test.mjs - several people at one scene in Chromium, against a real daemon: what others open, what
// each role is offered, what is said of limits and of an access that ended.
// Run: node --test tests/browser/together.test.mjs   (HELIO_BUILD_DIR; docs/testing.md)
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { Daemon, WAIT_MS, makeVariants, models, openBrowser, openPage, shownPixels, until, waitExact, waitFor, waitPicture } from "./rig.mjs";

const daemon = new Daemon();
let browser, host, guest;

const link = (words, role) => `${daemon.origin}/#${words}&ticket=${daemon.tokens[role]}&gi=NONE&samples=1`;
const title = (page) => page.$eval("#title", (t) => t.textContent);

before(async () => {
    await daemon.start();
    browser = await openBrowser();
    // Windows of their own: a page in the background gets no frames.
    host = await openPage(browser, link("scene=room", "edit"));
    guest = await openPage(await browser.createBrowserContext(), link("scene=room", "view"));
    for (const page of [host, guest])
        await page.waitForSelector("#empty:not([hidden])");
}, { timeout: WAIT_MS });

after(async () => {
    await browser?.close();
    await daemon.finish();
});

const dropFile = (page, name, bytes) => page.evaluate((file, base64) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], file));
    window.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, cancelable: true }));
}, name, Buffer.from(bytes).toString("base64"));

// The host drops a file, in place of what is there.
async function open(name, bytes) {
    await host.bringToFront();
    await dropFile(host, name, bytes);
    if (await host.evaluate(() => window.helio.scene.assets.length)) {
        await host.waitForSelector("dialog[open] button[value=replace]");
        await host.click("dialog[open] button[value=replace]");
    }
    await waitFor(host, (file) => document.title.includes(file), name);
}

// The guest looks from where the host does.
async function seesTheSame() {
    const eye = (page) => page.evaluate(() => window.helio.view.camera.eye.join());
    await guest.bringToFront();
    await until(async () => await eye(guest) === await eye(host), "both look from the same place");
    await waitPicture(guest, (d) => d.settled === "true");
}

test("who waits in an empty scene sees what another one opens", async () => {
    await waitFor(host, () => document.querySelector("#status").textContent.trim() === "Ready");
    await open("panes.glb", readFileSync(join(models, "panes.glb")));
    await waitFor(guest, () => document.querySelector("#empty").hidden
        && document.querySelector("#live").textContent === "edit opened panes.glb.");
    await seesTheSame();
    assert.equal(await title(guest), "panes.glb");
});

test("who has moved sees what is opened in place of it from where it is seen whole", async () => {
    await guest.focus("#picture");
    await guest.keyboard.press("ArrowLeft");
    await waitFor(guest, () => window.helio.view.node === 0n);
    await open("variants.gltf", makeVariants());
    await seesTheSame();
    assert.equal(await title(guest), "variants.gltf");
});

test("who may only look is not offered to open files", async () => {
    const offered = (page) => page.evaluate(() => [...document.querySelectorAll("button")]
        .some((b) => b.title === "Open files" && !b.hidden));
    assert.deepEqual([await offered(host), await offered(guest)], [true, false]);
});

test("who may only look hides nodes and chooses variants for its own view", async () => {
    const panel = (p) => p.$eval("#panel-scene", (e) => e.textContent);
    const shown = (p) => p.evaluate(() => [...window.helio.scene.nodes.values()].map((n) => window.helio.isShown(n.node)));
    const settled = () => waitFor(guest, () => {
        const { settled, exact, revision, seq } = document.querySelector("#picture").dataset;
        return settled === "true" && exact === "true" && Number(seq) === window.helio.view.seq && revision;
    });
    const pixels = async () => { await settled(); return (await shownPixels(guest)).toString("base64"); };
    const changes = async (before, action) => {
        await action();
        let now;
        await until(async () => (now = await pixels()) !== before, "the picture changes");
        return now;
    };
    const variant = (option) => guest.evaluate((wanted) => {
        const select = [...document.querySelectorAll("#panel-scene label")]
            .map((l) => l.textContent === "Variant, here" && document.getElementById(l.htmlFor)).find(Boolean);
        select.value = [...select.options].find((o) => o.textContent === wanted).value;
        select.dispatchEvent(new Event("change"));
    }, option);
    await guest.bringToFront();
    await guest.evaluate(() => window.helio.panels.set("scene", true));
    await waitFor(guest, () => document.querySelector("#panel-scene").textContent.includes("Variant, here"));
    const first = await pixels();
    const red = await changes(first, () => variant("red"));
    assert.equal(await changes(red, () => variant("As in the scene")), first);
    const mesh = () => guest.click("#panel-scene [aria-label*='mesh'] .icon-button");
    const without = await changes(first, mesh);
    assert.ok((await shown(guest)).includes(false));
    assert.ok(!(await shown(host)).includes(false), "the scene itself is as it was");
    assert.doesNotMatch(await guest.$eval("#toasts", (t) => t.textContent), /needs the role/);
    assert.equal(await changes(without, mesh), first);
    assert.doesNotMatch(await panel(host), /Variant, here/);
    await guest.evaluate(() => window.helio.panels.set("scene", false));
});

test("the panel shows the environment as it is, whoever has chosen it", async () => {
    const shown = (p) => p.evaluate(() => Object.fromEntries(["env", "intensity", "turn", "sunAzimuth", "sunHeight"]
        .map((row) => [row, window.helio.viewPanel.rows[row].input.value])));
    const before = await shown(guest);
    assert.equal(before.env, "AUTO");
    const sun = [Math.cos(0.5) * Math.sin(1), Math.sin(0.5), Math.cos(0.5) * Math.cos(1)];
    await host.evaluate((sun_direction) => window.helio.setEnvironment(
        { kind: "SKY", intensity: 4, rotation_rad: -Math.PI / 2, sun_direction }), sun);
    const wanted = { env: "SKY", intensity: "2", turn: "-90", sunAzimuth: "57", sunHeight: "29" };
    assert.deepEqual(await shown(host), wanted);
    await waitFor(guest, () => window.helio.viewPanel.rows.env.input.value === "SKY");
    assert.deepEqual(await shown(guest), wanted);
    await host.reload();
    await waitFor(host, () => window.helio?.scene.environment);
    assert.deepEqual(await shown(host), wanted);
    await guest.evaluate(() => window.helio.setEnvironment({ kind: "NONE" })); // refused: it may only look
    assert.deepEqual(await shown(guest), wanted);
    await host.evaluate(() => window.helio.setEnvironment({ kind: "AUTO", intensity: 1, rotation_rad: 0 }));
    await waitFor(guest, () => window.helio.viewPanel.rows.env.input.value === "AUTO");
});

test("a picture that is dropped lights the scene for all", async () => {
    await host.bringToFront();
    await dropFile(host, "room.hdr", readFileSync(join(models, "room.hdr")));
    for (const page of [host, guest])
        await waitFor(page, () => window.helio.viewPanel.rows.env.input.value === "FILE");
    await host.evaluate(() => window.helio.setEnvironment({ kind: "AUTO" }));
});

test("a note that is pinned is seen by others, who may not remove it", async () => {
    await host.evaluate(() => window.helio.fit(0n));
    await waitPicture(host, (d) => d.settled === "true");
    await host.focus("#picture");
    await host.keyboard.press("KeyN");
    await until(async () => { // in the middle, once the picture shows something there
        await host.focus("#picture");
        await host.keyboard.press("Enter");
        return host.waitForSelector("dialog[open] #note", { timeout: 3000 }).catch(() => null);
    }, "the dialog of a note");
    await host.type("#note", "<b>loose</b> & bent");
    await host.click("dialog[open] button[value=pin]");
    await guest.bringToFront();
    await guest.waitForSelector(".pin");
    await guest.click(".pin");
    const card = await guest.$eval("#card", (c) => [c.innerText, [...c.querySelectorAll("button")]
        .find((b) => b.textContent === "Remove").disabled]);
    assert.match(card[0], /<b>loose<\/b> & bent[^]*edit/);
    assert.equal(card[1], true);
    await host.bringToFront();
    await host.click(".pin");
    await host.evaluate(() => [...document.querySelectorAll("#card button")]
        .find((b) => b.textContent === "Remove").click());
    await guest.bringToFront();
    await waitFor(guest, () => !document.querySelector(".pin"));
});

test("the holder of the shared camera is notified of a request, and hands it over", async () => {
    const press = (page, label) => page.evaluate((text) => [...document.querySelectorAll("button")]
        .find((b) => b.textContent === text).click(), label);
    const text = (page) => page.$eval("#panel-people", (p) => p.textContent);
    await press(host, "Ask for it");
    await waitFor(host, () => window.helio.people.isHolder);
    await waitFor(guest, () => window.helio.people.shared.holder);
    await press(guest, "Ask for it");
    await waitFor(host, () => /view asks for the shared camera/.test(document.querySelector("#toasts").textContent));
    assert.match(await text(host), /asks for the camera/);
    assert.match(await text(guest), /number 1 of 1 that wait/);
    await press(guest, "Ask no longer");
    await waitFor(host, () => !window.helio.people.shared.waiting.length);
    await press(guest, "Ask for it");
    await waitFor(host, () => window.helio.people.shared.waiting.length);
    await press(host, "Give it");
    await waitFor(guest, () => window.helio.people.isHolder);
    for (const page of [host, guest])
        await page.evaluate(() => window.helio.people.setFollow(false));
    await press(guest, "Release");
    await waitFor(host, () => !window.helio.people.shared.holder);
    const admin = await openPage(await browser.createBrowserContext(), link("scene=room", "admin"));
    await waitFor(admin, () => window.helio.people.isThere);
    await press(admin, "Lock");
    await waitFor(guest, () => window.helio.people.shared.locked);
    assert.match(await text(guest), /Locked by an administrator/);
    await press(admin, "Unlock");
    await waitFor(guest, () => !window.helio.people.shared.locked);
    await admin.browserContext().close();
});

test("links that were not copied leave no tickets behind", async () => {
    const tickets = async () => (await daemon.manage("tickets", "list")).stdout.split("\n")
        .filter((line) => /^\s*\d/.test(line)).map((line) => line.trim().split(/\s+/)[0]);
    const before = await tickets();
    const link = () => host.$eval("dialog[open] input.text", (e) => e.value);
    const choose = async (access) => {
        const last = await link();
        await host.select("dialog[open] select", access);
        await until(async () => await link() !== last && (await link()).includes("ticket=") === (access !== "none"), access);
    };
    const added = async (count) => {
        let now;
        await until(async () => (now = (await tickets()).filter((n) => !before.includes(n))).length === count, `${count} tickets`);
        return now;
    };
    await host.bringToFront();
    for (const copies of [false, true]) {
        await host.evaluate(() => document.querySelector("#menu button[aria-label=Share]").click());
        await host.waitForSelector("dialog[open] select");
        await choose("view");
        const [first] = await added(1);
        await choose("edit");
        assert.notEqual((await added(1))[0], first);
        await choose("none");
        await added(0);
        await choose("view");
        await host.click("dialog[open] input.text");
        if (copies)
            await host.evaluate(() => document.execCommand("copy"));
        await host.keyboard.press("Escape");
        await host.waitForSelector("dialog", { hidden: true });
        await added(copies ? 1 : 0);
    }
});

test("a page with edits that is loaded again goes on as it was", async () => {
    const solo = await openPage(await browser.createBrowserContext(), link("", "edit"));
    await solo.waitForSelector("#empty:not([hidden])");
    await dropFile(solo, "panes.glb", readFileSync(join(models, "panes.glb")));
    await waitExact(solo);
    await solo.evaluate(async () => {
        const { helio } = window;
        await helio.setParams({ tonemap: "AGX" });
        helio.looks.change(0, { isOn: true, isFlipped: true });
        await helio.inspector.select(helio.scene.roots[0].node);
    });
    await waitFor(solo, () => window.helio.looks.box && !window.helio.looks.timer);
    await waitExact(solo);
    for (let i = 0; i < 2; i++) { // again and again
        const session = await solo.evaluate(() => String(window.helio.connection.session));
        await solo.reload();
        await waitFor(solo, () => window.helio?.scene.assets.length === 1);
        await waitExact(solo);
        await waitFor(solo, () => !document.querySelector("#card").hidden);
        assert.deepEqual(await solo.evaluate(() => [String(window.helio.connection.session),
            window.helio.viewPanel.rows.tonemap.input.value, window.helio.looks.rows[0].on.input.checked]), [session, "AGX", true]);
    }
    await solo.evaluate(() => { location.hash = "#scene=elsewhere"; });
    await until(() => solo.evaluate(() => window.helio?.scene.name === "elsewhere").catch(() => false), // it is loaded again
        "another link opens another scene");
    await solo.waitForSelector("#empty:not([hidden])");
    assert.deepEqual(solo.complaints, []);
    await solo.browserContext().close();
});

test("guests may come by the link before the host does", async () => {
    const words = `scene=early&load=${join(models, "panes.glb")}`;
    const first = await openPage(await browser.createBrowserContext(), link(words, "view"));
    await first.waitForSelector("#empty:not([hidden])");
    assert.match(await first.$eval("#empty", (e) => e.textContent), /view only/);
    assert.ok(await first.$eval("#curtain", (c) => c.hidden));
    const second = await openPage(await browser.createBrowserContext(), link(words, "edit"));
    await waitFor(second, () => window.helio.scene.assets.length === 1);
    assert.equal(await second.$eval("#toasts", (t) => t.textContent), "", "its own file is no news to it");
    const third = await openPage(await browser.createBrowserContext(), link(words, "edit"));
    await waitFor(third, () => window.helio.scene.assets.length === 1);
    await first.waitForSelector("#empty", { hidden: true });
    assert.equal(await second.evaluate(() => window.helio.scene.refresh().then(() => window.helio.scene.assets.length)), 1);
    for (const page of [first, second, third]) {
        assert.deepEqual(page.complaints, []);
        await page.browserContext().close();
    }
});

test("a page of which a module does not come is loaded again", async () => {
    const page = await (await browser.createBrowserContext()).newPage();
    let refused = 0;
    await page.setRequestInterception(true);
    page.on("request", (r) => r.url().endsWith("/looks.js") && refused++ < 2
        ? r.respond({ status: 503, body: "too many connections" }) : r.continue());
    await page.goto(link("scene=room", "view"));
    await waitFor(page, () => /Trying again/.test(document.querySelector("#curtain").textContent));
    await until(() => page.evaluate(() => document.body.dataset.state === "open").catch(() => false),
        "the page opens its session");
    assert.equal(refused, 3);
    await page.browserContext().close();
});

test("who is over a limit reads which one, and comes again when the server said", async () => {
    daemon.options = ["--max-sessions-per-token", "1"];
    await daemon.kill();
    await daemon.start();
    await waitFor(guest, () => window.helio.connection.isOpen);
    const page = await openPage(await browser.createBrowserContext(), link("scene=room", "view"));
    await waitFor(page, () => window.helio.connection.state === "waiting");
    const [text, rest_ms, tries] = await page.evaluate(() => {
        const { connection } = window.helio;
        return [document.querySelector("#curtain").textContent, connection.retryAt_ms - performance.now(),
            connection.tries];
    });
    assert.match(text, /does not let you in.*1 session open.*max-sessions-per-token.*Trying again in \d s/);
    assert.ok(tries === 1 && rest_ms > 1000, `try ${tries}, ${rest_ms} ms`);
    await guest.evaluate(() => window.helio.connection.close());
    await waitFor(page, () => window.helio.connection.isOpen); // without being asked to
    await page.browserContext().close();
    await guest.evaluate(() => window.helio.connection.connect());
    await waitFor(guest, () => window.helio.connection.isOpen);
});

test("who has lost the access reads why, and may sign in with another one", async () => {
    const { stdout } = await daemon.manage("tickets", "make", "--scene", "room", "--uses", "1", "--valid", "600");
    const secret = stdout.trim().split(/\s+/).at(-1);
    const page = await (await browser.createBrowserContext()).newPage();
    await page.goto(`${daemon.origin}/#scene=room&ticket=${secret}&gi=NONE&samples=1`);
    await waitFor(page, () => window.helio?.connection.isOpen);
    const tickets = await daemon.manage("tickets", "list");
    await daemon.manage("tickets", "revoke", tickets.stdout.trim().split("\n").at(-1).trim().split(/\s+/)[0]);
    await waitFor(page, () => /ticket was revoked/.test(document.querySelector("#token-error")?.textContent));
    assert.doesNotMatch(await page.$eval("#curtain", (c) => c.textContent), /Trying again/);
    await page.browserContext().close();
});

test("nobody complained", () =>
    assert.deepEqual([...host.complaints, ...guest.complaints], []));
