// view.js - the view of the scene: its size and settings, its camera, its frames and their credit.
//
// Events: "shown" (detail: { frame, latency_ms, decode_ms, split }), "verified" (boolean: the
// settled pixels on the canvas have the hash that the server states), "trouble" (detail: an
// error), "params" (settings changed), "started" (the server has the view, maybe anew).
import { intoFree, isFree, isSame, makeCamera, narrowed, sharesOf } from "./camera.js";
import { FramePainter, hexOf } from "./decode.js";
import { enums } from "./hgp.js";
import { Warp } from "./warp.js";

const VIEW = 1;
const CREDIT_FRAMES = 16; // the daemon keeps to what the network and the decoder take
const RESIZE_MS = 120;
const LEAST_SIDE_PX = 16;
const GREATEST_SIDE_PX = 16384;
const REMEMBERED_INPUTS = 256;
const BACKLOG_BYTES = 1 << 16; // cameras wait while more than this is still to be sent
const DEFAULT_VFOV_RAD = Math.PI / 4; // of view_fit
const FAILURES = 3; // key frames of one encoding before the next of the list takes its place

const [NORMAL, POSITION, NODE] = [2, 4, 8]; // of surface_query.what

// The answer to surface_query for one pixel; null: nothing is there.
function surfaceOf(data) {
    const view = new DataView(data.buffer, data.byteOffset, data.length);
    const vector = (at) => [0, 4, 8].map((i) => view.getFloat32(at + i, true));
    const node = view.getBigUint64(24, true);
    return node ? { normal: vector(0), position: vector(12), node } : null;
}

// Samples of a picture by settings that may not say it.
export const samplesOf = ({ mode, samples }) => samples ?? (mode === "PATH" ? 256 : 32);

const isLoopback = () => ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);

export class View extends EventTarget {
    // over: a canvas over the picture, for what is shown between frames; null: none.
    constructor(connection, canvas, over = null) {
        super();
        this.connection = connection;
        this.canvas = canvas;
        this.params = { encoding: "JPEG", quality: 85, max_fps: 60,
            still_encoding: isLoopback() ? "RAW_RGBA8" : FramePainter.stillEncoding() };
        this.codec = "auto";
        this.failures = new Map(); // encoding -> key frames in a row that could not be shown
        this.awaitsKey = new Set(); // encodings of which a key frame was asked for
        this.resolution = 1;
        this.maxPixels = 2560 * 1440;
        this.camera = makeCamera();
        this.sent = null;
        this.shown = null; // camera of the picture on the canvas
        this.node = 0n; // camera of the scene that the view follows
        this.seq = 0;
        this.inputs = new Map(); // sequence -> { time_ms, camera }
        this.frame = null;
        this.isStarted = false;
        this.isHidden = false;
        this.isEmpty = false;
        this.isFollowing = false; // another session moves its camera
        this.warp = over ? new Warp(over) : null;
        this.isReprojected = false;
        this.free = () => ({ x: [0, 1], y: [0, 1] }); // the part of the picture that nothing covers
        this.painter = new FramePainter(canvas, (f, t) => this.onShown(f, t),
            (f, e) => this.onFailed(f, e));
        connection.addEventListener("frame", (e) => this.onFrame(e.detail));
    }

    // ---- life ----------------------------------------------------------------------------------

    // Makes the view in a session that has just opened its scene.
    async start() {
        this.setSize();
        this.params.codecs ??= await this.codecs();
        const { params } = this;
        await this.place(() => this.settings());
        this.isStarted = true;
        if (this.params !== params) // they changed meanwhile
            await this.connection.call("view_set", this.settings());
        if (this.sent)
            this.sendCamera(true);
        else
            await this.fitFirst();
        this.dispatchEvent(new Event("started"));
        this.subscribe();
    }

    // Goes on in a session that was resumed: it has the view and its subscription.
    async resume() {
        this.isStarted = true;
        this.params.codecs ??= await this.codecs();
        await this.place(() => this.settings());
        if (this.sent)
            this.sendCamera(true);
        else
            await this.readCamera();
        this.dispatchEvent(new Event("started"));
        this.subscribe();
    }

    stop() {
        this.isStarted = false;
        this.inputs.clear();
        this.awaitsKey.clear();
    }

    subscribe() {
        if (this.isStarted)
            this.connection.send("subscribe",
                { view: VIEW, credit_frames: this.isIdle ? 0 : CREDIT_FRAMES });
    }

    get isIdle() {
        return this.isHidden || this.isEmpty;
    }

    // Nothing is rendered of a scene without geometry.
    setEmpty(isEmpty) {
        if (isEmpty === this.isEmpty)
            return;
        this.isEmpty = isEmpty;
        this.subscribe();
    }

    // A hidden page asks for no frames, so none are rendered for it.
    setHidden(isHidden) {
        this.isHidden = isHidden;
        this.subscribe();
    }

    settings() {
        return { view: VIEW, width: this.width, height: this.height, names: 1,
            samples: samplesOf(this.params), ...this.params };
    }

    // ---- settings ------------------------------------------------------------------------------

    // Changes parameters of view_set. A refused change is taken back, and thrown.
    async set(changes) {
        const before = this.params;
        this.params = { ...this.params, ...changes };
        this.dispatchEvent(new Event("params"));
        if (!this.isStarted)
            return;
        try {
            await this.connection.call("view_set", { view: VIEW, ...changes });
        } catch (error) {
            this.params = before;
            this.dispatchEvent(new Event("params"));
            throw error;
        }
    }

    // Encodings in motion, the best first: without a network between, what is encoded fastest.
    async codecs() {
        const known = await FramePainter.motionEncodings();
        const names = this.codec !== "auto" ? [this.codec, "JPEG"]
            : isLoopback() ? ["JPEG"] : known;
        return Uint8Array.from(names, (name) => enums.encoding[name]);
    }

    async setCodec(codec) {
        this.codec = codec;
        await this.set({ codecs: await this.codecs() });
    }

    // ---- size ----------------------------------------------------------------------------------

    setSize() {
        const box = this.canvas.getBoundingClientRect();
        const ratio = window.devicePixelRatio * this.resolution;
        let width = box.width * ratio, height = box.height * ratio;
        const shrink = Math.min(1, Math.sqrt(this.maxPixels / Math.max(1, width * height)));
        const side = (v) =>
            Math.max(LEAST_SIDE_PX, Math.min(GREATEST_SIDE_PX, Math.round(v * shrink)));
        width = side(width);
        height = side(height);
        const isNew = width !== this.width || height !== this.height;
        this.width = width;
        this.height = height;
        return isNew;
    }

    // The page was resized: once it rests for a moment the view gets its new size.
    resize() {
        clearTimeout(this.resizeTimer);
        this.resizeTimer = setTimeout(() => this.applySize(), RESIZE_MS);
    }

    async applySize() {
        if (!this.setSize() || !this.isStarted)
            return;
        await this.place(() => ({ view: VIEW, width: this.width, height: this.height }))
            .catch((error) => this.trouble(error));
    }

    // view_set with a size. More pixels than this session may have: half of them, and again.
    async place(message) {
        try {
            await this.connection.call("view_set", message());
        } catch (error) {
            const pixels = this.width * this.height;
            if (error.status !== "limit" || pixels < 65536)
                throw error;
            this.maxPixels = Math.floor(pixels / 2);
            this.setSize();
            await this.place(message);
        }
    }

    setResolution(resolution) {
        this.resolution = resolution;
        return this.applySize();
    }

    // ---- camera --------------------------------------------------------------------------------

    // The camera that the server chose for the scene as a whole.
    async fitted(options = {}) {
        return this.connection.call("view_fit", { view: VIEW, ...options });
    }

    // The same, in the part of the picture that is free: nearer where it fits there in its height alone, or its width.
    async fittedFree(options = {}) {
        const free = this.free();
        const aspect = this.width / this.height;
        const box = await this.connection.call("bounds_query", { node: options.node ?? 0n }).catch(() => null);
        const { vfov_rad = DEFAULT_VFOV_RAD } = options;
        let camera = null;
        for (const share of sharesOf(free)) {
            const fit = await this.fitted({ ...options, vfov_rad: narrowed(vfov_rad, share) });
            camera = { ...intoFree(fit, share, free, aspect), vfov_rad }; // not as the server rounded it
            if (box && !box.empty && isFree(camera, box, free, aspect))
                break;
        }
        return camera;
    }

    async fitFirst() {
        const { camera } = await this.fitted({ cameras: true });
        if (camera) {
            await this.follow(camera);
        } else {
            this.node = 0n;
            this.camera = await this.fittedFree();
            this.sendCamera(true);
        }
    }

    // Looks through a camera of the scene until the user moves.
    async follow(node) {
        this.node = node;
        this.sendCamera(true);
        await this.readCamera();
        this.needsPivot = true;
    }

    // The camera that the server has for the view.
    async readCamera() {
        const { text } = await this.connection.call("stats_query", { view: VIEW });
        const at = JSON.parse(text).camera;
        this.camera = makeCamera({ eye: at.eye, target: at.target,
            kind: at.kind.toUpperCase(), vfov_rad: (at.vfov_deg ?? 0) * Math.PI / 180,
            half_height: at.half_height });
        this.sent = structuredClone(this.camera);
        this.remember(this.seq);
    }

    // Sends the camera when it moved since; the newest one wins, so it never waits in a queue.
    sendCamera(force = false) {
        if (!force && (this.sent && isSame(this.sent, this.camera)))
            return false;
        if (!this.isStarted || this.isFollowing)
            return false;
        if (!force && this.connection.backlog_bytes > BACKLOG_BYTES)
            return false;
        if (!force)
            this.node = 0n;
        const { eye, target, up, kind, vfov_rad, half_height } = this.camera;
        const lens = kind === "ORTHOGRAPHIC" ? { half_height } : { vfov_rad };
        this.seq++;
        this.connection.send("view_camera", { view: VIEW, input_seq: this.seq,
            ...(this.node ? { camera: this.node } : { eye, target, up, kind, ...lens }) });
        this.sent = structuredClone(this.camera);
        this.remember(this.seq);
        return true;
    }

    // The shared camera moved: frames of this view will show it under its mover's numbers.
    takeShared(camera, seq) {
        this.camera = camera;
        this.sent = structuredClone(camera);
        this.inputs.clear();
        this.remember(Number(seq));
    }

    remember(seq) {
        this.inputs.set(seq, { time_ms: performance.now(), camera: this.sent });
        if (this.inputs.size > REMEMBERED_INPUTS)
            this.inputs.delete(this.inputs.keys().next().value);
    }

    // ---- frames --------------------------------------------------------------------------------

    onFrame({ frame, begun_ms, received_ms }) {
        if (frame.view !== VIEW)
            return;
        frame.times = { begun_ms, received_ms };
        this.painter.push(frame);
    }

    onShown(frame, { decode_ms }) {
        this.giveCredit(frame);
        this.failures.delete(frame.encoding);
        this.awaitsKey.delete(frame.encoding);
        this.frame = frame;
        const seq = Number(frame.input_seq);
        const input = this.inputs.get(seq);
        if (input)
            this.shown = input.camera;
        const now_ms = performance.now();
        const latency_ms = input && !input.seen ? now_ms - input.time_ms : null;
        const split = latency_ms === null ? null : this.split(frame, input.time_ms, now_ms);
        if (input)
            input.seen = true;
        for (const old of this.inputs.keys())
            if (old < seq)
                this.inputs.delete(old);
        this.label(frame);
        this.warp?.take(frame);
        this.reproject();
        this.dispatchEvent(new CustomEvent("shown",
            { detail: { frame, latency_ms, decode_ms, split } }));
        if (frame.settled && frame.hash)
            this.verify(frame);
    }

    // Until the frame of the newest camera is there, what is shown is the one before as that camera
    // sees it, if the settings want that. Frames themselves are shown as they are.
    reproject() {
        const { frame, camera, shown } = this;
        const isBehind = this.params.depth === 1 && frame && shown && !this.isFollowing
            && (Number(frame.input_seq) < this.seq || !isSame(this.sent, camera))
            && !isSame(shown, camera);
        const was = this.isReprojected;
        this.isReprojected = Boolean(isBehind && this.warp?.show(this.canvas, camera));
        if (was && !this.isReprojected)
            this.warp.hide();
        return this.isReprojected;
    }

    // How long ago the camera of the shown frame was the newest, in ms; null: it still is.
    get age_ms() {
        const next = this.isReprojected && this.inputs.get(Number(this.frame.input_seq) + 1);
        return next ? performance.now() - next.time_ms : null;
    }

    // A frame that cannot be decoded: a key frame is asked for, once. Those under way fail with it
    // until the key frame comes, which is the next attempt; after some of them in a row the server
    // takes the next encoding of the list. What a key frame has replaced did not fail.
    onFailed(frame, error) {
        const { encoding } = frame;
        this.giveCredit(frame);
        if (error.isReplaced || (this.awaitsKey.has(encoding) && frame.depends !== undefined))
            return;
        const count = (this.failures.get(encoding) ?? 0) + 1;
        const isOver = count >= FAILURES;
        this.failures.set(encoding, isOver ? 0 : count);
        this.awaitsKey.add(encoding);
        this.connection.send("key_frame",
            { view: VIEW, ...isOver ? { failed: enums.encoding[encoding] } : {} });
        if (isOver)
            this.trouble(error);
    }

    // Says when the frame came as well: the server holds its rate to what the network delivers.
    giveCredit({ number, times }) {
        if (this.isIdle || !times)
            return;
        const ns = (ms) => BigInt(Math.round(ms * 1000)) * 1000n;
        const { best } = this.connection;
        this.connection.send("taken", { view: VIEW, number,
            begun_ns: ns(times.begun_ms), received_ns: ns(times.received_ms), ...best ? { rtt_ns: ns(best.rtt_ms) } : {} });
    }

    // Where the time from input to picture went, in ms by stage; null: the server does not say.
    split(frame, input_ms, shown_ms) {
        const at = (field) => this.connection.toPageTime(frame[field]);
        const [came, begin, end, encoded, sent] = ["input_ns", "render_begin_ns", "render_end_ns",
            "encode_end_ns", "sent_ns"].map(at);
        if ([came, begin, end, encoded, sent].includes(null))
            return null;
        return { uplink: came - input_ms, wait: begin - came, render: end - begin,
            encode: encoded - end, send: sent - encoded,
            network: frame.times.received_ms - sent, show: shown_ms - frame.times.received_ms };
    }

    // What the canvas shows, readable for tests and scripts.
    label(frame) {
        Object.assign(this.canvas.dataset, { frame: frame.number, seq: frame.input_seq,
            revision: frame.scene_revision, samples: frame.samples, settled: frame.settled,
            encoding: frame.encoding, exact: "" });
    }

    // Are the settled pixels on the canvas those that the server rendered?
    async verify(frame) {
        const stated = hexOf(frame.hash);
        const hash = await this.painter.hash();
        if (this.frame !== frame)
            return;
        this.canvas.dataset.hash = stated;
        this.canvas.dataset.exact = hash === stated;
        this.dispatchEvent(new CustomEvent("verified", { detail: hash === stated }));
    }

    trouble(error) {
        this.dispatchEvent(new CustomEvent("trouble", { detail: error }));
    }

    // ---- questions -----------------------------------------------------------------------------

    // Position in the picture, 0..1 from the top left, to px of the newest frame.
    toPixel(x, y) {
        const { width, height } = this.canvas;
        const clamp = (v, most) => Math.max(0, Math.min(most - 1, Math.floor(v * most)));
        return { x: clamp(x, width), y: clamp(y, height) };
    }

    // What is under a place of the picture; null: nothing.
    async pick(x, y) {
        const picked = await this.connection.call("pick", { view: VIEW, ...this.toPixel(x, y) });
        return picked.hit ? picked : null;
    }

    // { position, normal, node } at a place of the frame that is shown; null: nothing. Where that frame shows a
    // state that the view has left, or it is reprojected, of the newest one.
    async surface(x, y) {
        if (!this.frame || this.isReprojected)
            return this.pick(x, y);
        try {
            const { data } = await this.connection.call("surface_query", { view: VIEW, ...this.toPixel(x, y),
                width: 1, height: 1, what: NORMAL | POSITION | NODE, frame: this.frame.number });
            return surfaceOf(data);
        } catch (error) {
            if (error.status !== "state")
                throw error;
            return this.pick(x, y);
        }
    }

    // A settled picture as a PNG file. signal (AbortSignal): the server renders nothing more for it.
    async screenshot(onProgress, signal) {
        const request = this.connection.nextRequest;
        signal.addEventListener("abort", () =>
            this.connection.call("frame_cancel", { view: VIEW, request }).catch(() => {}));
        const frame = await this.connection.call("frame_request",
            { view: VIEW, settled: true, encoding: "PNG8" }, onProgress);
        return frame.data;
    }
}
