"use strict";
// Piecewise Bezier curves from their control points: places and derivatives by de Casteljau's algorithm.
ocp.parts.curve = (() => {
  const ORDERS = 5; // q, v, a, jerk, snap

  class Curve {
    // point: of the data; dof: number of joints.
    constructor(point, dof) {
      this.dof = dof;
      this.durations = ocp.unpack(point.durations);
      this.knots = [0];
      for (const duration of this.durations) this.knots.push(this.knots[this.knots.length - 1] + duration);
      const control = ocp.unpack(point.control);
      let begin = 0;
      this.hodographs = point.degrees.map((degree, k) => {
        const points = control.subarray(begin * dof, (begin + degree + 1) * dof);
        begin += degree + 1;
        return this._derivatives(points, degree, this.durations[k]);
      });
    }

    get segments() { return this.durations.length; }
    get duration() { return this.knots[this.knots.length - 1]; }

    // Control points of derivatives 0 .. 4 over time: n (P[i + 1] - P[i]) / T, again and again.
    _derivatives(points, degree, duration) {
      const found = [points];
      for (let order = 1; order < ORDERS; order++) {
        const last = found[order - 1];
        const lower = degree - order;
        const next = new Float64Array(Math.max(lower + 1, 1) * this.dof);
        for (let i = 0; i < (lower + 1) * this.dof && lower >= 0; i++) {
          next[i] = ((lower + 1) / duration) * (last[i + this.dof] - last[i]);
        }
        found.push(next);
      }
      return found;
    }

    // Segment and local time in [0, 1] of a time [s].
    place(t) {
      let k = 0;
      while (k < this.segments - 1 && t >= this.knots[k + 1]) k++;
      return [k, Math.min(Math.max((t - this.knots[k]) / this.durations[k], 0), 1)];
    }

    // The order-th derivative of all joints on a segment at a local time.
    on(k, u, order) {
      const work = Float64Array.from(this.hodographs[k][order]);
      for (let left = work.length / this.dof - 1; left > 0; left--) {
        for (let i = 0; i < left * this.dof; i++) work[i] = (1 - u) * work[i] + u * work[i + this.dof];
      }
      return work.slice(0, this.dof);
    }

    at(t, order = 0) {
      const [k, u] = this.place(t);
      return this.on(k, u, order);
    }

    // Times, and a list of values a joint; an inner knot appears once a side.
    sample(order, count = 240) {
      const each = Math.max(Math.ceil(count / this.segments), 4);
      const times = [];
      const values = Array.from({ length: this.dof }, () => []);
      for (let k = 0; k < this.segments; k++) {
        for (let i = 0; i <= each; i++) {
          times.push(this.knots[k] + (i / each) * this.durations[k]);
          this.on(k, i / each, order).forEach((value, joint) => values[joint].push(value));
        }
      }
      return { times, values };
    }

    // Times of values that were sampled at even local times of every segment, both ends among them.
    times(each) {
      const times = [];
      for (let k = 0; k < this.segments; k++) {
        for (let i = 0; i < each; i++) times.push(this.knots[k] + (i / (each - 1)) * this.durations[k]);
      }
      return times;
    }
  }

  return { Curve, ORDERS };
})();
