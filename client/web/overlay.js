// overlay.js - what is drawn over the picture: measured distances, notes. Places follow the camera of the picture that is shown, not the one that was sent last.
import { length, project, sub } from "./camera.js";
import { h, metresText, svg } from "./dom.js";

const NEAR = 1e-3;

export class Overlay {
    constructor(element, canvas) {
        this.canvas = canvas;
        this.drawing = svg("svg", { class: "drawing", "aria-hidden": "true" });
        this.labels = h("div", { class: "labels" });
        element.append(this.drawing, this.labels);
        this.points = []; // of the measure, at most 2: { position, normal }
        this.notes = []; // { id, position, text, color }
        this.onNote = () => {};
    }

    // Draws anew for the camera of the shown picture.
    draw(camera) {
        this.camera = camera ?? this.camera;
        this.drawing.replaceChildren();
        this.labels.replaceChildren();
        if (!this.camera)
            return;
        const { clientWidth, clientHeight } = this.canvas;
        this.size = [clientWidth, clientHeight];
        this.drawMeasure();
        this.notes.forEach((note, i) => this.drawNote(note, i));
    }

    at(point) {
        return project(this.camera, point, ...this.size);
    }

    // A segment, cut where it goes behind the eye.
    line(a, b, type) {
        let from = this.at(a), to = this.at(b);
        if (!from && !to)
            return;
        if (!from || !to) {
            const seen = from ? a : b, other = from ? b : a;
            for (let t = 0.5, i = 0; i < 12; i++, t /= 2) {
                const cut = seen.map((v, k) => v + (other[k] - v) * t);
                const p = this.at(cut);
                if (p && p.depth > NEAR) {
                    from = this.at(seen);
                    to = p;
                    break;
                }
            }
            if (!from || !to)
                return;
        }
        this.drawing.append(svg("line",
            { class: type, x1: from.x, y1: from.y, x2: to.x, y2: to.y }));
    }

    drawMeasure() {
        const [a, b] = this.points;
        if (a && b)
            this.line(a.position, b.position, "measure");
        for (const point of this.points) {
            const p = this.at(point.position);
            if (p)
                this.drawing.append(svg("circle", { class: "measure", cx: p.x, cy: p.y, r: 5 }));
        }
        if (!a || !b)
            return;
        const middle = this.at(a.position.map((v, i) => (v + b.position[i]) / 2));
        if (middle)
            this.label(h("span", { class: "tag", text: metresText(this.distance()) }), middle);
    }

    distance() {
        const [a, b] = this.points;
        return a && b ? length(sub(b.position, a.position)) : 0;
    }

    drawNote(note, index) {
        const p = this.at(note.position);
        if (!p)
            return;
        const pin = h("button", { type: "button", class: "pin", text: String(index + 1),
            title: note.text, "aria-label": `Note ${index + 1}: ${note.text}`,
            on: { click: () => this.onNote(note) } });
        if (note.color)
            pin.style.background = note.color;
        this.label(pin, p);
    }

    label(node, { x, y }) {
        node.style.left = `${x}px`;
        node.style.top = `${y}px`;
        this.labels.append(node);
    }
}
