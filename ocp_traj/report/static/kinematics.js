"use strict";
// Where a robot's joints, tool and links are: a tree of joints that turn or slide, actuators mapped to joints first.
ocp.parts.kinematics = (() => {
  const OPERATIONS = {
    same: (a) => a, add: (a, b) => a + b, sub: (a, b) => a - b, mul: (a, b) => a * b, div: (a, b) => a / b,
    neg: (a) => -a, exp: Math.exp, log: Math.log, pow: Math.pow, sqrt: Math.sqrt, sq: (a) => a * a,
    twice: (a) => 2 * a, inv: (a) => 1 / a, sin: Math.sin, cos: Math.cos, tan: Math.tan, asin: Math.asin,
    acos: Math.acos, atan: Math.atan, atan2: Math.atan2, tanh: Math.tanh,
  };

  // A frame is 12 numbers: rotation, row by row, then position.
  const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];

  const turn = (f, x) => [
    f[0] * x[0] + f[1] * x[1] + f[2] * x[2],
    f[3] * x[0] + f[4] * x[1] + f[5] * x[2],
    f[6] * x[0] + f[7] * x[1] + f[8] * x[2],
  ];

  const move = (f, x) => {
    const y = turn(f, x);
    return [y[0] + f[9], y[1] + f[10], y[2] + f[11]];
  };

  const product = (f, g) => {
    const made = new Array(12);
    for (let i = 0; i < 3; i++) {
      for (let j = 0; j < 3; j++) made[3 * i + j] = f[3 * i] * g[j] + f[3 * i + 1] * g[3 + j] + f[3 * i + 2] * g[6 + j];
    }
    const at = move(f, [g[9], g[10], g[11]]);
    return [...made.slice(0, 9), ...at];
  };

  // Rodrigues' formula: a turn about a unit axis.
  const rotation = ([x, y, z], angle) => {
    const c = Math.cos(angle);
    const s = Math.sin(angle);
    const d = 1 - c;
    return [
      c + x * x * d, x * y * d - z * s, x * z * d + y * s,
      y * x * d + z * s, c + y * y * d, y * z * d - x * s,
      z * x * d - y * s, z * y * d + x * s, c + z * z * d, 0, 0, 0,
    ];
  };

  class Chain {
    constructor(robot) {
      this.robot = robot;
      this.children = [[], ...robot.joints.map(() => [])];
      robot.joints.forEach((joint, i) => this.children[joint.parent].push(i + 1));
    }

    // Joint coordinates of actuators' coordinates.
    joints(q) {
      const map = this.robot.actuators;
      if (!map) return q;
      const registers = new Float64Array(map.registers);
      const found = new Float64Array(map.size);
      for (const [name, written, first, second] of map.steps) {
        if (name === "const") registers[written] = first;
        else if (name === "in") registers[written] = q[first];
        else if (name === "out") found[written] = registers[first];
        else registers[written] = OPERATIONS[name](registers[first], registers[second]);
      }
      return found;
    }

    // The frame of every joint in the world, after those of the world itself; the tool's comes last.
    frames(q) {
      const s = this.joints(q);
      const frames = [IDENTITY];
      for (const joint of this.robot.joints) {
        const value = s[joint.column];
        const moved = joint.turns
          ? rotation(joint.axis, value)
          : [1, 0, 0, 0, 1, 0, 0, 0, 1, ...joint.axis.map((e) => e * value)];
        frames.push(product(product(frames[joint.parent], joint.placement), moved));
      }
      const tool = this.robot.tool;
      frames.push(product(frames[tool.joint], tool.placement));
      return frames;
    }

    tool(q) {
      const frame = this.frames(q)[this.robot.joints.length + 1];
      return [frame[9], frame[10], frame[11]];
    }

    // Lines that stand for links: from a joint to where the next one is mounted, and along the slide of one that slides.
    lines(frames) {
      const found = [];
      const origin = (f) => [f[9], f[10], f[11]];
      this.robot.joints.forEach((joint, i) => {
        const from = origin(frames[joint.parent]);
        const mount = move(frames[joint.parent], joint.placement.slice(9));
        if (joint.parent > 0 || joint.placement.slice(9).some((c) => c !== 0)) found.push({ from, to: mount, slide: false });
        if (!joint.turns) found.push({ from: mount, to: origin(frames[i + 1]), slide: true });
      });
      const carrier = this.robot.tool.joint;
      found.push({ from: origin(frames[carrier]), to: origin(frames[frames.length - 1]), slide: false, tool: true });
      return found;
    }
  }

  return { Chain, move, turn };
})();
