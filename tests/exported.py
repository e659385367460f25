"""C programs around exported code, for the tests: on a file of postures, and on whatever comes."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np

from holokin.base.types import Array
from holokin.export import Exported

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")

ON_A_FILE = """
#include <stdio.h>
#include "NAME.h"
int main(int argc, char **argv) {
  double in[NAME_N + NAME_M], out[NAME_N + 1];
  NAME_real q[NAME_N], dx[NAME_M], dq[NAME_N];
  FILE *from = fopen(argv[1], "rb"), *to = fopen(argv[2], "wb");
  (void)argc;
  while (fread(in, sizeof in, 1, from) == 1) {
    for (int i = 0; i < NAME_N; i++) q[i] = (NAME_real)in[i];
    for (int i = 0; i < NAME_M; i++) dx[i] = (NAME_real)in[NAME_N + i];
    out[NAME_N] = NAME_rate(q, dx, dq);
    for (int i = 0; i < NAME_N; i++) out[i] = (double)dq[i];
    fwrite(out, sizeof out, 1, to);
  }
  return fclose(to);
}
"""
"""dq = G dx and the status of every (q, dx) of a file."""

ON_ANYTHING = """
#include <math.h>
#include <stdio.h>
#include "NAME.h"
static unsigned state = 1;
static double draw(double size) { /* now and then something that is no number to compute with */
  state = state * 1664525u + 1013904223u;
  if (state % 97u == 0) return NAN;
  if (state % 97u == 1) return state & 4096u ? INFINITY : -INFINITY;
  if (state % 97u == 2) return 1e30 * size;
  if (state % 97u == 3) return 0.0;
  return size * ((double)(state >> 8) / 8388608.0 - 1.0);
}
static int wrong;
static void expect(int status, const NAME_real *out, int count) {
  for (int i = 0; i < count; i++) {
    if (status >= NAME_SINGULAR && (out[i] < 0 || out[i] > 0 || !(out[i] - out[i] == 0))) wrong++;
    if (!(out[i] - out[i] == 0)) wrong++;
  }
  if (status < NAME_IMPRECISE || status > NAME_LOST) wrong++;
}
int main(void) {
  long statuses[10] = {0};
  NAME_real q[NAME_N], target[NAME_TARGET], dx[NAME_M], twist[NAME_TWIST], T[16], G[NAME_N * NAME_M], dq[NAME_N], scale;
  NAME_parameters parameters;
  NAME_defaults(&parameters);
  for (int k = 0; k < CALLS; k++) {
    for (int i = 0; i < NAME_N; i++) q[i] = (NAME_real)draw(3.0);
    for (int i = 0; i < NAME_M; i++) dx[i] = (NAME_real)draw(1.0);
    for (int i = 0; i < NAME_TWIST; i++) twist[i] = (NAME_real)draw(1.0);
    expect(NAME_pose(q, T), T, 16);
    for (int i = 0; i < NAME_TARGET; i++) target[i] = NAME_TARGET == 16 ? T[i] : T[4 * (i % 3) + 3];
    target[k % NAME_TARGET] += (NAME_real)draw(0.1);
    expect(NAME_gain(q, G), G, NAME_N * NAME_M);
    expect(NAME_rate(q, dx, dq), dq, NAME_N);
    const int status = NAME_step(q, target, twist, &parameters, dq, &scale);
    expect(status, dq, NAME_N);
    statuses[status + 1]++;
LEAF
  }
  for (int i = 0; i < 10; i++) printf("%ld ", statuses[i]);
  return wrong != 0;
}
"""
"""Every function on CALLS postures, targets and rates, bad ones among them; prints how often each status came."""

SANITIZE = ("-O0", "-fsanitize=address,undefined", "-fsanitize-undefined-trap-on-error")
"""The program ends at whatever they find; undefined behaviour says no word then, and compiles in half the time."""

LEAF = """
    NAME_real c[NAME_R], g[NAME_R], before[NAME_N];
    expect(NAME_constraint(q, g), g, NAME_R);
    for (int i = 0; i < NAME_R; i++) c[i] = g[i] + (NAME_real)draw(0.01);
    expect(NAME_leaf_step(q, target, c, dq), dq, NAME_N);
    for (int i = 0; i < NAME_N; i++) before[i] = q[i];
    if (NAME_inverse(q, target, c, 12) > NAME_LIMIT)
      for (int i = 0; i < NAME_N; i++)
        if (!(q[i] - q[i] == 0 ? q[i] <= before[i] && q[i] >= before[i] : before[i] - before[i] != 0)) wrong++;
"""
"""The same of a leaf: what does not converge leaves q as it was."""


def program(written: Exported, text: str, folder: Path, *flags: str, leaf: str = "") -> Path:
    """The program of a text whose NAME and LEAF are replaced, built with the library by gcc's rules."""
    code = text.replace("LEAF\n", leaf).replace("NAME_", "@").replace("NAME", written.name)
    upper = ("N", "M", "R", "TARGET", "TWIST", "OK", "IMPRECISE", "LIMIT", "SINGULAR", "BAD_PARAMETERS")
    upper = (*upper, "NOT_A_ROTATION", "LOST")
    for word in sorted(upper, key=len, reverse=True):
        code = code.replace(f"@{word}", f"{written.name.upper()}_{word}")
    source = folder / "program.c"
    source.write_text(code.replace("@", f"{written.name}_"), "utf-8")
    made = folder / "program"
    library = str(written.folder / f"{written.name}.c")
    command = ["cc", "-std=c99", f"-I{written.folder}", *flags, str(source), library, "-o", str(made), "-lm"]
    subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    return made


def rates(written: Exported, folder: Path, Q: Array, X: Array, *flags: str) -> tuple[Array, Array]:
    """(dq (k, n), status (k,)) of the exported `rate` at many postures."""
    made = program(written, ON_A_FILE, folder, "-O1", *flags)
    np.hstack([Q, X]).tofile(folder / "in.bin")
    subprocess.run([str(made), str(folder / "in.bin"), str(folder / "out.bin")], check=True, timeout=300)
    out = np.fromfile(folder / "out.bin").reshape(len(Q), -1)
    return out[:, :-1], out[:, -1].astype(int)
