"use strict";
// Bodies as the eye sees them: of a capsule, a sphere, a box and a cylinder the exact outline, in a parallel view.
ocp.parts.bodies = (() => {
  const { move, turn } = ocp.parts.kinematics;

  // The outline of projected points, anticlockwise; Andrew's monotone chain.
  const hull = (points) => {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const side = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    const half = (list) => {
      const kept = [];
      for (const p of list) {
        while (kept.length > 1 && side(kept[kept.length - 2], kept[kept.length - 1], p) <= 0) kept.pop();
        kept.push(p);
      }
      return kept.slice(0, -1);
    };
    return [...half(sorted), ...half(sorted.reverse())];
  };

  const polygon = (context, points) => {
    context.beginPath();
    points.forEach((p, i) => (i ? context.lineTo(p[0], p[1]) : context.moveTo(p[0], p[1])));
    context.closePath();
  };

  const axis = (body, i) => [body.axes[i], body.axes[3 + i], body.axes[6 + i]];
  const along = (p, direction, size) => p.map((c, i) => c + size * direction[i]);

  // Points of the core, in the joint's frame, whose hull it is.
  const core = (body) => {
    if (body.kind === "cylinder") {
      const ring = [];
      for (let i = 0; i < 24; i++) {
        const angle = (2 * Math.PI * i) / 24;
        const side = along(along(body.centre, axis(body, 0), body.half[0] * Math.cos(angle)), axis(body, 1), body.half[1] * Math.sin(angle));
        ring.push(along(side, axis(body, 2), -body.half[2]), along(side, axis(body, 2), body.half[2]));
      }
      return ring;
    }
    let points = [body.centre];
    for (let i = 0; i < 3; i++) {
      if (body.half[i] > 0) points = points.flatMap((p) => [along(p, axis(body, i), -body.half[i]), along(p, axis(body, i), body.half[i])]);
    }
    return points;
  };

  // A body as something to draw: how near the eye its middle is, and how it is drawn.
  const item = (body, frame, camera, style) => {
    const seen = body.core.map((p) => camera.see(move(frame, p)));
    const depth = seen.reduce((sum, p) => sum + p[2], 0) / seen.length;
    const grown = body.radius * camera.scale;
    const draw = (context) => {
      context.lineJoin = "round";
      context.lineCap = "round";
      context.globalAlpha = style.alpha;
      const outline = seen.length > 2 ? hull(seen) : seen;
      const shape = (width, colour) => {
        polygon(context, outline);
        context.fillStyle = colour;
        context.strokeStyle = colour;
        context.lineWidth = Math.max(width, 0.01);
        if (outline.length > 2) context.fill();
        if (outline.length === 1) {
          context.beginPath();
          context.arc(outline[0][0], outline[0][1], width / 2, 0, 2 * Math.PI);
          context.fill();
        } else if (width > 0.5) context.stroke();
      };
      const edge = 1.6 * camera.ratio;
      shape(2 * grown + edge, style.edge);
      shape(Math.max(2 * grown - edge, 0), style.fill);
      if (body.kind === "box") faces(context, body, frame, camera, style);
      context.globalAlpha = 1;
    };
    return { depth, draw };
  };

  // The three faces of a box that look at the eye, the flatter the darker.
  const faces = (context, body, frame, camera, style) => {
    for (let i = 0; i < 3; i++) {
      for (const sign of [-1, 1]) {
        const normal = turn(frame, axis(body, i)).map((c) => sign * c);
        const facing = camera.facing(normal);
        if (facing <= 0) continue;
        const [j, k] = [(i + 1) % 3, (i + 2) % 3];
        const middle = along(body.centre, axis(body, i), sign * body.half[i]);
        const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) =>
          camera.see(move(frame, along(along(middle, axis(body, j), a * body.half[j]), axis(body, k), b * body.half[k]))));
        polygon(context, corners);
        context.globalAlpha = 0.28 * (1 - facing);
        context.fillStyle = style.edge;
        context.fill();
        context.globalAlpha = 0.8 * style.alpha;
        context.strokeStyle = style.edge;
        context.lineWidth = camera.ratio;
        context.stroke();
      }
    }
  };

  // A body with the points of its core, made once.
  const prepare = (body) => ({ ...body, core: body.kind === "half-space" ? [] : core(body) });

  return { prepare, item, axis, along };
})();
