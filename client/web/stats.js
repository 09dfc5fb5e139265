// stats.js - what frames say about themselves, as numbers and a small graph.
import { bytesText, h, svg } from "./dom.js";
import { panelHeader } from "./panels.js";

const VIEW = 1;
const WINDOW_MS = 2000;
const GRAPH_FRAMES = 60;
const DRAW_MS = 250;
const FLOW_MS = 1000;

// The latency by its stages, in their order.
const SPLIT = { uplink: "· to the server", wait: "· until rendering", render: "· rendering",
    encode: "· encoding", send: "· until sent", network: "· network", show: "· decoding, drawing" };

const ms = (v) => v === null || v === undefined || !Number.isFinite(v) ? "–" : `${v.toFixed(1)} ms`;

export const shownText = (age_ms) =>
    age_ms === null ? "The frame itself" : `Reprojected, ${age_ms.toFixed(0)} ms old`;

export function median(values) {
    const sorted = [...values].sort((a, b) => a - b);
    return sorted.length ? sorted[sorted.length >> 1] : null;
}

// Rows of the `flow` of stats_query.
export function flowRows(flow) {
    if (!flow)
        return [];
    const known = (value, text) => value > 0 ? text : "–";
    return [
        ["Server: frame rate to hold", known(flow.target_fps, `${flow.target_fps} fps`)],
        ["· time to render", known(flow.target_ms, ms(flow.target_ms))],
        ["· quality", known(flow.quality, `${flow.quality} %`)],
        ["· bit rate", known(flow.bitrate, `${(flow.bitrate / 1e6).toFixed(1)} Mbit/s`)],
        ["Network: rate", known(flow.rate_mbit_s, `${flow.rate_mbit_s.toFixed(1)} Mbit/s`)],
        ["· least round trip", known(flow.rtt_ms, ms(flow.rtt_ms))],
        ["· until delivered", known(flow.delay_ms, ms(flow.delay_ms))],
        ["· under way", `${flow.under_way} frames, ${bytesText(flow.bytes_under_way)}`],
        ["· frames held back", String(flow.held)],
    ];
}

export class Stats {
    // age_ms: of what is shown in place of the newest frame; null: that frame itself is shown.
    constructor(element, connection, onClose, age_ms) {
        this.age_ms = age_ms;
        this.element = element;
        this.connection = connection;
        this.frames = []; // { time_ms, bytes, latency_ms, decode_ms } of the last seconds
        this.latencies = []; // newest last
        this.flow = null; // of the newest stats_query
        this.askAt = 0;
        this.graph = svg("svg", { class: "spark", viewBox: `0 0 ${GRAPH_FRAMES} 40`,
            preserveAspectRatio: "none", role: "img", "aria-label": "Latency of the last frames" });
        this.list = h("dl", { tabindex: "0", "aria-label": "Statistics" });
        element.append(panelHeader("Statistics", onClose), this.graph, this.list);
        setInterval(() => this.draw(), DRAW_MS);
    }

    add({ frame, latency_ms, decode_ms, split }) {
        const time_ms = performance.now();
        this.last = frame;
        this.split = split ?? this.split;
        this.frames.push({ time_ms, bytes: frame.data.length, decode_ms });
        if (latency_ms !== null) {
            this.latencies.push(latency_ms);
            if (this.latencies.length > GRAPH_FRAMES)
                this.latencies.shift();
        }
        this.trim(time_ms);
    }

    trim(now) {
        while (this.frames.length && now - this.frames[0].time_ms > WINDOW_MS)
            this.frames.shift();
    }

    rows() {
        const { last, frames, connection } = this;
        const seconds = WINDOW_MS / 1000;
        const bytes = frames.reduce((sum, f) => sum + f.bytes, 0);
        const parts = Object.entries(this.split ?? {}).map(([name, v]) =>
            [SPLIT[name], ms(Math.max(0, v))]);
        const stages = (last?.stages ?? []).map((s) => [words(s.name), ms(Number(s.ns) / 1e6)]);
        return [
            ["Frames", `${(frames.length / seconds).toFixed(1)} fps`],
            ["Latency", ms(median(this.latencies))],
            ...parts,
            ["Shown", shownText(this.age_ms())],
            ["Round trip", ms(connection.rtt_ms)],
            ["Decoding", ms(median(frames.map((f) => f.decode_ms)))],
            ...stages.slice(0, 12),
            ["Received", `${bytesText(bytes / seconds)}/s`],
            ["Frame", last ? `${last.width} × ${last.height} ${last.encoding}` : "–"],
            ["Frame size", last ? bytesText(last.data.length) : "–"],
            ["Samples", last ? String(last.samples) : "–"],
            ["Missing pages", last ? String(last.missing_pages) : "–"],
            ["Missing clusters", last ? String(last.missing_clusters) : "–"],
            ...last?.noise === undefined ? [] : [["Noise", `${(last.noise * 100).toFixed(2)} %`]],
            ...last?.exposure_ev === undefined ? []
                : [["Exposure", `${last.exposure_ev.toFixed(2)} EV`]],
            ["Revision", last ? String(last.scene_revision) : "–"],
            ...flowRows(this.flow),
        ];
    }

    // What the server's controller knows and has chosen, once a second while the panel is open.
    askFlow(now) {
        if (now < this.askAt)
            return;
        this.askAt = now + FLOW_MS;
        this.connection.call("stats_query", { view: VIEW }).then(
            ({ text }) => { this.flow = JSON.parse(text).flow; }, () => { this.flow = null; });
    }

    draw() {
        if (this.element.hidden)
            return;
        this.askFlow(performance.now());
        this.trim(performance.now());
        this.list.replaceChildren(...this.rows().flatMap(([name, value]) =>
            [h("dt", { text: name }), h("dd", { text: value })]));
        const most = Math.max(50, ...this.latencies);
        const points = this.latencies.map((v, i) => `${i},${(39 - v / most * 37).toFixed(1)}`);
        this.graph.replaceChildren(svg("polyline", { points: points.join(" "), fill: "none",
            stroke: "currentColor", "stroke-width": "1.2",
            "vector-effect": "non-scaling-stroke" }));
    }
}

const words = (name) => name.charAt(0).toUpperCase() + name.slice(1).replaceAll("_", " ");
