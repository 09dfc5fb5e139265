// link.js - what the part of the address behind # says: scene, access, camera, settings.
// A browser never sends that part to a server. The first two functions are pure.
//
//   #scene=NAME       a named scene; without it the page has one of its own
//   &load=PATH        file for a scene that is empty (under an asset root, or demo:)
//   &ticket=T         access token or join ticket
//   &camera=...       eye, target, lens (camera.js)
//   &mode=PATH &samples=256 &tonemap=AGX &ev=1.5 &background=BLUR &debug=MIP &gi=PROBES
import { enums } from "./hgp.js";
import { cameraFromText, cameraToText } from "./camera.js";

const CHOICES = { mode: ["mode", "render_mode"], tonemap: ["tonemap", "tonemap"],
    background: ["background", "background"], debug: ["debug_view", "debug_view"],
    gi: ["gi", "gi"] };
const DEFAULTS = { mode: "REALTIME", tonemap: "ACES", background: "ENV", debug: "OFF", gi: "AUTO" };
const MOST_SAMPLES = 65536;

// { scene, load, ticket, camera, params } of an address; what is malformed is left out.
export function parseLink(hash) {
    const words = new URLSearchParams(hash.replace(/^#/, ""));
    const params = {};
    for (const [word, [field, kind]] of Object.entries(CHOICES))
        if (Object.hasOwn(enums[kind], words.get(word) ?? ""))
            params[field] = words.get(word);
    const ev = words.has("ev") ? Number(words.get("ev")) : NaN;
    if (ev >= -32 && ev <= 32)
        Object.assign(params, { exposure_ev: ev, exposure_mode: words.get("meter") === "off"
            ? "FIXED" : "AUTO" });
    const samples = Number(words.get("samples") ?? 0);
    if (Number.isInteger(samples) && samples >= 1 && samples <= MOST_SAMPLES)
        params.samples = samples;
    return {
        scene: words.get("scene") ?? "",
        load: words.get("load") ?? "",
        ticket: words.get("ticket") ?? "",
        camera: cameraFromText(words.get("camera") ?? ""),
        params,
    };
}

// The text behind # for a scene as it is looked at now.
export function formatLink({ scene, load, ticket, camera, params }) {
    const words = new URLSearchParams();
    if (scene)
        words.set("scene", scene);
    if (load)
        words.set("load", load);
    if (ticket)
        words.set("ticket", ticket);
    if (camera)
        words.set("camera", cameraToText(camera));
    for (const [word, [field]] of Object.entries(CHOICES))
        if (params?.[field] && params[field] !== DEFAULTS[word])
            words.set(word, params[field]);
    if (params?.samples)
        words.set("samples", String(params.samples));
    if (params?.exposure_ev || params?.exposure_mode === "FIXED")
        words.set("ev", String(params.exposure_ev ?? 0));
    if (params?.exposure_mode === "FIXED")
        words.set("meter", "off");
    return `#${words.toString().replaceAll("%2C", ",").replaceAll("%3A", ":")}`;
}

const KEPT = "helio-access";
const RESUME = "helio-resume";
const CAMERA = "helio-camera";

// Takes the access out of the visible address, where it would be copied by accident, and keeps
// it for this tab.
export function takeAccess() {
    const link = parseLink(location.hash);
    if (link.ticket) {
        sessionStorage.setItem(KEPT, link.ticket);
        const rest = { ...link, ticket: "" };
        history.replaceState(null, "", location.pathname + formatLink(rest));
    }
    return { ...link, ticket: sessionStorage.getItem(KEPT) ?? "" };
}

export function keepAccess(token) {
    if (token)
        sessionStorage.setItem(KEPT, token);
    else
        sessionStorage.removeItem(KEPT);
}

// Where this tab looked at a scene from, for when its page is loaded again: good once. Pages that are
// opened otherwise begin as their address says.
export function keepCamera(link, camera) {
    if (link.scene || link.load)
        sessionStorage.setItem(CAMERA, JSON.stringify([link.scene, link.load, cameraToText(camera)]));
}

export function takeCamera(link) {
    const kept = JSON.parse(sessionStorage.getItem(CAMERA) ?? "[]");
    const isReload = performance.getEntriesByType("navigation")[0]?.type === "reload";
    sessionStorage.removeItem(CAMERA);
    return isReload && kept[0] === link.scene && kept[1] === link.load ? cameraFromText(kept[2]) : null;
}

// The ticket of a session that goes on when this page is loaded again, good once, and how it showed the scene.
// address: the scene and load of the link that it was opened by; null: of a join ticket, whatever the link says.
export function keepResume(address, ticket, look) {
    sessionStorage.setItem(RESUME, JSON.stringify([address, Array.from(ticket), look]));
}

// { ticket, look }; nulls: there is none, or the address is another one by now.
export function takeResume({ scene, load }) {
    const [address, ticket, look] = JSON.parse(sessionStorage.getItem(RESUME) ?? "[[],null,null]");
    sessionStorage.removeItem(RESUME);
    const isSame = !address || (address[0] === scene && address[1] === load);
    return isSame && ticket ? { ticket: Uint8Array.from(ticket), look } : { ticket: null, look: null };
}
