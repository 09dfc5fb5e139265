// app.js - the viewer as a whole: one connection, one scene, one view, and the page around them.
import { blend, cameraToText, distance, halfHeight, makeCamera } from "./camera.js";
import { Connection, describeError } from "./connection.js";
import { Controls } from "./controls.js";
import {
    announce, ask, button, download, h, icon, iconButton, metresText, progressToast, toast,
} from "./dom.js";
import { formatLink, keepAccess, takeAccess } from "./link.js";
import { Overlay } from "./overlay.js";
import { ScenePanel, ViewPanel } from "./panels.js";
import { Scene } from "./scene.js";
import { Curtain, Panels, Status, VIEWS, askToken, menuButton, showHelp } from "./shell.js";
import { Stats } from "./stats.js";
import { Timeline } from "./timeline.js";
import { choose, filesOf } from "./upload.js";
import { View } from "./view.js";

const CLIENT = "helio-web/1";
const FLIGHT_MS = 350;
const LATER_MS = 60;
const LONG_TICK_S = 0.1;
const MODES = { orbit: "Orbit", fly: "Fly", walk: "Walk" };

const $ = (id) => document.getElementById(id);
const radians = (deg) => deg * Math.PI / 180;

class App {
    constructor() {
        this.link = takeAccess();
        const url = new URL(location.pathname, location.href);
        url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
        this.connection = new Connection(url.href, CLIENT);
        this.connection.token = this.link.ticket;
        this.canvas = $("picture");
        this.scene = new Scene(this.connection);
        this.view = new View(this.connection, this.canvas);
        this.view.params = { ...this.view.params, ...this.link.params };
        this.view.camera = this.link.camera ?? this.view.camera;
        this.view.sent = this.link.camera;
        this.overlay = new Overlay($("overlay"), this.canvas);
        this.status = new Status($("status"));
        this.curtain = new Curtain($("curtain"));
        this.tool = "select";
        this.opened = this.link.load ? { path: this.link.load } : null;
        this.build();
        this.listen();
        this.connection.connect();
    }

    // ---- the page ------------------------------------------------------------------------------

    build() {
        this.panels = new Panels((name, isOpen) => this.onPanel(name, isOpen));
        const close = (name) => () => this.panels.set(name, false);
        this.viewPanel = new ViewPanel($("panel-view"), {
            set: (changes) => this.setParams(changes),
            later: (changes) => this.later("params", changes, (c) => this.setParams(c)),
            lens: (changes) => this.setLens(changes),
            resolution: (v) => this.view.setResolution(v),
            environment: (fields) => this.setEnvironment(fields),
            environmentLater: (fields) =>
                this.later("environment", fields, (f) => this.setEnvironment(f)),
        }, close("view"));
        this.scenePanel = new ScenePanel($("panel-scene"), this.scene, {
            select: (id) => this.selectNode(id), toggle: (id, on) => this.setVisible(id, on),
            focus: (id) => this.fit(id), camera: (id) => this.follow(id),
            variant: (asset, name) => this.try(() => this.scene.setVariant(asset, name)),
            canEdit: () => this.connection.canEdit,
            warnings: (list) => this.showWarnings(list),
        }, close("scene"));
        this.stats = new Stats($("panel-stats"), this.connection, close("stats"));
        this.timeline = new Timeline($("timeline"), {
            set: (asset, animation, time) => this.scene.setAnimation(asset, animation, time),
            change: () => this.wake() });
        this.buildMenu();
        this.buildTools();
    }

    buildMenu() {
        const opener = (name, picture, label) => {
            const b = iconButton(picture, label, () => this.panels.toggle(name));
            this.panels.add(name, $(`panel-${name}`), b);
            return b;
        };
        const wide = { class: "icon-button only-wide" };
        this.fileInput = h("input", { type: "file", multiple: true, class: "hidden", tabindex: "-1",
            "aria-label": "Files to open", on: { change: () => this.openPicked() } });
        const more = () => [
            ["Open files", "open", "", () => this.fileInput.click()],
            ["Screenshot", "camera", "", () => this.screenshot()],
            ["Share", "share", "", () => this.share()],
            ["Help", "help", "?", showHelp]];
        $("menu").append(
            iconButton("open", "Open files", () => this.fileInput.click(), wide),
            iconButton("camera", "Screenshot", () => this.screenshot(), wide),
            iconButton("share", "Share", () => this.share(), wide),
            opener("scene", "scene", "Scene"), opener("view", "view", "View"),
            opener("stats", "stats", "Statistics"),
            iconButton("help", "Help", showHelp, wide),
            menuButton("more", "More", more, { class: "icon-button only-narrow" }), this.fileInput);
    }

    buildTools() {
        this.modeButtons = Object.entries(MODES).map(([mode, label]) =>
            iconButton(mode, label, () => this.setMode(mode), { data: { mode } }));
        this.toolButtons = ["measure"].map((tool) => iconButton(tool, "Measure",
            () => this.setTool(this.tool === tool ? "select" : tool), { data: { tool } }));
        const views = () => VIEWS.map(([name, key, at]) =>
            [name, null, key, () => this.standardView(at)]);
        $("tools").append(...this.modeButtons, h("span", { class: "gap" }),
            iconButton("fit", "Show everything", () => this.fit(0n)),
            menuButton("cube", "Standard views", views),
            h("span", { class: "gap" }), ...this.toolButtons);
        $("tools").addEventListener("keydown", (e) => this.toolKey(e));
    }

    // A toolbar is one tab stop per group for some readers; arrows go along it for all.
    toolKey(event) {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        const all = [...$("tools").querySelectorAll("button")];
        if (by)
            all[(all.indexOf(document.activeElement) + by + all.length) % all.length].focus();
    }

    listen() {
        const { connection, view, scene, canvas } = this;
        this.controls = new Controls(canvas, () => this.takeCamera(), {
            change: () => this.wake(), pick: (x, y) => this.onPick(x, y),
            focus: (x, y) => this.focusAt(x, y), key: (e) => this.onKey(e) });
        this.setMode("orbit");
        connection.addEventListener("state", (e) => this.onState(e.detail));
        connection.addEventListener("opened", (e) => this.onOpened(e.detail.resumed));
        connection.addEventListener("auth", (e) => this.signIn(e.detail));
        connection.addEventListener("message", (e) => this.onMessage(e.detail));
        view.addEventListener("shown", (e) => this.onShown(e.detail));
        view.addEventListener("verified", (e) => this.onVerified(e.detail));
        view.addEventListener("trouble", (e) => toast(describeError(e.detail), "error"));
        view.addEventListener("params", () => this.updateView());
        scene.addEventListener("changed", () => this.onScene());
        scene.addEventListener("assets", () => this.refreshScene());
        new ResizeObserver(() => view.resize()).observe(canvas);
        matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", () => view.resize());
        document.addEventListener("visibilitychange", () => view.setHidden(document.hidden));
        addEventListener("beforeunload", () => connection.close());
        addEventListener("hashchange", () => location.reload());
        this.listenDrops();
        this.updateView();
    }

    listenDrops() {
        const zone = $("dropzone");
        let depth = 0;
        const show = (by) => {
            depth = by === 0 ? 0 : depth + by;
            zone.hidden = depth <= 0;
        };
        addEventListener("dragenter", (e) => { e.preventDefault(); show(1); });
        addEventListener("dragleave", () => show(-1));
        addEventListener("dragover", (e) => e.preventDefault());
        addEventListener("drop", (e) => {
            e.preventDefault();
            show(0);
            this.openTransfer(e.dataTransfer);
        });
    }

    // ---- connection ----------------------------------------------------------------------------

    onState(state) {
        document.body.dataset.state = state;
        clearInterval(this.waitTimer);
        if (state === "open") {
            this.curtain.hide();
            return;
        }
        this.view.stop();
        this.status.set("lost", state === "connecting" ? "Connecting" : "Not connected");
        if (state === "waiting") {
            this.showWaiting();
            this.waitTimer = setInterval(() => this.showWaiting(), 500);
        }
    }

    showWaiting() {
        const { connection } = this;
        const rest = Math.max(0, connection.retryAt_ms - performance.now());
        const again = rest > 900 ? `Trying again in ${Math.ceil(rest / 1000)} s.` : "Trying again.";
        const why = connection.lastError ? `${describeError(connection.lastError)} ` : "";
        this.curtain.show(this.wasOpen ? "Connection lost" : "No connection",
            `${why}${again}`, ["Try now", () => connection.connect()]);
    }

    async onOpened(resumed) {
        try {
            if (resumed) {
                this.scene.setRange(resumed);
                await this.view.resume();
                announce("Connected again");
            } else {
                await this.openSession();
            }
            this.wasOpen = true;
            this.refreshScene();
        } catch (error) {
            if (error.status !== "closed")
                this.showFailure(error);
        }
    }

    async openSession() {
        const { scene, view, connection } = this;
        const path = this.opened?.path ?? "";
        await this.withProgress("Opening the scene", async (onProgress) => {
            await scene.open(this.link.scene, path, onProgress);
            if (this.opened?.files && !scene.existed)
                await scene.loadFiles(this.opened.files, onProgress);
        });
        await view.start();
        await connection.keep();
    }

    showFailure(error) {
        this.status.set("lost", "Not open");
        this.curtain.show("The scene cannot be opened", describeError(error),
            ["Try again", () => this.connection.connect()]);
    }

    async signIn(error) {
        const token = await askToken(error ? describeError(error) : null);
        if (token === null) {
            this.curtain.show("Signed out", "This server needs an access token or a join ticket.",
                ["Sign in", () => this.signIn(null)]);
            return;
        }
        keepAccess(token);
        this.connection.token = token;
        this.connection.connect();
    }

    onMessage({ name, body }) {
        if (name === "drain")
            toast(`The server is about to restart${body.reason ? `: ${body.reason}` : ""}.`);
        else if (name === "notice" && body.what === "worker")
            toast("The renderer was restarted; the scene is being restored.");
        else if (name === "notice" && body.reason)
            toast(`${body.what}: ${body.reason}`);
    }

    // ---- frames --------------------------------------------------------------------------------

    onShown(detail) {
        const { frame } = detail;
        this.stats.add(detail);
        this.overlay.draw(this.view.shown);
        this.scene.noteRevision(frame.scene_revision);
        if (frame.settled)
            this.status.set("settled", "Settled", "Nothing is left to improve");
        else if (this.isMoving)
            this.status.set("live", "Moving");
        else
            this.status.set("refining", `Refining ${this.progressText(frame)}`);
        if (this.view.needsPivot && frame.settled) {
            this.view.needsPivot = false;
            this.findPivot();
        }
    }

    progressText(frame) {
        const { params } = this.view;
        const most = params.samples ?? (params.mode === "PATH" ? 256 : 32);
        return `${Math.min(100, Math.round(frame.samples / most * 100))} %`;
    }

    onVerified(isSame) {
        if (isSame)
            this.status.set("settled", "Settled, exact",
                "The pixels shown are those that the server rendered, bit by bit");
    }

    // ---- camera --------------------------------------------------------------------------------

    // The camera that input moves: a flight that is under way ends where it is.
    takeCamera() {
        this.flight = null;
        this.view.needsPivot = false;
        return this.view.camera;
    }

    wake() {
        if (this.isAwake)
            return;
        this.isAwake = true;
        this.ticked_ms = performance.now();
        requestAnimationFrame((t) => this.tick(t));
    }

    // Once per animation frame while something moves: one camera at most is sent.
    tick(now_ms) {
        const dt_s = Math.min(LONG_TICK_S, Math.max(0, (now_ms - this.ticked_ms) / 1000));
        this.ticked_ms = now_ms;
        let goesOn = this.controls.tick(dt_s);
        goesOn = this.tickFlight(now_ms) || goesOn;
        goesOn = this.timeline.tick(dt_s) || goesOn;
        goesOn = this.view.sendCamera() || this.controls.pointers.size > 0 || goesOn;
        this.isMoving = goesOn;
        this.isAwake = goesOn;
        if (goesOn)
            requestAnimationFrame((t) => this.tick(t));
    }

    fly(to) {
        const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
        const from = structuredClone(this.view.camera);
        const begun_ms = performance.now();
        this.flight = { from, to, begun_ms, length_ms: isStill ? 0 : FLIGHT_MS };
        this.wake();
    }

    tickFlight(now_ms) {
        const { flight } = this;
        if (!flight)
            return false;
        const t = flight.length_ms ? Math.min(1, (now_ms - flight.begun_ms) / flight.length_ms) : 1;
        const ease = t < 1 ? 1 - (1 - Math.max(0, t)) ** 3 : 1;
        this.view.camera = makeCamera(t < 1 ? blend(flight.from, flight.to, ease) : flight.to);
        this.viewPanel.updateLens(this.view.camera);
        if (t >= 1)
            this.flight = null;
        return t < 1;
    }

    async fit(node, angles = null) {
        await this.try(async () => {
            const { eye, target, kind, vfov_rad } = this.view.camera;
            const d = eye.map((v, i) => v - target[i]);
            const [azimuth, elevation] = angles ?? [Math.atan2(d[0], d[2]),
                Math.asin(d[1] / Math.max(1e-9, Math.hypot(...d)))];
            const fit = await this.view.fitted({ node, kind, vfov_rad, azimuth_rad: azimuth,
                elevation_rad: Math.max(-Math.PI / 2, Math.min(Math.PI / 2, elevation)) });
            this.fly(makeCamera(fit));
        });
    }

    standardView(at) {
        if (Array.isArray(at))
            return this.fit(0n, at.map(radians));
        return this.try(async () => this.fly(makeCamera(await this.view.fitted({ cameras: false }))));
    }

    follow(id) {
        return this.try(async () => {
            this.flight = null;
            await this.view.follow(id);
            this.updateView();
        });
    }

    // Where a camera of the scene looks says nothing about what it looks at.
    async findPivot() {
        const picked = await this.view.pick(0.5, 0.5).catch(() => null);
        if (!picked || this.isMoving)
            return;
        const { camera } = this.view;
        const depth = picked.distance;
        const now = distance(camera);
        camera.target = camera.eye.map((v, i) => v + (camera.target[i] - v) * depth / now);
        this.view.sent = structuredClone(camera);
        this.controls.speed_mps = depth * 0.3;
    }

    setLens(changes) {
        const { camera } = this.view;
        if (changes.kind && changes.kind !== camera.kind) {
            const half = halfHeight(camera);
            if (changes.kind === "ORTHOGRAPHIC")
                changes.half_height = half;
        }
        Object.assign(camera, changes);
        this.viewPanel.updateLens(camera);
        this.wake();
    }

    setMode(mode) {
        this.controls.mode = mode;
        this.controls.speed_mps = Math.max(distance(this.view.camera) * 0.3, 1e-4);
        for (const b of this.modeButtons)
            b.setAttribute("aria-pressed", String(b.dataset.mode === mode));
        announce(`${MODES[mode]} mode`);
    }

    // ---- picking and measuring -----------------------------------------------------------------

    setTool(tool) {
        this.tool = tool;
        this.canvas.dataset.tool = tool;
        for (const b of this.toolButtons)
            b.setAttribute("aria-pressed", String(b.dataset.tool === tool));
        this.overlay.points = [];
        this.overlay.draw();
        if (tool === "measure")
            toast("Pick two places to measure between them.");
        this.showCard();
    }

    async onPick(x, y) {
        await this.try(async () => {
            const picked = await this.view.pick(x, y);
            if (this.tool === "measure")
                this.measure(picked);
            else if (picked)
                await this.selectNode(picked.node, picked);
            else
                this.clearSelection();
        });
    }

    measure(picked) {
        if (!picked) {
            toast("There is nothing to measure there.");
            return;
        }
        const { overlay } = this;
        overlay.points = overlay.points.length >= 2 ? [picked] : [...overlay.points, picked];
        overlay.draw();
        this.showCard();
    }

    async focusAt(x, y) {
        await this.try(async () => {
            const picked = await this.view.pick(x, y);
            if (!picked)
                return;
            const to = structuredClone(this.view.camera);
            const half = picked.position.map((v, i) => (to.eye[i] - to.target[i]) * 0.6);
            to.target = picked.position;
            to.eye = picked.position.map((v, i) => v + half[i]);
            this.fly(to);
        });
    }

    async selectNode(id, picked = null) {
        this.selection = { id, picked };
        this.overlay.box = null;
        if (this.panels.isOpen("scene") && this.scene.nodes.has(id) && this.scenePanel.tree.selected !== id)
            this.scenePanel.tree.reveal(id);
        this.showCard();
        const box = await this.scene.bounds(id).catch(() => null);
        if (this.selection?.id !== id || !box || box.empty)
            return;
        this.overlay.box = { min: box.min, max: box.max };
        this.selection.size = box.max.map((v, i) => v - box.min[i]);
        this.overlay.draw();
        this.showCard();
    }

    clearSelection() {
        this.selection = null;
        this.overlay.box = null;
        this.overlay.draw();
        this.scenePanel.tree.selected = null;
        this.scenePanel.tree.draw();
        this.showCard();
    }

    // The card of what is selected or measured.
    showCard() {
        const card = $("card");
        const content = this.tool === "measure" ? this.measureCard() : this.selectionCard();
        card.hidden = !content;
        card.replaceChildren(...content ?? []);
    }

    cardHead(title, onClose) {
        return h("header", {}, h("h2", { text: title }), iconButton("close", "Close", onClose));
    }

    measureCard() {
        const { points } = this.overlay;
        const [a, b] = points;
        const rows = a && b ? [["Distance", metresText(this.overlay.distance())],
            ["Along X, Y, Z", [0, 1, 2].map((i) => metresText(b.position[i] - a.position[i])).join(", ")],
            ["Angle of surfaces", `${angle(a.normal, b.normal).toFixed(1)}°`]]
            : [["Picked", `${points.length} of 2`]];
        if (a && b)
            announce(`Distance ${rows[0][1]}`);
        return [this.cardHead("Measure", () => this.setTool("select")), definitions(rows)];
    }

    selectionCard() {
        const { selection } = this;
        if (!selection)
            return null;
        const { id, picked, size } = selection;
        const vector = (v) => v.map((n) => n.toFixed(3)).join(", ");
        const rows = [];
        if (size)
            rows.push(["Size", size.map(metresText).join(" × ")]);
        if (picked)
            rows.push(["Place", vector(picked.position)], ["Normal", vector(picked.normal)],
                ["Texture", vector(picked.uv)], ["Part, triangle", `${picked.part}, ${picked.triangle}`],
                ["Distance", metresText(picked.distance)]);
        const isVisible = this.scene.nodes.get(id)?.visible ?? true;
        const hide = button(isVisible ? "Hide" : "Show", () => this.setVisible(id, !isVisible),
            { disabled: !this.connection.canEdit });
        return [this.cardHead(this.scene.nameOf(id), () => this.clearSelection()),
            definitions(rows), h("div", { class: "choices" },
                button("Zoom to it", () => this.fit(id)), hide,
                button("In the tree", () => { this.panels.set("scene", true); this.scenePanel.tree.reveal(id); }))];
    }

    // ---- keys ----------------------------------------------------------------------------------

    onKey(event) {
        const number = VIEWS.find(([, key]) => key === event.key);
        const actions = {
            KeyO: () => this.setMode("orbit"), KeyG: () => this.setMode("fly"),
            KeyK: () => this.setMode("walk"),
            KeyF: () => this.fit(event.shiftKey && this.selection ? this.selection.id : 0n),
            KeyM: () => this.setTool(this.tool === "measure" ? "select" : "measure"),
            KeyP: () => this.setParams({ mode: this.view.params.mode === "PATH" ? "REALTIME" : "PATH" }),
            KeyC: () => this.panels.toggle("scene"), KeyV: () => this.panels.toggle("view"),
            KeyT: () => this.panels.toggle("stats"), Space: () => this.timeline.toggle(),
            Enter: () => this.onPick(0.5, 0.5), Escape: () => this.escape(),
        };
        const action = number ? () => this.standardView(number[2])
            : event.key === "?" ? showHelp : actions[event.code];
        action?.();
        return Boolean(action);
    }

    escape() {
        if (this.tool !== "select")
            this.setTool("select");
        else if (this.selection)
            this.clearSelection();
        else
            this.panels.closeOne();
    }

    // ---- settings and edits --------------------------------------------------------------------

    // Failures are shown, not thrown.
    async try(action) {
        try {
            return await action();
        } catch (error) {
            toast(describeError(error), "error");
            return undefined;
        }
    }

    // Values of a slider that is moved are sent a moment later, together.
    later(key, changes, apply) {
        this.waiting ??= {};
        const was = this.waiting[key];
        const all = { ...was?.changes, ...changes };
        clearTimeout(was?.timer);
        this.waiting[key] = { changes: all, timer: setTimeout(() => {
            delete this.waiting[key];
            apply(all);
        }, LATER_MS) };
    }

    setParams(changes) {
        if (changes.mode)
            changes = { samples: changes.mode === "PATH" ? 256 : 32, ...changes };
        return this.try(() => this.view.set(changes));
    }

    setEnvironment(fields) {
        return this.try(() => this.scene.setEnvironment(fields));
    }

    setVisible(id, isVisible) {
        return this.try(async () => {
            await this.scene.setVisible(id, isVisible);
            this.showCard();
        });
    }

    updateView() {
        this.viewPanel.update(this.view.params, this.view.camera, this.connection.canEdit);
    }

    // ---- the scene -----------------------------------------------------------------------------

    async refreshScene() {
        await this.scene.refresh().catch(() => {});
    }

    onScene() {
        const { scene, connection } = this;
        this.scenePanel.update();
        this.timeline.setAnimations(scene.animations, connection.canEdit);
        const file = scene.assets.map((a) => a.file).filter(Boolean).map((f) => f.split("/").pop());
        const name = this.openedName ?? (this.link.scene || file.join(", "));
        $("title").textContent = name;
        document.title = name ? `${name} – Heliograph` : "Heliograph";
        this.updateView();
        this.showEmpty(!scene.total);
    }

    showEmpty(isEmpty) {
        const section = $("empty");
        section.hidden = !isEmpty;
        if (!isEmpty)
            return;
        const canEdit = this.connection.canEdit;
        section.replaceChildren(icon("scene"), h("h2", { text: "Nothing to see yet" }),
            h("p", { text: canEdit ? "Drop a scene here: glTF with its files, OBJ, FBX, PLY, STL."
                : "This scene is empty, and your access is view only." }),
            ...canEdit ? [h("div", { class: "choices" },
                button("Choose files", () => this.fileInput.click(), { class: "button primary" }),
                button("Open the demo", () => this.openDemo()))] : []);
    }

    async withProgress(text, action) {
        const task = progressToast(text);
        try {
            return await action((stage, share) => task.update(`${text}: ${stage}`, share));
        } finally {
            task.end();
        }
    }

    openDemo() {
        return this.openWith({ path: "demo:" }, "demo", (onProgress) =>
            this.scene.loadPath("demo:", onProgress));
    }

    openTransfer(transfer) {
        return this.try(async () => this.openFiles(await filesOf(transfer)));
    }

    openPicked() {
        const files = [...this.fileInput.files].map((file) => ({ path: file.name, file }));
        this.fileInput.value = "";
        if (files.length)
            this.try(() => this.openFiles(files));
    }

    async openFiles(files) {
        if (!files.length)
            return;
        if (!this.connection.canEdit) {
            toast("Your access is view only: files cannot be opened here.", "error");
            return;
        }
        const chosen = await choose(files);
        if (chosen.kind === "environment") {
            await this.withProgress(chosen.name, (onProgress) =>
                this.scene.setEnvironmentFile(chosen.files, onProgress));
            return;
        }
        await this.openWith({ files: chosen.files }, chosen.name, (onProgress) =>
            this.scene.loadFiles(chosen.files, onProgress));
    }

    // Loads into an empty scene, or asks whether what is there goes.
    async openWith(opened, name, load) {
        const before = this.scene.assets;
        const answer = before.length ? await ask(`Open ${name}`, h("p", { text:
            "The scene is not empty. Everyone who looks at it sees what is opened." }),
        [["Cancel", "cancel"], ["Add to the scene", "add"], ["Replace", "replace"]]) : "replace";
        if (answer !== "add" && answer !== "replace")
            return;
        await this.try(() => this.withProgress(name, async (onProgress) => {
            const { loaded, warnings } = await load(onProgress);
            if (answer === "replace")
                await this.scene.unloadAll(before);
            this.opened = opened;
            this.openedName = answer === "replace" ? name : this.openedName;
            $("empty").hidden = true;
            this.clearSelection();
            this.view.sent = null;
            await this.view.fitFirst();
            this.updateView();
            const notes = warnings.length ? ` ${warnings.length} notes: see the scene panel.` : "";
            toast(`${name}: ${Number(loaded.triangles).toLocaleString()} triangles.${notes}`);
        }));
    }

    showWarnings(list) {
        const text = (w) => typeof w === "string" ? w
            : [w.what, w.where, w.reason ?? w.message].filter(Boolean).join(" – ");
        return ask("Notes of the loader", h("ul", { class: "body", tabindex: "0" },
            ...list.map((w) => h("li", { text: text(w) }))), [["Close", "close"]]);
    }

    onPanel(name, isOpen) {
        if (name === "scene" && isOpen) {
            this.refreshScene();
            this.scenePanel.tree.draw();
        }
        if (name === "stats")
            this.stats.draw();
        if (isOpen)
            $(`panel-${name}`).querySelector("input, button, summary")?.focus({ preventScroll: true });
    }

    // ---- links and pictures --------------------------------------------------------------------

    screenshot() {
        return this.try(() => this.withProgress("Taking a picture", async (onProgress) => {
            const png = await this.view.screenshot((kind, body) => kind === "progress" && onProgress(
                body.stage, Number(body.total) ? Number(body.done) / Number(body.total) : null));
            const name = ($("title").textContent || "scene").replace(/[^\w.-]+/g, "_");
            download(png, "image/png", `${name}.png`);
        }));
    }

    shareUrl(withCamera, ticket) {
        const { view } = this;
        const hash = formatLink({ scene: this.link.scene, load: this.opened?.path ?? "", ticket,
            camera: withCamera ? view.camera : null, params: withCamera ? view.params : {} });
        return location.origin + location.pathname + hash;
    }

    async share() {
        const isPrivate = !this.link.scene && !this.opened?.path;
        const field = h("input", { class: "text", readonly: true, "aria-label": "Link",
            on: { focus: () => field.select() } });
        const camera = h("input", { type: "checkbox", class: "switch", role: "switch", checked: true,
            id: "share-camera", on: { change: () => show() } });
        const access = h("input", { type: "checkbox", class: "switch", role: "switch",
            id: "share-access", on: { change: () => show() } });
        const show = () => {
            field.value = this.shareUrl(camera.checked,
                access.checked ? this.connection.token ?? "" : "");
        };
        show();
        const row = (text, input) => h("div", { class: "row" },
            h("label", { for: input.id, text }), input);
        const answer = await ask("Share", h("div", { class: "body" },
            isPrivate ? h("p", { class: "hint", text:
                "This scene belongs to this page alone: the link opens an empty one." }) : null,
            field, row("With camera and settings", camera),
            this.connection.token ? row("With my access", access) : null,
            this.connection.token ? h("p", { class: "hint", text:
                "A link with access lets everyone who has it do what you may do." }) : null),
        [["Close", "close"], ["Copy link", "copy"]]);
        if (answer === "copy")
            await this.try(async () => {
                await navigator.clipboard.writeText(field.value);
                toast("The link was copied.");
            });
    }
}

const definitions = (rows) => h("dl", {}, ...rows.flatMap(([name, value]) =>
    [h("dt", { text: name }), h("dd", { text: value })]));

function angle(a, b) {
    const cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return Math.acos(Math.max(-1, Math.min(1, cosine))) * 180 / Math.PI;
}

// For scripts of tests and of the console.
window.helio = new App();
window.helio.cameraText = () => cameraToText(window.helio.view.camera);
