// share.js - links to what is looked at, and pictures of it.
import { describeProgress } from "./connection.js";
import { ask, download, h, selectRow, toast } from "./dom.js";
import { formatLink } from "./link.js";

const HOUR_S = 3600;
const ACCESS = [["none", "None: they sign in"], ["view", "View, for a day"],
    ["edit", "Edit, for a day"]];
const GUESTS = 20;

// The settled picture, which may take long: until then it can be cancelled, also without a connection.
export async function takePicture(app) {
    const cancel = new AbortController();
    const none = new Promise((done) => cancel.signal.addEventListener("abort", () => done(null)));
    const png = await app.withProgress("Screenshot", (onProgress) =>
        Promise.race([none, app.view.screenshot((kind, body) =>
            kind === "progress" && onProgress(...describeProgress(body)), cancel.signal)]),
    () => cancel.abort());
    if (png)
        download(png, "image/png", `${(app.title || "scene").replace(/[^\w.-]+/g, "_")}.png`);
}

export function shareUrl(app, withCamera, ticket) {
    const { view } = app;
    const hash = formatLink({ scene: app.link.scene, load: app.opened?.path ?? "", ticket,
        camera: withCamera ? view.camera : null, params: withCamera ? view.params : {} });
    return location.origin + location.pathname + hash;
}

// The access that a link gives, one at a time: a ticket that was not copied is revoked when another one takes its place,
// as the server keeps only so many.
export class LinkTicket {
    // onChange(access): the link has this one by now.
    constructor(connection, onChange) {
        this.connection = connection;
        this.onChange = onChange;
        this.made = null;
        this.queue = Promise.resolve();
    }

    get secret() {
        return this.made?.secret ?? "";
    }

    // The link was copied.
    keep() {
        if (this.made)
            this.made.isKept = true;
    }

    // access: "none", "view", "edit".
    change(access) {
        const done = this.queue.then(() => this.replace(access));
        this.queue = done.catch(() => {});
        return done;
    }

    async replace(access) {
        const { made: old, connection } = this;
        this.made = null;
        this.onChange("none");
        if (old && !old.isKept)
            await connection.call("join_revoke", { ticket: old.ticket }).catch(() => {}); // it may be gone
        if (access === "none")
            return;
        this.made = await connection.call("join_make", { role: access.toUpperCase(), uses: GUESTS,
            valid_s: 24 * HOUR_S });
        this.onChange(access);
    }
}

// Browsers copy for pages from TLS or from this machine only.
export async function copyText(text) {
    try {
        await navigator.clipboard.writeText(text);
        toast("The link was copied.");
    } catch {
        await ask("Copy the link", h("div", { class: "body" },
            h("p", { text: "This browser copies nothing for this page"
                + (window.isSecureContext ? "." : ", which came without TLS.")
                + " Select the link and copy it:" }),
            h("textarea", { class: "text", readonly: true, rows: 4, "aria-label": "Link",
                text, on: { focus: (e) => e.target.select() } })), [["Close", "close"]]);
    }
}

export async function share(app) {
    const hasName = Boolean(app.link.scene);
    const canInvite = hasName && app.connection.canEdit;
    const ticket = new LinkTicket(app.connection, (value) => { access.set(value); show(); });
    const keep = () => ticket.keep();
    const field = h("input", { class: "text", readonly: true, "aria-label": "Link",
        on: { focus: () => field.select(), copy: keep, dragstart: keep } });
    const camera = h("input", { type: "checkbox", class: "switch", role: "switch", checked: true,
        id: "share-camera", on: { change: () => show() } });
    const access = selectRow("Access", ACCESS, (value) => app.attempt(() => ticket.change(value)));
    const show = () => { field.value = shareUrl(app, camera.checked, ticket.secret); };
    show();
    const hint = !hasName ? "This scene belongs to this page alone: the link opens one of its own."
        : canInvite ? `A link with access is good for ${GUESTS} people and this scene only.`
        : "Who opens the link signs in with a token or a ticket of their own.";
    const answer = await ask("Share", h("div", { class: "body" }, field,
        h("div", { class: "row" },
            h("label", { for: "share-camera", text: "Camera, settings" }), camera),
        canInvite ? access.row : null, h("p", { class: "hint", text: hint })),
    [["Close", "close"], ["Copy link", "copy"]]);
    const url = field.value;
    if (answer === "copy")
        keep();
    ticket.change("none");
    if (answer === "copy")
        await copyText(url);
}
