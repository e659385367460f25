"""Exported C of strategies with a closed inverse: all postures, those of Python, and the start's branch at once."""

import ctypes
import shutil
import subprocess
from itertools import product
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, campaign
from exported import STRICT
from holokin.base.errors import ExportError
from holokin.export import check, export_c
from holokin.motion.ik import InverseKinematics
from holokin.motion.ik.closed_leaf import closed_leaf
from holokin.strategies.constraints import tilted

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")

UR = np.array([0.3, -1.2, 1.4, -0.9, 0.7, 0.2])


def follows_the_tool(p, R):
    return 0.8 * p[0] * p[1] - ca.sin(2 * p[2]) + 0.3 * R[0, 1]


CASES = {
    "plain": ("panda", hk.lock("panda_joint7"), PANDA_START),
    "follows": ("panda", hk.lock("panda_joint7", follows=follows_the_tool), PANDA_START),
    "rail": ("rail-ur10e", hk.lock(0, follows=lambda p, _R: p[0]), np.append(0.2, UR)),
    "six": ("ur5e", None, UR),
}


EACH = list(product(CASES, (False, True)))
FEW = [("follows", False), ("rail", True), ("six", False)]


class Compiled:
    """An export as a library of Python, in double or in single precision."""

    def __init__(self, strategy: hk.Strategy, q0: np.ndarray, folder: Path, single: bool) -> None:
        self.made = export_c(strategy, folder, q0=q0, name="arm", vectors_count=4)
        self.type, self.n, file = np.float32 if single else np.float64, len(q0), folder / "arm.so"
        flags = [*STRICT, "-O0", "-shared", "-fPIC", *(["-DARM_FLOAT"] if single else [])]
        subprocess.run(["cc", *flags, str(folder / "arm.c"), "-o", str(file), "-lm"], check=True, timeout=300)
        self.library = ctypes.CDLL(str(file))

    def postures(self, pose: np.ndarray, level: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
        """(what it returns, postures (k, n), signs (k,))."""
        target, c = (np.ascontiguousarray(x, dtype=self.type) for x in (pose, level))
        q, signs = np.zeros((8, self.n), dtype=self.type), np.zeros(8, dtype=np.intc)
        arrays = [target, *([c] if len(c) else []), q, signs]
        count = self.library.arm_postures(*(ctypes.c_void_p(x.ctypes.data) for x in arrays))
        return count, q[: max(count, 0)].astype(float), signs[: max(count, 0)]

    def solve(self, pose: np.ndarray, most: int) -> tuple[int, np.ndarray]:
        target, q = np.ascontiguousarray(pose, dtype=self.type), np.zeros(self.n, dtype=self.type)
        status = self.library.arm_solve(*(ctypes.c_void_p(x.ctypes.data) for x in (q, target)), most)
        return status, q.astype(float)


@pytest.fixture(scope="module")
def panda(tmp_path_factory: pytest.TempPathFactory) -> tuple[Compiled, InverseKinematics, hk.Robot]:
    """A Panda whose joint 7 follows the tool, in double precision; its inverse kinematics in Python; the arm."""
    strategy = hk.holonomic(hk.pose(hk.load("panda")), CASES["follows"][1])
    code = Compiled(strategy, PANDA_START, tmp_path_factory.mktemp("panda"), False)
    return code, hk.ik(strategy, PANDA_START), strategy.task.robot


@pytest.mark.parametrize(("case", "single"), [few if few in FEW else campaign(("case", "single"), few) for few in EACH])
def test_all_postures_are_those_of_python_on_random_poses(case: str, single: bool, tmp_path: Path):
    name, rule, q0 = CASES[case]
    robot = hk.load(name)
    strategy = hk.moore_penrose(hk.pose(robot)) if rule is None else hk.holonomic(hk.pose(robot), rule)
    code, solver = Compiled(strategy, q0, tmp_path, single), hk.ik(strategy, q0)
    rng = np.random.default_rng(0)
    low, high = np.maximum(robot.lower, -3.0), np.minimum(robot.upper, 3.0)
    compared, level = 0, np.zeros(0)
    for posture in rng.uniform(low, high, (200, robot.n)):
        pose = robot.pose(posture)
        level = np.zeros(0) if rule is None else solver.strategy.g(posture)
        python = solver.all(pose, level if len(level) else None, near=(robot.lower + robot.upper) / 2)
        count, q, signs = code.postures(pose, level)
        if single and (count != len(python.q) or not len(python.q) or python.rcond.min() < 0.02):
            continue  # two postures nearly meet, or one is at a limit: too near for single precision
        order = np.lexsort(np.round(q, 6).T[::-1])
        if not single:
            assert count == len(python.q) >= 1 and np.abs(q[order] - python.q).max() < 1e-9
            assert np.abs(robot.pose(q) - pose).max() < 1e-10
            leaf = closed_leaf(solver.strategy, level, True) or pytest.fail("it has a closed inverse")
            rows = leaf.one(pose)  # in the order of the signs + + +, + + -, ...
            assert signs.tolist() == np.flatnonzero((rows[:, 9] > 1e-10) & (rows[:, 10] >= 0)).tolist()
            assert (np.sign(rows[signs, 6:9]) == 1 - 2 * (signs[:, None] >> np.arange(2, -1, -1) & 1)).all()
        else:
            gaps = np.abs(q[:, None] - python.q[None]).max(axis=2)
            assert gaps.min(axis=0).max() < 5e-3 and gaps.min(axis=1).max() < 5e-3
        assert (np.diff(signs) > 0).all()
        compared += 1
    assert compared > (100 if single else 190)
    # What is no pose, and what is out of reach.
    bad = robot.pose(q0)
    bad[0, 3] = np.nan
    assert code.postures(bad, np.atleast_1d(level))[0] == -4
    assert code.postures(1.5 * robot.pose(q0), level)[0] == -7
    far = robot.pose(q0)
    far[:3, 3] += [0, 30.0, 0]
    assert code.postures(far, level)[0] == 0


def test_signs_stay_along_a_motion_and_name_the_starts_branch(panda):
    code, solver, robot = panda
    level, seen = np.atleast_1d(solver.strategy.constraint_value(PANDA_START)), set()
    pose = robot.pose(PANDA_START)
    for angle in np.linspace(0, 2 * np.pi, 60):
        there = pose.copy()
        there[:3, 3] += 0.1 * np.array([np.cos(angle) - 1, np.sin(angle), 0])
        _, q, signs = code.postures(there, level)
        own = np.flatnonzero(np.abs(q - solver(there)).max(axis=1) < 1e-9)
        assert len(own) == 1
        seen.add(int(signs[own[0]]))
    assert len(seen) == 1


def test_solve_answers_by_the_closed_form_what_python_does_and_needs_no_pieces(panda):
    code, solver, robot = panda
    poses = robot.pose(PANDA_START + np.random.default_rng(1).uniform(-0.6, 0.6, (100, 7)))
    python = solver.batch(poses)
    assert python.reached.sum() > 40
    for pose, q, reached in zip(poses, python.q, python.reached, strict=True):
        status, own = code.solve(pose, 1)
        if reached:
            assert status == 0 and np.abs(own - q).max() < 1e-9


def test_solve_goes_a_path_where_coordinates_that_a_joint_follows_may_jump(tmp_path: Path):
    robot = hk.load("panda")
    chart = hk.pose(robot, "rotation-vector", reference=robot.pose(PANDA_START)[:3, :3])
    rule = tilted(hk.lock(6), lambda x: 0.2 * x[3] - 0.1 * x[0], chart=chart)
    strategy = hk.holonomic(hk.pose(robot), rule)
    code, solver = Compiled(strategy, PANDA_START, tmp_path, False), hk.ik(strategy, PANDA_START)
    closed = solver._paths.closed
    assert closed is not None and np.isfinite(closed.turn)
    assert "target[10] > HK_C(" in (tmp_path / "arm.c").read_text()
    poses = robot.pose(PANDA_START + np.random.default_rng(2).uniform(-0.3, 0.3, (20, 7)))
    for pose in poses:
        q = closed.one(pose)
        status, own = code.solve(pose, 1)
        assert q is None or (status == 0 and np.abs(own - q).max() < 1e-9)


def test_the_self_test_of_the_export_asks_for_all_postures_and_notices_a_wrong_one(tmp_path: Path):
    strategy = hk.holonomic(hk.pose(hk.load("panda")), CASES["follows"][1])
    made = export_c(strategy, tmp_path, q0=PANDA_START, name="arm", vectors_count=2)
    file = tmp_path / "arm.c"
    right = file.read_text()
    broken = right.replace("q[count * HK_N + i] = y[i];", "q[count * HK_N + i] = y[i] + HK_C(1e-6) * (i == 3);")
    assert broken != right and "arm_postures(target, c, found, signs)" in (tmp_path / "arm_selftest.c").read_text()
    file.write_text(broken)
    with pytest.raises(ExportError, match="postures"):
        check(made)


def test_the_wrapper_for_cpp_gives_the_same(tmp_path: Path):
    if shutil.which("c++") is None:
        pytest.skip("no C++ compiler here")
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(6))
    export_c(strategy, tmp_path, q0=PANDA_START, name="arm", vectors_count=2)
    (tmp_path / "main.cpp").write_text(
        '#include <cstdio>\n#include "arm.hpp"\nint main() {\n  const auto q = arm::start();\n'
        "  const auto found = arm::postures(arm::pose(q).value, arm::constraint(q).value);\n"
        "  double least = 9;\n  for (int i = 0; i < found.count; i++) {\n    double off = 0;\n"
        "    for (int j = 0; j < 7; j++) off += (found.q[i][j] - q[j]) * (found.q[i][j] - q[j]);\n"
        "    if (off < least) least = off;\n  }\n  return least < 1e-18 ? 0 : 1;\n}\n"
    )
    flags = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-O0"]
    subprocess.run(["cc", "-std=c99", *flags, "-c", "arm.c", "-o", "arm.o"], cwd=tmp_path, check=True)
    subprocess.run(["c++", "-std=c++17", *flags, "main.cpp", "arm.o", "-o", "main"], cwd=tmp_path, check=True)
    assert subprocess.run([str(tmp_path / "main")], check=False).returncode == 0
