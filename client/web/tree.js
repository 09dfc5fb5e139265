// tree.js - the scene's nodes as a tree of which only the rows in sight are elements, so that a
// hundred thousand nodes cost no more than thirty. One tab stop; arrows, Home, End, Space, Enter.
import { h, icon, iconButton } from "./dom.js";

const ROW_PX = 30;
const MARGIN_ROWS = 6;
const INDENT_PX = 14;
const DEEPEST_INDENT = 12;

export class Tree {
    // on: { select(id), toggle(id, visible), open(id), isShown(node) }
    constructor(scene, on) {
        this.scene = scene;
        this.on = on;
        this.expanded = new Set();
        this.selected = null;
        this.filter = "";
        this.rows = [];
        this.space = h("div", { class: "tree-space" });
        this.element = h("div", { class: "tree", role: "tree", tabindex: "0",
            "aria-label": "Scene nodes",
            on: { scroll: () => this.draw(), keydown: (e) => this.key(e) } }, this.space);
        new ResizeObserver(() => this.draw()).observe(this.element);
    }

    // Lists what is expanded, or with a filter what matches and what is above it.
    update() {
        if (!this.expanded.size && !this.filter)
            this.expandFirst();
        this.rows = [];
        const wanted = this.filter ? this.matches() : null;
        const visit = (nodes, level) => nodes.forEach((node, i) => {
            if (wanted && !wanted.has(node.node))
                return;
            const isOpen = wanted ? true : this.expanded.has(node.node);
            this.rows.push({ node, level, isOpen, index: i, of: nodes.length });
            if (isOpen)
                visit(node.children, level + 1);
        });
        visit(this.scene.roots, 0);
        this.space.dataset.rows = this.rows.length;
        this.space.style.height = `${this.rows.length * ROW_PX}px`;
        this.draw();
    }

    // Opens chains of single nodes, so that the first look shows more than one word.
    expandFirst() {
        let nodes = this.scene.roots;
        for (let depth = 0; depth < 8 && nodes.length === 1; depth++) {
            this.expanded.add(nodes[0].node);
            nodes = nodes[0].children;
        }
    }

    matches() {
        const text = this.filter.toLowerCase();
        const wanted = new Set();
        for (const node of this.scene.nodes.values()) {
            if (!node.name.toLowerCase().includes(text))
                continue;
            for (let n = node; n && !wanted.has(n.node); n = this.scene.nodes.get(n.parent))
                wanted.add(n.node);
        }
        return wanted;
    }

    setFilter(text) {
        this.filter = text.trim();
        this.element.scrollTop = 0;
        this.update();
    }

    // Shows a node: opens what is above it and scrolls there.
    reveal(id) {
        this.selected = id;
        for (let n = this.scene.nodes.get(id); n; n = this.scene.nodes.get(n.parent))
            if (n.node !== id)
                this.expanded.add(n.node);
        this.update();
        this.scrollTo(this.rows.findIndex((r) => r.node.node === id));
    }

    scrollTo(index) {
        if (index < 0)
            return;
        const top = index * ROW_PX, { scrollTop, clientHeight } = this.element;
        if (top < scrollTop)
            this.element.scrollTop = top;
        else if (top + ROW_PX > scrollTop + clientHeight)
            this.element.scrollTop = top + ROW_PX - clientHeight;
        this.draw();
    }

    draw() {
        const first = Math.max(0, Math.floor(this.element.scrollTop / ROW_PX) - MARGIN_ROWS);
        const count = Math.ceil(this.element.clientHeight / ROW_PX) + 2 * MARGIN_ROWS;
        const shown = this.rows.slice(first, first + count);
        this.space.replaceChildren(...shown.map((row, i) => this.drawRow(row, first + i)));
        const at = shown.findIndex((r) => r.node.node === this.selected);
        if (at >= 0)
            this.element.setAttribute("aria-activedescendant", `node-${this.selected}`);
        else
            this.element.removeAttribute("aria-activedescendant");
    }

    drawRow(row, index) {
        const { node, level, isOpen } = row;
        const kind = node.camera ? "camera" : node.light ? "light" : node.mesh ? "mesh" : "group";
        const name = this.scene.nameOf(node.node), isShown = this.on.isShown(node);
        const element = h("div", { class: `node${isShown ? "" : " off"}`, role: "treeitem",
            id: `node-${node.node}`, "aria-level": String(level + 1),
            "aria-posinset": String(row.index + 1), "aria-setsize": String(row.of),
            "aria-selected": String(node.node === this.selected),
            "aria-expanded": node.children.length ? String(isOpen) : null,
            "aria-label": `${name}, ${kind}${isShown ? "" : ", hidden"}`,
            on: { click: () => this.select(node.node), dblclick: () => this.on.open(node.node) } },
        h("span", { class: "twist", on: { click: (e) => this.twist(e, node) } },
            node.children.length ? icon("chevron") : ""),
        icon(kind), h("span", { class: "name", text: name }));
        const eye = iconButton(isShown ? "eye" : "eye-off",
            isShown ? `Hide ${name}` : `Show ${name}`,
            (e) => { e.stopPropagation(); this.on.toggle(node.node, !isShown); },
            { tabindex: "-1", "aria-hidden": "true" });
        element.append(eye);
        element.style.top = `${index * ROW_PX}px`;
        element.style.paddingLeft = `${6 + Math.min(level, DEEPEST_INDENT) * INDENT_PX}px`;
        return element;
    }

    twist(event, node) {
        event.stopPropagation();
        this.setOpen(node, !this.expanded.has(node.node));
    }

    setOpen(node, isOpen) {
        if (isOpen)
            this.expanded.add(node.node);
        else
            this.expanded.delete(node.node);
        this.update();
    }

    select(id) {
        this.selected = id;
        this.draw();
        this.on.select(id);
    }

    key(event) {
        const at = this.rows.findIndex((r) => r.node.node === this.selected);
        const row = this.rows[at];
        const go = (index) => {
            const to = Math.max(0, Math.min(this.rows.length - 1, index));
            if (this.rows[to]) {
                this.select(this.rows[to].node.node);
                this.scrollTo(to);
            }
        };
        const page = Math.max(1, Math.floor(this.element.clientHeight / ROW_PX) - 1);
        const moves = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: this.rows.length - 1,
            PageDown: at + page, PageUp: at - page };
        if (event.key in moves)
            go(moves[event.key]);
        else if (event.key === "ArrowRight" && row?.node.children.length)
            row.isOpen ? go(at + 1) : this.setOpen(row.node, true);
        else if (event.key === "ArrowLeft" && row)
            row.isOpen && row.node.children.length ? this.setOpen(row.node, false)
                : go(this.rows.findIndex((r) => r.node.node === row.node.parent));
        else if (event.key === " " && row)
            this.on.toggle(row.node.node, !this.on.isShown(row.node));
        else if (event.key === "Enter" && row)
            this.on.open(row.node.node);
        else
            return;
        event.preventDefault();
    }
}
