// timeline.js - the animation bar: which animation, play and pause, the time.
import { h, icon } from "./dom.js";

const timeText = (s) => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;

export class Timeline {
    // on: { set(asset, animation, time_s) -> promise, change() }
    constructor(element, on) {
        this.element = element;
        this.on = on;
        this.list = [];
        this.time_s = 0;
        this.isPlaying = false;
        this.isBusy = false;
        this.build();
    }

    build() {
        this.play = h("button", { type: "button", class: "icon-button",
            on: { click: () => this.toggle() } });
        this.select = h("select", { "aria-label": "Animation",
            on: { change: () => { this.choose(); this.seek(0); } } });
        this.slider = h("input", { type: "range", min: "0", step: "any", value: "0",
            "aria-label": "Time", on: { input: () => this.seek(Number(this.slider.value)) } });
        this.output = h("output", {});
        this.element.append(this.play, this.select, this.slider, this.output);
        this.show();
    }

    // The scene's animations; those of one asset that move different things can also run together. What is chosen stays chosen. Who may
    // not edit has no bar: the time is not known there.
    setAnimations(list, canEdit) {
        const key = JSON.stringify(list);
        if (key !== this.key) {
            const was = this.current, { time_s } = this;
            this.key = key;
            const together = new Map();
            for (const a of list)
                together.set(a.asset, [...together.get(a.asset) ?? [], a]);
            this.list = [...together].flatMap(([asset, all]) => {
                const joint = all.filter((a) => !a.conflicts);
                return joint.length < 2 ? all : [{ asset, animation: -1, name: "All together",
                    duration_s: Math.max(...joint.map((a) => a.duration_s)) }, ...all];
            });
            this.select.replaceChildren(...this.list.map((a, i) =>
                h("option", { value: String(i), text: a.name })));
            const at = this.list.findIndex((a) =>
                a.asset === was?.asset && a.animation === was.animation);
            this.select.value = String(Math.max(0, at));
            this.choose(at < 0 ? 0 : time_s);
        }
        this.select.hidden = this.list.length < 2;
        this.element.hidden = !this.list.length || !canEdit;
        if (this.element.hidden)
            this.pause();
    }

    get current() {
        return this.list[Number(this.select.value) || 0];
    }

    choose(time_s = 0) {
        this.time_s = time_s;
        this.slider.max = String(this.current?.duration_s ?? 1);
        this.show();
    }

    toggle() {
        if (this.element.hidden)
            return;
        this.isPlaying = !this.isPlaying;
        this.show();
        this.on.change();
    }

    pause() {
        this.isPlaying = false;
        this.show();
    }

    seek(time_s) {
        this.time_s = time_s;
        this.isPending = true;
        this.show();
        this.send();
    }

    // One animation frame; true while it plays.
    tick(dt_s) {
        if (!this.isPlaying)
            return false;
        this.time_s = (this.time_s + dt_s) % Math.max(this.current.duration_s, 1e-3);
        this.isPending = true;
        this.show();
        this.send();
        return true;
    }

    // The newest time wins: one edit is under way at a time.
    async send() {
        if (this.isBusy || !this.isPending)
            return;
        this.isBusy = true;
        this.isPending = false;
        const { asset, animation } = this.current;
        try {
            await this.on.set(asset, animation, this.time_s);
        } catch {
            this.pause();
        }
        this.isBusy = false;
        if (this.isPending)
            this.send();
    }

    show() {
        const label = this.isPlaying ? "Pause" : "Play";
        if (this.play.title !== label) {
            this.play.title = label;
            this.play.setAttribute("aria-label", label);
            this.play.replaceChildren(icon(this.isPlaying ? "pause" : "play"));
        }
        this.slider.value = String(this.time_s);
        this.output.textContent = timeText(this.time_s);
        this.slider.setAttribute("aria-valuetext", this.output.textContent);
    }
}
