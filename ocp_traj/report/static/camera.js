"use strict";
// A parallel view of space, all axes to one scale: turned, moved and zoomed by pointer, wheel and buttons.
ocp.parts.camera = (() => {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const n = Math.hypot(...a); return a.map((c) => c / n); };

  // yaw, pitch [rad] of each view.
  const VIEWS = { oblique: [-0.75, 0.42], front: [0, 0], side: [Math.PI / 2, 0], top: [0, Math.PI / 2] };

  class Camera {
    constructor(canvas, up, changed) {
      this.canvas = canvas;
      this.changed = changed;
      this.up = unit(up);
      const other = Math.abs(this.up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
      const along = other.map((c, i) => c - dot(other, this.up) * this.up[i]);
      this.ahead = unit(along); // the world's x, where up is not along it
      this.left = cross(this.up, this.ahead);
      this.centre = [0, 0, 0];
      this.reach = 1;
      this.view("oblique");
      this._listen();
    }

    view(name) {
      [this.yaw, this.pitch] = VIEWS[name];
      this.zoom = 1;
      this.shift = [0, 0];
      this.changed();
    }

    // What has to be in sight: points of space.
    fit(points) {
      const low = [Infinity, Infinity, Infinity];
      const high = [-Infinity, -Infinity, -Infinity];
      for (const p of points) {
        for (let i = 0; i < 3; i++) {
          low[i] = Math.min(low[i], p[i]);
          high[i] = Math.max(high[i], p[i]);
        }
      }
      if (!Number.isFinite(low[0])) return;
      this.centre = low.map((c, i) => (c + high[i]) / 2);
      this.reach = Math.max(...points.map((p) => Math.hypot(...p.map((c, i) => c - this.centre[i]))), 1e-3);
    }

    // To be called before drawing.
    aim() {
      const box = this.canvas.getBoundingClientRect();
      const ratio = window.devicePixelRatio || 1;
      const [width, height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
      if (this.canvas.width !== width || this.canvas.height !== height) {
        this.canvas.width = width;
        this.canvas.height = height;
      }
      this.ratio = ratio;
      this.scale = (this.zoom * 0.47 * Math.min(width, height)) / this.reach; // pixels a metre
      const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
      const mix = (a, b, c) => [0, 1, 2].map((i) => a * this.ahead[i] + b * this.left[i] + c * this.up[i]);
      this.toEye = mix(cy * cp, sy * cp, sp);
      this.toRight = cross(this.up, mix(cy, sy, 0));
      this.toTop = cross(this.toEye, this.toRight);
      this.origin = [width / 2 + this.shift[0] * ratio, height / 2 + this.shift[1] * ratio];
    }

    // Pixels from the left and from the top, and how near the eye [m].
    see(p) {
      const d = [p[0] - this.centre[0], p[1] - this.centre[1], p[2] - this.centre[2]];
      return [
        this.origin[0] + this.scale * dot(d, this.toRight),
        this.origin[1] - this.scale * dot(d, this.toTop),
        dot(d, this.toEye),
      ];
    }

    // How much a face with this normal looks at the eye.
    facing(normal) { return dot(normal, this.toEye); }

    zoomBy(factor) {
      this.zoom = Math.min(Math.max(this.zoom * factor, 0.2), 40);
      this.changed();
    }

    _listen() {
      const held = new Map();
      const apart = () => {
        const [a, b] = [...held.values()];
        return Math.hypot(a[0] - b[0], a[1] - b[1]);
      };
      this.canvas.addEventListener("pointerdown", (event) => {
        this.canvas.setPointerCapture(event.pointerId);
        held.set(event.pointerId, [event.clientX, event.clientY]);
      });
      this.canvas.addEventListener("pointermove", (event) => {
        const last = held.get(event.pointerId);
        if (!last) return;
        const before = held.size === 2 ? apart() : 0;
        const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
        held.set(event.pointerId, [event.clientX, event.clientY]);
        if (held.size === 2) {
          this.shift = [this.shift[0] + dx / 2, this.shift[1] + dy / 2];
          if (before > 0) this.zoomBy(apart() / before);
        } else if (event.shiftKey || event.buttons === 2) {
          this.shift = [this.shift[0] + dx, this.shift[1] + dy];
        } else {
          this.yaw -= 0.008 * dx;
          this.pitch = Math.min(Math.max(this.pitch + 0.008 * dy, -Math.PI / 2), Math.PI / 2);
        }
        this.changed();
      });
      for (const name of ["pointerup", "pointercancel"]) {
        this.canvas.addEventListener(name, (event) => held.delete(event.pointerId));
      }
      this.canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      this.canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        this.zoomBy(Math.exp(-0.0015 * event.deltaY));
      }, { passive: false });
    }
  }

  return { Camera, VIEWS };
})();
