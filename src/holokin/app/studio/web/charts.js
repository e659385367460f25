// Drift after each round: bars for each strategy, a table, and sentences.

const RETURNED = 1e-6; // rad or m: what integration leaves is below it

function amount(value, unit) {
  if (value < RETURNED) return value === 0 ? `0 ${unit}` : `${value.toExponential(0).replace("e-", "e\u2212")} ${unit}`;
  return `${value < 0.01 ? value.toPrecision(2) : value.toFixed(3)} ${unit}`;
}

function make(kind, attributes, ...children) {
  const svg = ["svg", "rect", "line", "text", "title"].includes(kind);
  const node = svg ? document.createElementNS("http://www.w3.org/2000/svg", kind) : document.createElement(kind);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

// Bars of a strategy's drift, up to the largest of all strategies.
function bars(strategy, drifts, cycles, largest, joints) {
  const [width, height, left, foot] = [320, 120, 4, 18], step = (width - 2 * left) / cycles;
  const label = `${strategy.name}: ` + (drifts.length ? drifts.map((d, k) => `round ${k + 1} ${amount(d.largest, joints[d.joint].unit)}`).join(", ") : "no round yet");
  const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
  svg.append(make("line", { x1: 0, x2: width, y1: height - foot, y2: height - foot, stroke: "#9aa1ab" }));
  drifts.forEach((d, k) => {
    const tall = Math.max(1.5, (d.largest / largest) * (height - foot - 18));
    const x = left + k * step + 0.12 * step, y = height - foot - tall;
    svg.append(make("rect", { x, y, width: 0.76 * step, height: tall, rx: Math.min(2, step / 5), fill: strategy.css }));
    if (cycles <= 10 || (k + 1) % 10 === 0)
      svg.append(make("text", { x: x + 0.38 * step, y: height - 4, "font-size": 12, "text-anchor": "middle", fill: "#5b6370" }, String(k + 1)));
    if (k === drifts.length - 1)
      svg.append(make("text", { x: Math.min(width - 2, x + 0.76 * step), y: y - 5, "font-size": 13, "text-anchor": "end", fill: "#22262e" }, amount(d.largest, joints[d.joint].unit)));
  });
  return make("figure", {}, make("figcaption", {}, strategy.name), svg);
}

function table(strategies, drifts, joints) {
  const rows = Math.max(...drifts.map((d) => d.length));
  const head = make("tr", {}, make("th", { scope: "col" }, "Round"), ...strategies.map((strategy) => make("th", { scope: "col" }, strategy.name)));
  const body = Array.from({ length: rows }, (_, k) =>
    make("tr", {}, make("th", { scope: "row" }, String(k + 1)),
      ...drifts.map((d) => make("td", {}, d[k] ? `${amount(d[k].largest, joints[d[k].joint].unit)} (${joints[d[k].joint].name})` : "-"))));
  return make("table", {}, make("thead", {}, head), make("tbody", {}, ...body));
}

// What became of each strategy, in sentences.
function sentences(strategies, drifts, joints) {
  return strategies.map((strategy, i) => {
    const last = drifts[i].at(-1), stop = strategy.ended ? `It stops in round ${strategy.cycles + 1} at ${strategy.ended}.` : "";
    if (!last) return `${strategy.name}: ${stop || "no round yet."}`;
    const rounds = `${drifts[i].length} round${drifts[i].length > 1 ? "s" : ""}`, joint = joints[last.joint];
    const said = last.largest === 0
      ? `${strategy.name}: after ${rounds} every joint is where it began, to the last digit.`
      : last.largest < RETURNED
      ? `${strategy.name}: after ${rounds} every joint is where it began, within ${amount(last.largest, joint.unit)}.`
      : `${strategy.name}: after ${rounds} ${joint.name} is ${amount(last.largest, joint.unit)} from where it began.`;
    return `${said} ${stop}`.trim();
  });
}
