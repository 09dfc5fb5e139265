// app.js - the viewer as a whole: one connection, one scene, one view, and the page around them.
import { blend, cameraToText, distance, halfHeight, makeCamera } from "./camera.js";
import { Connection, RequestError, describeError, waitText } from "./connection.js";
import { Controls } from "./controls.js";
import { announce, ask, dismiss, h, iconButton, progressToast, toast } from "./dom.js";
import { Inspector } from "./inspect.js";
import { keepAccess, keepCamera, keepResume, takeAccess, takeCamera, takeResume } from "./link.js";
import { Looks } from "./looks.js";
import { Opening } from "./opening.js";
import { Overlay } from "./overlay.js";
import { ScenePanel, ViewPanel } from "./panels.js";
import { People } from "./people.js";
import { Scene } from "./scene.js";
import { share, takePicture } from "./share.js";
import { Curtain, Panels, Status, VIEWS, askToken, menuButton, showHelp } from "./shell.js";
import { Stats } from "./stats.js";
import { Timeline } from "./timeline.js";
import { View, samplesOf } from "./view.js";

const CLIENT = "helio-web/1";
const FLIGHT_MS = 350;
const LATER_MS = 60;
const EXPLAIN_MS = 5000; // between two explanations of the same
const LONG_TICK_S = 0.1;
// What is said of a session, and of how it is shared, ends with it.
const OF_SESSION = ["drain", "idle", "frame", "follow", "camera", "asks"];
const MODES = { orbit: "Orbit", fly: "Fly", walk: "Walk" };

const $ = (id) => document.getElementById(id);
const radians = (deg) => deg * Math.PI / 180;

class App {
    constructor() {
        this.link = takeAccess();
        const url = new URL("hgp", location.href);
        url.hash = "";
        if (this.link.scene) // for load balancers, which keep a scene's viewers on one daemon
            url.searchParams.set("scene", this.link.scene);
        url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
        this.connection = new Connection(url.href, CLIENT);
        this.connection.token = this.link.ticket;
        this.address = [this.link.scene, this.link.load];
        this.kept = takeResume(this.link); // of the page before, when this tab was loaded again
        this.connection.ticket = this.kept.ticket;
        this.canvas = $("picture");
        this.scene = new Scene(this.connection);
        this.view = new View(this.connection, this.canvas, $("warp"));
        this.view.params = { ...this.view.params, ...this.link.params };
        const camera = takeCamera(this.link) ?? this.link.camera;
        this.view.camera = camera ?? this.view.camera;
        this.view.sent = camera;
        this.looks = new Looks(this.connection, this.view, this.scene,
            (error) => this.showError(error));
        this.overlay = new Overlay($("overlay"), this.canvas);
        this.status = new Status($("status"));
        this.curtain = new Curtain($("curtain"));
        this.title = "";
        this.opened = this.link.load ? { path: this.link.load } : null;
        this.build();
        this.listen();
        this.connection.connect();
    }

    // ---- the page ------------------------------------------------------------------------------

    build() {
        this.panels = new Panels($("shell"), $("tools"),
            (name, isOpen) => this.onPanel(name, isOpen));
        this.view.free = () => this.panels.free(this.canvas);
        const close = (name) => () => this.panels.set(name, false);
        this.viewPanel = new ViewPanel($("panel-view"), {
            set: (changes) => this.setParams(changes),
            later: (changes) => this.later("params", changes, (c) => this.setParams(c)),
            metered: (is) => this.setMetered(is),
            lens: (changes) => this.setLens(changes),
            clipping: this.looks.section(),
            resolution: (v) => this.view.setResolution(v),
            codec: (v) => this.attempt(() => this.view.setCodec(v)),
            reproject: (is) => this.setReprojection(is),
            environment: (fields) => this.setEnvironment(fields),
            environmentLater: (fields) =>
                this.later("environment", fields, (f) => this.setEnvironment(f)),
        }, close("view"));
        this.scenePanel = new ScenePanel($("panel-scene"), this.scene, {
            select: (id) => this.inspector.select(id), toggle: (id, on) => this.setVisible(id, on),
            isShown: (node) => this.isShown(node.node), focus: (id) => this.fit(id), camera: (id) => this.follow(id),
            variant: (asset, name) => this.setVariant(asset, name), variantHere: (asset) => this.looks.variants.get(asset),
            canEdit: () => this.connection.canEdit,
            warnings: (list) => this.showWarnings(list),
        }, close("scene"));
        this.stats = new Stats($("panel-stats"), this.connection, close("stats"),
            () => this.view.age_ms);
        this.timeline = new Timeline($("timeline"), {
            set: (asset, animation, time) => this.scene.setAnimation(asset, animation, time),
            change: () => this.wake() });
        this.inspector = new Inspector(this, $("card"), this.canvas);
        this.opening = new Opening(this, $("dropzone"), $("empty"));
        this.buildMenu();
        this.buildTools();
    }

    buildMenu() {
        const opener = (name, picture, label, props = {}) => {
            const b = iconButton(picture, label, () => this.panels.toggle(name), props);
            this.panels.add(name, $(`panel-${name}`), b);
            return b;
        };
        const wide = { class: "icon-button only-wide" };
        const open = () => this.opening.input.click();
        const picture = () => this.attempt(() => takePicture(this));
        const link = () => this.attempt(() => share(this));
        const people = opener("people", "people", "People", { ...wide, hidden: true });
        this.people = new People(this, $("panel-people"), people,
            () => this.panels.set("people", false));
        const more = () => [
            ...this.connection.canEdit ? [["Open files", "open", "", open]] : [], ["Screenshot", "camera", "", picture],
            ["Share", "share", "", link],
            ...this.people.isThere
                ? [["People", "people", "", () => this.panels.toggle("people")]] : [],
            ["Help", "help", "?", showHelp]];
        this.openButton = iconButton("open", "Open files", open, { ...wide, hidden: true });
        $("menu").append(this.openButton,
            iconButton("camera", "Screenshot", picture, wide),
            iconButton("share", "Share", link, wide),
            people, opener("scene", "scene", "Scene"), opener("view", "view", "View"),
            opener("stats", "stats", "Statistics"), iconButton("help", "Help", showHelp, wide),
            menuButton("more", "More", more, { class: "icon-button only-narrow" }),
            this.opening.input);
    }

    buildTools() {
        this.modeButtons = Object.entries(MODES).map(([mode, label]) =>
            iconButton(mode, label, () => this.setMode(mode), { data: { mode } }));
        const views = () => VIEWS.map(([name, key, at]) =>
            [name, null, key, () => this.standardView(at)]);
        $("tools").append(...this.modeButtons, h("span", { class: "gap" }),
            iconButton("fit", "Show everything", () => this.fit(0n)),
            menuButton("cube", "Standard views", views),
            h("span", { class: "gap" }), ...this.inspector.buttons);
        $("tools").addEventListener("keydown", (e) => this.toolKey(e));
    }

    // Arrows go along the toolbar, beside Tab.
    toolKey(event) {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        const all = [...$("tools").querySelectorAll("button")];
        if (by)
            all[(all.indexOf(document.activeElement) + by + all.length) % all.length].focus();
    }

    listen() {
        const { connection, view, scene, canvas } = this;
        this.controls = new Controls(canvas, () => this.takeCamera(), {
            change: () => this.wake(), pick: (x, y) => this.inspector.pick(x, y),
            focus: (x, y) => this.inspector.focusAt(x, y), key: (e) => this.onKey(e) });
        this.setMode("orbit");
        connection.addEventListener("state", (e) => this.onState(e.detail));
        connection.addEventListener("opened", (e) => this.onOpened(e.detail.resumed));
        connection.addEventListener("auth", (e) => this.signIn(e.detail));
        connection.addEventListener("message", (e) => this.onMessage(e.detail));
        connection.addEventListener("active", () => dismiss("idle"));
        view.addEventListener("shown", (e) => this.onShown(e.detail));
        view.addEventListener("verified", (e) => this.onVerified(e.detail));
        view.addEventListener("trouble", (e) => this.showError(e.detail));
        view.addEventListener("params", () => this.updateView());
        scene.addEventListener("changed", () => this.onScene());
        scene.addEventListener("assets", () => this.refreshScene());
        scene.addEventListener("environment", () => this.viewPanel.updateEnvironment(scene.environment));
        new ResizeObserver(() => view.resize()).observe(canvas);
        this.watchPixelRatio();
        view.setHidden(document.hidden); // a tab may be opened in the background
        document.addEventListener("visibilitychange", () => view.setHidden(document.hidden));
        addEventListener("pagehide", () => this.leave());
        // A page that the browser kept, and shows again as it was left.
        addEventListener("pageshow", (e) => {
            if (e.persisted && connection.state === "closed")
                connection.connect();
        });
        addEventListener("hashchange", () => location.reload());
        this.updateView();
    }

    // Of the screen that the window is on, and of the browser's zoom. A query is of one ratio: the next one needs its own.
    watchPixelRatio() {
        matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", () => {
            this.view.resize();
            this.watchPixelRatio();
        }, { once: true });
    }

    // A session goes on when the page is loaded again where it came in by a join ticket, which may be good once
    // only, or has edits, files that were dropped among them, that might end with it.
    leave() {
        const { connection, scene, view, looks, people } = this;
        if (view.sent)
            keepCamera(this.link, view.camera);
        if (!connection.ticket || !(connection.joined || scene.isEdited || this.isKept)) {
            connection.close();
            return;
        }
        const { codecs, ...params } = view.params;
        keepResume(connection.joined ? null : this.address, connection.ticket,
            { params, seq: view.seq, looks: looks.state, isFollowing: people.isFollowing });
    }

    // The session of the page before goes on here.
    takeUp({ params, seq, looks, isFollowing }) {
        this.isKept = true;
        this.view.seq = seq;
        this.view.params = { ...this.view.params, ...params };
        this.looks.restore(looks);
        this.people.isFollowing = isFollowing;
        this.updateView();
    }

    // ---- connection ----------------------------------------------------------------------------

    onState(state) {
        document.body.dataset.state = state;
        clearInterval(this.waitTimer);
        dismiss(...state === "open" ? ["closed"] : OF_SESSION);
        if (state === "open") {
            this.openButton.hidden = !this.connection.canEdit;
            this.curtain.hide();
            this.status.set("live", "Preparing", "The first picture is on its way");
            return;
        }
        this.view.stop();
        if (state === "ended") {
            this.showEnd();
            return;
        }
        this.status.set("lost", state === "connecting" ? "Connecting" : "Not connected");
        if (state === "waiting") {
            this.showWaiting();
            this.waitTimer = setInterval(() => this.showWaiting(), 500);
        }
    }

    showEnd() {
        const { lastError } = this.connection;
        this.status.set("lost", "Ended");
        this.curtain.show("The session was ended", lastError.status === "timeout"
            ? "Nothing was done here for a long time." : `The server says: ${lastError.message}.`,
        ["Open again", () => this.connection.connect()]);
    }

    showWaiting() {
        const { connection } = this;
        const rest = Math.max(0, connection.retryAt_ms - performance.now());
        const again = rest > 900 ? `Trying again in ${waitText(rest)}.` : "Trying again.";
        const { lastError } = connection;
        const why = lastError ? `${describeError(lastError, false)} ` : "";
        const isRefused = lastError instanceof RequestError && lastError.status !== "closed";
        this.curtain.show(isRefused ? "The server does not let you in now"
            : this.wasOpen ? "Connection lost" : "No connection", `${why}${again}`, ["Try now", () => connection.connect()]);
    }

    async onOpened(resumed) {
        try {
            const { look } = this.kept;
            this.kept.look = null;
            if (resumed) {
                if (look)
                    this.takeUp(look);
                this.scene.setRange(resumed);
                await this.view.resume();
                announce("Connected again");
            } else {
                await this.openSession();
            }
            this.wasOpen = true;
            const watched = this.people.watch(); // first, so that no edit is missed
            this.refreshScene().then(() => {
                if (look && this.looks.selected !== null)
                    this.inspector.select(this.looks.selected);
            });
            await watched;
        } catch (error) {
            if (error.status !== "closed")
                this.showFailure(error);
        }
    }

    async openSession() {
        const { scene, view, connection } = this;
        const { path, files } = this.opened ?? {};
        this.link.scene = connection.joined || this.link.scene;
        await this.withProgress("Opening the scene", async (onProgress) => {
            await scene.open(this.link.scene);
            if ((path || files) && await this.mayFill())
                await (path ? scene.loadPath(path, onProgress) : scene.loadFiles(files, onProgress));
        });
        this.opening.framed = null; // the camera is chosen for what is there now
        await view.start();
        await connection.keep();
    }

    // Whether this page loads what belongs into the scene: it is new, or those who came before may only
    // look. Others who may edit are about to load the same.
    async mayFill() {
        const { scene, connection, people } = this;
        if (!connection.canEdit || !scene.existed)
            return connection.canEdit;
        await scene.refresh();
        return !scene.total && !scene.assets.length && people.isOnlyEditor();
    }

    showFailure(error) {
        this.status.set("lost", "Not open");
        this.curtain.show("The scene cannot be opened", describeError(error),
            ["Try again", () => this.connection.connect()]);
    }

    async signIn(error) {
        this.curtain.show("Signed out", "This server needs an access token or a join ticket.",
            ["Sign in", () => this.signIn(null)]);
        const token = await askToken(error ? describeError(error) : null);
        if (token === null)
            return;
        keepAccess(token);
        this.connection.token = token;
        this.connection.connect();
    }

    onMessage({ name, body }) {
        if (name === "drain")
            toast(`Sessions end within ${waitText(body.deadline_ms)}${body.reason ? `: ${body.reason}` : ""}.`, "info", null, "drain");
        else if (name === "drain_cancelled")
            toast("Sessions go on.", "info", null, "drain");
        else if (name === "message")
            toast(`${body.from}: ${body.text}`);
        else if (name === "idle_warning")
            toast(`This session ends in ${waitText(body.remaining_ms)}.`, "info",
                ["Stay", () => this.view.subscribe()], "idle");
        else if (name === "edited")
            this.scene.noteEdit(body);
        else if (name === "notice" && body.what === "worker")
            this.toastUntilFrame("The renderer was restarted; the scene is being restored.");
        else if (name === "notice" && body.limit)
            this.explainLimit(new RequestError(body));
        else if (name === "notice" && body.reason)
            toast(`${body.what}: ${body.reason}`);
    }

    // A limit that refuses nothing, but lets pictures wait.
    explainLimit(error) {
        const text = describeError(error, false);
        this.toastUntilFrame(text);
        this.status.set("refining", "Waiting", text);
    }

    // Why no pictures come: true until the next one that is sent.
    toastUntilFrame(text) {
        this.waitsSince_ms = performance.now();
        toast(text, "info", null, "frame");
    }

    showError(error) {
        toast(describeError(error), "error", null, error.status === "closed" ? "closed" : "");
    }

    // ---- frames --------------------------------------------------------------------------------

    onShown(detail) {
        const { frame } = detail;
        if (frame.times?.begun_ms > this.waitsSince_ms) {
            this.waitsSince_ms = undefined;
            dismiss("frame");
        }
        this.stats.add(detail);
        this.overlay.draw(this.view.isReprojected ? this.view.camera : this.view.shown);
        this.scene.noteFrame(frame.scene_revision);
        if (this.view.isEmpty)
            this.status.set("settled", "Ready");
        else if (frame.settled)
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
        const share = frame.samples / samplesOf(this.view.params);
        return `${Math.min(100, Math.round(share * 100))} %`;
    }

    onVerified(isSame) {
        if (isSame && !this.view.isEmpty)
            this.status.set("settled", "Exact",
                "The pixels shown are those that the server rendered, bit by bit");
    }

    // ---- camera --------------------------------------------------------------------------------

    // The camera that input moves: a flight that is under way ends where it is.
    takeCamera() {
        this.flight = null;
        this.view.needsPivot = false;
        this.explainFollowing();
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
        const input = this.controls.tick(dt_s);
        let moves = input && !this.controls.isResting;
        moves = this.tickFlight(now_ms) || moves;
        moves = this.timeline.tick(dt_s) || moves;
        moves = this.view.sendCamera() || this.controls.pointers.size > 0 || moves;
        if (this.view.reproject())
            this.overlay.draw(this.view.camera);
        this.isMoving = moves;
        this.isAwake = moves || input;
        if (this.isAwake)
            requestAnimationFrame((t) => this.tick(t));
    }

    // Input does nothing while another session moves the camera that this view follows.
    explainFollowing() {
        const now_ms = performance.now();
        if (this.people.canMove || now_ms - (this.explained_ms ?? -Infinity) < EXPLAIN_MS)
            return;
        this.explained_ms = now_ms;
        const { holder } = this.people.shared;
        const of = holder ? ` of ${this.people.nameOf(holder)}` : "";
        toast(`This view follows the shared camera${of}.`, "info",
            ["Leave it", () => this.attempt(() => this.people.setFollow(false))], "follow");
    }

    fly(to) {
        this.explainFollowing();
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
        await this.attempt(async () => {
            const { eye, target, kind, vfov_rad } = this.view.camera;
            const d = eye.map((v, i) => v - target[i]);
            const [azimuth, elevation] = angles ?? [Math.atan2(d[0], d[2]),
                Math.asin(d[1] / Math.max(1e-9, Math.hypot(...d)))];
            this.fly(await this.view.fittedFree({ node, kind, vfov_rad, azimuth_rad: azimuth,
                elevation_rad: Math.max(-Math.PI / 2, Math.min(Math.PI / 2, elevation)) }));
        });
    }

    standardView(at) {
        if (Array.isArray(at))
            return this.fit(0n, at.map(radians));
        return this.attempt(async () =>
            this.fly(await this.view.fittedFree()));
    }

    follow(id) {
        return this.attempt(async () => {
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
        this.explainFollowing();
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

    // ---- keys ----------------------------------------------------------------------------------

    onKey(event) {
        const number = VIEWS.find(([, key]) => key === event.key);
        const actions = {
            KeyO: () => this.setMode("orbit"), KeyG: () => this.setMode("fly"),
            KeyK: () => this.setMode("walk"),
            KeyF: () => this.fit(event.shiftKey ? this.inspector.selection?.id ?? 0n : 0n),
            KeyM: () => this.inspector.toggleTool("measure"),
            KeyN: () => this.inspector.toggleTool("note"),
            KeyP: () => this.setParams(
                { mode: this.view.params.mode === "PATH" ? "REALTIME" : "PATH" }),
            KeyC: () => this.panels.toggle("scene"), KeyV: () => this.panels.toggle("view"),
            KeyT: () => this.panels.toggle("stats"), Space: () => this.timeline.toggle(),
            Enter: () => this.inspector.pick(0.5, 0.5), Escape: () => this.escape(),
        };
        const action = number ? () => this.standardView(number[2])
            : event.key === "?" ? showHelp : actions[event.code];
        action?.();
        return Boolean(action);
    }

    escape() {
        if (!this.inspector.escape())
            this.panels.closeOne();
    }

    // ---- settings and edits --------------------------------------------------------------------

    // Failures are shown, not thrown.
    async attempt(action) {
        try {
            return await action();
        } catch (error) {
            this.showError(error);
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
            changes = { samples: samplesOf(changes), ...changes };
        return this.attempt(() => this.view.set(changes));
    }

    // A fixed exposure is the one that was metered last, so that the picture stays as it is.
    setMetered(is) {
        const ev = this.view.frame?.exposure_ev ?? this.view.params.exposure_ev ?? 0;
        return this.setParams(is ? { exposure_mode: "AUTO", exposure_ev: 0 }
            : { exposure_mode: "FIXED", exposure_ev: Math.round(ev * 100) / 100 });
    }

    async setReprojection(isOn) {
        if (isOn && !this.view.warp.start())
            toast("This browser has no WebGL 2, which reprojection takes.", "error");
        else
            await this.setParams({ depth: isOn ? 1 : 0 });
        this.updateView();
    }

    setEnvironment(fields) {
        return this.attempt(() => this.scene.setEnvironment(fields));
    }

    isShown(id) {
        return !this.looks.hidden.has(id) && (this.scene.nodes.get(id)?.visible ?? true);
    }

    // Who may not edit the scene changes this view alone.
    setVisible(id, isVisible) {
        return this.attempt(async () => {
            if (this.connection.canEdit)
                await this.scene.setVisible(id, isVisible);
            else if (isVisible && !this.looks.hidden.has(id))
                toast("It is hidden in the scene, and your access is view only.");
            else
                await this.looks.setHidden(id, !isVisible);
            this.scenePanel.tree.draw();
            this.inspector.showCard();
        });
    }

    setVariant(asset, name) {
        return this.attempt(() => this.connection.canEdit ? this.scene.setVariant(asset, name)
            : this.looks.setVariant(asset, name));
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
        this.showTitle();
        this.updateView();
        this.opening.setEmpty(!scene.total);
        this.attempt(() => this.opening.followScene());
    }

    showTitle() {
        const file = this.scene.assets.map((a) => a.file).filter(Boolean).map((f) => f.split("/").pop());
        const name = this.openedName ?? (this.link.scene || file.join(", "));
        this.title = name;
        $("title").textContent = name;
        document.title = name ? `${name} – Heliograph` : "Heliograph";
    }

    async withProgress(text, action, onCancel = null) {
        const task = progressToast(text, onCancel);
        try {
            return await action((stage, share) => task.update(`${text}: ${stage}`, share));
        } finally {
            task.end();
        }
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
            ($(`panel-${name}`).querySelector("input, select, dl, ul button")
                ?? $(`panel-${name}`).querySelector("button")).focus({ preventScroll: true });
    }

}

// For scripts of tests and of the console.
window.helio = new App();
window.helio.cameraText = () => cameraToText(window.helio.view.camera);
