// scene.js - the scene of the session: what it holds, and edits of it.
//
// Events: "changed" (nodes or assets were listed anew), "assets" (they were loaded or removed), "environment".
import { RequestError, describeProgress } from "./connection.js";
import { findMessage } from "./hgp.js";
import { upload } from "./upload.js";

const PAGE_NODES = 4096;
const MOST_NODES = 200000;
const REFRESH_MS = 1500;
const ASSET_MS = 100; // sooner, as this is what people wait for
const ENVIRONMENT_MS = 300; // of another client's edits; a slider makes many
// Edits that change nothing of what is listed: names, places in the tree, what is visible, assets, variants.
const UNLISTED = ["animation_set", "environment_set", "material_set", "texture_set", "light_set"];

export class Scene extends EventTarget {
    constructor(connection) {
        super();
        this.connection = connection;
        this.due_ms = Infinity; // when the list is requested again
        this.clear();
    }

    clear() {
        this.nodes = new Map();
        this.roots = [];
        this.assets = [];
        this.environment = null; // { kind, intensity, rotation_rad, ... } of info_query; null: not known
        this.total = 0;
        this.revision = 0n;
        this.listed = -1n;
        this.isWanted = false;
        this.isEdited = false; // by this page, but for what its link loads
        this.setTold(false);
        this.loads = 0; // edits that loaded or removed assets
        this.loader = 0n; // session that loaded an asset last; 0 = not known
    }

    // ---- opening -------------------------------------------------------------------------------

    // Joins or makes the scene.
    async open(name) {
        this.clear();
        this.name = name;
        const opened = await this.connection.call("scene_open", { name });
        this.setRange(opened);
        this.existed = opened.existed;
        this.revision = opened.revision;
    }

    setRange({ first_id, id_count }) {
        this.nextAsset = first_id;
        this.endAsset = first_id + id_count;
    }

    takeAssetNumber() {
        const used = new Set(this.assets.map((a) => a.number));
        while (used.has(this.nextAsset) && this.nextAsset < this.endAsset)
            this.nextAsset++;
        if (this.nextAsset >= this.endAsset)
            throw new RequestError({ status: "limit", what: "scene",
                reason: "this session has no numbers for assets left" });
        return this.nextAsset++;
    }

    async load(message, onProgress) {
        const warnings = [];
        const loaded = await this.connection.call("asset_load",
            { asset: this.takeAssetNumber(), path: "", files: [], ...message },
            (kind, body) => {
                if (kind === "progress")
                    onProgress(...describeProgress(body));
                else
                    warnings.push(body);
            });
        this.revision = loaded.revision;
        this.dispatchEvent(new Event("assets"));
        return { loaded, warnings };
    }

    loadPath(path, onProgress) {
        return this.load({ path }, onProgress);
    }

    async loadFiles(files, onProgress) {
        const sent = await upload(this.connection, files, onProgress);
        onProgress("Opening", null);
        this.isEdited = true;
        return this.load({ files: sent }, onProgress);
    }

    async unloadAll(assets) {
        for (const asset of assets)
            await this.connection.call("asset_unload", { asset: asset.number });
        this.dispatchEvent(new Event("assets"));
    }

    // ---- what is in it -------------------------------------------------------------------------

    // Whether edits are told (scene_watch): frames need not tell of them then.
    setTold(isTold) {
        this.isTold = isTold;
        this.edits = null; // number of the newest one
    }

    // A frame showed this revision.
    noteFrame(revision) {
        if (!this.isTold)
            this.noteRevision(revision);
        else if (revision > this.revision)
            this.revision = revision;
    }

    // Something that is listed has changed: the list on the page follows after a moment.
    noteRevision(revision, wait_ms = REFRESH_MS) {
        if (revision > this.revision)
            this.revision = revision;
        if (!this.isWanted || this.revision <= this.listed || this.due_ms <= performance.now() + wait_ms)
            return;
        clearTimeout(this.timer);
        this.due_ms = performance.now() + wait_ms;
        this.timer = setTimeout(() => {
            this.due_ms = Infinity;
            this.refresh().catch(() => {});
        }, wait_ms);
    }

    // Somebody's edit took effect, of which there may be no frame: none come of an empty scene.
    noteEdit({ message, session, revision, number }) {
        const isMissing = this.edits !== null && number !== this.edits + 1n; // one was not told
        this.edits = number;
        const name = findMessage(message)?.name;
        if (name === "environment_set" && session !== this.connection.session)
            this.noteEnvironment();
        const isAsset = name === "asset_load" || name === "asset_unload";
        if (UNLISTED.includes(name) && !isMissing)
            return;
        this.loads += isAsset;
        if (name === "asset_load")
            this.loader = session;
        if (isAsset || isMissing || session !== this.connection.session) // what this page did itself needs no new list
            this.noteRevision(revision, isAsset ? ASSET_MS : REFRESH_MS);
    }

    // Another client has changed the environment: what it is now follows after a moment.
    noteEnvironment() {
        if (!this.isWanted)
            return;
        this.lightTimer ??= setTimeout(async () => {
            this.lightTimer = undefined;
            this.setInfoEnvironment(await this.info().catch(() => ({})));
        }, ENVIRONMENT_MS);
    }

    async info() {
        return JSON.parse((await this.connection.call("info_query", {})).text);
    }

    setInfoEnvironment({ environment }) {
        if (!environment)
            return;
        this.environment = { ...environment, kind: environment.kind.toUpperCase() };
        this.dispatchEvent(new Event("environment"));
    }

    async refresh() {
        this.isWanted = true;
        let info, nodes, loads;
        do { // an asset that came or went between the answers: they do not belong together
            loads = this.loads;
            info = await this.info();
            nodes = await this.listNodes();
        } while (this.loads !== loads);
        this.listed = this.revision;
        this.assets = info.assets.map((asset, i) => ({ ...asset,
            number: asset.asset ?? this.guessNumber(nodes, i) }));
        this.index(nodes);
        this.setInfoEnvironment(info);
        this.dispatchEvent(new Event("changed"));
    }

    async listNodes() {
        const nodes = [];
        for (;;) {
            const page = await this.connection.call("nodes_query",
                { first: nodes.length, count: PAGE_NODES });
            nodes.push(...page.nodes);
            this.total = page.total;
            if (nodes.length >= page.total || !page.nodes.length || nodes.length >= MOST_NODES)
                return nodes;
        }
    }

    // Ids of loaded objects say their asset.
    guessNumber(nodes, index) {
        const numbers = [...new Set(nodes.map((n) => Number(n.node >> 32n)))].filter(Boolean);
        return numbers[index] ?? 0;
    }

    index(list) {
        this.nodes = new Map(list.map((n) => [n.node, { ...n, children: [] }]));
        this.roots = [];
        for (const node of this.nodes.values())
            (this.nodes.get(node.parent)?.children ?? this.roots).push(node);
    }

    nameOf(id) {
        const node = this.nodes.get(id);
        return node?.name || `node ${id & 0xffffffffn}`;
    }

    get cameras() {
        return [...this.nodes.values()].filter((n) => n.camera);
    }

    get animations() {
        return this.assets.flatMap((asset) => (asset.animations ?? []).map((a, i) =>
            ({ asset: asset.number, animation: i, name: a.name || `Animation ${i + 1}`,
                duration_s: a.duration_s, conflicts: a.conflicts })));
    }

    get variants() {
        return this.assets.flatMap((asset) => (asset.variants ?? []).map((name) =>
            ({ asset: asset.number, name })));
    }

    // ---- edits ---------------------------------------------------------------------------------

    async edit(name, message) {
        this.isEdited = true;
        const { revision } = await this.connection.call(name, message);
        // What this page did itself needs no new list.
        if (this.listed === this.revision)
            this.listed = revision;
        this.revision = revision;
    }

    async setVisible(id, visible) {
        await this.edit("node_set", { node: id, visible });
        const node = this.nodes.get(id);
        if (node)
            node.visible = visible;
        this.dispatchEvent(new Event("changed"));
    }

    async setVariant(number, variant) {
        try {
            await this.edit("variant_set", { asset: number, variant });
            const asset = this.assets.find((a) => a.number === number);
            if (asset)
                asset.variant = variant;
        } finally {
            this.dispatchEvent(new Event("changed")); // what is refused is not chosen
        }
    }

    setAnimation(asset, animation, time_s) {
        return this.edit("animation_set", { asset, animation, time_s });
    }

    async setEnvironment(fields) {
        try {
            await this.edit("environment_set", fields);
            const { hash, ...known } = fields;
            this.environment = { ...this.environment, ...known };
        } finally {
            this.dispatchEvent(new Event("environment")); // what is refused is not chosen
        }
    }

    async setEnvironmentFile(files, onProgress) {
        const [{ hash }] = await upload(this.connection, files, onProgress);
        await this.setEnvironment({ kind: "FILE", hash });
    }

    bounds(node) {
        return this.connection.call("bounds_query", { node });
    }
}
