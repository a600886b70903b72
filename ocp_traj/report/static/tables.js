"use strict";
// Tables: margins, variables, limits, the state at an instant; and the same as CSV.
ocp.parts.tables = (() => {
  const { SYMBOLS, BINDING } = ocp.parts.panels;
  const verdict = (code) => ocp.data.verdicts[Number(code)];
  const left = (text) => ({ text, class: "text" });

  // The rows of a point's audit, worst first.
  const rowsOf = (set, point) => point.row.map((key, i) => {
    const [limit, label, unit] = set.rows[key];
    const [bound, attained, instant, proved, margin, allowance] = point.unpackedNumbers.slice(6 * i, 6 * i + 6);
    return { limit, label, unit, bound, attained, instant, proved, margin, allowance, verdict: verdict(point.verdicts[i]) };
  });

  // Whether a row holds a variable to its bounds: that is told beside the variable.
  const isVariable = (set, row) => set.variables.labels.some((label, i) => label === row.label && set.variables.blocks[i] === row.limit);

  const margins = (set, point, go) => {
    const rows = rowsOf(set, point).filter((row) => !isVariable(set, row));
    rows.sort((a, b) => (b.verdict === "violated") - (a.verdict === "violated") || (b.verdict === "undecided") - (a.verdict === "undecided")
      || (a.verdict === "checked") - (b.verdict === "checked") || a.margin - b.margin);
    const heads = [left("limit"), left("of"), "attained", "bound", left("unit"), "at [s]", "stays within", "margin", left("verdict")];
    ocp.table(ocp.get("margins"), heads, rows.map((row) => [
      left(row.limit), left(row.label), ocp.number(row.attained), ocp.number(row.bound), left(ocp.unit(row.unit)), ocp.number(row.instant, 4),
      ocp.number(row.proved), row.verdict === "checked" ? "–" : ocp.percent(row.margin), { text: row.verdict, class: `text ${row.verdict}` },
    ]), (i) => ({ class: `jump${rows[i].verdict !== "checked" && rows[i].margin <= BINDING ? " binding" : ""}`, title: "go to this instant" }));
    ocp.get("margins").querySelectorAll("tbody tr").forEach((row, i) => row.addEventListener("click", () => go(rows[i].instant)));
    ocp.get("proof").textContent = `${point.words}. "stays within" is what the value is proved not to pass; "checked" is held to a tolerance at stated instants; a bar marks limits that bind.`;
  };

  const variables = (set, point) => {
    const { labels, units, blocks } = set.variables;
    const [lower, upper] = [ocp.unpack(set.variables.lower), ocp.unpack(set.variables.upper)];
    const x = point.x ? ocp.unpack(point.x) : null;
    const kept = new Map(rowsOf(set, point).map((row) => [`${row.limit}\n${row.label}`, row]));
    const objectives = set.objectives.map((objective, i) => [
      { text: `${objective.id}${objective.traded ? " (traded)" : ""}`, class: "text" }, ocp.number(point.objectives[i], 8),
      "", objective.sense === "max" ? "more is better" : "", left(ocp.unit(objective.unit)), "",
    ]);
    const parameters = Object.entries(point.parameters).map(([name, value]) => [left(`parameter ${name}`), ocp.number(value, 8), "", "", "", ""]);
    const rows = labels.map((label, i) => {
      const row = kept.get(`${blocks[i]}\n${label}`);
      return [
        left(blocks[i] === label || labels.filter((l) => l === label).length < 2 ? label : `${blocks[i]} ${label}`), x ? ocp.number(x[i], 8) : "–", ocp.number(lower[i]), ocp.number(upper[i]),
        left(ocp.unit(units[i])), row ? { text: row.verdict, class: `text ${row.verdict}` } : "",
      ];
    });
    ocp.table(ocp.get("variables"), [left("name"), "value", "least", "most", left("unit"), left("verdict")], [...objectives, ...parameters, ...rows]);
  };

  const limits = (set) => {
    const bound = (value) => (value === null ? "–" : ocp.number(value));
    ocp.table(ocp.get("limits"), [left("limit"), left("of"), "least", "most", left("unit"), left("source")], set.limits.flatMap((limit) =>
      limit.labels.map((label, i) => [left(limit.id), left(label), bound(limit.lower[i]), bound(limit.upper[i]), left(ocp.unit(limit.units[i])), { text: limit.eq || "–", class: "text wrap" }])));
  };

  const now = (set, curve, time) => {
    const [k, u] = curve.place(time);
    const values = SYMBOLS.map((_, order) => curve.on(k, u, order));
    const heads = [left("joint"), ...SYMBOLS, left("units")];
    ocp.table(ocp.get("now"), heads, set.joints.map((joint, i) => [
      left(joint), ...values.map((v) => ocp.number(v[i], 5)), left(set.units.map((of) => ocp.unit(of[i])).join(", ")),
    ]));
  };

  const quoted = (value) => {
    const text = value === null || value === undefined || Number.isNaN(value) ? "" : String(value);
    return /[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
  };
  const csv = (rows) => rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n";

  // As `front.csv` has it: a row a point; objectives, variables, margin, verdict, in full precision.
  const pointsCsv = (set) => {
    const { labels, units, blocks } = set.variables;
    const taken = new Set(set.objectives.map((o) => o.id));
    const names = labels.map((label, i) => {
      const name = taken.has(label) ? `${blocks[i]} ${label}` : label;
      taken.add(label);
      return `${name} [${units[i]}]`;
    });
    const heads = ["point", ...set.objectives.map((o) => `${o.id} [${o.unit}]`), ...names, "margin", "verdict"];
    return csv([heads, ...set.points.map((point) => [
      point.name, ...point.objectives, ...(point.x ? ocp.unpack(point.x) : labels.map(() => null)), point.margin, point.verdict,
    ])]);
  };

  const marginsCsv = (set, point) => csv([
    ["limit", "label", "unit", "bound", "attained", "instant [s]", "proved_bound", "margin", "allowance", "verdict"],
    ...rowsOf(set, point).map((r) => [r.limit, r.label, r.unit, r.bound, r.attained, r.instant, r.proved, r.margin, r.allowance, r.verdict]),
  ]);

  const download = (name, text) => {
    const link = ocp.element("a", { href: URL.createObjectURL(new Blob([text], { type: "text/csv" })), download: name });
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };

  return { margins, variables, limits, now, pointsCsv, marginsCsv, download };
})();
