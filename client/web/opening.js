// opening.js - scenes that come into the page: dropped, chosen, or the demo; and the empty scene.
import { ask, button, h, icon, toast } from "./dom.js";
import { choose, filesOf } from "./upload.js";

export class Opening {
    constructor(app, zone, section) {
        this.app = app;
        this.section = section;
        this.framed = null; // Set of what the camera was chosen for (contents); null: not yet known
        this.isOpening = false;
        this.input = h("input", { type: "file", multiple: true, class: "hidden", tabindex: "-1",
            "aria-label": "Files to open", on: { change: () => this.openPicked() } });
        this.listen(zone);
    }

    listen(zone) {
        let depth = 0;
        const show = (by) => {
            depth = by === 0 ? 0 : depth + by;
            zone.hidden = depth <= 0 || !this.app.connection.canEdit;
        };
        addEventListener("dragenter", (e) => { e.preventDefault(); show(1); });
        addEventListener("dragleave", () => show(-1));
        addEventListener("dragover", (e) => e.preventDefault());
        addEventListener("drop", (e) => {
            e.preventDefault();
            show(0);
            this.app.attempt(async () => this.openFiles(await filesOf(e.dataTransfer)));
        });
    }

    openPicked() {
        const files = [...this.input.files].map((file) => ({ path: file.name, file }));
        this.input.value = "";
        this.app.attempt(() => this.openFiles(files));
    }

    async openFiles(files) {
        const { app } = this;
        if (!files.length)
            return;
        if (!app.connection.canEdit) {
            toast("Your access is view only: files cannot be opened here.", "error");
            return;
        }
        const chosen = await choose(files);
        if (chosen.kind === "environment") {
            await app.withProgress(chosen.name, (onProgress) =>
                app.scene.setEnvironmentFile(chosen.files, onProgress));
            return;
        }
        if (chosen.others?.length)
            toast(`${chosen.name} is opened, one scene at a time. Not opened: ${chosen.others.join(", ")}.`);
        await this.open({ files: chosen.files }, chosen.name, (onProgress) =>
            app.scene.loadFiles(chosen.files, onProgress));
    }

    openDemo() {
        const { app } = this;
        return app.attempt(() => this.open({ path: "demo:" }, "demo", (onProgress) =>
            app.scene.loadPath("demo:", onProgress)));
    }

    // Loads into an empty scene, or asks whether what is there goes.
    async open(opened, name, load) {
        const { app } = this;
        const before = app.scene.assets;
        const answer = before.length ? await ask(`Open ${name}`, h("p", { text:
            "The scene is not empty. Everyone who looks at it sees what is opened." }),
        [["Cancel", "cancel"], ["Add to the scene", "add"], ["Replace", "replace"]]) : "replace";
        if (answer !== "add" && answer !== "replace")
            return;
        this.isOpening = true;
        try {
            await app.withProgress(name, async (onProgress) => {
                const { loaded, warnings } = await load(onProgress);
                if (answer === "replace")
                    await app.scene.unloadAll(before);
                app.opened = opened;
                app.openedName = answer === "replace" ? name : app.openedName;
                await this.show(name, loaded, warnings);
            });
        } finally {
            this.isOpening = false;
        }
    }

    async show(name, loaded, warnings) {
        this.setEmpty(false);
        await this.frame();
        const count = warnings.length;
        const notes = count ? ` ${count} ${count === 1 ? "note" : "notes"}: see the scene panel.` : "";
        toast(`${name}: ${Number(loaded.triangles).toLocaleString()} triangles.${notes}`);
        await this.app.refreshScene();
    }

    // Begins with what is in the scene now.
    async frame() {
        const { app } = this;
        app.inspector.reset();
        app.looks.reset();
        await app.view.fitFirst();
        app.updateView();
    }

    // What the scene holds, as keys.
    contents() {
        const { assets, total } = this.app.scene;
        return new Set(assets.length || !total ? assets.map((a) => a.number) : ["nodes"]);
    }

    // The scene was listed. When another client has replaced everything that the camera was framed on, it is
    // framed again, except when others move it, or it is that of a link into an empty scene.
    async followScene() {
        const { app, framed } = this;
        const now = this.contents();
        if (!framed || this.isOpening)
            this.framed = now;
        if (this.framed === now || !now.size || [...now].some((key) => framed.has(key)))
            return;
        this.framed = now;
        const files = app.scene.assets.map((a) => a.file?.split("/").pop()).filter(Boolean).join(", ");
        app.opened = null;
        app.openedName = files || undefined;
        app.showTitle();
        const who = app.people.knownName(app.scene.loader);
        if (files)
            toast(who ? `${who} opened ${files}.` : `${files} was opened.`);
        if (app.people.canMove && (framed.size || !app.link.camera))
            await this.frame();
    }

    setEmpty(isEmpty) {
        const { app, section } = this;
        section.hidden = !isEmpty;
        app.view.setEmpty(isEmpty);
        if (!isEmpty)
            return;
        const { canEdit } = app.connection;
        app.status.set("settled", "Ready");
        section.replaceChildren(icon("scene"), h("h2", { text: "Nothing to see yet" }),
            h("p", { text: canEdit ? "Drop a scene here: glTF with its files, OBJ, FBX, Collada, PLY, STL, OFF or a height map."
                : "This scene is empty, and your access is view only." }),
            ...canEdit ? [h("div", { class: "choices" },
                button("Choose files", () => this.input.click(), { class: "button primary" }),
                button("Open the demo", () => this.openDemo()))] : []);
    }
}
