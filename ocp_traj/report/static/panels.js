"use strict";
// What moves over time, a panel a quantity and unit: its curves, its limits, where they bind, and the instant shown.
ocp.parts.panels = (() => {
  const ORDERS = ["position", "velocity", "acceleration", "jerk", "snap"];
  const SYMBOLS = ["q", "v", "a", "jerk", "snap"];
  const NEAR = 1.0; // a bound is drawn where it lies within so many ranges of the data, ..
  const CLOSE = 0.1; // .. or this share of the limit's scale; it is written above the panel where it does not
  const BINDING = 1e-3; // margin up to which a limit is said to bind

  // Every panel of a set: {title, unit, limit, order, rows: [{index, label, colour, dash, lower, upper}]}.
  const panelsOf = (set) => {
    const found = [];
    const split = (limit, order, labels, units, title) => {
      for (const unit of new Set(units)) {
        const rows = labels.map((label, index) => ({ label, index })).filter(({ index }) => units[index] === unit)
          .map(({ label, index }) => ({
            label, index, joint: labels.length === set.joints.length ? index : null,
            lower: limit ? limit.lower[index] : null, upper: limit ? limit.upper[index] : null,
            scale: limit ? limit.scale[index] : 1,
          }));
        found.push({ title, unit, limit, order, rows });
      }
    };
    SYMBOLS.forEach((symbol, order) => {
      const limit = set.limits.find((one) => one.order === order) || null;
      const highest = Math.max(...set.points.flatMap((point) => point.degrees));
      if (!limit && order > highest) return; // nothing but zeros
      split(limit, order, set.joints, set.units[order], `${ORDERS[order]} ${symbol === ORDERS[order] ? "" : symbol}`.trim());
    });
    for (const limit of set.limits.filter((one) => one.order === null)) {
      if (limit.kind === "clearance") found.push({ title: limit.id, unit: "m", limit, order: null, rows: [{ label: "least of all pairs", index: 0, joint: null, lower: limit.lower[0], upper: null, scale: limit.scale[0] }] });
      else split(limit, null, limit.labels, limit.units, limit.id);
    }
    return found;
  };

  class Panels {
    constructor(changed) {
      this.element = ocp.get("panels");
      this.hidden = new Set();
      this.changed = changed;
      ocp.get("curves-note").textContent = "Dashed: limits; one that lies far off is written above its panel. ◆: a limit binds there, its margin at most 0.1 %. Click a curve to go to that instant.";
    }

    // The panels of a set, empty as yet.
    build(set) {
      this.set = set;
      this.panels = panelsOf(set);
      this.hidden.clear();
      this._chips();
      const boxes = this.panels.map((panel) => {
        panel.plot = ocp.element("div", { class: "plot" });
        panel.far = ocp.element("span", { class: "far" });
        panel.cursor = ocp.element("div", { class: "cursor", hidden: "" });
        const head = ocp.element("h3", {}, ocp.quantity(panel.title, panel.unit), panel.far);
        return ocp.element("div", { class: "panel" }, head, panel.plot, panel.cursor);
      });
      for (const old of this.element.querySelectorAll(".js-plotly-plot")) Plotly.purge(old);
      ocp.clear(this.element, ...boxes);
    }

    _chips() {
      const chips = this.set.joints.map((joint, index) => {
        const swatch = document.createElementNS("http://www.w3.org/2000/svg", "svg");
        for (const [name, value] of Object.entries({ width: 22, height: 8, "aria-hidden": "true" })) swatch.setAttribute(name, value);
        const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
        const dash = { solid: "", dash: "6 3", dot: "2 2", dashdot: "6 2 2 2" }[ocp.dash(index)];
        for (const [name, value] of Object.entries({ x1: 0, x2: 22, y1: 4, y2: 4, stroke: ocp.colour(index), "stroke-width": 3, "stroke-dasharray": dash })) line.setAttribute(name, value);
        swatch.append(line);
        const chip = ocp.element("button", { type: "button", class: "chip", "aria-pressed": "true", title: "show or hide" }, swatch, joint);
        chip.addEventListener("click", () => {
          if (this.hidden.has(index)) this.hidden.delete(index); else this.hidden.add(index);
          chip.setAttribute("aria-pressed", String(!this.hidden.has(index)));
          this.settled = this.fill(this.point, this.curve);
        });
        return chip;
      });
      ocp.clear(ocp.get("joints"), ...chips);
    }

    // The curves of a point, panel by panel so that the page stays quick; a later call ends an earlier one.
    async fill(point, curve) {
      this.point = point;
      this.curve = curve;
      const turn = (this.turn = (this.turn || 0) + 1);
      await ocp.plotly();
      for (const panel of this.panels) {
        if (turn !== this.turn) return;
        this._data(panel);
        await Plotly.react(panel.plot, ...this._drawn(panel), ocp.config);
        if (!panel.listening) {
          panel.listening = true;
          panel.plot.on("plotly_click", (event) => this.changed(event.points[0].x));
          panel.plot.on("plotly_afterplot", () => this.show(this.time));
        }
        await new Promise((done) => setTimeout(done));
      }
      if (turn === this.turn) this.show(this.time);
    }

    // Times and values of every row.
    _data(panel) {
      const { curve, point } = this;
      if (panel.order !== null) {
        const { times, values } = curve.sample(panel.order);
        panel.times = times;
        panel.rows.forEach((row) => { row.values = values[row.index]; });
        return;
      }
      const sample = point.samples[panel.limit.id];
      if (panel.limit.kind === "clearance") {
        panel.times = curve.times(sample.least.shape[1]);
        panel.rows[0].values = Array.from(ocp.unpack(sample.least));
        panel.rows[0].text = Array.from(ocp.unpack(sample.row), (row) => panel.limit.labels[row]);
        if (panel.limit.parameter) panel.rows[0].lower = point.parameters[panel.limit.parameter];
        return;
      }
      const [, each, width] = sample.shape;
      const flat = ocp.unpack(sample);
      panel.times = curve.times(each);
      panel.rows.forEach((row) => {
        row.values = panel.times.map((_, i) => (Number.isNaN(flat[i * width + row.index]) ? null : flat[i * width + row.index]));
      });
    }

    // Rows of the audit that belong to a panel and bind.
    _binding(panel, rows) {
      if (!panel.limit) return [];
      const { set, point } = this;
      const numbers = point.unpackedNumbers;
      return point.row.flatMap((key, i) => {
        const [limit, label] = set.rows[key];
        const [, attained, instant, , margin] = numbers.slice(6 * i, 6 * i + 6);
        const mine = limit === panel.limit.id && margin <= BINDING && Number.isFinite(attained);
        const row = panel.limit.kind === "clearance" ? rows[0] : rows.find((one) => one.label === label);
        return mine && row ? [{ row, attained, instant, label }] : [];
      });
    }

    _drawn(panel) {
      const rows = panel.rows.filter((row) => row.joint === null || !this.hidden.has(row.joint));
      const traces = rows.map((row) => ({
        type: "scatter", mode: "lines", name: row.label, x: panel.times, y: row.values, text: row.text,
        line: { color: ocp.colour(row.index), width: 1.8, dash: ocp.dash(row.index) }, connectgaps: false,
        hovertemplate: `${row.label}${row.text ? " %{text}" : ""} %{y:.6g} at %{x:.4g} s<extra></extra>`,
      }));
      const { lines, far, low, high } = this._bounds(rows);
      panel.far.textContent = far;
      for (const { value, colour } of lines) {
        traces.push({ type: "scatter", mode: "lines", x: [0, this.curve.duration], y: [value, value], hoverinfo: "skip", line: { color: colour, width: 1.4, dash: "6px,4px" } });
      }
      const binding = this._binding(panel, rows);
      traces.push({
        type: "scatter", mode: "markers", x: binding.map((b) => b.instant), y: binding.map((b) => b.attained),
        text: binding.map((b) => b.label), hovertemplate: "%{text} binds: %{y:.6g} at %{x:.4g} s<extra></extra>",
        marker: { symbol: "diamond", size: 9, color: binding.map((b) => ocp.colour(b.row.index)), line: { width: 1.2, color: ocp.shade("ink") } },
      });
      const pad = 0.07 * (high - low);
      const knots = this.curve.segments > 40 ? [] : this.curve.knots.map((x) => ({ type: "line", x0: x, x1: x, y0: 0, y1: 1, yref: "paper", layer: "below", line: { width: 1, color: ocp.shade("grid") } }));
      return [traces, ocp.layout({
        margin: { l: 48, r: 8, t: 4, b: 34 }, hovermode: "closest", shapes: knots,
        xaxis: ocp.axis({ range: [0, this.curve.duration], showgrid: false, automargin: false, title: { text: "time [s]", standoff: 2, font: { size: 11 } } }),
        yaxis: ocp.axis({ range: [low - pad, high + pad], nticks: 5, automargin: true, tickformat: "~g", exponentformat: "power" }),
      })];
    }

    // Bounds to draw, those too far off in words, and the range of values to show.
    _bounds(rows) {
      const values = rows.flatMap((row) => row.values).filter((v) => v !== null);
      let low = values.length ? values.reduce((a, b) => Math.min(a, b)) : 0;
      let high = values.length ? values.reduce((a, b) => Math.max(a, b)) : 0;
      const scale = Math.max(...rows.map((row) => row.scale), 0) || 1;
      const room = Math.max(high - low, 1e-3 * scale);
      const near = Math.max(NEAR * room, CLOSE * scale);
      const [least, most] = [low - near, high + near];
      const lines = new Map();
      const far = new Map();
      for (const row of rows) {
        for (const [bound, sign] of [[row.lower, "≥"], [row.upper, "≤"]]) {
          if (bound === null || bound === undefined) continue;
          if (bound >= least && bound <= most) {
            low = Math.min(low, bound);
            high = Math.max(high, bound);
            lines.set(bound, lines.has(bound) ? ocp.shade("bad") : ocp.colour(row.index));
          } else {
            const both = row.lower === -row.upper && !(-bound >= least && -bound <= most);
            const words = both ? `±${ocp.number(row.upper, 4)}` : `${sign} ${ocp.number(bound, 4)}`;
            far.set(words, (far.get(words) || new Set()).add(row.label));
          }
        }
      }
      if (rows.length === 1) for (const bound of lines.keys()) lines.set(bound, ocp.shade("bad"));
      const all = [...far].map(([words, labels]) => {
        if (labels.size === rows.length) return words;
        return `${words} (${labels.size > 2 ? `${labels.size} of ${rows.length}` : [...labels].join(", ")})`;
      });
      if (high - low < 1e-9 * Math.max(Math.abs(high), scale)) [low, high] = [low - 0.5 * room, high + 0.5 * room];
      return { lines: [...lines].map(([value, colour]) => ({ value, colour })), far: all.length ? `limit ${all.join("; ")}` : "", low, high };
    }

    // The instant, as a line over every panel.
    show(time) {
      this.time = time;
      for (const panel of this.panels || []) {
        const layout = panel.plot._fullLayout;
        if (!layout || !layout.xaxis || !layout.xaxis._length) continue;
        const [from, to] = layout.xaxis.range;
        const share = (time - from) / (to - from);
        const inside = share >= 0 && share <= 1;
        panel.cursor.hidden = !inside;
        if (!inside) continue;
        panel.cursor.style.left = `${panel.plot.offsetLeft + layout.xaxis._offset + share * layout.xaxis._length - 1}px`;
        panel.cursor.style.top = `${panel.plot.offsetTop + layout.yaxis._offset}px`;
        panel.cursor.style.height = `${layout.yaxis._length}px`;
      }
    }
  }

  return { Panels, SYMBOLS, BINDING };
})();
