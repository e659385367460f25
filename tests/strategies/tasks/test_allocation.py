"""Tasks x = f(u) of coordinates without a robot: the thrusters of a ship; and tasks of more than three rows."""

from __future__ import annotations

import shutil
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IIWA_START
from holokin.app.job import open_job, run_job
from holokin.app.report.job_figures import figures
from holokin.robot import Capsule, Robot, servo, to_mjcf, to_urdf, with_capsules, with_shape

K = np.array([3.0, 3.0, 4.2, 6.55])
AT_X, AT_Y = np.array([37.0, 35.0, -41.5, -41.5]), np.array([0.0, 0.0, 7.0, -7.0])
"""Largest thrusts [100 kN] and places [m] of two bow and two stern thrusters, osv.m of the MSS toolbox [Fos21]."""
U0 = np.array([0.3, 0.3, 0.4, 0.4, 0.5, 0.5])
Q0 = IIWA_START + [0, 0, 0.2, 0, 0.3, 0, 0.1]


@pytest.fixture(scope="module")
def ship() -> Robot:
    return hk.robot.coordinates(
        ("bow1", "bow2", "stern1", "stern2", "a1", "a2"), lower=[-1, -1, -1, -1, -1.5, -1.5], upper=1.5,
        max_velocity=0.2, units=["1", "1", "1", "1", "rad", "rad"], name="ship",
    )  # fmt: skip


@pytest.fixture(scope="module")
def force(ship: Robot) -> hk.Task:
    """Surge, sway, yaw / 41.5 m."""

    def tau(u: ca.SX) -> ca.SX:
        T = [u[i] * K[i] for i in range(4)]
        x = [0, 0, T[2] * ca.cos(u[4]), T[3] * ca.cos(u[5])]
        y = [T[0], T[1], T[2] * ca.sin(u[4]), T[3] * ca.sin(u[5])]
        yaw = sum(AT_X[i] * y[i] - AT_Y[i] * x[i] for i in range(4))
        return ca.vertcat(sum(x), sum(y), yaw / 41.5)

    return hk.custom_task(ship, tau, units=("100 kN",) * 3, names=("surge", "sway", "yaw"), name="force")


@pytest.fixture(scope="module")
def pairs(force: hk.Task) -> hk.Strategy:
    """Bow thrusters alike, stern thrusters alike, azimuths alike."""
    rows = np.kron(np.eye(3), [1.0, -1.0])
    return hk.holonomic(force, hk.linear(rows))


@pytest.fixture(scope="module")
def six() -> hk.Task:
    """Position and the z axis of an iiwa's tool, as five rows of one's own."""
    robot = hk.load("iiwa14")

    def rows(q: ca.SX) -> ca.SX:
        k = robot.kinematics(q)
        return ca.vertcat(k.position, k.rotation[0, 2], k.rotation[1, 2])

    return hk.custom_task(robot, rows, units=("m", "m", "m", "1", "1"), names=("x", "y", "z", "ax", "ay"))


def closed_form(wanted: np.ndarray) -> np.ndarray:
    """Equal pairs: surge, sway and yaw are linear in the bow's share s and the stern's t (cos a, sin a)."""
    stern = K[2] + K[3]
    A = np.array([
        [0.0, stern, 0.0],
        [K[0] + K[1], 0.0, stern],
        [(AT_X[:2] @ K[:2]) / 41.5, -(AT_Y[2:] @ K[2:]) / 41.5, (AT_X[2:] @ K[2:]) / 41.5],
    ])  # fmt: skip
    s, along, aside = np.linalg.solve(A, wanted)
    t, a = np.hypot(along, aside), np.arctan2(aside, along)
    return np.array([s, s, t, t, a, a])


def test_thrusts_that_follow_a_force_round_a_loop_return_on_a_leaf_alone(force: hk.Task, pairs: hk.Strategy) -> None:
    at = force(U0)
    loop = hk.circle(at, at - [0, 1.0, 0], [1, 0, -1], speed=0.2)
    assert hk.drift(hk.moore_penrose(force), loop, U0).largest[0] > 0.03
    assert hk.drift(pairs, loop, U0, cycles=2).largest.max() < 1e-12
    assert not hk.involutivity(hk.moore_penrose(force), hk.around(U0, 0.1)).holonomic
    assert hk.involutivity(pairs, hk.around(U0, 0.1)).holonomic


def test_the_inverse_of_an_allocation_is_its_closed_form(force: hk.Task, pairs: hk.Strategy) -> None:
    ik, rng = hk.ik(pairs, U0), np.random.default_rng(0)
    wanted = force(U0) + rng.uniform(-0.5, 0.5, (20, 3))
    for x, u in zip(wanted, ik.batch(wanted).q, strict=True):
        assert np.abs(u - closed_form(x)).max() < 1e-9
        assert np.abs(force(u) - x).max() < 1e-9


def test_the_jacobian_of_an_allocation_is_its_slope(force: hk.Task) -> None:
    rng, h = np.random.default_rng(1), 1e-6
    for u in U0 + rng.uniform(-0.2, 0.2, (5, 6)):
        dq = rng.uniform(-1, 1, 6)
        assert np.abs((force(u + h * dq) - force(u - h * dq)) / (2 * h) - force.jacobian(u) @ dq).max() < 1e-7
    assert force.units == ("100 kN",) * 3


def test_a_controller_of_thrusters_keeps_their_rates(force: hk.Task, pairs: hk.Strategy) -> None:
    c = hk.controller(pairs, dt=0.1, q0=U0)
    x = force(U0)
    du = c.step(U0, x + [0.1, 0, 0], np.array([1.0, 0, 0]))
    assert c.scale == 1.0
    assert np.abs(force.jacobian(U0) @ du - [1.0, 0, 0]).max() < 1e-9
    c.step(U0, x, np.array([9.0, 0, 0]))
    assert c.status.name == "SLOWED"
    walk = hk.simulate(c, force, hk.line(x, x + [0.3, 0.2, 0.1], speed=0.05), U0, dt=0.1)
    assert np.abs(walk.q[-1] - closed_form(x + [0.3, 0.2, 0.1])).max() < 1e-3
    assert walk.tracking_error("100 kN") > 0


def test_coordinates_have_no_pose_and_say_so(ship: Robot, force: hk.Task) -> None:
    for asked in (
        lambda: ship.pose(U0), lambda: ship.jacobian(U0), lambda: hk.pose(ship), lambda: hk.position(ship),
        lambda: to_urdf(ship), lambda: to_mjcf(ship), lambda: servo(ship, "position", U0), lambda: with_capsules(ship),
        lambda: with_shape(ship, "ball", Capsule(0.1)), lambda: hk.check(U0[None], hk.Scene(floor=0.0), robot=ship),
    ):  # fmt: skip
        with pytest.raises(hk.HolokinError, match=r"no links: give their task by hk\.custom_task"):
            asked()
    assert ship.skeleton(U0) == []
    assert repr(ship) == "Robot('ship', n=6)"
    with pytest.raises(hk.HolokinError, match="lower of the coordinates"):
        hk.robot.coordinates(("a", "b"), lower=[0.0])
    with pytest.raises(hk.HolokinError, match="at least one"):
        hk.robot.coordinates(())
    with pytest.raises(hk.HolokinError, match="units of the coordinates"):
        hk.robot.coordinates(("a", "b"), units=["N"])
    with pytest.raises(hk.HolokinError, match="two joints"):
        hk.robot.coordinates(("a", "a"))
    with pytest.raises(hk.HolokinError, match="limits"):
        hk.follow(hk.moore_penrose(force), hk.line(force(U0), [0, 0, 0]), U0 + 2)


def test_a_check_of_thrusts_looks_at_their_limits_and_says_that_it_knows_no_distances(ship: Robot) -> None:
    report = hk.check(np.array([U0, U0 + [9.0, 0, 0, 0, 0, 0]]), robot=ship)
    assert [finding.kind for finding in report.findings] == [hk.motion.checks.FindingKind.POSITION]
    assert "distances were not looked at" in report.table()


def test_a_task_of_five_rows_of_ones_own_is_that_of_its_formulas(six: hk.Task) -> None:
    robot, rng, h = hk.load("iiwa14"), np.random.default_rng(2), 1e-6
    assert (six.m, six._point, six.row_names) == (5, 5, ("x", "y", "z", "ax", "ay"))
    for q in Q0 + rng.uniform(-0.2, 0.2, (5, 7)):
        T, dq = robot.pose(q), rng.uniform(-1, 1, 7)
        assert np.abs(six(q) - [*T[:3, 3], *T[:2, 2]]).max() < 1e-12
        assert np.abs((six(q + h * dq) - six(q - h * dq)) / (2 * h) - six.jacobian(q) @ dq).max() < 1e-7
    assert np.abs(six[[4, 0]](Q0) - six(Q0)[[4, 0]]).max() == 0.0


def test_paths_lead_through_points_of_five_coordinates(six: hk.Task, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    law, x = hk.holonomic(six, hk.lock(0, 6)), six(Q0)
    points = np.array([x, x + [0.05, 0, 0, 0, 0.02], x + [0.05, 0.05, 0.02, 0.03, 0]])
    loop = hk.path.through(points, closed=True, seconds=[1.0, 2.0, 1.5])
    assert loop.duration == 4.5
    assert np.abs(loop.at(2.0).position[0, :5] - points[1:].mean(axis=0)).max() < 1e-12
    walk = hk.follow(law, loop, Q0, samples=60)
    assert np.abs(walk.drift()).max() < 1e-12
    assert np.abs(six.value_batch(walk.q)[walk.t == 1.0] - points[1]).max() < 1e-9
    assert hk.drift(hk.moore_penrose(six), loop, Q0, samples=100).largest[0] > 1e-5
    ik = hk.ik(law, Q0)
    assert np.abs(six(ik(points[2])) - points[2]).max() < 1e-9
    assert hk.path.through(points, speed=0.1).duration == pytest.approx(
        np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / 0.1
    )
    for bad, fault in (([points[0]], "at least two"), (points[[0, 0]], "points that differ")):
        with pytest.raises(hk.HolokinError, match=fault):
            hk.path.through(bad)
    with pytest.raises(hk.HolokinError, match=r"\(5,\)"):
        ik(points[2][:4])
    c = hk.controller(law, dt=0.01, q0=Q0)
    assert np.abs(six.jacobian(Q0) @ c.step(Q0, x, np.array([0.1, 0, 0, 0, 0])) - [0.09, 0, 0, 0, 0]).max() < 1e-9


@pytest.mark.campaign
def test_seven_joints_hold_a_pose_written_as_six_rows_of_ones_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of one's own that are a pose give the joints of the pose task itself."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # two calls take less time than a compiler
    robot = hk.load("iiwa14")
    reference = robot.pose(Q0)[:3, :3]

    def rows(q: ca.SX) -> ca.SX:
        k = robot.kinematics(q)
        M = ca.SX(reference).T @ k.rotation
        return ca.vertcat(k.position, M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1])

    own = hk.custom_task(robot, rows, units=("m", "m", "m", "rad", "rad", "rad"))
    pose, target = hk.pose(robot), robot.pose(Q0)
    target[:3, 3] += [0.05, -0.05, 0.05]
    target[:3, :3] = target[:3, :3] @ Rotation.from_rotvec([0.1, 0.0, -0.2]).as_matrix()
    M = reference.T @ target[:3, :3]
    x = np.array([*target[:3, 3], M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
    a, b = (hk.ik(hk.holonomic(task, hk.lock(2)), Q0) for task in (own, pose))
    assert np.abs(a(x) - b(target)).max() < 1e-9


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
def test_exported_c_of_an_allocation_and_of_five_rows_does_what_python_does(
    pairs: hk.Strategy, six: hk.Task, tmp_path: Path
) -> None:
    for name, law, start in (("ship", pairs, U0), ("five", hk.moore_penrose(six), Q0)):
        written = hk.export.export_c(law, tmp_path / name, q0=start, name=name, vectors_count=4)
        assert all(line.endswith("passed") for line in hk.export.check(written))
    assert "a point of the task's coordinates, 5 numbers" in (tmp_path / "five" / "five.hpp").read_text("utf-8")


def test_a_job_allocates_without_a_robot(tmp_path: Path) -> None:
    file = tmp_path / "ship.toml"
    file.write_text(
        """title = "Thrusters"
[robot]
name = "ship"
[robot.coordinates]
names = ["bow", "stern", "azimuth"]
lower = [-1, -1, -1.5]
upper = 1.5
units = ["1", "1", "rad"]
[task]
kind = "custom"
expressions = ["10.75*stern*cos(azimuth)", "6*bow + 10.75*stern*sin(azimuth)"]
units = ["100 kN", "100 kN"]
[start]
q = [0.3, 0.4, 0.5]
[path]
kind = "circle"
center = [0, 1.0, 0]
relative = true
speed = 0.2
samples = 40
[strategies.moore-penrose]
kind = "moore-penrose"
[strategies.alike]
kind = "custom"
g = ["bow - stern"]
[expect.moore-penrose]
holonomic = false
drift = { above = 0.01 }
[expect.alike]
drift = { below = 1e-12 }
tracking = { below = 1e-9 }
""",
        "utf-8",
    )
    result = run_job(*open_job(str(file)))
    assert result.passed
    assert result.strategies[0].metrics["tracking"] > 0  # in units of the task's own
    assert "robot" not in [stem for stem, _, _ in figures(result)]
    file.write_text(file.read_text("utf-8").replace("[robot]\n", '[robot]\ntip = "a"\n'), "utf-8")
    with pytest.raises(hk.HolokinError, match="tip stands beside coordinates"):
        run_job(*open_job(str(file)))
