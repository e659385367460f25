// A strategy of the robot: WebAssembly of the C by which hk.follow goes along a path.

const ROWS = 64; // steps of one call: PAGE_ROWS of strategy.c

// The bytes of deflated base64.
async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

class Strategy {
  static async load(given, data, index) {
    const { instance } = await WebAssembly.instantiate(await unpacked(given.module), {});
    return new Strategy(given, data, index, instance.exports);
  }

  constructor(given, data, index, code) {
    code._initialize?.();
    Object.assign(this, { name: given.name, leaf: given.leaf, index, code, n: data.joints.length, pieces: data.pieces });
    this.color = [1, 3, 5].map((k) => parseInt(given.color.slice(k, k + 2), 16) / 255);
    this.css = given.color;
    this.rows = new Float64Array(0);
  }

  at(place, size) {
    return new Float64Array(this.code.memory.buffer, this.code[place](), size);
  }

  // Begins anew along a loop: { first, rows, counts, begin }.
  begin(loop) {
    const begin = loop.begin[this.index];
    this.loop = loop;
    this.side = begin.side;
    this.q0 = begin.q0;
    this.steps = loop.counts.reduce((sum, count) => sum + count, 0);
    this.at("segments", 43 * loop.rows.length).set(loop.rows.flat());
    [...loop.counts, 0].forEach((count, i) => this.code.count(i, count));
    this.at("closing", 12).set(loop.first);
    this.at("state", this.n + begin.state.length).set([...begin.q0, ...begin.state]);
    if (this.leaf) this.at("state", this.n + begin.state.length + this.n + 1).fill(0, this.n + begin.state.length);
    this.rows = new Float64Array(this.n * (1 + this.steps));
    this.rows.set(begin.q0);
    this.done = 0;
    this.ended = "";
  }

  // Goes on to so many cycles, for so many milliseconds at most; true when that is done, or no more can be.
  advance(cycles, patience) {
    const wanted = cycles * this.steps, until = performance.now() + patience;
    while (this.done < wanted && !this.ended) {
      this.block(wanted);
      if (performance.now() > until) break;
    }
    return this.done >= wanted || Boolean(this.ended);
  }

  block(wanted) {
    const first = this.done % this.steps, last = Math.min(first + ROWS, this.steps, first + wanted - this.done);
    this.at("state", this.n).set(this.row(this.done));
    const did = this.code.follow(first, last, 1, this.side, 0);
    this.keep(this.at("rows", did * this.n));
    this.done += did;
    if (did === last - first) return;
    this.at("state", this.n).set(this.row(this.done));
    const limit = this.code.follow(first + did, first + did + 1, 1, this.side, 1) === 1;
    const edge = "as at the edge of its reach";
    this.ended = limit ? "a joint limit" : this.leaf ? `the end of its leaf, ${edge}` : `a singular posture, ${edge}`;
  }

  keep(values) {
    const end = this.n * (this.done + 1);
    if (end + values.length > this.rows.length) {
      const more = new Float64Array(Math.max(2 * this.rows.length, end + values.length));
      more.set(this.rows);
      this.rows = more;
    }
    this.rows.set(values, end);
  }

  row(step) {
    return this.rows.subarray(this.n * step, this.n * (step + 1));
  }

  // Whole cycles that were gone.
  get cycles() {
    return Math.floor(this.done / this.steps);
  }

  // The joint that is farthest from its start after a cycle, and how far.
  drift(cycle) {
    const end = this.row(cycle * this.steps);
    let [joint, largest] = [0, 0];
    for (let i = 0; i < this.n; i++) {
      const far = Math.abs(end[i] - this.q0[i]);
      if (far > largest) [joint, largest] = [i, far];
    }
    return { joint, largest };
  }

  // Joints after so many steps, a fraction between two of them; where the strategy ended, its last.
  posture(steps) {
    const k = Math.min(Math.floor(steps), this.done), next = Math.min(k + 1, this.done), share = Math.min(steps - k, 1);
    const [a, b] = [this.row(k), this.row(next)];
    return Float64Array.from(a, (value, i) => value + share * (b[i] - value));
  }

  // Points at a posture: the tool's, then both ends of each piece.
  points(q) {
    this.at("state", this.n).set(q);
    this.code.draw();
    return Float64Array.from(this.at("drawn", 3 + 6 * this.pieces.length));
  }
}
