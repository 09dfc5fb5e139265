// inspect.js - what is under the pointer: selecting, measuring between two points, pinning notes;
// and the card that shows it.
import { ask, announce, button, h, iconButton, metresText, toast } from "./dom.js";

const TOOLS = { measure: "Measure", note: "Note" };
const NEARER = 0.6; // of the distance, when the camera goes to a place
const NOTE_BYTES = 2000;

const definitions = (rows) => h("dl", {}, ...rows.flatMap(([name, value]) =>
    [h("dt", { text: name }), h("dd", { text: value })]));
const vector = (v) => v.map((n) => n.toFixed(3).replace(/^-(0\.0+)$/, "$1")).join(", ");

function angle_deg(a, b) {
    const cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return Math.acos(Math.max(-1, Math.min(1, cosine))) * 180 / Math.PI;
}

export class Inspector {
    // app: { view, looks, scene, overlay, people, connection, panels, scenePanel, fly, fit, setVisible,
    // attempt }
    constructor(app, card, canvas) {
        this.app = app;
        this.card = card;
        this.canvas = canvas;
        this.tool = "select";
        this.selection = null; // { id, picked, size }
        this.buttons = Object.entries(TOOLS).map(([tool, label]) =>
            iconButton(tool, label, () => this.toggleTool(tool),
                { data: { tool }, "aria-pressed": "false" }));
        app.overlay.onNote = (note) => this.showNote(note);
    }

    toggleTool(tool) {
        this.setTool(this.tool === tool ? "select" : tool);
    }

    setTool(tool) {
        this.tool = tool;
        this.canvas.dataset.tool = tool;
        for (const b of this.buttons)
            b.setAttribute("aria-pressed", String(b.dataset.tool === tool));
        this.app.overlay.points = [];
        this.app.overlay.draw();
        if (tool === "measure")
            announce("Pick two points to measure between them.");
        if (tool === "note")
            announce("Pick the place of the note.");
        this.showCard();
    }

    async pick(x, y) {
        await this.app.attempt(async () => {
            const { tool, app: { view } } = this;
            const picked = await (tool === "select" ? view.pick(x, y) : view.surface(x, y));
            if (tool !== this.tool)
                return;
            if (tool === "measure")
                this.measure(picked);
            else if (tool === "note")
                await this.pinNote(picked);
            else if (picked)
                await this.select(picked.node, picked);
            else
                this.clear();
        });
    }

    measure(picked) {
        const { overlay } = this.app;
        if (!picked) {
            toast("There is nothing to measure there.");
            return;
        }
        overlay.points = overlay.points.length >= 2 ? [picked] : [...overlay.points, picked];
        overlay.draw();
        this.showCard();
    }

    // The camera goes to what is under a place and turns around it from then on.
    async focusAt(x, y) {
        await this.app.attempt(async () => {
            const picked = await this.app.view.pick(x, y);
            if (picked)
                this.goTo(picked.position);
        });
    }

    goTo(position) {
        const to = structuredClone(this.app.view.camera);
        to.eye = position.map((v, i) => v + (to.eye[i] - to.target[i]) * NEARER);
        to.target = position;
        this.app.fly(to);
    }

    // ---- selection -----------------------------------------------------------------------------

    async select(id, picked = null) {
        const { scene, panels, scenePanel, looks } = this.app;
        this.selection = { id, picked };
        looks.select(id);
        if (panels.isOpen("scene") && scene.nodes.has(id) && scenePanel.tree.selected !== id)
            scenePanel.tree.reveal(id);
        announce(`${scene.nameOf(id)} selected`);
        this.showCard();
        const box = await scene.bounds(id).catch(() => null);
        if (this.selection?.id !== id || !box || box.empty)
            return;
        this.selection.size = box.max.map((v, i) => v - box.min[i]);
        this.showCard();
    }

    clear() {
        const { looks, scenePanel } = this.app;
        this.selection = null;
        this.note = null;
        looks.select(null);
        scenePanel.tree.selected = null;
        scenePanel.tree.draw();
        this.showCard();
    }

    // Another scene: nothing is selected, and no place of the old one picked.
    reset() {
        this.app.overlay.points = [];
        this.app.overlay.draw();
        this.clear();
    }

    // Takes back one thing; false: there was nothing.
    escape() {
        if (this.tool !== "select")
            this.setTool("select");
        else if (this.selection || this.note)
            this.clear();
        else
            return false;
        return true;
    }

    // ---- the card ------------------------------------------------------------------------------

    showCard() {
        const content = this.tool === "measure" ? this.measureCard()
            : this.tool === "note" ? this.pinCard()
            : this.note ? this.noteCard() : this.selectionCard();
        this.card.hidden = !content;
        this.card.replaceChildren(...content ?? []);
    }

    head(title, onClose) {
        return h("header", {}, h("h2", { text: title }), iconButton("close", "Close", onClose));
    }

    measureCard() {
        const [a, b] = this.app.overlay.points;
        const rows = a && b ? [["Distance", metresText(this.app.overlay.distance())],
            ["Along X, Y, Z", [0, 1, 2].map((i) =>
                metresText(b.position[i] - a.position[i])).join(", ")],
            ["Between surfaces", `${angle_deg(a.normal, b.normal).toFixed(1)}°`]]
            : [["Picked", a ? "1 of 2 points" : "none yet: pick two points"]];
        if (a && b)
            announce(`Distance ${rows[0][1]}`);
        return [this.head("Measure", () => this.setTool("select")), definitions(rows)];
    }

    pinCard() {
        return [this.head("Note", () => this.setTool("select")),
            h("p", { class: "hint", text: "Pick the place that the note is about." })];
    }

    selectionCard() {
        if (!this.selection)
            return null;
        const { app } = this;
        const { id, picked, size } = this.selection;
        const rows = size ? [["Size", size.map(metresText).join(" × ")]] : [];
        if (picked)
            rows.push(["Place", vector(picked.position)], ["Normal", vector(picked.normal)],
                ["Texture", vector(picked.uv)],
                ["Part, triangle", `${picked.part}, ${picked.triangle}`],
                ["Distance", metresText(picked.distance)]);
        const isVisible = app.isShown(id);
        const here = app.connection.canEdit ? "" : " here";
        return [this.head(app.scene.nameOf(id), () => this.clear()), definitions(rows),
            h("div", { class: "choices" }, button("Zoom to it", () => app.fit(id)),
                button(`${isVisible ? "Hide" : "Show"}${here}`, () => app.setVisible(id, !isVisible)),
                button("In the tree", () => {
                    app.panels.set("scene", true);
                    app.scenePanel.tree.reveal(id);
                }))];
    }

    // ---- notes ---------------------------------------------------------------------------------

    async pinNote(picked) {
        if (!picked) {
            toast("There is nothing to pin a note to.");
            return;
        }
        const area = h("textarea", { class: "text area", id: "note", maxlength: NOTE_BYTES,
            autofocus: true });
        const answer = await ask("Note", h("div", { class: "body" },
            h("label", { for: "note", text: "Everyone who looks at the scene sees it." }), area),
        [["Cancel", "cancel"], ["Pin it", "pin"]]);
        const text = area.value.trim();
        this.setTool("select");
        if (answer === "pin" && text)
            await this.app.people.addNote({ position: picked.position, normal: picked.normal,
                node: picked.node, text });
    }

    showNote(note) {
        this.note = note;
        this.showCard();
        announce(`Note by ${note.author}: ${note.text}`);
    }

    noteCard() {
        const { note, app } = this;
        const close = () => { this.note = null; this.showCard(); };
        const remove = () => app.attempt(async () => {
            await app.people.removeNote(note.annotation);
            close();
        });
        const when = new Date(Number(note.time_ms)).toLocaleString();
        return [this.head("Note", close), h("p", { text: note.text }),
            definitions([["By", note.label || note.author], ["When", when]]),
            h("div", { class: "choices" }, button("Go there", () => this.goTo(note.position)),
                button("Remove", remove, { disabled: !note.own && !app.connection.canEdit }))];
    }
}
