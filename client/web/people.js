// people.js - who else is in the scene: the list of them, the camera that they share, the notes
// that they pin. A server without these messages leaves the page without them.
import { makeCamera } from "./camera.js";
import { button, dismiss, h, icon, iconButton, toast, toggleRow } from "./dom.js";
import { panelHeader } from "./panels.js";

const VIEW = 1;
const colorText = (rgb) => `#${rgb.toString(16).padStart(6, "0")}`;

export class People {
    // app: { connection, view, overlay, inspector, attempt }
    constructor(app, element, opener, onClose) {
        this.app = app;
        this.opener = opener;
        this.sessions = [];
        this.notes = new Map();
        this.shared = { holder: 0n, locked: false, waiting: [] };
        this.isFollowing = false;
        this.list = h("ul", { class: "people" });
        this.cameraText = h("p", { class: "hint", role: "status" });
        this.actions = h("div", { class: "choices" });
        this.follow = toggleRow("Follow it", (is) => app.attempt(() => this.setFollow(is)));
        this.noteList = h("ul", { class: "people" });
        element.append(panelHeader("People", onClose), this.list,
            h("div", { class: "rows" }, h("h3", { text: "Shared camera" }), this.cameraText,
                this.follow.row, this.actions),
            h("div", { class: "rows" }, h("h3", { text: "Notes" }), this.noteList));
        this.handlers = {
            participants: (b) => { this.sessions = b.sessions; this.draw(); },
            camera_state: (b) => this.onCamera(b), camera_moved: (b) => this.onMoved(b),
            annotations: (b) => this.setNotes(b.annotations),
            annotation: (b) => this.setNotes(b.annotation, true),
            annotation_removed: (b) => { this.notes.delete(b.annotation); this.drawNotes(); },
        };
        app.connection.addEventListener("message", (e) =>
            this.handlers[e.detail.name]?.(e.detail.body));
    }

    // After the scene was opened, or the session resumed.
    async watch() {
        this.isThere = await this.app.connection.call("scene_watch",
            { participants: true, camera: true, annotations: true, edits: true }).then(() => true, () => false);
        this.app.scene.setTold(this.isThere);
        this.opener.hidden = !this.isThere;
        if (this.isThere && this.isFollowing)
            await this.setFollow(true);
        this.draw();
    }

    // No other connected client may edit the scene; false where that is not known.
    isOnlyEditor() {
        return this.app.connection.call("scene_watch", { participants: true }).then(() =>
            this.sessions.every((s) => s.session === this.self || s.role === "VIEW" || s.away), () => false);
    }

    get self() {
        return this.app.connection.session;
    }

    get isHolder() {
        return this.shared.holder === this.self;
    }

    // Input moves the picture, unless another session has the camera that this view follows.
    get canMove() {
        return !this.isFollowing || this.isHolder;
    }

    // "" for who is not there, or has no name.
    knownName(session) {
        const who = this.sessions.find((s) => s.session === session);
        return who?.label || who?.name || "";
    }

    nameOf(session) {
        return session === this.self ? "you" : this.knownName(session) || `session ${session}`;
    }

    // ---- the shared camera ---------------------------------------------------------------------

    async setFollow(is) {
        await this.app.connection.call("camera_follow", { view: VIEW, follow: is });
        this.isFollowing = is;
        this.app.view.isFollowing = is && !this.isHolder;
        if (is && this.moved)
            this.onMoved(this.moved);
        if (!is)
            this.app.view.sendCamera(true);
        if (this.canMove)
            dismiss("follow");
        this.draw();
    }

    onCamera(state) {
        const { holder: before, waiting } = this.shared;
        this.shared = state;
        this.app.view.isFollowing = this.isFollowing && !this.isHolder;
        if (state.holder !== before && state.change !== "NONE"
            && (this.isFollowing || this.isHolder))
            toast(state.holder ? `The shared camera is with ${this.nameOf(state.holder)}.`
                : "The shared camera is free.", "info", null, "camera");
        if (this.canMove)
            dismiss("follow");
        this.tellAsked(waiting, state.waiting);
        this.draw();
    }

    // The holder is notified of new requests, for as long as it can answer them.
    tellAsked(before, now) {
        for (const { session } of before)
            if (!this.isHolder || !now.some((w) => w.session === session))
                dismiss(`asks ${session}`);
        for (const { session } of this.isHolder ? now : [])
            if (!before.some((w) => w.session === session))
                toast(`${this.nameOf(session)} asks for the shared camera.`, "info",
                    ["Give it", () => this.ask("camera_give", { session })], `asks ${session}`);
    }

    onMoved(moved) {
        this.moved = moved;
        if (!this.isFollowing || this.isHolder || !moved.eye)
            return;
        this.app.view.takeShared(makeCamera(moved), moved.input_seq);
    }

    ask(message, fields = {}) {
        return this.app.attempt(async () => {
            await this.app.connection.call(message, fields);
            if (message !== "camera_give" && !this.isFollowing)
                await this.setFollow(true);
        });
    }

    drawCamera() {
        const { shared, app } = this;
        const place = shared.waiting.findIndex((w) => w.session === this.self) + 1;
        this.cameraText.textContent = [shared.holder ? `With ${this.nameOf(shared.holder)}.` : "It is free.",
            shared.locked ? "Locked by an administrator." : "",
            place ? `You are number ${place} of ${shared.waiting.length} that wait for it.` : ""].filter(Boolean).join(" ");
        this.follow.set(this.isFollowing);
        const actions = [];
        if (this.isHolder)
            actions.push(button("Release", () => this.ask("camera_give")));
        else if (place)
            actions.push(button("Ask no longer", () => this.ask("camera_give")));
        else if (!shared.locked)
            actions.push(button("Ask for it", () => this.ask("camera_request")));
        const isAdmin = app.connection.role === "ADMIN";
        if (!this.isHolder && shared.holder && app.connection.canEdit && (!shared.locked || isAdmin))
            actions.push(button("Take it", () => this.ask("camera_take")));
        if (isAdmin)
            actions.push(button(shared.locked ? "Unlock" : "Lock", () => app.attempt(() =>
                app.connection.call("camera_lock", { locked: !shared.locked }))));
        this.actions.replaceChildren(...actions);
    }

    // ---- notes ---------------------------------------------------------------------------------

    setNotes(list, isChange = false) {
        if (!isChange)
            this.notes.clear();
        for (const note of list)
            this.notes.set(note.annotation, { ...note, id: note.annotation,
                color: colorText(note.color) });
        this.drawNotes();
    }

    async addNote(fields) {
        const { annotation } = await this.app.connection.call("annotation_set",
            { annotation: 0n, kind: "MARKER", ...fields });
        this.setNotes(annotation, true);
    }

    async removeNote(annotation) {
        await this.app.connection.call("annotation_remove", { annotation });
        this.notes.delete(annotation);
        this.drawNotes();
    }

    drawNotes() {
        const { overlay, inspector } = this.app;
        overlay.notes = [...this.notes.values()];
        overlay.draw();
        this.noteList.replaceChildren(...overlay.notes.map((note, i) => h("li", {},
            h("span", { class: "count", text: String(i + 1) }),
            h("button", { type: "button", class: "plain", text: note.text || "(no text)",
                on: { click: () => {
                    inspector.showNote(note);
                    inspector.goTo(note.position);
                } } }))));
        if (!overlay.notes.length)
            this.noteList.replaceChildren(
                h("li", { class: "hint", text: "No notes yet. Press N." }));
    }

    // ---- the panel -----------------------------------------------------------------------------

    draw() {
        const { shared } = this;
        this.list.replaceChildren(...this.sessions.map((s) => {
            const dot = h("span", { class: "person" }, icon("people"));
            dot.style.color = colorText(s.color);
            const give = this.isHolder && s.session !== this.self
                ? iconButton("camera", `Give the camera to ${this.nameOf(s.session)}`,
                    () => this.ask("camera_give", { session: s.session })) : null;
            const about = [s.role.toLowerCase(),
                s.session === shared.holder ? "has the camera" : "",
                shared.waiting.some((w) => w.session === s.session) ? "asks for the camera" : "", s.away ? "away" : ""]
                .filter(Boolean).join(", ");
            return h("li", {}, dot, h("span", { class: "name", text: this.nameOf(s.session) }),
                h("span", { class: "hint", text: about }), give);
        }));
        this.drawCamera();
        this.drawNotes();
    }
}
