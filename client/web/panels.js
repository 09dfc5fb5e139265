// panels.js - the panels at the sides: settings of the view, and what is in the scene.
import { enums } from "./hgp.js";
import {
    button, h, iconButton, section, segmented, selectRow, sliderRow, toggleRow,
} from "./dom.js";
import { Tree } from "./tree.js";
import { samplesOf } from "./view.js";

const words = (name) => name.charAt(0) + name.slice(1).toLowerCase().replaceAll("_", " ");
const choices = (names, texts = {}) => names.map((n) => [n, texts[n] ?? words(n)]);

const TONEMAPS = { ACES: "ACES", AGX: "AgX", PBR_NEUTRAL: "PBR Neutral", LINEAR: "None (clamp)" };
const DEBUG = { OFF: "Picture", MIP: "Texture levels", RESIDENCY: "Resident textures",
    MISSING: "Missing textures", CLUSTER: "Clusters", LOD: "Levels of detail",
    PROBES: "Light probes", SHADOWS: "Shadow maps", SCALE: "Render scale",
    HISTORY: "History", MOTION: "Motion vectors" };
const RESOLUTIONS = [["1", "Full"], ["0.75", "75 %"], ["0.5", "50 %"], ["0.25", "25 %"]];
const OF_SCENE = "\0"; // the value of a choice that no variant can be called
const SAMPLES = [16, 64, 256, 1024, 4096];

export function panelHeader(title, onClose) {
    return h("header", {}, h("h2", { text: title }),
        iconButton("close", `Close ${title}`, onClose));
}

// ---- settings of the view ----------------------------------------------------------------------

export class ViewPanel {
    // on: { set(changes), metered(is), resolution(value), environment(fields), clipping: a section }
    constructor(element, on, onClose) {
        this.on = on;
        this.rows = {};
        this.element = element;
        element.append(panelHeader("View", onClose), this.rendering(), this.light(),
            this.environment(), this.backgroundSection(), on.clipping, this.debug());
    }

    rendering() {
        const { on, rows } = this;
        rows.mode = segmented("Rendering", [["REALTIME", "Real time"], ["PATH", "Path traced"]],
            (mode) => on.set({ mode }));
        rows.samples = selectRow("Samples", SAMPLES.map((n) => [String(n), String(n)]),
            (v) => on.set({ samples: Number(v) }));
        rows.denoise = toggleRow("Denoise", (is) => on.set({ denoise: is ? "STILL" : "OFF" }));
        rows.resolution = selectRow("Resolution", RESOLUTIONS, (v) => on.resolution(Number(v)));
        rows.quality = sliderRow("Quality while moving", { min: 30, max: 100, step: 5,
            format: (v) => `${v} %` }, (quality) => on.later({ quality }));
        rows.codec = selectRow("Codec", [["auto", "Automatic"], ["JPEG", "JPEG"],
            ["JPEG_444", "JPEG 4:4:4"], ["H264", "H.264"], ["H264_444", "H.264 4:4:4"],
            ["AV1", "AV1"], ["TILES_JPEG", "Tiles, JPEG"], ["TILES", "Tiles, lossless"]],
        (v) => on.codec(v));
        rows.reproject = toggleRow("Reproject between frames", (is) => on.reproject(is));
        rows.gi = selectRow("Indirect light", choices(Object.keys(enums.gi),
            { AUTO: "Automatic", NONE: "Off", RAYS: "Rays", PROBES: "Probes" }),
        (gi) => on.set({ gi }));
        rows.kind = selectRow("Projection", choices(Object.keys(enums.camera_kind)),
            (kind) => on.lens({ kind }));
        rows.fov = sliderRow("Field of view", { min: 15, max: 110, step: 1,
            format: (v) => `${v}°` }, (v) => on.lens({ vfov_rad: v * Math.PI / 180 }));
        return section("Rendering", true, ...["mode", "samples", "denoise", "gi", "resolution",
            "codec", "quality", "reproject", "kind", "fov"].map((k) => rows[k].row));
    }

    light() {
        const { on, rows } = this;
        rows.tonemap = selectRow("Tone curve", choices(Object.keys(enums.tonemap), TONEMAPS),
            (tonemap) => on.set({ tonemap }));
        rows.auto = toggleRow("Metered", on.metered);
        rows.ev = sliderRow("Exposure", { min: -16, max: 16, step: 0.1,
            format: (v) => `${v > 0 ? "+" : ""}${v.toFixed(1)} EV` },
        (exposure_ev) => on.later({ exposure_ev, exposure_mode: this.exposureMode }));
        return section("Exposure", true, rows.tonemap.row, rows.auto.row, rows.ev.row);
    }

    get exposureMode() {
        return this.rows.auto.input.checked ? "AUTO" : "FIXED";
    }

    environment() {
        const { on, rows } = this;
        const sun = () => {
            const a = this.sunAt[0] * Math.PI / 180, e = this.sunAt[1] * Math.PI / 180;
            on.environmentLater({ kind: "SKY", sun_direction: [Math.cos(e) * Math.sin(a),
                Math.sin(e), Math.cos(e) * Math.cos(a)] });
        };
        this.sunAt = [-40, 50];
        rows.env = selectRow("Light from", [["AUTO", "Scene"], ["SKY", "Sky and sun"],
            ["FILE", "Picture"], ["COLOR", "Even light"], ["NONE", "Nothing"]], (kind) => {
            on.environment(kind === "COLOR" ? { kind, color: [0.8, 0.8, 0.8] } : { kind });
            this.showSun(kind);
        });
        rows.sunAzimuth = sliderRow("Sun direction", { min: -180, max: 180, step: 1,
            format: (v) => `${v}°` }, (v) => { this.sunAt[0] = v; sun(); });
        rows.sunHeight = sliderRow("Sun height", { min: -5, max: 90, step: 1,
            format: (v) => `${v}°` }, (v) => { this.sunAt[1] = v; sun(); });
        rows.intensity = sliderRow("Brightness", { min: -4, max: 4, step: 0.1,
            format: (v) => `${(2 ** v).toFixed(2)} ×` },
        (v) => on.environmentLater({ intensity: 2 ** v }));
        this.meterHint = h("div", {}, h("p", { class: "hint",
            text: "Exposure is metered, which makes up for this." }),
        button("Fix exposure", () => on.metered(false)));
        rows.turn = sliderRow("Rotation", { min: -180, max: 180, step: 1, format: (v) => `${v}°` },
            (v) => on.environmentLater({ rotation_rad: v * Math.PI / 180 }));
        rows.sunAzimuth.set(-40);
        rows.sunHeight.set(50);
        rows.intensity.set(0);
        rows.turn.set(0);
        this.envHint = h("p", { class: "hint",
            text: "Drop an .hdr or .exr picture on the page to be lit by it." });
        this.fileOption = rows.env.input.querySelector("[value=FILE]");
        this.fileOption.hidden = true; // until the scene has had one
        this.showSun("AUTO");
        return section("Environment", false, ...["env", "sunAzimuth", "sunHeight", "intensity"]
            .map((k) => rows[k].row), this.meterHint, rows.turn.row, this.envHint);
    }

    showSun(kind) {
        this.rows.sunAzimuth.row.hidden = this.rows.sunHeight.row.hidden = kind !== "SKY";
    }

    // Shows what the scene's environment is, whoever has chosen it; null: not known.
    updateEnvironment(environment) {
        if (!environment)
            return;
        const { rows } = this;
        const { kind, intensity = 1, rotation_rad = 0, sun_direction: sun = [0, 0, 0] } = environment;
        const degrees = (rad) => Math.round(rad * 180 / Math.PI);
        this.fileOption.hidden &&= kind !== "FILE";
        rows.env.set(kind);
        this.showSun(kind);
        rows.intensity.set(Math.log2(Math.max(intensity, 1e-9)));
        rows.turn.set(degrees(Math.atan2(Math.sin(rotation_rad), Math.cos(rotation_rad))));
        if (Math.hypot(...sun) > 0)
            this.sunAt = [degrees(Math.atan2(sun[0], sun[2])), degrees(Math.asin(sun[1] / Math.hypot(...sun)))];
        rows.sunAzimuth.set(this.sunAt[0]);
        rows.sunHeight.set(this.sunAt[1]);
    }

    backgroundSection() {
        const { on, rows } = this;
        rows.background = selectRow("Background", choices(["ENV", "BLUR", "COLOR", "DISPLAY"],
            { ENV: "Environment", BLUR: "Out of focus", COLOR: "Lit colour",
                DISPLAY: "Plain colour" }),
        (background) => on.set({ background }));
        const pick = h("input", { type: "color", id: "background-color",
            on: { input: () => on.later({ background_color: linearOf(pick.value) }) } });
        this.backgroundColor = pick;
        rows.ground = selectRow("Shadow ground", choices(["NONE", "Y", "Z"],
            { NONE: "None", Y: "Y is up", Z: "Z is up" }), (ground) => on.set({ ground }));
        return section("Background", false, rows.background.row,
            h("div", { class: "row" },
                h("label", { for: "background-color", text: "Colour" }), pick),
            rows.ground.row);
    }

    debug() {
        this.rows.debug = selectRow("Show", choices(Object.keys(enums.debug_view), DEBUG),
            (debug_view) => this.on.set({ debug_view }));
        return section("Diagnosis", false, this.rows.debug.row);
    }

    // Shows the settings as they are.
    update(params, camera, canEdit) {
        const { rows } = this;
        const isPath = params.mode === "PATH";
        rows.mode.set(params.mode ?? "REALTIME");
        rows.samples.set(String(samplesOf(params)));
        rows.samples.row.hidden = rows.denoise.row.hidden = !isPath;
        rows.gi.row.hidden = isPath;
        rows.denoise.set(params.denoise === "STILL");
        rows.quality.set(params.quality);
        rows.gi.set(params.gi ?? "AUTO");
        rows.reproject.set(params.depth === 1);
        rows.tonemap.set(params.tonemap ?? "ACES");
        rows.auto.set(params.exposure_mode !== "FIXED");
        this.meterHint.hidden = params.exposure_mode === "FIXED";
        rows.ev.set(params.exposure_ev ?? 0);
        rows.background.set(params.background ?? "ENV");
        if (document.activeElement !== this.backgroundColor)
            this.backgroundColor.value = hexOfLinear(params.background_color ?? [0, 0, 0]);
        rows.ground.set(params.ground ?? "NONE");
        rows.debug.set(params.debug_view ?? "OFF");
        this.updateLens(camera);
        for (const key of ["env", "sunAzimuth", "sunHeight", "intensity", "turn"])
            rows[key].input.disabled = !canEdit;
        this.envHint.textContent = canEdit
            ? "Drop an .hdr or .exr picture on the page to be lit by it."
            : "Your access is view only: the light belongs to the scene.";
    }

    updateLens(camera) {
        const { rows } = this;
        rows.kind.set(camera.kind);
        rows.fov.row.hidden = camera.kind !== "PERSPECTIVE";
        rows.fov.set(Math.round(camera.vfov_rad * 180 / Math.PI));
    }
}

// A colour of the page (#rrggbb, sRGB) as linear numbers.
export function linearOf(hex) {
    return [1, 3, 5].map((i) => {
        const v = parseInt(hex.slice(i, i + 2), 16) / 255;
        return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    });
}

// And back; what is brighter than white is white.
export function hexOfLinear(color) {
    return "#" + color.map((v) => {
        const c = Math.min(1, Math.max(0, v));
        const s = c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
        return Math.round(255 * s).toString(16).padStart(2, "0");
    }).join("");
}

// ---- what is in the scene ----------------------------------------------------------------------

export class ScenePanel {
    // on: { select(id), toggle(id, visible), isShown(node), focus(id), variant(asset, name), variantHere(asset),
    // camera(id), open() }
    constructor(element, scene, on, onClose) {
        this.scene = scene;
        this.on = on;
        this.tree = new Tree(scene, { select: on.select, toggle: on.toggle, isShown: on.isShown, open: on.focus });
        this.search = h("input", { type: "search", class: "text", placeholder: "Search nodes",
            "aria-label": "Search nodes", on: { input: () => this.find() } });
        this.count = h("p", { class: "hint", role: "status" });
        this.extra = h("div", { class: "extras" });
        element.append(panelHeader("Scene", onClose), this.extra,
            h("div", { class: "search" }, this.search, this.count), this.tree.element);
    }

    find() {
        this.tree.setFilter(this.search.value);
        this.showCount();
    }

    showCount() {
        const { scene } = this;
        const listed = scene.nodes.size < scene.total
            ? `the first ${scene.nodes.size} of ${scene.total} nodes`
            : scene.total === 1 ? "1 node" : `${scene.total} nodes`;
        this.count.textContent = this.search.value
            ? `${this.tree.rows.length} of ${listed}` : listed;
    }

    update() {
        const { scene, on } = this;
        this.tree.update();
        this.showCount();
        const rows = [];
        for (const asset of scene.assets.filter((a) => a.variants?.length)) {
            const { row, set } = selectRow(on.canEdit() ? "Variant" : "Variant, here",
                [...on.canEdit() ? [] : [[OF_SCENE, "As in the scene"]],
                    ["", "As in the file"], ...asset.variants.map((v) => [v, v || "(no name)"])],
                (v) => on.variant(asset.number, v === OF_SCENE ? null : v));
            set(on.canEdit() ? asset.variant ?? "" : on.variantHere(asset.number) ?? OF_SCENE);
            rows.push(row);
        }
        const cameras = scene.cameras;
        if (cameras.length) {
            const { row } = selectRow("Camera", [["", "Choose…"], ...cameras.map((n) =>
                [String(n.node), scene.nameOf(n.node)])], (v) => v && on.camera(BigInt(v)));
            rows.push(row);
        }
        const notes = scene.assets.flatMap((a) => a.warnings ?? []);
        if (notes.length)
            rows.push(button(`Notes of the loader (${notes.length})`, () =>
                on.warnings(notes)));
        this.extra.replaceChildren(...rows.length ? [h("div", { class: "rows" }, ...rows)] : []);
    }
}
