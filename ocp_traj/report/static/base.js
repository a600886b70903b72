"use strict";
// What all parts share: the page's data, arrays, numbers in words, colours, elements.
const ocp = { parts: {} };

ocp.data = JSON.parse(document.getElementById("data").textContent);

// An array packed as base64 of little-endian bytes, flat, as numbers in full precision.
ocp.unpack = (packed) => {
  const kind = "f8" in packed ? "f8" : "f4";
  const text = atob(packed[kind]);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const view = new DataView(bytes.buffer);
  const width = kind === "f8" ? 8 : 4;
  const values = new Float64Array(bytes.length / width);
  for (let i = 0; i < values.length; i++) {
    values[i] = width === 8 ? view.getFloat64(8 * i, true) : view.getFloat32(4 * i, true);
  }
  return values;
};

// A number in so many significant digits, as tables show it.
ocp.number = (value, digits = 6) => {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e7)
    ? value.toExponential(Math.min(digits, 4) - 1).replace("e+", "e")
    : String(Number(value.toPrecision(digits)));
  return text.replace("-", "−");
};

// A margin as a percentage; one that rounding alone leaves is not told to its last digit.
ocp.percent = (margin) => {
  if (margin === null || Number.isNaN(margin)) return "–";
  if (margin >= 0 && margin < 5e-6) return margin === 0 ? "0 %" : "< 0.001 %";
  return `${ocp.number(100 * margin, 3)} %`;
};

// A unit with its exponents raised: m/s2 as m/s².
ocp.unit = (text) => text.replace(/([a-zA-Z])([0-9])/g, (_, letter, digit) => letter + "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)]);
ocp.quantity = (name, unit) => (unit && unit !== "-" ? `${name} [${ocp.unit(unit)}]` : name);

// Okabe and Ito's colours, which the colour-blind tell apart; the yellow is left out, pale on white. Then dashes.
ocp.colours = ["#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#8c8c8c"];
ocp.dashes = ["solid", "dash", "dot", "dashdot"];
ocp.colour = (index) => ocp.colours[index % ocp.colours.length];
ocp.dash = (index) => ocp.dashes[Math.floor(index / ocp.colours.length) % ocp.dashes.length];

// A colour of the style sheet, as it is in the present theme; kept, for a picture asks for hundreds.
ocp.shades = new Map();
ocp.shade = (name) => {
  if (!ocp.shades.has(name)) {
    ocp.shades.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  }
  return ocp.shades.get(name);
};

// What all plots share: colours of the theme, small margins, no logo and no button that leads elsewhere.
ocp.layout = (more) => ({
  paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, autosize: true,
  font: { color: ocp.shade("ink"), size: 12, family: "system-ui, -apple-system, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif" },
  hoverlabel: { bgcolor: ocp.shade("paper"), bordercolor: ocp.shade("line"), font: { color: ocp.shade("ink") } },
  ...more,
});
ocp.axis = (more) => ({
  gridcolor: ocp.shade("grid"), linecolor: ocp.shade("line"), zeroline: false, showline: true, ticks: "outside",
  tickcolor: ocp.shade("line"), automargin: true, ...more,
});
ocp.config = { displaylogo: false, responsive: true, displayModeBar: false, showLink: false, showSendToCloud: false, topojsonURL: "", plotlyServerURL: "" };

// plotly.js, which takes a second to read: run once the page is there and can be used.
ocp.plotly = () => (ocp.plotlyRead ||= (async () => {
  await new Promise((done) => setTimeout(done, 50));
  if (!("DecompressionStream" in window)) {
    document.getElementById("curves-note").textContent = "The plots need a browser of 2023 or later; all else is here.";
    throw new Error("this browser has no DecompressionStream");
  }
  const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.append(script);
})());

ocp.get = (id) => document.getElementById(id);

// An element with attributes and children; text is never read as markup.
ocp.element = (tag, attributes = {}, ...children) => {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) made.setAttribute(name, value);
  }
  for (const child of children) made.append(child);
  return made;
};

ocp.clear = (element, ...children) => { element.replaceChildren(...children); };

// A table of heads and rows; a cell is text, or {text, class}. Numbers stand right, words left.
ocp.table = (element, heads, rows, attributes = () => ({})) => {
  const cell = (tag, value) => {
    const given = typeof value === "object" && value !== null ? value : { text: value };
    return ocp.element(tag, { class: given.class }, String(given.text));
  };
  const head = ocp.element("thead", {}, ocp.element("tr", {}, ...heads.map((h) => cell("th", h))));
  const body = ocp.element("tbody", {});
  rows.forEach((row, index) => body.append(ocp.element("tr", attributes(index), ...row.map((c) => cell("td", c)))));
  ocp.clear(element, head, body);
};
