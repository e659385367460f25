"""`radial` as a loop, in C and on the virtual machine: the same numbers as written out and differentiated by CasADi."""

from __future__ import annotations

import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from chains import chain
from conftest import IIWA_START, IRB_START, PANDA_START, PPR_START, SOUND, campaign, sampled
from exported import LEAF, ON_ANYTHING, SANITIZE, STRICT, program
from holokin.app.job import open_job, run_job
from holokin.base.errors import JobError, SingularityError
from holokin.base.types import Array
from holokin.export.c.c_folder import check
from holokin.motion import control_step
from holokin.motion.ik.branch import extended_jacobian, rays_from
from holokin.motion.ik.leaf import leaf_step
from holokin.strategies import constraints, pfaffian
from holokin.symbolic.native import emit, kernel
from holokin.symbolic.native import toolchain as native
from holokin.symbolic.native.kernel import BatchKernel

compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")

Law = tuple[hk.Strategy, np.ndarray, int]
"""The given strategy, the start posture, the steps."""


def weight(q: ca.SX) -> list[list]:
    return [[1.5 + 0.3 * ca.sin(q[i]) if i == j else 0.1 for j in range(7)] for i in range(7)]


LAWS: dict[str, Callable[[], Law]] = {
    "the pseudo-inverse": lambda: (hk.moore_penrose(hk.pose(hk.load("panda"))), PANDA_START, 4),
    "a constant weight": lambda: (hk.weighted(hk.pose(hk.load("iiwa14")), 0.2 + np.eye(7)), IIWA_START, 2),
    "a weight of the posture": lambda: (hk.weighted(hk.pose(hk.load("panda"), "rpy"), weight), PANDA_START, 1),
    "the arm angle": lambda: (hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle()), PANDA_START, 3),
    "rows": lambda: (
        pfaffian(hk.pose(hk.load("panda")), lambda q: [[1, ca.sin(q[2]), 0, 0.3 * q[0], 1, 0, 0]]), PANDA_START, 2,
    ),
    "stationary": lambda: (
        hk.holonomic(hk.pose(hk.load("panda")), hk.stationary(constraints.centring_cost())), PANDA_START, 1,
    ),
    "four redundant joints": lambda: (hk.moore_penrose(hk.position(hk.load("panda"))), PANDA_START, 2),
    "rotation vectors": lambda: (
        hk.moore_penrose(hk.pose(hk.load("panda"), "rotation-vector", reference=np.eye(3))), PANDA_START, 1,
    ),
    "a plane": lambda: (hk.moore_penrose(hk.position(hk.load("ppr"))), PPR_START, 16),
    "ten joints": lambda: (hk.moore_penrose(hk.position(chain(10))), np.full(10, 0.2), 1),
}  # fmt: skip


def written_out(twin: hk.HolonomicStrategy) -> ca.Function:
    """q -> (G, rcond, margin, g, J_g), as one expression; J_g as CasADi differentiates g."""
    e = twin.expressions
    found, g = e.rate(ca.SX.eye(twin.task.m), written_out=True), twin.constraint_expression
    return ca.Function(
        "written_out", [e.q], [found.X, found.rcond, twin._margin_expression, g, ca.densify(ca.jacobian(g, e.q))]
    )


def apart(twin: hk.HolonomicStrategy, q: np.ndarray, found: tuple[Array, float, float], wanted: ca.Function) -> float:
    """How far what a loop found at q, (G, rcond, margin), with g and J_g, is from what is written out."""
    ours = [*found, twin.constraint_value(q), twin.rows(q)]
    return max(
        float(np.abs(np.ravel(a) - np.ravel(np.array(b), order="C")).max()) / max(1.0, float(np.abs(np.array(b)).max()))
        for a, b in zip(ours, wanted(q), strict=True)
    )


@sampled(2, "name", LAWS)
def test_the_loop_gives_what_is_written_out(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """G, its rcond, the margin, the label and its gradient, by the sweep back and by CasADi's derivatives."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    given, start, steps = LAWS[name]()
    twin = hk.radial(given, start, steps=steps)
    wanted = written_out(twin)
    for q in start + np.random.default_rng(3).uniform(-0.1, 0.1, (4, len(start))):
        assert apart(twin, q, twin.gain(q), wanted) < 1e-12


@pytest.fixture(scope="module")
def panda_twin() -> hk.HolonomicStrategy:
    return hk.radial(hk.moore_penrose(hk.pose(hk.load("panda"))), PANDA_START)


def test_the_loop_is_short_and_what_is_differentiated_is_written_out(panda_twin: hk.HolonomicStrategy) -> None:
    """The curvature, of the unrolled expression, is 0; a level alone takes no sweep back."""
    made = panda_twin.gain.program
    assert made.transport is not None
    assert made.instructions < 10_000 < made.operations < 45_000
    assert written_out(panda_twin).n_instructions() > 3 * made.instructions
    assert not panda_twin.constraint_value.program.sloping
    assert hk.involutivity(panda_twin, hk.around(PANDA_START, 0.05), samples=4).relative < 1e-10


def test_the_gradient_is_that_of_the_label_by_differences(panda_twin: hk.HolonomicStrategy) -> None:
    q, h = PANDA_START + 0.1, 1e-5
    slopes = [(panda_twin.g(q + h * e)[0] - panda_twin.g(q - h * e)[0]) / (2 * h) for e in np.eye(7)]
    assert panda_twin.rows(q)[0] == pytest.approx(slopes, abs=1e-8)


def by_c(twin: hk.HolonomicStrategy, Q: Array) -> list[Array]:
    """(G, rcond, margin) at many postures by native code, in vector registers."""
    f = twin.gain
    shapes = [shape if shape != (1,) else () for shape in f.output_shapes.values()]
    results = [np.empty((len(Q), *shape)) for shape in shapes]
    BatchKernel(f.program, *f._shapes)([np.ascontiguousarray(Q)], results, 1)
    return results


@pytest.mark.campaign
@compiled
@sampled(2, ("name", "most"), [("a plane", 4096), ("a plane", 0), ("four redundant joints", 0), ("ten joints", 4096)])
def test_c_gives_what_is_written_out_also_where_it_keeps_little(
    name: str, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emit, "MOST_KEPT", most)
    given, start, steps = LAWS[name]()
    twin = hk.radial(given, start, steps=steps)
    assert f"HK_TRANSPORT_MOST {most}\n" in twin.gain.c("body")
    wanted = written_out(twin)
    Q = start + np.random.default_rng(4).uniform(-0.1, 0.1, (5, len(start)))
    for q, *found in zip(Q, *by_c(twin, Q), strict=True):
        assert apart(twin, q, tuple(found), wanted) < 1e-12


@compiled
def test_a_control_step_in_c_is_the_step_of_the_virtual_machine(
    panda_twin: hk.HolonomicStrategy, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = hk.controller(panda_twin, dt=1e-3, q0=PANDA_START)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    machine = hk.controller(panda_twin, dt=1e-3, q0=PANDA_START)
    assert "native" in step.engine and "native" not in machine.engine
    pose, twist = panda_twin.task.robot.pose(PANDA_START + 0.01), np.full(6, 0.05)
    for q in PANDA_START + np.random.default_rng(5).uniform(-0.03, 0.03, (4, 7)):  # the tool is within 0.1 m
        assert step.step(q, pose, twist) == pytest.approx(machine.step(q, pose, twist), abs=1e-12)


@pytest.mark.campaign
@compiled
def test_follow_in_c_takes_the_steps_of_the_virtual_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    given, start, _ = LAWS["a plane"]()
    twin = hk.radial(given, start)
    point = given.task.robot.pose(start)[:3, 3]
    loop = hk.circle(point, point - [0.2, 0, 0])
    assert leaf_step(twin).program.transport is extended_jacobian(twin).program.transport
    fast = hk.follow(twin, loop, start, samples=6000)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    slow = hk.follow(twin, loop, start, samples=6000)
    assert np.abs(fast.q - slow.q).max() < 1e-12
    assert np.abs(fast.q[-1] - start).max() < 1e-12


@pytest.mark.campaign
@pytest.mark.parametrize("native_code", [pytest.param("1", marks=compiled), "0"])
def test_its_inverse_is_where_following_the_ray_ends(
    native_code: str, panda_twin: hk.HolonomicStrategy, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`follow` looks for folds on its way; `inverse` leaps along rays from the center: each pose has one posture."""
    monkeypatch.setenv("HOLOKIN_NATIVE", native_code)
    twin = hk.radial(hk.moore_penrose(panda_twin.task), PANDA_START)
    point, turned = twin.task.robot.pose(PANDA_START)[:3, 3], twin.task.robot.pose(PANDA_START)
    ik = hk.ik(twin, PANDA_START)
    assert rays_from(twin) is not None
    q = PANDA_START
    for end in point + np.array([[0.05, 0.1, -0.2], [-0.15, -0.3, 0.1], [-0.1, 0.2, 0.1]]):
        turned[:3, 3] = end
        wanted = hk.follow(twin, hk.line(point, end), PANDA_START, samples=5, limits=False).q[-1]
        assert np.abs(ik(turned) - wanted).max() < 1e-11
        near = wanted + 0.02 * np.cos(np.arange(7))
        assert np.abs(ik.near(turned, near) - wanted).max() < 1e-11
        q = ik.near(turned, q)
        assert np.abs(q - wanted).max() < 1e-11


def gone(task: hk.Task, start: np.ndarray, v: Array, steps: int = 60) -> Array:
    """Where dq/dt = J^+ v leads from a posture in t = 1 (k, n), v (k, m): Runge-Kutta, which no turn escapes."""
    q, h = np.repeat(start[None], len(v), axis=0), 1 / steps

    def rate(q: Array) -> Array:
        J = task.jacobian_batch(q)[0]
        return np.einsum("kji,kj->ki", J, np.linalg.solve(J @ J.swapaxes(1, 2), v[..., None])[..., 0])

    for _ in range(steps):
        a = rate(q)
        b = rate(q + h / 2 * a)
        c = rate(q + h / 2 * b)
        q = q + h / 6 * (a + 2 * (b + c) + rate(q + h * c))
    return q


@compiled
@pytest.mark.parametrize(("arm", "count"), [campaign(("arm", "count"), ("panda", 120)), ("planar-3r", 200)])
def test_its_inverse_is_where_the_given_law_leads_along_hundreds_of_rays(arm: str, count: int) -> None:
    """In the same turns of all joints, and as near as 16 steps are to the given law, integrated in 60."""
    robot, rng = hk.load(arm), np.random.default_rng(1)
    task = hk.position(robot) if robot.planar else hk.pose(robot)
    start = np.array([0.3, 1.5, 1.0]) if robot.planar else PANDA_START
    ik = hk.ik(hk.radial(hk.moore_penrose(task), start, steps=16), start)
    v = rng.uniform(-1.5, 1.5, (count, 2)) if robot.planar else rng.uniform(-0.5, 0.5, (count, 6)) * [1, 1, 1, 3, 3, 3]
    poses = np.tile(robot.pose(start), (count, 1, 1))
    poses[:, : min(3, v.shape[1]), 3] += v[:, :3]
    if not robot.planar:
        poses[:, :3, :3] = Rotation.from_rotvec(v[:, 3:]).as_matrix() @ poses[:, :3, :3]
    found = ik.batch(poses)
    off = np.abs(gone(task, start, v) - found.q)[found.reached].max(axis=1)
    assert found.reached.sum() > count / 2
    assert np.abs(found.q - start)[found.reached].max() > 1.3
    assert off.max() < 0.05
    assert np.median(off) < 1e-4


@pytest.mark.campaign
@compiled
def test_a_full_turn_from_which_newton_begins_is_not_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Postures a turn of a joint apart have one pose and one level: what is a turn off is refused, and looked for in
    shorter pieces."""
    start, first = np.array([0.3, 0.9, 0.7]), "rate[i] = y[HK_TRANSPORT_S % 2][i] - q[i];"
    task = hk.position(hk.load("planar-3r"))
    right = hk.ik(hk.radial(hk.moore_penrose(task), start), start)([1.0, 1.2])
    written = kernel.prelude
    assert first in written("ray.c")
    monkeypatch.setattr(
        kernel, "prelude", lambda name: written(name).replace(first, f"{first} rate[0] += 6.283185307179586;")
    )
    ik = hk.ik(hk.radial(hk.moore_penrose(task), start), start)
    assert ik([1.0, 1.2]) == pytest.approx(right, abs=1e-12)


def test_rays_are_those_of_laws_whose_label_is_arc_length_in_coordinates_of_straight_ways() -> None:
    for name, rays in (("the pseudo-inverse", True), ("a plane", True), ("four redundant joints", False)):
        given, start, _ = LAWS[name]()
        assert (rays_from(hk.radial(given, start, steps=1)) is not None) is rays
    tilt = hk.radial(hk.moore_penrose(hk.pose(hk.load("irb140"), "rpy", rows=[0, 1, 2, 3, 4])), IRB_START, steps=1)
    assert tilt.constraint.angular == (True,)
    assert rays_from(tilt) is None
    assert rays_from(hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle())) is None


@pytest.mark.campaign
@compiled
@pytest.mark.parametrize("name", ["a plane", "four redundant joints"])
def test_exported_c_equals_python_in_both_precisions(name: str, tmp_path: Path) -> None:
    given, start, _ = LAWS[name]()
    made = hk.export.export_c(hk.radial(given, start, steps=2), tmp_path, q0=start, name="law", vectors_count=8)
    code = (tmp_path / "law.c").read_text()
    assert code.count("static void hk_transport(") == 1
    double, single = check(made)
    assert "8 test cases" in double
    assert "passed" in single


@pytest.mark.campaign
@compiled
@pytest.mark.parametrize("flags", [(), ("-DLAW_FLOAT",)])
def test_sanitizers_find_nothing_in_a_loop_whatever_comes(flags: tuple[str, ...], tmp_path: Path) -> None:
    given, start, _ = LAWS["a plane"]()
    made = hk.export.export_c(hk.radial(given, start, steps=1), tmp_path, q0=start, name="law", vectors_count=2)
    run = subprocess.run(
        [str(program(made, ON_ANYTHING, tmp_path, *STRICT, *SANITIZE, *flags, "-DCALLS=400", leaf=LEAF))],
        capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr


def test_a_segment_that_passes_a_singular_posture_is_refused_by_the_loop_too() -> None:
    """An arm of three links, straightened: the given law has no rate there."""
    given = hk.moore_penrose(hk.position(hk.load("planar-3r")))
    twin = hk.radial(given, [0.3, 0.9, 0.7])
    straight = np.array([0.3, 0.0, 0.0])
    with pytest.raises(SingularityError):
        twin(straight)
    wanted = [np.array(value).item() for value in written_out(twin)(straight)[1:3]]
    assert [bool(value > 1e-6) for value in wanted] == [bool(value > 1e-6) for value in twin.gain(straight)[1:]]


def test_a_step_that_is_too_long_for_c_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    given, start, _ = LAWS["a plane"]()
    monkeypatch.setattr(control_step, "LARGEST", 100)
    step = hk.controller(hk.radial(given, start), dt=1e-3, q0=start)
    assert "virtual machine (the step takes " in step.engine
    assert "operations written out, 100 are the most for C)" in step.engine


# --- fitted, in a job ---

JOB = (
    SOUND["title"] + SOUND["robot"] + SOUND["start"]
    + '[path]\nkind = "circle"\ncenter = [-0.05, 0.0]\nrelative = true\nsamples = 20\n'
    + '[strategies.near]\nkind = "radial"\n'
    + '[strategies.fast]\nkind = "fitted"\nof = "near"\nradius = 0.12\nsamples = 80\n'
    + "[expect.fast]\nholonomic = true\ndrift = { below = 1e-12 }\nspeed = { below = 1.01 }\n"
)  # fmt: skip


@pytest.mark.campaign
def test_a_job_fits_a_polynomial_to_another_law_of_it(tmp_path: Path) -> None:
    (tmp_path / "fit.toml").write_text(JOB)
    result = run_job(*open_job(str(tmp_path / "fit.toml")))
    near, fast = result.strategies
    assert fast.passed
    assert np.abs(near.cycles.q - fast.cycles.q).max() < 1e-4


@pytest.mark.parametrize(
    ("of", "said"),
    [("nearr", "no other strategy of this job; did you mean 'near'"), ("fast", "no other strategy of this job")],
)
def test_a_fit_to_what_the_job_has_not_is_refused(of: str, said: str, tmp_path: Path) -> None:
    text = JOB.replace('of = "near"', f'of = "{of}"')
    assert tomllib.loads(text)
    (tmp_path / "fit.toml").write_text(text)
    with pytest.raises(JobError, match=said):
        open_job(str(tmp_path / "fit.toml"))


def test_a_fit_to_a_law_without_leaves_is_refused(tmp_path: Path) -> None:
    (tmp_path / "fit.toml").write_text(JOB.replace('kind = "radial"', 'kind = "moore-penrose"'))
    with pytest.raises(JobError, match="it has no leaves"):
        run_job(*open_job(str(tmp_path / "fit.toml")))
