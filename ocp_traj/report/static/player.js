"use strict";
// Time: a slider, play and pause, speed, steps. What follows it is told of every change.
ocp.parts.player = (() => {
  const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2];

  class Player {
    constructor(changed) {
      this.changed = changed;
      this.duration = 1;
      this.time = 0;
      this.playing = false;
      this.frames = []; // times at which the last ones were drawn [ms]
      this.slider = ocp.get("time");
      this.speed = ocp.get("speed");
      for (const value of SPEEDS) {
        this.speed.append(ocp.element("option", { value, selected: value === 1 ? "" : null }, `× ${value}`));
      }
      this.slider.addEventListener("input", () => this.to(Number(this.slider.value) * this.duration));
      ocp.get("play").addEventListener("click", () => this.toggle());
    }

    // Of another trajectory: the same share of it has passed.
    over(duration) {
      const share = this.time / this.duration;
      this.duration = duration;
      this.to(share * duration);
    }

    to(time) {
      this.time = Math.min(Math.max(time, 0), this.duration);
      this.slider.value = String(this.time / this.duration);
      const digits = this.duration < 1 ? 3 : 2;
      ocp.get("clock").textContent = `${this.time.toFixed(digits)} of ${this.duration.toFixed(digits)} s`;
      this.slider.setAttribute("aria-valuetext", ocp.get("clock").textContent);
      this.changed(this.time);
    }

    step(share) { this.to(this.time + share * this.duration); }

    toggle() {
      this.playing = !this.playing;
      ocp.get("play").textContent = this.playing ? "❚❚" : "▶";
      if (!this.playing) return;
      if (this.time >= this.duration) this.to(0);
      let last = performance.now();
      this.frames = [];
      const frame = (now) => {
        if (!this.playing) return;
        const passed = Math.max((now - last) / 1000, 0) * Number(this.speed.value);
        last = now;
        this.frames = [...this.frames.slice(-120), now];
        const next = this.time + passed;
        this.to(next > this.duration ? next % this.duration : next);
        requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }

    // Frames a second while it plays.
    get rate() {
      const span = this.frames[this.frames.length - 1] - this.frames[0];
      return this.frames.length > 1 ? (1000 * (this.frames.length - 1)) / span : 0;
    }
  }

  return { Player };
})();
