"""What native inverse kinematics shows before it answers: Taylor models hold what they say, and no fold is passed."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.base.errors import BranchError, SingularityError
from holokin.motion.ik.edge import along
from holokin.strategies import HolonomicStrategy
from holokin.symbolic.native import code_file, enabled
from holokin.symbolic.native.toolchain import library

pytestmark = pytest.mark.skipif(not enabled(), reason="no compiler")


def models(strategy: HolonomicStrategy) -> Callable[..., np.ndarray]:
    """(c, v, w, z, radius) -> models of the extended Jacobian by columns: m, a, b, c, r0, r, s, e, an idle one."""
    found = along(strategy)
    assert found is not None
    probe = """
void probe(const double *c, const double *v, const double *w, const double *z, const double *radius,
           hk_model *A) {
  hk_model x[HK_N];
  for (int i = 0; i < HK_N; i++) {
    hk_model_constant(c[i], x + i);
    x[i].a = v[i], x[i].b = w[i], x[i].c = z[i], x[i].s = x[i].e[i] = radius[0];
  }
  hk_along_body(x, A);
}
"""
    code = code_file("scalar.h") + "#define HK_N 7\n" + code_file("model.c") + found.c + probe
    run = library(code, needs=("probe",)).probe
    run.restype = None

    def call(c: np.ndarray, v: np.ndarray, w: np.ndarray, z: np.ndarray, radius: float) -> np.ndarray:
        out = np.empty((49, 15))
        given = [np.ascontiguousarray(a, dtype=float) for a in (c, v, w, z, [radius])]
        run(*(ctypes.c_void_p(a.ctypes.data) for a in (*given, out)))
        return out

    return call


@pytest.mark.parametrize(
    "constraint",
    [
        hk.arm_angle(),
        hk.strategies.constraints.height("panda_joint4"),
        hk.custom(lambda q: ca.sqrt(2 + q[2]) / (3 - q[0] * q[1])),
    ],
    ids=["sqrt and division", "height", "own"],
)
def test_a_taylor_model_holds_the_extended_jacobian_at_a_thousand_postures(
    panda: hk.Robot, constraint: hk.Constraint
) -> None:
    strategy = hk.holonomic(hk.pose(panda), constraint)
    at, rng = models(strategy), np.random.default_rng(0)
    tight = 0.0
    for size in (0.003, 0.03, 0.1):
        q, v = PANDA_START + rng.uniform(-0.2, 0.2, 7), size * rng.uniform(-1, 1, 7)
        w, z, radius = *(0.3 * size * rng.uniform(-1, 1, (2, 7))), 0.05 * size
        m, a, b, c, r0, r, s = (column.reshape(7, 7).T for column in at(q, v, w, z, radius).T[:7])
        e = at(q, v, w, z, radius)[:, 7:14].reshape(7, 7, 7).transpose(1, 0, 2)
        assert np.abs(s - np.abs(e).sum(axis=2)).max() < 1e-12
        for k in range(300):
            t, u = rng.uniform(-1, 1), rng.uniform(-1, 1, 7) * (k % 3 > 0)
            u = np.sign(u) if k % 3 == 2 else u
            p = q + t * v + t**2 * w + t**3 * z + radius * u
            A = np.vstack([strategy.task.jacobian(p), strategy.rows(p)])
            off = np.abs(A - (m + t * (a + t * (b + t * c)) + e @ u))
            assert (off <= (r if k % 3 else r0) * (1 + 1e-9) + 1e-14).all()
            tight = max(tight, float((off / (r0 + 1e-13)).max()) if k % 3 == 0 and size == 0.03 else 0.0)
    assert tight > 1e-3  # a bound, and no guess from far away


FOLDS = {
    "cubic": (lambda w: lambda s: s**3 - 3 * w * w * s, lambda w: w),
    "wave": (lambda w: lambda s: s - 1.5 * w * ca.sin(s / w), None),
}


@pytest.mark.parametrize("kind", list(FOLDS))
@sampled(1, "width", [0.0316, 1e-3])
def test_a_fold_however_narrow_is_not_passed(kind: str, width: float) -> None:
    """The PPR arm with g = h(q3) + x: h' = 0 where the leaf folds. Poses beyond are refused."""
    h = FOLDS[kind][0](width)
    strategy = hk.holonomic(hk.position(hk.load("ppr")), hk.custom(lambda q: h(q[2]) + q[0] + ca.cos(q[2])))
    assert along(strategy) is not None
    begin = 0.2
    fold = width
    if kind == "wave":
        begin = width * (2 * np.pi * 3 + np.pi)
        turn = np.arccos(1 / 1.5)
        fold = width * (2 * np.pi * np.floor((begin / width + turn) / (2 * np.pi)) + turn)
    value = ca.Function("h", [s := ca.SX.sym("s")], [h(s)])
    start = np.array([0.3, 0.2, begin])
    tool = strategy.task.robot.pose(start)[:3, 3]
    ik, room = hk.ik(strategy, start), float(value(begin) - value(fold))
    assert "native" in ik.engine
    near = ik(tool + [0.999 * room, 0, 0])
    assert fold < near[2] < begin
    assert float(value(near[2])) == pytest.approx(float(value(begin)) - 0.999 * room, abs=1e-12)
    for beyond in (1.001, 1.5, 30.0):
        with pytest.raises((BranchError, SingularityError)):
            ik(tool + [beyond * room, 0, 0])
    for share in (0.9, 0.99, 0.999):  # and from a posture before it
        q = ik(tool + [share * room, 0, 0])
        for beyond in (1.0001, 2 - share, 1.1, 2.0, 4.0, 4.5):  # 4: as far again behind both folds of the cubic
            with pytest.raises((BranchError, SingularityError)):
                ik.near(tool + [beyond * room, 0, 0], q)


def test_a_way_that_ends_at_a_fold_ends_close_to_it_and_says_so() -> None:
    """The PPR arm with g = q3^3 - 3 w^2 q3 + x: the leaf folds at q3 = w, however far beyond it the pose lies."""
    w, start = 0.05, np.array([0.3, 0.2, 0.4])
    h = FOLDS["cubic"][0](w)
    ik = hk.ik(hk.holonomic(hk.position(hk.load("ppr")), hk.custom(lambda q: h(q[2]) + q[0] + ca.cos(q[2]))), start)
    room = start[2] ** 3 - 3 * w * w * start[2] + 2 * w**3
    beyond = ik.strategy.task.robot.pose(start)[:3, 3] + np.outer([1.1 * room, 1.5 * room, 3 * room], [1, 0, 0])
    found = ik.batch(beyond)
    assert (found.status == hk.motion.ik.InverseStatus.LEAF_ENDS).all()
    assert np.abs(found.last[:, 2] - w).max() < 0.01 * w
    with pytest.raises(BranchError, match=r"leads no farther than q1"):
        ik(beyond[0])


@pytest.mark.campaign
@pytest.mark.parametrize("slope", [1e-2, 1e-3, 1e-4])
def test_a_way_that_passes_close_by_a_fold_goes_on(slope: float) -> None:
    """The PPR arm with g = q3^3 + slope q3 + x: q3 goes through 0 quickly, but it does."""
    strategy = hk.holonomic(
        hk.position(hk.load("ppr")), hk.custom(lambda q: q[2] ** 3 + slope * q[2] + q[0] + ca.cos(q[2]))
    )
    start = np.array([0.3, 0.2, 0.3])
    tool = strategy.task.robot.pose(start)[:3, 3]
    q = hk.ik(strategy, start)(tool + [2 * (0.3**3 + slope * 0.3), 0, 0])
    assert q[2] == pytest.approx(-0.3, abs=1e-12)
