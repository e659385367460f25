"""The C++17 header of exported C: compiled without a warning, and every function gives what Python gives."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_START, sampled
from holokin.base.errors import ArgumentError
from holokin.export import Exported, export_c

STRICT = ("-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-fno-exceptions")
PROGRAM = """
#include <cstdio>
#include <type_traits>
#include "NAME.hpp"
#include "NAME.hpp"
static_assert(std::is_same_v<NAME::Joints, std::array<double, NAME_N>>);
static_assert(std::is_trivially_copyable_v<NAME::Result<NAME::Step>>);
template <class A> void print(const A &values) { for (double x : values) std::printf("%.17g ", x); }
int main() {
  NAME::Joints q = NAME::start();
  for (double &x : q) x += 0.05;
  NAME::Rows dx{};
  for (double &x : dx) x = 0.1;
  const auto T = NAME::pose(q);
  NAME::Target target{};
  if (target.size() == 16) for (std::size_t i = 0; i < target.size(); i++) target[i] = T.value[i];
  else for (std::size_t i = 0; i < target.size(); i++) target[i] = T.value[4 * i + 3];
  NAME::Twist twist{};
  twist[0] = 0.01;
  const auto dq = NAME::rate(q, dx);
  const auto step = NAME::step(q, target, twist, NAME::defaults());
  const auto found = NAME::solve(target, 200);
  const auto near = NAME::inverse(q, target, NAME::constraint(q).value, 10);
  if (!T || !dq || !step || !found || !near) return 1;
  print(T.value); print(NAME::gain(q).value); print(dq.value); print(step.value.rates); print(found.value);
  print(near.value); print(NAME::constraint(q).value);
  q[0] = 1.0 / 0.0 * 1.0;
  const auto bad = NAME::rate(q, dx);
  return bad || bad.status != NAME::Status::not_finite;
}
"""

pytestmark = pytest.mark.skipif(not (shutil.which("g++") and shutil.which("cc")), reason="no C++ compiler here")


def ran(written: Exported, folder: Path) -> np.ndarray:
    """The numbers that a C++ program prints."""
    source = PROGRAM.replace("NAME_N", f"{written.name.upper()}_N").replace("NAME", written.name)
    (folder / "main.cpp").write_text(source, "utf-8")
    library, program = folder / "law.o", folder / "program"
    for command in (
        ["cc", "-std=c99", "-O1", "-c", str(written.folder / f"{written.name}.c"), "-o", str(library)],
        ["g++", *STRICT, f"-I{written.folder}", str(folder / "main.cpp"), str(library), "-o", str(program), "-lm"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
        assert done.returncode == 0, done.stderr
    said = subprocess.run([str(program)], capture_output=True, text=True, timeout=60, check=True)
    return np.array(said.stdout.split(), dtype=float)


@pytest.mark.campaign
@sampled(1, "name", ["ppr", "panda"])
def test_cpp_gives_what_python_gives(name: str, tmp_path: Path) -> None:
    """pose, gain, rate, control step, inverse kinematics from the start and from near by, and the constraint."""
    robot = hk.load(name)
    start, task = (PPR_START, hk.position(robot)) if name == "ppr" else (PANDA_START, hk.pose(robot))
    law = hk.holonomic(task, hk.lock(2))
    found = ran(export_c(law, tmp_path / "c", q0=start, name=f"{name}_law", vectors_count=2), tmp_path)
    q = start + 0.05
    T, dx = robot.pose(q), np.full(task.m, 0.1)
    twist = np.zeros(3 if name == "ppr" else 6)
    twist[0] = 0.01
    loop = hk.controller(law, dt=1e-3, q0=start)
    target = T[:3, 3] if name == "ppr" else T
    parts = [T.ravel(), law(q).ravel(), law(q) @ dx, loop.step(q, target, twist), hk.ik(law, start)(T), q, q[[2]]]
    np.testing.assert_allclose(found, np.concatenate(parts), rtol=1e-9, atol=1e-11)


def test_a_name_that_is_a_word_of_cpp_is_refused(tmp_path: Path) -> None:
    law = hk.holonomic(hk.position(hk.load("ppr")), hk.lock(2))
    with pytest.raises(ArgumentError, match="no word or header of C"):
        export_c(law, tmp_path, q0=PPR_START, name="namespace")
