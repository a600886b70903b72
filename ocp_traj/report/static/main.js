"use strict";
// The page: which trajectory and instant are shown, and all parts made to follow.
ocp.parts.main = (() => {
  const { Curve } = ocp.parts.curve;
  const { Scene, VIEWS } = ocp.parts.scene;
  const tables = ocp.parts.tables;
  const sets = ocp.data.sets;
  const state = { set: -1, point: 0, settled: Promise.resolve() };
  let scene = null;

  for (const set of sets) {
    for (const point of set.points) point.unpackedNumbers = ocp.unpack(point.numbers);
  }
  const curvesOf = (set) => (set.curves ||= set.points.map((point) => new Curve(point, set.joints.length)));

  const player = new ocp.parts.player.Player((time) => follow(time));
  const panels = new ocp.parts.panels.Panels((time) => player.to(time));
  const front = new ocp.parts.front.Front(sets, (set, point) => choose(set, point));

  const follow = (time) => {
    if (state.set < 0) return;
    const set = sets[state.set];
    if (scene) scene.show(time);
    panels.show(time);
    tables.now(set, curvesOf(set)[state.point], time);
  };

  const openSet = (index) => {
    const set = sets[index];
    state.set = index;
    ocp.get("set").value = String(index);
    ocp.clear(ocp.get("point"), ...set.points.map((point, i) => ocp.element("option", { value: i }, name(set, point, i))));
    ocp.get("title").textContent = set.title;
    ocp.get("subtitle").textContent = [set.problem, set.curve, set.reference].filter(Boolean).join(" · ");
    scene = null;
    ocp.get("stage").hidden = "absent" in set.robot;
    ocp.get("views").hidden = "absent" in set.robot;
    if ("absent" in set.robot) ocp.get("robot-note").textContent = set.robot.absent;
    else {
      const canvas = ocp.element("canvas", { id: "robot", tabindex: "0", "aria-label": ocp.get("robot").getAttribute("aria-label") });
      ocp.get("robot").replaceWith(canvas); // with the last one's listeners
      state.point = 0;
      scene = new Scene(canvas, set, curvesOf(set));
      views();
      ocp.get("robot-note").textContent = legend(set);
    }
    panels.build(set);
    tables.limits(set);
    request(set);
  };

  const legend = (set) => {
    const linked = set.robot.bodies.some((body) => body.joint > 0);
    const still = set.robot.bodies.some((body) => body.joint === 0);
    return [
      linked ? "Links have the shape of their collision bodies." : "Links are lines from joint to joint: the problem gives them no shape.",
      "○ turns, □ slides. Orange: path of the tool; ◇ points it has to pass" + (set.points.length > 1 ? "; grey: the other points' paths" : "") + ".",
      still ? "Purple: what stands still." : "",
      set.robot.paths.length ? `Green: ${set.robot.paths.map((path) => path.name).join(", ")}.` : "",
    ].filter(Boolean).join(" ");
  };

  const name = (set, point, i) => {
    const values = set.objectives.flatMap((o, k) => (o.traded && point.objectives[k] !== null ? [`${o.id} ${ocp.number(point.objectives[k], 4)}`] : []));
    const marks = [set.knee === i ? "knee" : "", set.ends.includes(i) ? "end" : ""].filter(Boolean).join(", ");
    return [point.name, ...values, marks].filter(Boolean).join(" · ");
  };

  const choose = (setIndex, pointIndex) => {
    if (setIndex !== state.set) openSet(setIndex);
    const set = sets[setIndex];
    state.point = Math.min(Math.max(pointIndex, 0), set.points.length - 1);
    const point = set.points[state.point];
    const curve = curvesOf(set)[state.point];
    ocp.get("point").value = String(state.point);
    ocp.get("verdict").textContent = `${point.verdict}, margin ${ocp.percent(point.margin)}, ${ocp.number(curve.duration, 5)} s`;
    ocp.get("verdict").className = point.verdict;
    if (scene) scene.choose(state.point);
    tables.margins(set, point, (time) => player.to(time));
    tables.variables(set, point);
    player.over(curve.duration);
    state.settled = Promise.all([front.select(setIndex, state.point), panels.fill(point, curve)]);
    return state.settled;
  };

  const request = (set) => {
    const versions = Object.entries(set.versions).map(([key, value]) => `${key} ${value}`).join(", ");
    const facts = {
      [set.isRun ? "run" : "trajectory"]: set.name, problem: set.problem, source: set.reference, ...set.request,
      "made with": versions, "proved with": `ocp-traj ${ocp.data.version}, when this page was written`, remarks: set.notes.join("; "),
    };
    ocp.clear(ocp.get("request"), ...Object.entries(facts).filter(([, value]) => value).flatMap(([key, value]) =>
      [ocp.element("dt", {}, key), ocp.element("dd", {}, value)]));
    ocp.get("command").textContent = set.command;
  };

  const views = () => ocp.clear(ocp.get("views"), ...Object.keys(VIEWS).map((view) =>
    ocp.element("button", { type: "button", onclick: () => scene.camera.view(view) }, view)),
  ocp.element("button", { type: "button", "aria-label": "nearer", onclick: () => scene.camera.zoomBy(1.25) }, "+"),
  ocp.element("button", { type: "button", "aria-label": "farther", onclick: () => scene.camera.zoomBy(0.8) }, "−"));

  const theme = (dark) => {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    ocp.shades.clear();
    if (state.set >= 0) choose(state.set, state.point);
  };

  const KEYS = {
    ArrowLeft: () => choose(state.set, state.point - 1), ArrowUp: () => choose(state.set, state.point - 1),
    ArrowRight: () => choose(state.set, state.point + 1), ArrowDown: () => choose(state.set, state.point + 1),
    Home: () => choose(state.set, 0), End: () => choose(state.set, sets[state.set].points.length - 1),
    k: () => sets[state.set].knee !== null && choose(state.set, sets[state.set].knee),
    "[": () => choose((state.set + sets.length - 1) % sets.length, 0), "]": () => choose((state.set + 1) % sets.length, 0),
    " ": () => player.toggle(), ",": () => player.step(-0.01), ".": () => player.step(0.01),
  };
  document.addEventListener("keydown", (event) => {
    const typed = event.target.closest("input, select, button, textarea, pre, .scroll") && !(event.key in { k: 1, "[": 1, "]": 1, ",": 1, ".": 1 });
    if (typed || event.ctrlKey || event.metaKey || event.altKey || !(event.key in KEYS)) return;
    event.preventDefault();
    KEYS[event.key]();
  });

  ocp.clear(ocp.get("set"), ...sets.map((set, i) => ocp.element("option", { value: i }, set.name)));
  ocp.get("set-label").hidden = sets.length < 2;
  ocp.get("set").addEventListener("change", (event) => choose(Number(event.target.value), 0));
  ocp.get("point").addEventListener("change", (event) => choose(state.set, Number(event.target.value)));
  ocp.get("previous").addEventListener("click", () => choose(state.set, state.point - 1));
  ocp.get("next").addEventListener("click", () => choose(state.set, state.point + 1));
  ocp.get("table-csv").addEventListener("click", () => tables.download(`${sets[state.set].name}.csv`, tables.pointsCsv(sets[state.set])));
  ocp.get("margins-csv").addEventListener("click", () => {
    const set = sets[state.set];
    tables.download(`${set.name}-${set.points[state.point].name}-margins.csv`, tables.marginsCsv(set, set.points[state.point]));
  });
  ocp.get("theme").addEventListener("click", () => theme(document.documentElement.dataset.theme !== "dark"));
  if (front.empty) document.querySelector("main").classList.add("alone");
  new ResizeObserver(() => scene && scene.draw()).observe(ocp.get("stage"));

  const preferred = window.matchMedia("(prefers-color-scheme: dark)");
  preferred.addEventListener("change", (event) => theme(event.matches));
  theme(preferred.matches);
  choose(0, sets[0].knee ?? 0);
  performance.mark("usable"); // everything but the plots is there
  return { state, choose, player, panels, front, scene: () => scene };
})();
