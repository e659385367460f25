// Loops of the tool that the page makes itself, as tables of segments: see Path.table of holokin.

const SPEED = 0.1; // m/s, of the path

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const axis = (k) => [0, 1, 2].map((i) => Number(i === k));

// An arc of a whole turn about a centre, from the start: counter-clockwise about the normal, or clockwise.
function turn(start, center, normal, clockwise, rotation) {
  const x = start.map((v, i) => v - center[i]), y = cross(normal, x), angle = (clockwise ? -2 : 2) * Math.PI;
  const radius = Math.hypot(...x), bend = angle * angle * radius;
  const seconds = (radius * Math.abs(angle)) / SPEED;
  return [...center, ...x, ...y, angle, ...new Array(21).fill(0), ...rotation, seconds, bend, 0];
}

// A circle, or a figure eight of two, from the start of a loop to a point opposite to it.
function round(kind, from, size, plane, steps) {
  const start = from.first.slice(0, 3), rotation = from.first.slice(3), normal = axis(plane);
  const middle = (sign) => start.map((v, i) => v + (sign * size[i]) / 2);
  const rows = [turn(start, middle(1), normal, false, rotation)];
  if (kind === "eight") rows.push(turn(start, middle(-1), normal, true, rotation));
  const each = Math.ceil(steps / rows.length);
  return { ...from, rounds: 0, text: "", rows, counts: rows.map(() => each), line: lineOf(rows) };
}

// Points along segments.
function lineOf(rows) {
  const each = Math.max(2, Math.ceil(72 / rows.length));
  return rows.flatMap((row) => Array.from({ length: each }, (_, k) => point(row, (k + 1) / each)));
}

function point(row, u) {
  const c = Math.cos(row[9] * u), s = Math.sin(row[9] * u);
  return [0, 1, 2].map((i) => row[i] + c * row[3 + i] + s * row[6 + i] + u * (row[10 + i] + u * (row[13 + i] + u * row[16 + i])));
}

// A loop as the page has it from Python, with its table read.
async function opened(loop) {
  const numbers = Array.from(new Float64Array(await unpacked(loop.table)));
  const rows = Array.from({ length: numbers.length / 43 }, (_, k) => numbers.slice(43 * k, 43 * (k + 1)));
  return { ...loop, rows, line: lineOf(rows) };
}

// A vector of a length in a plane, at an angle from the plane's first axis.
function inPlane(plane, length, angle) {
  const [u, v] = [axis((plane + 1) % 3), axis((plane + 2) % 3)];
  return [0, 1, 2].map((i) => length * (Math.cos(angle) * u[i] + Math.sin(angle) * v[i]));
}

// The length and the angle of such a vector.
function ofPlane(plane, size) {
  const [u, v] = [size[(plane + 1) % 3], size[(plane + 2) % 3]];
  return [Math.hypot(u, v), Math.atan2(v, u)];
}
