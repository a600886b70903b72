"use strict";
// The picture of a robot at an instant: floor, surroundings, links, paths of the tool, places it has to pass.
ocp.parts.scene = (() => {
  const { Chain, move } = ocp.parts.kinematics;
  const { prepare, item, axis, along } = ocp.parts.bodies;
  const { Camera, VIEWS } = ocp.parts.camera;
  const PATH = 160; // pieces of a tool's path

  class Scene {
    constructor(canvas, set, curves) {
      this.canvas = canvas;
      this.context = canvas.getContext("2d");
      this.chain = new Chain(set.robot);
      this.bodies = set.robot.bodies.map(prepare);
      this.paths = set.robot.paths;
      this.places = set.places;
      this.curves = curves;
      this.lines = curves.map((curve) => this._path(curve));
      this.camera = new Camera(canvas, set.robot.up, () => this.draw());
      this.frames = null;
      this._fit();
    }

    _path(curve) {
      const points = [];
      for (let i = 0; i <= PATH; i++) points.push(this.chain.tool(curve.at((i / PATH) * curve.duration)));
      return points;
    }

    // Everything that is ever seen: paths, postures along them, bodies that stand still.
    _fit() {
      const points = [...this.lines.flat(), ...this.paths.flatMap((p) => p.points)];
      const curve = this.curves[0];
      for (let i = 0; i <= 8; i++) {
        const frames = this.chain.frames(curve.at((i / 8) * curve.duration));
        for (const line of this.chain.lines(frames)) points.push(line.from, line.to);
        for (const body of this.bodies) {
          if (body.joint > 0) points.push(...body.core.map((p) => move(frames[body.joint], p)));
        }
      }
      this.camera.fit(points);
      const near = (p) => Math.hypot(...p.map((c, i) => c - this.camera.centre[i])) < 1.6 * this.camera.reach;
      for (const body of this.bodies) {
        if (body.joint === 0 && body.core.length && near(body.centre)) points.push(body.centre);
      }
      this.camera.fit(points);
      const up = this.camera.up;
      const height = (p) => p[0] * up[0] + p[1] * up[1] + p[2] * up[2];
      this.ground = Math.min(...points.map(height));
    }

    choose(index) {
      this.chosen = index;
      const curve = this.curves[index];
      this.marks = this.places.flatMap((place) => place.at.map(([segment, u]) => {
        const k = segment < 0 ? curve.segments + segment : segment;
        return { name: place.id, at: this.chain.tool(curve.on(k, u, 0)) };
      }));
    }

    show(t) {
      this.time = t;
      this.frames = this.chain.frames(this.curves[this.chosen].at(t));
      this.draw();
    }

    draw() {
      if (!this.frames) return;
      const { context, camera } = this;
      camera.aim();
      context.clearRect(0, 0, this.canvas.width, this.canvas.height);
      this._floor();
      this.lines.forEach((points, index) => {
        if (index !== this.chosen) this._line(points, ocp.shade("link"), 1, 0.35);
      });
      const items = [...this._bodies(), ...this._links(), ...this._chosenPath(), ...this._given()];
      items.sort((a, b) => a.depth - b.depth);
      for (const one of items) one.draw(context);
      for (const mark of this.marks) this._diamond(camera.see(mark.at));
      const tool = this.frames[this.frames.length - 1];
      this._tool(camera.see([tool[9], tool[10], tool[11]]));
      this._axes();
    }

    _tool([x, y]) {
      const { context, camera } = this;
      context.beginPath();
      context.arc(x, y, 5 * camera.ratio, 0, 2 * Math.PI);
      context.fillStyle = ocp.shade("chosen");
      context.fill();
      context.strokeStyle = ocp.shade("paper");
      context.lineWidth = 1.5 * camera.ratio;
      context.stroke();
    }

    _line(points, colour, width, alpha = 1) {
      const { context, camera } = this;
      context.globalAlpha = alpha;
      context.strokeStyle = colour;
      context.lineWidth = width * camera.ratio;
      context.lineCap = "round";
      context.beginPath();
      points.forEach((p, i) => {
        const [x, y] = camera.see(p);
        if (i) context.lineTo(x, y); else context.moveTo(x, y);
      });
      context.stroke();
      context.globalAlpha = 1;
    }

    // A grid below everything, where nothing is said to stand; half-spaces as a grid on their face.
    _floor() {
      const { camera } = this;
      const colour = ocp.shade("line");
      const step = 10 ** Math.floor(Math.log10(camera.reach)) / (camera.reach / 10 ** Math.floor(Math.log10(camera.reach)) < 3 ? 2 : 1);
      const sheet = (centre, a, b) => {
        const count = Math.ceil((1.1 * camera.reach) / step);
        for (let i = -count; i <= count; i++) {
          for (const [one, other] of [[a, b], [b, a]]) {
            const middle = along(centre, one, i * step);
            this._line([along(middle, other, -count * step), along(middle, other, count * step)], colour, 0.7, 0.75);
          }
        }
      };
      const walls = this.bodies.filter((body) => body.kind === "half-space");
      const lift = (c, normal, level) => along(c, normal, level - (c[0] * normal[0] + c[1] * normal[1] + c[2] * normal[2]));
      for (const wall of walls) {
        const normal = axis(wall, 2);
        const level = wall.centre[0] * normal[0] + wall.centre[1] * normal[1] + wall.centre[2] * normal[2] + wall.radius;
        sheet(lift(camera.centre, normal, level), axis(wall, 0), axis(wall, 1));
      }
      if (!walls.length) sheet(lift(camera.centre, camera.up, this.ground), camera.ahead, camera.left);
    }

    _bodies() {
      const link = { fill: ocp.shade("link"), edge: ocp.shade("soft"), alpha: 0.92 };
      const still = { fill: ocp.shade("obstacle"), edge: ocp.shade("obstacle"), alpha: 0.4 };
      return this.bodies.filter((body) => body.core.length)
        .map((body) => item(body, this.frames[body.joint], this.camera, body.joint > 0 ? link : still));
    }

    // Links as lines and joints as dots: thick where no bodies tell the links' shape.
    _links() {
      const { camera } = this;
      const shaped = this.bodies.some((body) => body.joint > 0);
      const items = this.chain.lines(this.frames).map((line) => {
        const [a, b] = [camera.see(line.from), camera.see(line.to)];
        const draw = (context) => {
          context.lineCap = "round";
          const stroke = (width, colour) => {
            context.strokeStyle = colour;
            context.lineWidth = width * camera.ratio;
            context.beginPath();
            context.moveTo(a[0], a[1]);
            context.lineTo(b[0], b[1]);
            context.stroke();
          };
          if (!shaped) stroke(line.slide ? 6 : line.tool ? 7 : 11, ocp.shade("soft"));
          stroke(shaped ? 2 : line.slide ? 3.5 : line.tool ? 4.5 : 8.5, ocp.shade(line.slide ? "accent" : shaped ? "ink" : "link"));
        };
        return { depth: (a[2] + b[2]) / 2 + (shaped ? 2 * camera.reach : 0), draw };
      });
      this.chain.robot.joints.forEach((joint, i) => {
        const frame = this.frames[i + 1];
        const [x, y, depth] = camera.see([frame[9], frame[10], frame[11]]);
        items.push({ depth: depth + 2 * camera.reach, draw: (context) => this._dot(context, x, y, shaped ? 3 : 4.5, joint.turns) });
      });
      return items;
    }

    _dot(context, x, y, radius, turns) {
      const size = radius * this.camera.ratio;
      context.beginPath();
      if (turns) context.arc(x, y, size, 0, 2 * Math.PI);
      else context.rect(x - size, y - size, 2 * size, 2 * size);
      context.fillStyle = ocp.shade("paper");
      context.fill();
      context.lineWidth = 1.6 * this.camera.ratio;
      context.strokeStyle = ocp.shade("ink");
      context.stroke();
    }

    // Piece by piece, so that links hide what is behind them.
    _chosenPath() {
      return this._pieces(this.lines[this.chosen], ocp.shade("chosen"), 2.4);
    }

    _given() {
      return this.paths.flatMap((path) => this._pieces(path.points, ocp.shade("good"), 5, 0.45));
    }

    _pieces(points, colour, width, alpha = 1) {
      const { camera } = this;
      const seen = points.map((p) => camera.see(p));
      return seen.slice(1).map((b, i) => ({
        depth: (seen[i][2] + b[2]) / 2,
        draw: (context) => {
          context.globalAlpha = alpha;
          context.strokeStyle = colour;
          context.lineWidth = width * camera.ratio;
          context.lineCap = alpha < 1 ? "butt" : "round";
          context.beginPath();
          context.moveTo(seen[i][0], seen[i][1]);
          context.lineTo(b[0], b[1]);
          context.stroke();
          context.globalAlpha = 1;
        },
      }));
    }

    _diamond([x, y]) {
      const { context } = this;
      const size = 5 * this.camera.ratio;
      context.beginPath();
      context.moveTo(x, y - size);
      context.lineTo(x + size, y);
      context.lineTo(x, y + size);
      context.lineTo(x - size, y);
      context.closePath();
      context.fillStyle = ocp.shade("paper");
      context.fill();
      context.strokeStyle = ocp.shade("chosen");
      context.lineWidth = 2 * this.camera.ratio;
      context.stroke();
    }

    // The world's axes, in the corner, and a measure of length.
    _axes() {
      const { context, camera } = this;
      const ratio = camera.ratio;
      const at = [34 * ratio, this.canvas.height - 34 * ratio];
      const zero = camera.see([0, 0, 0]);
      context.font = `${12 * ratio}px system-ui, sans-serif`;
      context.textAlign = "center";
      context.textBaseline = "middle";
      ["x", "y", "z"].forEach((name, i) => {
        const tip = camera.see([0, 1, 2].map((k) => (k === i ? 1 : 0)));
        const [dx, dy] = [(tip[0] - zero[0]) / camera.scale, (tip[1] - zero[1]) / camera.scale];
        context.strokeStyle = context.fillStyle = ocp.shade("soft");
        context.lineWidth = 1.5 * ratio;
        context.beginPath();
        context.moveTo(...at);
        context.lineTo(at[0] + 18 * ratio * dx, at[1] + 18 * ratio * dy);
        context.stroke();
        if (Math.hypot(dx, dy) > 0.15) context.fillText(name, at[0] + 27 * ratio * dx, at[1] + 27 * ratio * dy);
      });
      const room = (0.22 * this.canvas.width) / camera.scale;
      const power = 10 ** Math.floor(Math.log10(room));
      const length = [5, 2, 1].map((k) => k * power).find((k) => k <= room);
      const [right, base] = [this.canvas.width - 12 * ratio, this.canvas.height - 14 * ratio];
      context.beginPath();
      context.moveTo(right - length * camera.scale, base);
      context.lineTo(right, base);
      context.stroke();
      context.fillText(`${ocp.number(length, 2)} m`, right - (length * camera.scale) / 2, base - 10 * ratio);
    }
  }

  return { Scene, VIEWS };
})();
