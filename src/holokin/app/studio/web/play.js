// The page: controls, the hand that drags the loop, and what is drawn at each moment.

const PAUSE = 0.5; // seconds at the start between two rounds
const WORK = 3; // milliseconds of computing in a frame
const SAID = 100; // milliseconds between two reports while rounds are computed
const GHOST = [0.42, 0.45, 0.5], GREEN = [0, 0.62, 0.45];

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);

function fail(problem) {
  $("trouble").hidden = false;
  $("trouble").textContent = `The page cannot run here: ${problem.message || problem}. It needs a browser with WebAssembly and WebGL 2, of 2023 or newer.`;
}

class Page {
  constructor(strategies, stage) {
    Object.assign(this, { strategies, stage, playing: true, time: 0, silent: 0, kind: "circle", plane: data.plane, size: data.size, cycles: data.rounds });
    this.offer();
    this.wire();
    this.change();
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) this.hold(false);
  }

  // The loops to choose from.
  offer() {
    const kinds = [["circle", "A circle"], ["eight", "A figure eight"], ...data.loops.map((loop, i) => [String(i), loop.name])];
    for (const [value, name] of kinds.filter(([, name]) => name)) {
      const input = make("input", { type: "radio", name: "kind", value });
      input.checked = value === this.kind;
      $("kinds").append(make("label", {}, input, make("span", {}, name)));
    }
    const planes = data.planar ? [["2", "the plane of the arm"]] : [["2", "level"], ["0", "upright, across"], ["1", "upright, along"]];
    for (const [value, name] of planes) $("plane").append(make("option", { value }, name));
    $("plane").value = String(this.plane);
    $("plane-label").hidden = data.planar;
    this.labels = this.strategies.map((strategy) => {
      const value = make("span", { class: "value" }), of = make("span", { class: "of" });
      const name = make("b", {}, strategy.name), now = make("span", { class: "of now" });
      name.style.borderColor = strategy.css;
      $("labels").append(make("div", { class: "label" }, name, value, of, now));
      return { value, of, now };
    });
  }

  wire() {
    $("controls").addEventListener("input", (event) => this.set(event.target));
    $("controls").addEventListener("submit", (event) => event.preventDefault());
    $("play").addEventListener("click", () => this.hold(!this.playing));
    $("again").addEventListener("click", () => { this.time = 0; this.hold(true); });
    $("view").addEventListener("click", () => this.stage.camera.reset());
    const canvas = this.stage.canvas;
    canvas.addEventListener("pointerdown", (event) => this.grab(event));
    canvas.addEventListener("pointermove", (event) => this.pull(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => this.release());
    canvas.addEventListener("touchstart", (event) => { if (this.near(event.touches[0])) event.preventDefault(); }, { passive: false });
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    const wake = () => (this.fresh = true);
    for (const name of ["input", "click", "pointerdown", "pointermove", "pointerup", "wheel", "keydown"]) document.addEventListener(name, wake, true);
    new ResizeObserver(wake).observe(canvas);
  }

  set(field) {
    if (field.name === "kind") this.kind = field.value;
    if (field.id === "plane") {
      const [length, angle] = ofPlane(this.plane, this.size);
      this.plane = Number(field.value);
      this.size = inPlane(this.plane, length, angle);
    }
    if (field.id === "size" || field.id === "direction") {
      this.size = inPlane(this.plane, (Number($("size").value) / 100) * this.most, (Number($("direction").value) * Math.PI) / 180);
    }
    if (field.id === "cycles") this.cycles = Number(field.value);
    if (field.id === "speed") return this.show();
    this.change();
  }

  hold(playing) {
    this.playing = playing;
    $("play").textContent = playing ? "Pause" : "Play";
    $("play").setAttribute("aria-pressed", String(playing));
  }

  get own() {
    return this.kind === "circle" || this.kind === "eight";
  }

  get most() {
    return 1.2 * data.loops[0].view.around;
  }

  // Another loop: all strategies begin anew.
  change() {
    this.loop = this.own ? round(this.kind, data.loops[0], this.size, this.plane, data.steps) : data.loops[Number(this.kind)];
    if (this.loop.view !== this.stage.camera.view) this.stage.camera.show(this.loop.view);
    this.strategies.forEach((strategy) => strategy.begin(this.loop));
    this.rounds = this.loop.rounds || this.cycles;
    this.told = -1;
    this.time = 0;
    this.work(2 * WORK, 1);
    this.show();
  }

  // What the controls say.
  show() {
    const [length, angle] = ofPlane(this.plane, this.size);
    $("size").value = String(Math.round((100 * length) / this.most));
    $("direction").value = String(Math.round((180 * angle) / Math.PI));
    $("size-out").textContent = `${(100 * length).toFixed(1)} cm`;
    $("direction-out").textContent = `${Math.round((180 * angle) / Math.PI)}\u00b0`;
    $("speed-out").textContent = `${this.rate} \u00d7`;
    for (const id of ["plane", "size", "direction"]) $(id).disabled = !this.own;
    $("hint").classList.toggle("gone", !this.own || Boolean(this.dragged));
  }

  get rate() {
    return 2 ** Number($("speed").value);
  }

  // Computes ahead, the strategies in turn.
  work(patience, cycles = this.rounds) {
    for (const strategy of this.strategies) strategy.advance(cycles, patience / this.strategies.length);
    const done = this.strategies.reduce((sum, strategy) => sum + strategy.cycles + (strategy.ended ? 0.5 : 0), 0);
    if (done === this.told || (!this.ready && performance.now() < this.silent)) return;
    this.report();
    this.told = done;
    this.silent = performance.now() + SAID;
  }

  // Whether all rounds are computed.
  get ready() {
    return this.strategies.every((strategy) => strategy.ended || strategy.cycles >= this.rounds);
  }

  report() {
    const drifts = this.strategies.map((strategy) => Array.from({ length: Math.min(strategy.cycles, this.rounds) }, (_, k) => strategy.drift(k + 1)));
    const largest = Math.max(1e-3, ...drifts.flat().map((d) => d.largest));
    const last = this.strategies.map((strategy, i) => drifts[i].at(-1));
    $("charts").replaceChildren(...this.strategies.map((strategy, i) => bars(strategy, drifts[i], this.rounds, largest, data.joints)));
    $("table").replaceChildren(table(this.strategies, drifts, data.joints));
    this.strategies.forEach((strategy, i) => {
      this.labels[i].value.textContent = last[i] ? amount(last[i].largest, data.joints[last[i].joint].unit) : strategy.ended ? "stops" : "...";
      this.labels[i].of.textContent = strategy.ended && !last[i] ? `at ${strategy.ended}` : `drift after ${drifts[i].length} round${drifts[i].length === 1 ? "" : "s"}`;
    });
    if (this.ready) $("story").replaceChildren(...[...sentences(this.strategies, drifts, data.joints), this.loop.text || ""].map((said) => make("span", {}, `${said} `)));
  }

  // Steps that are shown at a time: rounds with a rest between them.
  steps() {
    const steps = this.strategies[0].steps, seconds = this.loop.rows.reduce((sum, row) => sum + row[40], 0);
    const each = Math.max(2.5, Math.min(8, seconds)) + PAUSE, all = this.rounds * each;
    const at = this.time % (all + 2), round = Math.min(Math.floor(at / each), this.rounds - 1);
    const share = Math.min(1, Math.max(0, (at - round * each) / (each - PAUSE)));
    return steps * (round + share);
  }

  frame(now) {
    const gap = Math.min(0.1, (now - (this.before ?? now)) / 1000);
    this.before = now;
    if (this.playing && !this.held) this.time += gap * this.rate;
    this.work(WORK);
    if (this.playing || this.fresh) {
      this.fresh = false;
      const steps = this.steps();
      this.stage.draw(this.panels, (k) => this.fill(this.strategies[k], steps));
      this.place();
      this.count(steps);
    }
    requestAnimationFrame((then) => this.frame(then));
  }

  // Says which round is shown.
  count(steps) {
    this.strategies.forEach((strategy, i) => {
      const round = Math.min(Math.floor(steps / strategy.steps) + 1, this.rounds), stopped = strategy.ended && steps >= strategy.done;
      const said = stopped ? `stopped in round ${strategy.cycles + 1}` : `shown: round ${round} of ${this.rounds}`;
      if (this.labels[i].now.textContent !== said) this.labels[i].now.textContent = said;
    });
  }

  // The rods of a strategy's panel.
  fill(strategy, steps) {
    const { bodies, wires, ghosts, marks } = this.stage, thick = 0.0035 * this.loop.view.around, line = this.loop.line;
    const now = strategy.points(strategy.posture(steps));
    this.arm(strategy, now, bodies, 1);
    if (steps > 0) this.arm(strategy, strategy.points(strategy.q0), ghosts, 0.16);
    const rounds = Math.min(Math.floor(steps / strategy.steps), strategy.cycles);
    for (let k = 1; k <= rounds; k++) this.bones(strategy, strategy.points(strategy.row(k * strategy.steps)), wires.thin, 1.2 * thick);
    line.forEach((p, i) => {
      wires.thin.add(line[(i || line.length) - 1], p, 1.5 * thick, GREEN, 1);
      marks.thin.add(line[(i || line.length) - 1], p, thick, GREEN, 0.5);
    });
    if (this.own) bodies.round.add(this.handle, this.handle, 9 * thick * (this.over || this.held ? 1.25 : 1), GREEN, 1);
  }

  arm(strategy, points, set, alpha) {
    const mix = (white) => strategy.color.map((c) => c * (1 - white) + white);
    const paint = { link: mix(0.62), other: mix(0.4), hinge: strategy.color, carriage: strategy.color, rail: [0.7, 0.72, 0.75], base: [0.55, 0.58, 0.63], tool: [0.2, 0.22, 0.26] };
    data.pieces.forEach((piece, i) => {
      if (alpha < 1 && (piece.role === "base" || piece.role === "rail")) return;
      const a = points.subarray(3 + 6 * i, 6 + 6 * i), b = points.subarray(6 + 6 * i, 9 + 6 * i);
      (piece.flat ? set.flat : set.round).add(a, b, piece.radius, alpha < 1 ? GHOST : paint[piece.role], alpha);
    });
  }

  // The middle lines of links, where the arm stood after a round.
  bones(strategy, points, rods, radius) {
    data.pieces.forEach((piece, i) => {
      if (piece.role === "link") rods.add(points.subarray(3 + 6 * i, 6 + 6 * i), points.subarray(6 + 6 * i, 9 + 6 * i), radius, strategy.color, 1);
    });
  }

  get handle() {
    return this.loop.first.slice(0, 3).map((v, i) => v + this.size[i]);
  }

  // The page scrolls, unless the picture was chosen, by a click, or Ctrl is held, as by two fingers on a touchpad.
  wheel(event) {
    if (!event.ctrlKey && document.activeElement !== this.stage.canvas) return;
    event.preventDefault();
    this.stage.camera.zoom(Math.exp(-event.deltaY / 800));
  }

  // Where an event is in its panel, from -1 to 1.
  spot(event) {
    const box = this.stage.canvas.getBoundingClientRect(), [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const inside = (p) => x >= p.x && x < p.x + p.wide && y >= p.y && y < p.y + p.high;
    const panel = this.dragging ?? this.panels.find(inside) ?? this.panels[0];
    return [(2 * (x - panel.x)) / panel.wide - 1, 1 - (2 * (y - panel.y)) / panel.high, panel];
  }

  near(event) {
    if (!this.own || !this.stage.lens) return false;
    const [x, y, panel] = this.spot(event), [hx, hy] = project(this.stage.lens, this.handle);
    return Math.hypot(((x - hx) * panel.wide) / 2, ((y - hy) * panel.high) / 2) < 30;
  }

  grab(event) {
    this.held = this.near(event) ? "loop" : "view";
    this.dragging = this.spot(event)[2]; // the pointer may leave its panel
    this.last = [event.clientX, event.clientY];
    this.stage.canvas.setPointerCapture(event.pointerId);
    this.stage.canvas.classList.add("held");
  }

  pull(event) {
    this.over = this.near(event);
    this.stage.canvas.classList.toggle("over", this.over);
    if (this.held === "view") this.stage.camera.turn((event.clientX - this.last[0]) / 150, (event.clientY - this.last[1]) / 150);
    this.last = [event.clientX, event.clientY];
    if (this.held !== "loop") return;
    const [x, y] = this.spot(event), at = meet(this.stage.lens, x, y, this.loop.first, axis(this.plane));
    if (at) this.drag(at.map((v, i) => v - this.loop.first[i]));
  }

  // The ball is at a place from the start: it stays in its plane, and within what the sliders can say.
  drag(size) {
    const [length, angle] = ofPlane(this.plane, size);
    this.dragged = true;
    this.size = inPlane(this.plane, Math.min(this.most, Math.max(0.01 * this.most, length)), angle);
    this.change();
  }

  release() {
    this.held = "";
    this.dragging = undefined;
    this.stage.canvas.classList.remove("held");
  }

  key(event) {
    const step = 0.02 * this.most, moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key === "+" || event.key === "-") this.stage.camera.zoom(event.key === "+" ? 1.1 : 1 / 1.1);
    else if (event.key === " ") this.hold(!this.playing);
    else if (moves[event.key] && this.own) {
      const { right, up, back } = this.stage.lens, [x, y] = moves[event.key];
      this.drag(this.size.map((v, i) => v + step * (x * right[i] + y * (up[i] - back[i]))));
    } else return;
    event.preventDefault();
  }

  // Where each strategy is drawn: side by side, or one above the other where the page is narrow.
  get panels() {
    const { clientWidth, clientHeight } = this.stage.canvas, count = this.strategies.length, stacked = clientWidth < 560;
    const [wide, high] = stacked ? [clientWidth, clientHeight / count] : [clientWidth / count, clientHeight];
    return this.strategies.map((_, k) => ({ x: stacked ? 0 : k * wide, y: stacked ? k * high : 0, wide, high }));
  }

  // The hint beside the ball.
  place() {
    const { wide, high } = this.panels[0], [x, y] = project(this.stage.lens, this.handle);
    $("hint").style.left = `${Math.max(4, Math.min(((x + 1) / 2) * wide - 55, wide - 150))}px`;
    $("hint").style.top = `${((1 - y) / 2) * high + 18}px`;
  }
}

try {
  const strategies = await Promise.all(data.strategies.map((given, i) => Strategy.load(given, data, i)));
  data.loops = await Promise.all(data.loops.map(opened));
  const page = new Page(strategies, new Stage($("canvas"), data.loops[0].view));
  page.frame(performance.now());
  globalThis.holokin = page;
} catch (problem) {
  fail(problem);
}
