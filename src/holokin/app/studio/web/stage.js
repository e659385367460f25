// Draws arms, loops and the floor by WebGL 2. Everything is a rod from a to b with a radius: round at its ends, or flat.
// With three.js a page would have 640 kB instead of 110, and without a graphics card a picture would take half as long again.

const VERTEX = `#version 300 es
layout(location=0) in vec3 spot;
layout(location=1) in vec3 normal;
layout(location=2) in float end;
layout(location=3) in vec4 from;
layout(location=4) in vec3 to;
layout(location=5) in vec4 paint;
uniform mat4 camera;
uniform vec3 shade; // floor z, 1 for the shadow, lift
out vec3 outward;
out vec3 place;
out vec4 color;
void main() {
  vec3 z = to - from.xyz;
  float size = length(z);
  z = size > 1e-9 ? z / size : vec3(0, 0, 1);
  vec3 x = normalize(abs(z.z) < 0.9 ? cross(z, vec3(0, 0, 1)) : cross(z, vec3(1, 0, 0)));
  mat3 turn = mat3(x, cross(z, x), z);
  place = mix(from.xyz, to, end) + from.w * (turn * spot);
  outward = turn * normal;
  color = paint;
  if (shade.y > 0.5) place = vec3(place.xy - vec2(0.28, -0.2) * max(place.z - shade.x, 0.0), shade.x + shade.z);
  gl_Position = camera * vec4(place, 1);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 outward;
in vec3 place;
in vec4 color;
uniform vec3 shade;
uniform vec3 eye;
out vec4 shown;
void main() {
  if (shade.y > 0.5) { shown = vec4(0.80, 0.82, 0.85, 1); return; }
  vec3 n = normalize(outward), v = normalize(eye - place);
  float key = max(dot(n, normalize(vec3(0.28, -0.2, 0.9))), 0.0), sky = 0.5 + 0.5 * n.z;
  float front = max(dot(n, v), 0.0), gloss = pow(max(dot(n, normalize(vec3(0.28, -0.2, 0.9) + v)), 0.0), 40.0);
  vec3 lit = color.rgb * (0.46 + 0.2 * sky + 0.28 * key + 0.14 * front) + 0.16 * gloss;
  shown = vec4(lit, color.a);
}`;

const FLOOR_VERTEX = `#version 300 es
layout(location=0) in vec2 corner;
uniform mat4 camera;
uniform vec4 floor_; // middle x, y, z, reach
out vec2 place;
void main() {
  place = floor_.xy + corner * floor_.w;
  gl_Position = camera * vec4(place, floor_.z, 1);
}`;

const FLOOR_FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
uniform vec4 floor_;
uniform float square;
out vec4 shown;
float lines(vec2 at, float width) {
  vec2 near = abs(fract(at - 0.5) - 0.5) / fwidth(at);
  return 1.0 - min(min(near.x, near.y) / width, 1.0);
}
void main() {
  float fade = 1.0 - smoothstep(0.35, 1.0, length(place - floor_.xy) / floor_.w);
  shown = vec4(0.55, 0.59, 0.65, fade * 0.5 * lines(place / square, 1.3));
}`;

const NUMBERS = 11; // of a rod: a, radius, b, red, green, blue, alpha

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) || "WebGL failed");
  return made;
}

// A ball that is cut at its middle: the halves are the ends of a rod.
function roundRod(around, up) {
  const rings = [];
  for (let half = 0; half < 2; half++)
    for (let i = 0; i <= up; i++) rings.push([((half - 1) * Math.PI) / 2 + (i / up) * (Math.PI / 2), half]);
  const corner = ([height, end], turn) => {
    const c = Math.cos(height), p = [c * Math.cos(turn), c * Math.sin(turn), Math.sin(height)];
    return [...p, ...p, end];
  };
  return strips(rings, around, corner);
}

// A rod with flat ends.
function flatRod(around) {
  const rings = [[0, 0, -1], [1, 0, -1], [1, 0, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]];
  const corner = ([radius, end, up], turn) => {
    const c = Math.cos(turn), s = Math.sin(turn);
    return [radius * c, radius * s, 0, ...(up ? [0, 0, up] : [c, s, 0]), end];
  };
  return strips(rings, around, corner);
}

// Rings of corners (spot, normal, end), and triangles between them.
function strips(rings, around, corner) {
  const corners = rings.flatMap((ring) => Array.from({ length: around }, (_, k) => corner(ring, (2 * Math.PI * k) / around)));
  const triangles = [];
  for (let i = 0; i + 1 < rings.length; i++)
    for (let k = 0; k < around; k++) {
      const [p, q] = [i * around + k, i * around + ((k + 1) % around)], [r, s] = [p + around, q + around];
      triangles.push(p, q, r, q, s, r); // counter-clockwise from outside
    }
  return { corners: new Float32Array(corners.flat()), triangles: new Uint16Array(triangles) };
}

// Rods that are drawn by one call.
class Rods {
  constructor(gl, mesh) {
    this.gl = gl;
    this.corners = mesh.triangles.length;
    this.list = new Float32Array(64 * NUMBERS);
    this.count = 0;
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, mesh.corners, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STATIC_DRAW);
    [[0, 3, 0], [1, 3, 12], [2, 1, 24]].forEach(([at, size, from]) => this.attribute(at, size, 28, from));
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    [[3, 4, 0], [4, 3, 16], [5, 4, 28]].forEach(([at, size, from]) => {
      this.attribute(at, size, 4 * NUMBERS, from);
      gl.vertexAttribDivisor(at, 1);
    });
  }

  attribute(at, size, stride, from) {
    this.gl.enableVertexAttribArray(at);
    this.gl.vertexAttribPointer(at, size, this.gl.FLOAT, false, stride, from);
  }

  add(a, b, radius, color, alpha) {
    if ((this.count + 1) * NUMBERS > this.list.length) {
      const more = new Float32Array(2 * this.list.length);
      more.set(this.list);
      this.list = more;
    }
    this.list.set([a[0], a[1], a[2], radius, b[0], b[1], b[2], color[0], color[1], color[2], alpha], NUMBERS * this.count++);
  }

  draw() {
    if (!this.count) return;
    const gl = this.gl;
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.list.subarray(0, this.count * NUMBERS), gl.DYNAMIC_DRAW);
    gl.drawElementsInstanced(gl.TRIANGLES, this.corners, gl.UNSIGNED_SHORT, 0, this.count);
  }
}

const LOWER = 0.1; // of half a panel's height: by so much things are seen lower than its middle

// A camera that goes round a point: at(width, height) gives its matrix, ray and project go between pixels and space.
class Camera {
  constructor(view) {
    this.show(view);
  }

  show(view) {
    this.view = view;
    this.reset();
  }

  reset() {
    this.azimuth = (this.view.azimuth * Math.PI) / 180;
    this.elevation = (this.view.elevation * Math.PI) / 180;
    this.nearer = 1;
  }

  turn(right, up) {
    this.azimuth -= right;
    this.elevation = Math.min(1.55, Math.max(-0.2, this.elevation + up));
  }

  zoom(factor) {
    this.nearer = Math.min(4, Math.max(0.4, this.nearer * factor));
  }

  at(width, height) {
    const narrow = Math.min(1, (1.25 * width) / height), open = 0.5; // rad, of the height
    const distance = (this.view.around * 1.18) / Math.sin(open / 2) / narrow / this.nearer;
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    const back = [ce * ca, ce * sa, se], right = [-sa, ca, 0], up = [-se * ca, -se * sa, ce];
    const eye = this.view.center.map((c, i) => c + distance * back[i]);
    const f = 1 / Math.tan(open / 2), near = distance / 50, far = distance * 8, g = f * (height / width);
    const row = (axis, k) => axis.map((v) => k * v).concat(-k * dot(axis, eye));
    const [x, y, z] = [row(right, g), row(up, f), row(back, 1)];
    const depth = z.map((v) => ((far + near) / (near - far)) * v);
    depth[3] += (2 * far * near) / (near - far);
    y.forEach((v, i) => (y[i] = v + LOWER * z[i])); // below the words at the top
    const matrix = new Float32Array(16);
    [x, y, depth, z.map((v) => -v)].forEach((values, i) => values.forEach((v, k) => (matrix[4 * k + i] = v)));
    return { matrix, eye, right, up, back, f, g };
  }
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// Where a point is seen, from -1 to 1 to the right and up.
function project(lens, p) {
  const m = lens.matrix, w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
  return [0, 1].map((i) => (m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]) / w);
}

// Where the line of sight through (x, y), each from -1 to 1, meets a plane; null where it does not.
function meet(lens, x, y, point, normal) {
  const way = [0, 1, 2].map((i) => (x / lens.g) * lens.right[i] + ((y + LOWER) / lens.f) * lens.up[i] - lens.back[i]);
  const slope = dot(way, normal);
  if (Math.abs(slope) < 0.02 * Math.hypot(...way)) return null;
  const share = dot(normal, [0, 1, 2].map((i) => point[i] - lens.eye[i])) / slope;
  return share > 0 ? lens.eye.map((e, i) => e + share * way[i]) : null;
}

class Stage {
  constructor(canvas, view) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.canvas = canvas;
    this.gl = gl;
    this.camera = new Camera(view);
    this.solid = program(gl, VERTEX, FRAGMENT);
    this.ground = program(gl, FLOOR_VERTEX, FLOOR_FRAGMENT);
    const at = (made, names) => Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)]));
    this.solidAt = at(this.solid, ["camera", "shade", "eye"]);
    this.groundAt = at(this.ground, ["camera", "floor_", "square"]);
    this.sheet = gl.createVertexArray();
    gl.bindVertexArray(this.sheet);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    const meshes = { round: roundRod(20, 4), flat: flatRod(32), thin: roundRod(5, 1) };
    const rods = () => Object.fromEntries(Object.entries(meshes).map(([kind, mesh]) => [kind, new Rods(gl, mesh)]));
    this.bodies = rods(); // they throw shadows
    this.wires = rods();
    this.ghosts = rods();
    this.marks = rods(); // they are seen through everything
  }

  // The side of a square of the floor [m]: 1, 2 or 5 times a power of ten.
  get square() {
    const rough = this.camera.view.around / 2.5, power = 10 ** Math.floor(Math.log10(rough));
    return power * [5, 2, 1].find((k) => k * power <= rough * 1.0001);
  }

  // Draws panels, { x, y, wide, high } in pixels of the page; fill(k) adds the rods of panel k to the sets.
  draw(panels, fill) {
    const { gl, canvas } = this, scale = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.enable(gl.SCISSOR_TEST);
    gl.enable(gl.CULL_FACE);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    this.lens = this.camera.at(panels[0].wide, panels[0].high);
    panels.forEach(({ x, y, wide, high }, k) => {
      const place = [x, canvas.clientHeight - y - high, wide, high].map((v) => Math.round(scale * v));
      gl.viewport(...place);
      gl.scissor(...place);
      for (const set of [this.bodies, this.wires, this.ghosts, this.marks]) Object.values(set).forEach((rods) => (rods.count = 0));
      fill(k);
      this.panel();
    });
  }

  panel() {
    const { gl, lens, square } = this, { view } = this.camera, span = Math.max(1.6 * view.around, 2 * square);
    gl.clearColor(0.933, 0.941, 0.953, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.disable(gl.DEPTH_TEST);
    gl.useProgram(this.solid);
    gl.uniformMatrix4fv(this.solidAt.camera, false, lens.matrix);
    gl.uniform3fv(this.solidAt.eye, lens.eye);
    gl.uniform3f(this.solidAt.shade, view.floor, 1, 0);
    Object.values(this.bodies).forEach((rods) => rods.draw());
    gl.useProgram(this.ground);
    gl.enable(gl.BLEND);
    gl.uniformMatrix4fv(this.groundAt.camera, false, lens.matrix);
    gl.uniform4f(this.groundAt.floor_, view.center[0], view.center[1], view.floor, span);
    gl.uniform1f(this.groundAt.square, square);
    gl.bindVertexArray(this.sheet);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.solid);
    gl.uniform3f(this.solidAt.shade, view.floor, 0, 0);
    for (const set of [this.bodies, this.wires]) Object.values(set).forEach((rods) => rods.draw());
    gl.enable(gl.BLEND);
    Object.values(this.ghosts).forEach((rods) => rods.draw());
    gl.disable(gl.DEPTH_TEST);
    Object.values(this.marks).forEach((rods) => rods.draw());
    gl.disable(gl.BLEND);
  }
}
