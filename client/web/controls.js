// controls.js - mouse, touch, keyboard and gamepad to movements of a camera.
// Nothing is sent here: what moved is read from the camera once per animation frame.
import { distance, dolly, look, move, orbit, pan } from "./camera.js";

const TURN_RAD_PER_PX = 0.005;
const WHEEL_PER_PX = 0.0015;
const CLICK_PX = 6;
const CLICK_MS = 450;
const DOUBLE_MS = 350;
const DEAD_ZONE = 0.15;
const KEY_TURN_RAD_S = 1.2;
const TAP_S = 1 / 30; // that a key counts for at least, however soon it is up again

// Keys by their place on the keyboard: what they do while they are held.
const HELD = {
    KeyW: [0, 0, 1], KeyS: [0, 0, -1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0],
    KeyE: [0, 1, 0], KeyQ: [0, -1, 0], PageUp: [0, 1, 0], PageDown: [0, -1, 0],
};
const TURNS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
// Buttons of a gamepad (standard mapping) to keys, as in helio view; B is the next style.
const PAD_KEYS = { 0: () => "KeyF", 1: (mode) => NEXT_STYLE[mode], 2: () => "KeyP", 8: () => "KeyT" };
const NEXT_STYLE = { orbit: "KeyG", fly: "KeyK", walk: "KeyO" };
const ZOOMS = { Equal: -1, NumpadAdd: -1, Minus: 1, NumpadSubtract: 1 };

export class Controls {
    // on: { change(), pick(x, y), focus(x, y), key(event) -> taken }; x, y: 0..1 of the element.
    constructor(element, getCamera, on) {
        this.element = element;
        this.getCamera = getCamera;
        this.on = on;
        this.mode = "orbit";
        this.speed_mps = 1;
        this.held = new Set();
        this.tapped = new Set(); // since the last animation frame
        this.pointers = new Map();
        this.lastClick_ms = 0;
        this.hasPad = false;
        this.padHeld = new Set(); // buttons of it that are pressed
        this.listen();
    }

    listen() {
        const { element } = this;
        const listen = (type, handler, options) =>
            element.addEventListener(type, (e) => handler.call(this, e), options);
        listen("pointerdown", this.pointerDown);
        listen("pointermove", this.pointerMove);
        listen("pointerup", this.pointerUp);
        listen("pointercancel", this.pointerUp);
        listen("wheel", this.wheel, { passive: false });
        listen("contextmenu", (e) => e.preventDefault());
        listen("keydown", this.keyDown);
        listen("keyup", (e) => this.held.delete(e.code));
        listen("blur", () => this.held.clear());
        addEventListener("gamepadconnected", () => {
            this.hasPad = true;
            this.on.change();
        });
    }

    get isFlying() {
        return this.mode !== "orbit";
    }

    // ---- pointers ------------------------------------------------------------------------------

    place(event) {
        const box = this.element.getBoundingClientRect();
        return { x: (event.clientX - box.left) / box.width,
            y: (event.clientY - box.top) / box.height, aspect: box.width / box.height };
    }

    pointerDown(event) {
        this.element.setPointerCapture(event.pointerId);
        this.element.focus({ preventScroll: true });
        this.pointers.set(event.pointerId,
            { x: event.clientX, y: event.clientY, startX: event.clientX, startY: event.clientY,
                start_ms: event.timeStamp, button: event.button, moved: false });
        if (this.pointers.size > 1)
            this.pointers.forEach((p) => { p.moved = true; });
    }

    pointerMove(event) {
        const pointer = this.pointers.get(event.pointerId);
        if (!pointer)
            return;
        const dx = event.clientX - pointer.x, dy = event.clientY - pointer.y;
        if (!pointer.moved && Math.hypot(event.clientX - pointer.startX,
            event.clientY - pointer.startY) < CLICK_PX)
            return;
        pointer.moved = true;
        const before = this.gesture();
        pointer.x = event.clientX;
        pointer.y = event.clientY;
        if (this.pointers.size === 1)
            this.drag(pointer, dx, dy, event.shiftKey);
        else
            this.pinch(before, this.gesture());
        this.on.change();
    }

    drag(pointer, dx, dy, shift) {
        const camera = this.getCamera();
        if (pointer.button > 0 || shift)
            pan(camera, dx, dy, this.element.clientHeight);
        else if (this.isFlying)
            look(camera, -dx * TURN_RAD_PER_PX, -dy * TURN_RAD_PER_PX);
        else
            orbit(camera, -dx * TURN_RAD_PER_PX, dy * TURN_RAD_PER_PX);
    }

    // Middle and spread of the fingers.
    gesture() {
        const all = [...this.pointers.values()];
        const x = all.reduce((s, p) => s + p.x, 0) / all.length;
        const y = all.reduce((s, p) => s + p.y, 0) / all.length;
        const spread = all.reduce((s, p) => s + Math.hypot(p.x - x, p.y - y), 0) / all.length;
        return { x, y, spread, count: all.length };
    }

    // Two fingers move and zoom the picture, three go ahead and sideways.
    pinch(before, after) {
        const camera = this.getCamera();
        const dx = after.x - before.x, dy = after.y - before.y;
        if (after.count > 2) {
            const metres = 2 * this.step_m() / this.element.clientHeight;
            move(camera, dx * metres, 0, -dy * metres, this.mode === "walk");
            return;
        }
        pan(camera, dx, dy, this.element.clientHeight);
        if (before.spread > 0 && after.spread > 0)
            this.zoom(before.spread / after.spread, after.x, after.y);
    }

    zoom(factor, clientX, clientY) {
        const { x, y, aspect } = this.place({ clientX, clientY });
        const limited = Math.max(0.2, Math.min(5, factor));
        if (this.isFlying && this.getCamera().kind === "PERSPECTIVE")
            move(this.getCamera(), 0, 0, (1 - limited) * this.step_m(), this.mode === "walk");
        else
            dolly(this.getCamera(), limited, 2 * x - 1, 1 - 2 * y, aspect);
    }

    pointerUp(event) {
        const pointer = this.pointers.get(event.pointerId);
        this.pointers.delete(event.pointerId);
        if (!pointer || pointer.moved || event.type === "pointercancel" || pointer.button !== 0
            || event.timeStamp - pointer.start_ms > CLICK_MS)
            return;
        const { x, y } = this.place(event);
        const isDouble = event.timeStamp - this.lastClick_ms < DOUBLE_MS;
        this.lastClick_ms = isDouble ? 0 : event.timeStamp;
        if (isDouble)
            this.on.focus(x, y);
        else
            this.on.pick(x, y);
    }

    wheel(event) {
        event.preventDefault();
        const px = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
        this.zoom(Math.exp(px * WHEEL_PER_PX), event.clientX, event.clientY);
        this.on.change();
    }

    // ---- keys ----------------------------------------------------------------------------------

    keyDown(event) {
        if (event.ctrlKey || event.metaKey || event.altKey)
            return;
        if (event.code in HELD || event.code in TURNS || event.code in ZOOMS) {
            this.held.add(event.code);
            if (!event.repeat)
                this.tapped.add(event.code);
            this.isShifted = event.shiftKey;
            event.preventDefault();
            this.on.change();
        } else if (!event.repeat && this.on.key(event)) {
            event.preventDefault();
        }
    }

    // Metres that one second of flying, or a turn of the wheel, is worth.
    step_m() {
        return this.mode === "walk" ? Math.max(this.speed_mps, 1e-6)
            : Math.max(this.speed_mps, distance(this.getCamera()) * 0.25);
    }

    // ---- once per animation frame --------------------------------------------------------------

    // Moves by what is held for dt_s; true while something is, or a gamepad is to be read again (isResting:
    // nothing of it is held).
    tick(dt_s) {
        const keys = this.tickKeys(dt_s);
        this.padRests = true;
        const pad = this.hasPad && this.tickPad(dt_s);
        this.isResting = !keys && this.padRests;
        return keys || pad;
    }

    tickKeys(dt_s) {
        if (!this.held.size && !this.tapped.size)
            return false;
        const camera = this.getCamera();
        const go = [0, 0, 0];
        if (this.tapped.size)
            dt_s = Math.max(dt_s, TAP_S);
        for (const code of new Set([...this.held, ...this.tapped])) {
            (HELD[code] ?? []).forEach((v, i) => { go[i] += v; });
            if (code in TURNS)
                this.turnByKey(camera, TURNS[code], dt_s);
            if (code in ZOOMS)
                dolly(camera, Math.exp(ZOOMS[code] * 1.5 * dt_s));
        }
        if (go.some((v) => v !== 0)) {
            const metres = this.step_m() * dt_s * (this.isShifted ? 4 : 1);
            move(camera, go[0] * metres, go[1] * metres, go[2] * metres, this.mode === "walk");
        }
        this.tapped.clear();
        return true;
    }

    turnByKey(camera, [x, y], dt_s) {
        const angle = KEY_TURN_RAD_S * dt_s;
        const px = this.element.clientHeight * 0.5 * dt_s;
        if (this.isShifted)
            pan(camera, -x * px, y * px, this.element.clientHeight);
        else if (this.isFlying)
            look(camera, -x * angle, y * angle);
        else
            orbit(camera, x * angle, y * angle);
    }

    // A button counts once, when it goes down.
    padButtons({ buttons }) {
        for (const [index, keyOf] of Object.entries(PAD_KEYS)) {
            const isDown = Boolean(buttons[index]?.pressed);
            if (isDown && !this.padHeld.has(index))
                this.on.key({ code: keyOf(this.mode), key: "" });
            this.padHeld[isDown ? "add" : "delete"](index);
        }
    }

    // Sticks: left goes, right turns; triggers sink and rise.
    tickPad(dt_s) {
        const pad = navigator.getGamepads?.().find((p) => p?.connected);
        if (!pad)
            return false;
        const stick = (i) => {
            const v = pad.axes[i] ?? 0;
            return Math.abs(v) < DEAD_ZONE ? 0 : v;
        };
        const rise = (pad.buttons[7]?.value ?? 0) - (pad.buttons[6]?.value ?? 0);
        const turn = [stick(2), stick(3)].map((v) => v * 2 * dt_s);
        const isStill = !rise && [0, 1, 2, 3].every((i) => stick(i) === 0);
        this.padButtons(pad);
        this.padRests = isStill;
        if (isStill)
            return true;
        const camera = this.getCamera();
        if (this.isFlying)
            look(camera, -turn[0], -turn[1]);
        else
            orbit(camera, -turn[0], turn[1]);
        const metres = this.step_m() * dt_s;
        move(camera, stick(0) * metres, rise * metres, -stick(1) * metres, this.mode === "walk");
        return true;
    }
}

