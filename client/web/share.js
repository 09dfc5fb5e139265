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

// A secret that lets others into the scene, "" where none is wanted.
async function makeTicket(app, access) {
    if (access === "none")
        return "";
    const made = await app.connection.call("join_make", { role: access.toUpperCase(),
        uses: GUESTS, valid_s: 24 * HOUR_S });
    return made.secret;
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
    const field = h("input", { class: "text", readonly: true, "aria-label": "Link",
        on: { focus: () => field.select() } });
    const camera = h("input", { type: "checkbox", class: "switch", role: "switch", checked: true,
        id: "share-camera", on: { change: () => show() } });
    let ticket = "";
    const access = selectRow("Access", ACCESS, (value) => app.attempt(async () => {
        access.set("none");
        ticket = await makeTicket(app, value);
        access.set(value);
        show();
    }));
    const show = () => { field.value = shareUrl(app, camera.checked, ticket); };
    show();
    const hint = !hasName ? "This scene belongs to this page alone: the link opens one of its own."
        : canInvite ? `A link with access is good for ${GUESTS} people and this scene only.`
        : "Who opens the link signs in with a token or a ticket of their own.";
    const answer = await ask("Share", h("div", { class: "body" }, field,
        h("div", { class: "row" },
            h("label", { for: "share-camera", text: "Camera, settings" }), camera),
        canInvite ? access.row : null, h("p", { class: "hint", text: hint })),
    [["Close", "close"], ["Copy link", "copy"]]);
    if (answer !== "copy")
        return;
    await copyText(field.value);
}
