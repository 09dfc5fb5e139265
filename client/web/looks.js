// looks.js - how this view alone shows the scene: what is selected or hidden, variants, and clipping planes
// with the panel section that sets them. The scene stays as it is.
import { h, metresText, section, selectRow, sliderRow, toggleRow } from "./dom.js";

const VIEW = 1;
const AXES = ["X", "Y", "Z"];
const STEPS = 1000; // of a slider along the scene
const HIDDEN = 1, SELECTED = 4; // properties of a node_override
const CAPS = [["MATERIAL", "Material"], ["HATCH", "Hatched"], ["COLOR", "Colour"], ["NONE", "None"]];
const LATER_MS = 60;

export class Looks {
    // onError(error): a change was refused.
    constructor(connection, view, scene, onError) {
        this.connection = connection;
        this.view = view;
        this.scene = scene;
        this.onError = onError;
        this.selected = null;
        this.hidden = new Set(); // nodes
        this.variants = new Map(); // asset -> its variant in place of the scene's
        this.cuts = AXES.map(() => ({ isOn: false, share: 0.5, isFlipped: false }));
        this.caps = "MATERIAL";
        this.box = null; // of the scene: { min, max }
        this.timer = 0; // planes are about to be sent
        view.addEventListener("started", () => this.onStarted());
    }

    // A view that was made anew shows everything.
    onStarted() {
        if (this.selected !== null || this.hidden.size)
            this.sendOverrides();
        for (const asset of this.variants.keys())
            this.sendVariant(asset);
        if (this.cuts.some((c) => c.isOn))
            this.sendClip();
    }

    // For restore, in a page that goes on with this view.
    get state() {
        const { cuts, caps, box, selected } = this;
        return { cuts, caps, box, selected: selected === null ? null : String(selected), hidden: [...this.hidden].map(String),
            variants: [...this.variants] };
    }

    restore({ cuts, caps, box, selected, hidden, variants }) {
        Object.assign(this, { cuts, caps, box, selected: selected === null ? null : BigInt(selected),
            hidden: new Set(hidden.map(BigInt)), variants: new Map(variants) });
        this.capRow?.set(caps);
        this.update();
    }

    async call(name, fields) {
        if (!this.view.isStarted)
            return;
        try {
            await this.connection.call(name, { view: VIEW, ...fields });
        } catch (error) {
            if (error.status !== "closed")
                this.onError(error);
        }
    }

    // ---- nodes and variants --------------------------------------------------------------------

    // Outlines a node and what is below it; null: nothing.
    select(node) {
        if (node === this.selected)
            return;
        this.selected = node;
        this.sendOverrides();
    }

    // Hides a node and what is below it, or shows it again.
    setHidden(node, isHidden) {
        this.hidden[isHidden ? "add" : "delete"](node);
        return this.sendOverrides();
    }

    sendOverrides() {
        const { nodes: known } = this.scene; // none before they are listed
        const there = [...this.hidden].filter((node) => !known.size || known.has(node));
        const nodes = new Set(this.selected === null ? there : [...there, this.selected]);
        const overrides = [...nodes].map((node) => {
            const hidden = this.hidden.has(node), selected = node === this.selected;
            return { node, set: (hidden && HIDDEN) | (selected && SELECTED), hidden, selected, tint: [0, 0, 0, 0], alpha: 1 };
        });
        return this.call("view_overrides", { overrides, clear: true });
    }

    // null: that of the scene.
    setVariant(asset, variant) {
        if (variant === null)
            this.variants.delete(asset);
        else
            this.variants.set(asset, variant);
        return this.sendVariant(asset);
    }

    sendVariant(asset) {
        const variant = this.variants.get(asset);
        return this.call("view_variant", { asset, ...variant === undefined ? {} : { variant } });
    }

    // ---- clipping planes -----------------------------------------------------------------------

    // Where a cut is along its axis, in metres.
    place(axis) {
        const { min, max } = this.box ?? { min: [0, 0, 0], max: [0, 0, 0] };
        return min[axis] + (max[axis] - min[axis]) * this.cuts[axis].share;
    }

    planes() {
        return this.cuts.flatMap(({ isOn, isFlipped }, axis) => {
            if (!isOn || !this.box)
                return [];
            const sign = isFlipped ? 1 : -1;
            return [{ normal: AXES.map((_, i) => i === axis ? sign : 0),
                distance: sign * this.place(axis) }];
        });
    }

    sendClip() {
        return this.call("view_clip", { planes: this.planes(), caps: this.caps });
    }

    // A change of a cut; the planes stay where they are in metres when the scene grows.
    change(axis, changes) {
        Object.assign(this.cuts[axis], changes);
        this.update();
        clearTimeout(this.timer);
        const timer = setTimeout(async () => {
            if (!this.box)
                await this.measure();
            if (this.timer !== timer)
                return; // changed meanwhile
            this.update();
            this.sendClip();
            this.timer = 0;
        }, LATER_MS);
        this.timer = timer;
    }

    async measure() {
        const box = await this.scene.bounds(0n).catch(() => null);
        this.box = box && !box.empty ? { min: box.min, max: box.max } : null;
    }

    // Another scene: its box is asked for again, and nothing of it is cut or hidden.
    reset() {
        this.hidden.clear();
        this.variants.clear();
        const wasCut = this.cuts.some((c) => c.isOn);
        this.cuts.forEach((cut) => Object.assign(cut, { isOn: false, share: 0.5 }));
        this.box = null;
        this.update();
        if (wasCut)
            this.sendClip();
    }

    // ---- the section of the panel --------------------------------------------------------------

    section() {
        this.rows = AXES.map((name, axis) => this.axisRows(name, axis));
        this.capRow = selectRow("Cut solids", CAPS, (caps) => {
            this.caps = caps;
            this.sendClip();
        });
        const rows = section("Clipping", false,
            ...this.rows.flatMap((r) => [r.on.row, r.at.row, r.flip.row]), this.capRow.row,
            h("p", { class: "hint", text: "Only this view is cut." }));
        this.update();
        return rows;
    }

    axisRows(name, axis) {
        return {
            on: toggleRow(`Cut along ${name}`, (isOn) => this.change(axis, { isOn })),
            at: sliderRow(`${name}`, { min: 0, max: STEPS, step: 1,
                format: () => metresText(this.place(axis)) },
            (v) => this.change(axis, { share: v / STEPS })),
            flip: toggleRow(`Other side of ${name}`,
                (isFlipped) => this.change(axis, { isFlipped })),
        };
    }

    update() {
        this.rows?.forEach((row, axis) => {
            const { isOn, share, isFlipped } = this.cuts[axis];
            row.on.set(isOn);
            row.at.set(share * STEPS);
            row.flip.set(isFlipped);
            row.at.row.hidden = row.flip.row.hidden = !isOn;
        });
        if (this.capRow)
            this.capRow.row.hidden = !this.cuts.some((c) => c.isOn);
    }
}
