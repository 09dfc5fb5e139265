// shell.js - the frame around the picture: bar, tools, status, sheets, and the dialogs that need
// nothing but words.
import { announce, ask, h, icon, iconButton } from "./dom.js";

export const VIEWS = [["Default", "0", {}], ["Front", "1", [0, 0]], ["Right", "2", [90, 0]],
    ["Back", "3", [180, 0]], ["Left", "4", [-90, 0]], ["Top", "5", [0, 90]],
    ["Bottom", "6", [0, -90]], ["Isometric", "7", [45, 35.26]]];

const KEYS = [["Arrow keys", "turn; with Shift move"],
    ["W A S D, Q E", "go ahead, sideways, down, up"],
    ["+ −", "zoom"], ["O G K", "orbit, fly, walk"], ["F", "show everything"],
    ["Shift F", "show what is selected"],
    ["1 … 7, 0", "front, right, back, left, top, bottom, isometric, default"],
    ["Enter", "pick what is in the middle"], ["M", "measure: two picks"], ["N", "note"],
    ["P", "real time or path traced"], ["Space", "play or pause"], ["C", "scene panel"],
    ["V", "view panel"], ["T", "statistics"], ["Esc", "clear, or close a panel"]];
const GESTURES = [["Drag, one finger", "turn"], ["Right drag, two fingers", "move; pinch to zoom"],
    ["Three fingers", "go ahead and sideways"], ["Wheel", "zoom to the pointer"],
    ["Click", "pick"], ["Double click", "turn around that place"],
    ["Gamepad", "sticks go and look, triggers sink and rise; A shows everything, B next style, X path traced, Back statistics"]];

export function showHelp() {
    const list = (rows) => h("dl", { class: "keys" }, ...rows.flatMap(([key, text]) =>
        [h("dt", {}, h("kbd", { text: key })), h("dd", { text })]));
    const title = (text) => h("h3", { text });
    const body = { class: "body", tabindex: "0", role: "group", "aria-label": "Keys" };
    return ask("Controls", h("div", body, title("Keys, when the picture has the focus"),
        list(KEYS), title("Mouse and touch"), list(GESTURES)), [["Close", "close"]]);
}

// A token for a server that asks for one; null: given up.
export async function askToken(reason) {
    const input = h("input", { class: "text", type: "password", id: "token", autocomplete: "off",
        "aria-describedby": "token-error", autofocus: true });
    const body = h("div", { class: "body" },
        h("label", { for: "token", text: "This server needs an access token or a join ticket." }),
        input,
        h("p", { id: "token-error", class: "error-text", role: "alert", text: reason ?? "" }));
    const answer = await ask("Sign in", body, [["Cancel", "cancel"], ["Sign in", "go"]]);
    return answer === "go" ? input.value.trim() : null;
}

// ---- panels ------------------------------------------------------------------------------------

const isNarrow = () => matchMedia("(max-width: 719px)").matches;

const GAP_PX = 10; // --gap of style.css
const FREE_LEAST = 0.3;
const MESSAGE_PX = 240; // as wide as messages are at least

// Panels stand beside each other as long as there is room; then those opened first give way.
export class Panels {
    // shell: the element that holds them, and tools at the bottom
    constructor(shell, tools, onChange) {
        this.shell = shell;
        this.tools = tools;
        this.items = new Map(); // name -> { panel, opener }
        this.open = []; // names, the newest last
        this.onChange = onChange;
        addEventListener("resize", () => this.makeRoom());
    }

    add(name, panel, opener) {
        opener.setAttribute("aria-expanded", "false");
        opener.setAttribute("aria-controls", panel.id);
        this.items.set(name, { panel, opener });
        panel.addEventListener("keydown", (e) => {
            if (e.key === "Escape") {
                e.stopPropagation();
                this.set(name, false);
                opener.focus();
            }
        });
    }

    isOpen(name) {
        return !this.items.get(name).panel.hidden;
    }

    set(name, isOpen) {
        const { panel, opener } = this.items.get(name);
        panel.hidden = !isOpen;
        opener.setAttribute("aria-expanded", String(isOpen));
        this.open = this.open.filter((other) => other !== name);
        if (isOpen)
            this.open.push(name);
        this.makeRoom();
        this.onChange(name, isOpen);
    }

    // What is left of the window's width.
    get rest_px() {
        return this.open.reduce((rest, name) =>
            rest - this.items.get(name).panel.offsetWidth - GAP_PX, innerWidth - GAP_PX);
    }

    makeRoom() {
        while (this.open.length > 1 && (isNarrow() || this.rest_px < 0))
            this.set(this.open[0], false);
        this.shell.classList.toggle("tight", !isNarrow() && this.open.length > 0
            && this.rest_px < this.tools.offsetWidth + 2 * GAP_PX);
        this.placeMessages();
    }

    // Messages stand between the panels, and where that is too narrow at their lower ends.
    placeMessages() {
        const isCrowded = !isNarrow() && this.rest_px < MESSAGE_PX + GAP_PX;
        const { classList, style } = document.body;
        classList.toggle("crowded", isCrowded);
        for (const side of ["left", "right"]) {
            const shown = this.shell.querySelectorAll(`.side.${side} > .panel:not([hidden])`);
            const taken_px = isNarrow() || isCrowded ? 0
                : [...shown].reduce((sum, panel) => sum + panel.offsetWidth + GAP_PX, 0);
            style.setProperty(`--taken-${side}`, `${taken_px}px`);
        }
    }

    // The part of the picture that nothing covers, as shares of its width and height; of each at least FREE_LEAST is
    // taken to be free, beginning where most is.
    free(canvas) {
        const box = canvas.getBoundingClientRect();
        const edge = { left: box.left, right: box.right, top: box.top, bottom: box.bottom };
        const isShown = (e) => e.checkVisibility({ visibilityProperty: true });
        for (const panel of [...this.shell.querySelectorAll(".panel")].filter(isShown)) {
            const { left, right, top } = panel.getBoundingClientRect();
            if (isNarrow())
                edge.bottom = Math.min(edge.bottom, top);
            else if (panel.parentNode.matches(".left"))
                edge.left = Math.max(edge.left, right);
            else
                edge.right = Math.min(edge.right, left);
        }
        for (const part of [...this.shell.querySelectorAll("#dock > *")].filter(isShown))
            edge.bottom = Math.min(edge.bottom, part.getBoundingClientRect().top);
        const span = (from, to, first, size) => {
            if (!size)
                return [0, 1];
            const begin = Math.max(0, (from - first) / size), end = Math.min(1, (to - first) / size);
            return end - begin >= FREE_LEAST ? [begin, end]
                : begin > 1 - end ? [1 - FREE_LEAST, 1] : [0, FREE_LEAST];
        };
        return { x: span(edge.left, edge.right, box.left, box.width), y: span(edge.top, edge.bottom, box.top, box.height) };
    }

    toggle(name) {
        this.set(name, !this.isOpen(name));
    }

    // Closes the newest of the open panels; false: none was open.
    closeOne() {
        const name = this.open.at(-1);
        if (name)
            this.set(name, false);
        return Boolean(name);
    }
}

// ---- a menu that a button opens ----------------------------------------------------------------

// items: [text, icon or null, key or "", action]; made anew whenever it opens.
export function menuButton(name, label, items, props = {}) {
    const opener = iconButton(name, label, () => toggle(), { "aria-haspopup": "menu",
        "aria-expanded": "false", ...props });
    let popup = null;
    const close = () => {
        popup?.remove();
        popup = null;
        opener.setAttribute("aria-expanded", "false");
    };
    const act = (action) => { close(); opener.focus(); action(); };
    const open = () => {
        popup = h("div", { class: "popup", role: "menu", "aria-label": label, popover: "auto",
            on: { toggle: (e) => e.newState === "closed" && close(), keydown: step } },
        ...items().map(([text, picture, key, action]) => h("button", { type: "button",
            role: "menuitem", on: { click: () => act(action) } },
        picture ? icon(picture) : "", h("span", { text }),
        h("span", { class: "key", text: key }))));
        document.body.append(popup);
        popup.showPopover();
        place(popup, opener);
        opener.setAttribute("aria-expanded", "true");
        popup.firstElementChild.focus();
    };
    const toggle = () => popup ? close() : open();
    return opener;
}

function step(event) {
    const all = [...event.currentTarget.children];
    const at = all.indexOf(document.activeElement);
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!by)
        return;
    event.preventDefault();
    all[(at + by + all.length) % all.length].focus();
}

function place(popup, opener) {
    const at = opener.getBoundingClientRect(), box = popup.getBoundingClientRect();
    const left = Math.max(8, Math.min(at.left, innerWidth - box.width - 8));
    const below = at.bottom + 6 + box.height < innerHeight;
    popup.style.left = `${left}px`;
    popup.style.top = `${below ? at.bottom + 6 : Math.max(8, at.top - box.height - 6)}px`;
}

// ---- status and curtain ------------------------------------------------------------------------

export class Status {
    constructor(element) {
        this.element = element;
        this.words = element.querySelector(".words");
    }
    set(state, text, title = "") {
        this.element.dataset.state = state;
        this.words.textContent = text;
        this.element.title = title;
    }
}

// What covers the picture while there is no connection, or no session.
export class Curtain {
    constructor(element) {
        this.element = element;
    }
    show(title, text, action = null) {
        const key = `${title}|${action?.[0]}`;
        if (this.key !== key) {
            this.key = key;
            this.text = h("p", {});
            const parts = [h("h2", { text: title }), this.text];
            if (action)
                parts.push(h("button", { type: "button", class: "button primary", text: action[0],
                    on: { click: action[1] } }));
            this.element.replaceChildren(...parts);
            announce(`${title}. ${text}`);
        }
        this.text.textContent = text;
        this.element.hidden = false;
    }
    hide() {
        this.key = null;
        this.element.hidden = true;
    }
}
