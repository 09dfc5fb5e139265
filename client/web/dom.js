// dom.js - small helpers to build the page: elements, form rows, messages, dialogs.

const SVG = "http://www.w3.org/2000/svg";

function apply(node, props) {
    for (const [key, value] of Object.entries(props)) {
        if (value === undefined || value === null || value === false)
            continue;
        if (key === "on")
            for (const [type, handler] of Object.entries(value))
                node.addEventListener(type, handler);
        else if (key === "text")
            node.textContent = value;
        else if (key === "data")
            Object.assign(node.dataset, value);
        else if (key in node && typeof value !== "string" && !(node instanceof SVGElement))
            node[key] = value;
        else
            node.setAttribute(key, value === true ? "" : value);
    }
}

// An HTML element with properties or attributes, texts and children.
export function h(name, props = {}, ...children) {
    const node = document.createElement(name);
    apply(node, props);
    node.append(...children.filter((c) => c !== null && c !== undefined));
    return node;
}

export function svg(name, props = {}, ...children) {
    const node = document.createElementNS(SVG, name);
    apply(node, props);
    node.append(...children);
    return node;
}

export const icon = (name) =>
    svg("svg", { class: "icon", "aria-hidden": "true" }, svg("use", { href: `#i-${name}` }));

// A button with an icon; `label` is its name for assistive technology and its tooltip.
export function iconButton(name, label, onClick, props = {}) {
    return h("button", { type: "button", class: "icon-button", "aria-label": label, title: label,
        on: { click: onClick }, ...props }, icon(name));
}

export const button = (text, onClick, props = {}) =>
    h("button", { type: "button", class: "button", text, on: { click: onClick }, ...props });

let ids = 0;
export const newId = () => `x${++ids}`;

// ---- form rows: { row, set(value) } ------------------------------------------------------------

export function selectRow(label, options, onChange) {
    const id = newId();
    const select = h("select", { id, on: { change: () => onChange(select.value) } },
        ...options.map(([value, text]) => h("option", { value, text })));
    return {
        row: h("div", { class: "row" }, h("label", { for: id, text: label }), select),
        input: select,
        set: (value) => { select.value = value; },
    };
}

export function sliderRow(label, { min, max, step, format }, onInput) {
    const id = newId();
    const output = h("output", { for: id });
    const show = () => {
        output.textContent = format(Number(input.value));
        input.setAttribute("aria-valuetext", output.textContent);
    };
    const input = h("input", { id, type: "range", min: String(min), max: String(max),
        step: String(step), on: { input: () => { show(); onInput(Number(input.value)); } } });
    show();
    return {
        row: h("div", { class: "row slider" }, h("label", { for: id, text: label }), output, input),
        input,
        set: (value) => {
            if (document.activeElement !== input || !input.matches(":active"))
                input.value = String(value);
            show();
        },
    };
}

export function toggleRow(label, onChange) {
    const id = newId();
    const input = h("input", { id, type: "checkbox", class: "switch", role: "switch",
        on: { change: () => onChange(input.checked) } });
    return {
        row: h("div", { class: "row" }, h("label", { for: id, text: label }), input),
        input,
        set: (value) => { input.checked = value; },
    };
}

// A choice of few, as buttons side by side (a radio group).
export function segmented(label, options, onChange) {
    const name = newId();
    const inputs = new Map();
    const items = options.map(([value, text]) => {
        const input = h("input", { type: "radio", name, value, id: newId(),
            on: { change: () => onChange(value) } });
        inputs.set(value, input);
        return h("span", { class: "segment" }, input, h("label", { for: input.id, text }));
    });
    return {
        row: h("fieldset", { class: "segmented" },
            h("legend", { class: "hidden", text: label }), ...items),
        set: (value) => inputs.forEach((input, key) => { input.checked = key === value; }),
    };
}

export function section(title, isOpen, ...rows) {
    return h("details", { class: "section", open: isOpen },
        h("summary", {}, h("span", { text: title }), icon("chevron")),
        h("div", { class: "rows" }, ...rows));
}

// ---- messages ----------------------------------------------------------------------------------

const LASTING_MS = 6000;
const LEAST_MS = 1200;

// Shows a text for a while and tells it to screen readers. kind: "info" or "error". about: the state that it tells of,
// which has one text at a time, until it is over (dismiss).
export function toast(text, kind = "info", action = null, about = "") {
    const list = document.getElementById("toasts");
    const node = h("div", { class: `toast ${kind}`, data: { about, since: performance.now() } }, h("span", { text }));
    const end = () => removeToast(node);
    if (action)
        node.append(button(action[0], () => { end(); action[1](); }));
    node.append(iconButton("close", "Dismiss", end));
    for (const old of list.querySelectorAll(".toast > span"))
        if (old.textContent === text || (about && old.parentNode.dataset.about === about))
            removeToast(old.parentNode);
    list.append(node);
    while (list.childElementCount > 3)
        list.firstElementChild.remove();
    const wait_ms = kind === "error" || action ? 2 * LASTING_MS : LASTING_MS;
    // Not while it is read or used.
    const expire = () => node.matches(":hover, :focus-within") ? setTimeout(expire, wait_ms) : end();
    setTimeout(expire, wait_ms);
    announce(text);
}

// The focus goes back to the picture, not to the top of the page.
function removeToast(node) {
    const hasFocus = node.contains(document.activeElement);
    node.remove();
    if (hasFocus)
        document.getElementById("picture").focus({ preventScroll: true });
}

// These states are over: what was said of them holds no longer. Each text is there for long enough to be read as one.
export function dismiss(...abouts) {
    for (const node of document.querySelectorAll("#toasts > .toast"))
        if (abouts.some((about) => about === node.dataset.about || about === node.dataset.about?.split(" ")[0]))
            setTimeout(() => removeToast(node), Math.max(0, Number(node.dataset.since) + LEAST_MS - performance.now()));
}

// Says a text to screen readers only.
export function announce(text) {
    const live = document.getElementById("live");
    live.textContent = "";
    setTimeout(() => { live.textContent = text; }, 30);
}

// A task that takes a while: { update(text, share or null), end() }.
export function progressToast(text, onCancel = null) {
    const label = h("span", { text });
    const bar = h("progress", { max: 1, "aria-label": text });
    const node = h("div", { class: "toast task" }, label, bar);
    if (onCancel)
        node.append(button("Cancel", onCancel));
    document.getElementById("toasts").append(node);
    announce(text);
    return {
        update(words, share) {
            label.textContent = words;
            if (share === null)
                bar.removeAttribute("value");
            else
                bar.value = share;
        },
        end: () => node.remove(),
    };
}

// ---- dialogs -----------------------------------------------------------------------------------

// A modal dialog with buttons [text, value]; the promise is the value pressed, or null.
export function ask(title, body, choices) {
    return new Promise((resolve) => {
        const titleId = newId();
        const end = (value) => {
            dialog.close();
            dialog.remove();
            resolve(value);
        };
        // The last choice is what Enter in a field means: the form's only button that submits.
        const buttons = choices.map(([text, value], i) => i === choices.length - 1
            ? h("button", { type: "submit", value, text, class: "button primary" })
            : h("button", { type: "button", value, text, class: "button",
                on: { click: () => end(value) } }));
        const form = h("form", { method: "dialog",
            on: { submit: (e) => { e.preventDefault(); end(choices.at(-1)[1]); } } },
        body, h("div", { class: "choices" }, ...buttons));
        const dialog = h("dialog", { class: "dialog", "aria-labelledby": titleId },
            h("h2", { id: titleId, text: title }), form);
        dialog.addEventListener("cancel", (e) => { e.preventDefault(); end(null); });
        document.body.append(dialog);
        dialog.showModal();
    });
}

export const bytesText = (n) => n < 1e3 ? `${Math.round(n)} B`
    : n < 1e6 ? `${(n / 1e3).toFixed(0)} kB`
    : n < 1e9 ? `${(n / 1e6).toFixed(1)} MB` : `${(n / 1e9).toFixed(2)} GB`;

// Metres in a unit that fits.
export function metresText(m) {
    const a = Math.abs(m);
    if (a < 5e-7) // nothing is left of it, but for a sign
        return "0.000 m";
    return a >= 1000 ? `${(m / 1000).toFixed(3)} km` : a >= 1 ? `${m.toFixed(3)} m`
        : a >= 0.01 ? `${(m * 100).toFixed(2)} cm` : `${(m * 1000).toFixed(3)} mm`;
}

export function download(bytes, type, name) {
    const url = URL.createObjectURL(new Blob([bytes], { type }));
    h("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
}
