"use strict";
// The front: two objectives as a plot; more of them in space and as parallel coordinates. A click chooses a point.
ocp.parts.front = (() => {
  const SYMBOLS = { proved: "circle", checked: "circle", undecided: "diamond", violated: "x" };
  const PAPER = ["triangle-up", "triangle-down", "star", "pentagon", "hexagram"];

  class Front {
    constructor(sets, choose) {
      this.sets = sets;
      this.choose = choose;
      this.element = ocp.get("front");
      const first = sets.find((set) => set.isRun);
      this.names = first ? first.traded : [];
      this.objectives = this.names.map((name) => first.objectives.find((o) => o.id === name));
      // What can be put into one picture: sets whose points have all the objectives of the first run.
      this.shown = sets.map((set, index) => ({ set, index }))
        .filter(({ set }) => this.objectives.every((objective) => this._has(set, objective)));
      this.left = sets.filter((set) => !this.shown.some((one) => one.set === set)).map((set) => set.name);
      this.kind = this.names.length > 2 ? "parallel coordinates" : "plot";
      if (this.names.length > 2) this._buttons();
    }

    get empty() { return this.names.length < 2; }

    _has(set, { id, unit }) {
      const index = set.objectives.findIndex((o) => o.id === id && o.unit === unit);
      return index >= 0 && set.points.every((point) => point.objectives[index] !== null);
    }

    value(set, point, name) { return point.objectives[set.objectives.findIndex((o) => o.id === name)]; }

    label(objective) {
      return ocp.quantity(objective.id, objective.unit) + (objective.sense === "max" ? ", more is better" : "");
    }

    _buttons() {
      const pairs = this.names.flatMap((a, i) => this.names.slice(i + 1).map((b) => [a, b]));
      const kinds = ["parallel coordinates", "3-D", ...pairs.map(([a, b]) => `${a}, ${b}`)];
      const press = (kind) => {
        this.kind = kind;
        for (const button of ocp.get("front-views").children) button.setAttribute("aria-pressed", String(button.textContent === kind));
        this.draw();
      };
      ocp.clear(ocp.get("front-views"), ...kinds.map((kind) => ocp.element(
        "button", { type: "button", "aria-pressed": String(kind === this.kind), onclick: () => press(kind) }, kind)));
    }

    select(setIndex, pointIndex) {
      this.chosen = [setIndex, pointIndex];
      return this.draw();
    }

    async draw() {
      if (this.empty) return;
      ocp.get("front-title").textContent = `Front: ${this.names.join(", ")}`;
      ocp.get("front-note").textContent = [
        "Click or tap a point, or use the arrow keys.",
        this.left.length ? `Not drawn here, for want of these objectives: ${this.left.join(", ")}.` : "",
      ].join(" ");
      await ocp.plotly();
      const made = this.kind === "parallel coordinates" ? this._parallel()
        : this.kind === "3-D" ? this._space()
          : this._plane(this.kind === "plot" ? this.names : this.kind.split(", "));
      await Plotly.react(this.element, made.traces, made.layout, ocp.config);
      this._listen();
    }

    _listen() {
      if (this.listening) return;
      this.listening = true;
      this.element.on("plotly_click", (event) => {
        const where = event.points.map((p) => p.customdata).find((data) => data);
        if (where) this.choose(where[0], where[1]);
      });
    }

    // Points of each set, then what marks some of them, for any list of objectives.
    _groups(names) {
      const all = ({ set }) => set.points.map((point) => names.map((name) => this.value(set, point, name)));
      const groups = this.shown.map((one, order) => ({
        name: one.set.name, values: all(one), data: one.set.points.map((_, i) => [one.index, i]),
        text: one.set.points.map((point) => `${one.set.name}, point ${point.name}, ${point.verdict}`),
        marker: { color: ocp.colour(order === 3 ? 7 : order), size: one.set.isRun ? 8 : 12, symbol: one.set.isRun ? one.set.points.map((p) => SYMBOLS[p.verdict]) : "star" },
        lines: one.set.isRun && names.length === 2,
      }));
      const at = (one, index) => names.map((name) => this.value(one.set, one.set.points[index], name));
      const marked = (name, pick, marker) => {
        const found = this.shown.filter((one) => one.set.isRun).flatMap((one) => pick(one.set).map((index) => ({ one, index })));
        if (!found.length) return;
        groups.push({
          name, values: found.map(({ one, index }) => at(one, index)), data: found.map(({ one, index }) => [one.index, index]),
          text: found.map(({ one, index }) => `${name}: ${one.set.name}, point ${index}`), marker,
        });
      };
      const ring = (color, size, symbol) => ({ color, size, symbol, line: { width: 2, color } });
      marked("ends", (set) => set.ends, ring(ocp.shade("soft"), 15, "square-open"));
      marked("knee", (set) => (set.knee === null ? [] : [set.knee]), ring(ocp.shade("good"), 17, "diamond-open"));
      const paper = {};
      for (const { set } of this.shown) Object.assign(paper, set.paper);
      Object.entries(paper).forEach(([label, values], i) => {
        if (!names.every((name) => name in values)) return;
        groups.push({ name: label, values: [names.map((name) => values[name])], data: [null], text: [label], marker: { color: "#cc79a7", size: 11, symbol: PAPER[i % PAPER.length], line: { width: 1, color: ocp.shade("ink") } } });
      });
      const one = this.shown.find(({ index }) => index === this.chosen[0]);
      if (one) {
        groups.push({
          name: "chosen", values: [at(one, this.chosen[1])], data: [this.chosen], text: ["chosen"],
          marker: ring(ocp.shade("chosen"), 20, "circle-open"),
        });
      }
      return groups;
    }

    _legend() {
      return { showlegend: true, legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 11 } } };
    }

    _plane(names) {
      const [x, y] = names.map((name) => this.objectives.find((o) => o.id === name));
      const traces = this._groups(names).map((group) => ({
        type: "scatter", mode: group.lines && this.names.length === 2 ? "lines+markers" : "markers", name: group.name,
        x: group.values.map((v) => v[0]), y: group.values.map((v) => v[1]), customdata: group.data, text: group.text,
        marker: group.marker, line: { width: 1, color: group.marker.color, dash: "dot" },
        hovertemplate: `%{text}<br>${x.id} %{x:.6g} ${ocp.unit(x.unit)}<br>${y.id} %{y:.6g} ${ocp.unit(y.unit)}<extra></extra>`,
      }));
      return { traces, layout: ocp.layout({
        margin: { l: 10, r: 12, t: 8, b: 10 }, ...this._legend(), hovermode: "closest",
        xaxis: ocp.axis({ title: { text: this.label(x), standoff: 8 } }), yaxis: ocp.axis({ title: { text: this.label(y), standoff: 8 } }),
      }) };
    }

    _space() {
      const names = this.names.slice(0, 3);
      const open = { "circle-open": "circle-open", "square-open": "square-open", "diamond-open": "diamond-open", circle: "circle", diamond: "diamond", x: "x" };
      const traces = this._groups(names).map((group) => ({
        type: "scatter3d", mode: "markers", name: group.name, customdata: group.data, text: group.text,
        x: group.values.map((v) => v[0]), y: group.values.map((v) => v[1]), z: group.values.map((v) => v[2]),
        marker: { ...group.marker, size: group.marker.size * 0.6, symbol: Array.isArray(group.marker.symbol) ? group.marker.symbol.map((s) => open[s] || "diamond") : open[group.marker.symbol] || "diamond" },
        hovertemplate: `%{text}<br>${names.map((n, i) => `${n} %{${"xyz"[i]}:.6g}`).join("<br>")}<extra></extra>`,
      }));
      const axis = (i) => ({ title: { text: ocp.quantity(this.objectives[i].id, this.objectives[i].unit), font: { size: 11 } }, gridcolor: ocp.shade("line"), backgroundcolor: ocp.shade("card"), color: ocp.shade("ink") });
      return { traces, layout: ocp.layout({
        margin: { l: 0, r: 0, t: 8, b: 0 }, ...this._legend(),
        scene: { xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "cube", camera: { eye: { x: 1.75, y: 1.75, z: 1.1 } } },
      }) };
    }

    // Every objective an upright axis from its least to its largest value, the better end at the bottom.
    _parallel() {
      const ranges = this.objectives.map((objective) => {
        const values = this.shown.flatMap(({ set }) => set.points.map((point) => this.value(set, point, objective.id)));
        return [Math.min(...values), Math.max(...values)];
      });
      const share = (value, i) => {
        const [low, high] = ranges[i];
        const part = high - low > 1e-6 * Math.max(Math.abs(low), Math.abs(high)) ? (value - low) / (high - low) : 0.5;
        return this.objectives[i].sense === "max" ? 1 - part : part;
      };
      const line = (set, index, i, style) => ({
        type: "scatter", mode: "lines+markers", showlegend: false, x: this.names.map((_, k) => k),
        y: this.names.map((name, k) => share(this.value(set, set.points[i], name), k)),
        customdata: this.names.map(() => [index, i]),
        text: this.names.map((name) => `${set.name}, point ${set.points[i].name}<br>${name} ${ocp.number(this.value(set, set.points[i], name))}`),
        hovertemplate: "%{text}<extra></extra>", ...style,
      });
      const traces = this.shown.flatMap(({ set, index }, order) => set.points.map((_, i) => line(set, index, i, {
        line: { width: 1.2, color: ocp.colour(order === 3 ? 7 : order) }, marker: { size: 6, color: ocp.colour(order === 3 ? 7 : order) }, opacity: 0.65,
      })));
      const one = this.shown.find(({ index }) => index === this.chosen[0]);
      if (one) {
        traces.push(line(one.set, one.index, this.chosen[1], { line: { width: 4, color: ocp.shade("chosen") }, marker: { size: 9, color: ocp.shade("chosen") } }));
      }
      const end = (i, worst) => ocp.number(ranges[i][(this.objectives[i].sense === "max") === worst ? 0 : 1], 4);
      const words = (i, worst, y) => ({ x: i, y, text: end(i, worst), showarrow: false, yanchor: worst ? "bottom" : "top", yshift: worst ? 6 : -6, bgcolor: ocp.shade("card"), font: { size: 11, color: ocp.shade("soft") } });
      return { traces, layout: ocp.layout({
        margin: { l: 10, r: 10, t: 8, b: 10 }, hovermode: "closest",
        xaxis: ocp.axis({ tickvals: this.names.map((_, k) => k), tickangle: 0, tickfont: { size: 11 }, ticktext: this.objectives.map((o) => `${o.id}<br>${o.unit === "-" ? "" : `[${ocp.unit(o.unit)}]`}<br>${o.sense === "max" ? "more is better" : "less is better"}`), range: [-0.35, this.names.length - 0.65], gridcolor: ocp.shade("soft"), fixedrange: true }),
        yaxis: { visible: false, range: [-0.12, 1.12], fixedrange: true },
        annotations: this.names.flatMap((_, i) => [words(i, true, 1), words(i, false, 0)]),
      }) };
    }
  }

  return { Front };
})();
