"""Following: what is kept when it fails, limits, leaves that fold, and files."""

from __future__ import annotations

import csv

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, PPR_START
from holokin.base.errors import (
    ArgumentError,
    BranchError,
    JointLimitError,
    LimitReachedError,
    NotFiniteError,
    OpenPathError,
    OutOfReachError,
    PathError,
    PathSingularityError,
    ShapeError,
    SingularityError,
    SingularityKind,
    StartError,
    TrackingError,
)

R3_START = np.array([0.3, 0.9, 0.7])


def r3(constraint: hk.Constraint | None = None) -> hk.Strategy:
    task = hk.position(hk.load("planar-3r"))
    return hk.moore_penrose(task) if constraint is None else hk.holonomic(task, constraint)


def tool(strategy: hk.Strategy, q: np.ndarray) -> np.ndarray:
    return strategy.task.robot.pose(q)[:3, 3]


@pytest.mark.parametrize("constraint", [None, hk.linear([0, 1.0, -1.0])], ids=["velocity", "leaf"])
def test_a_path_out_of_reach_keeps_what_was_computed(constraint: hk.Constraint | None) -> None:
    strategy = r3(constraint)
    start = tool(strategy, R3_START)
    away = hk.line(start, start / np.linalg.norm(start) * 3.5)
    with pytest.raises(OutOfReachError, match="out of reach") as caught:
        hk.follow(strategy, away, R3_START, samples=200, limits=False)
    walk = caught.value.trajectory
    assert walk.status is hk.motion.Status.OUT_OF_REACH
    assert 20 < len(walk) < 200
    assert walk.tracking_error() < 1e-3
    assert np.linalg.norm(tool(strategy, walk.q[-1])) < 3.0 + 1e-9
    assert np.linalg.norm(tool(strategy, walk.q[-1])) > 2.9


def test_a_joint_that_meets_its_limit_stops_the_walk_and_is_named() -> None:
    robot = hk.load("planar-3r")
    tight = hk.from_dh(
        [{"a": 1.0, "joint": c.name, "lower": -1.0, "upper": 1.0} for c in robot.coordinates], name="tight"
    )
    strategy = hk.moore_penrose(hk.position(tight))
    start = tool(strategy, R3_START)
    with pytest.raises(LimitReachedError, match=r"q2.*outside its limits") as caught:
        hk.follow(strategy, hk.line(start, start * 0.4), R3_START)
    walk = caught.value.trajectory
    assert walk.status is hk.motion.Status.LIMIT
    assert (walk.q <= tight.upper + 1e-9).all()
    free = hk.follow(strategy, hk.line(start, start * 0.4), R3_START, limits=False)
    assert free.status is hk.motion.Status.COMPLETE
    assert free.q[:, 1].max() > 1.0


def test_the_pseudo_inverse_drives_a_panda_into_a_limit_in_the_end(panda: hk.Robot) -> None:
    """What users report: arms that stop after some loops."""
    start = panda.pose(PANDA_START)[:3, 3]
    with pytest.raises(LimitReachedError) as caught:
        hk.drift(
            hk.moore_penrose(hk.pose(panda)), hk.circle(start, start - [0.1, 0, 0]), PANDA_START, cycles=60, samples=60
        )
    assert 3 < caught.value.trajectory.cycles < 60


def test_a_leaf_that_folds_is_an_error_of_its_own_and_never_a_jump() -> None:
    """g = q1 on the planar arm: beyond the reach of the two last links, inside the workspace."""
    strategy = r3(hk.lock("q1"))
    start, end = tool(strategy, R3_START), np.array([2.75 * np.cos(2.2), 2.75 * np.sin(2.2), 0.0])
    with pytest.raises(BranchError) as caught:
        hk.follow(strategy, hk.line(start, end), R3_START, samples=150)
    walk = caught.value.trajectory
    assert walk.status is hk.motion.Status.BRANCH
    targets = start + np.linspace(0, 1, 151)[:, None] * (end - start)
    elbow = np.array([np.cos(R3_START[0]), np.sin(R3_START[0]), 0.0])
    within = np.linalg.norm(targets - elbow, axis=1) < 2.0  # the two free links are 2 m long
    assert len(walk) == np.argmin(within)  # every sample within their reach, and none beyond
    assert np.abs(np.diff(walk.q, axis=0)).max() < 0.35
    assert np.abs(walk.q[:, 0] - R3_START[0]).max() < 1e-12
    assert (np.sign(walk.q[:, 2]) == 1).all()  # the elbow never flips


def test_leaf_following_with_few_samples_finds_the_same_joints_as_with_many() -> None:
    """Steps are halved until a bound shows that Newton stays on the branch."""
    strategy = r3(hk.linear([0, 1.0, -1.0]))
    start = tool(strategy, R3_START)
    path = hk.polyline([start, [-0.5, 1.2, 0], [-1.0, -1.0, 0], [0.8, -0.9, 0]])
    few = hk.follow(strategy, path, R3_START, samples=3, limits=False)
    many = hk.follow(strategy, path, R3_START, samples=2000, limits=False)
    assert len(few) < 8
    assert np.abs(few.q[-1] - many.q[-1]).max() < 1e-12


def test_one_long_step_never_lands_on_another_branch() -> None:
    """q1 held: two elbows reach each point. A line done in one sample ends as it does in 100, if it can be done."""
    strategy = r3(hk.lock("q1"))
    start = tool(strategy, R3_START)
    rng = np.random.default_rng(1)
    done = 0
    for end in start + np.column_stack([rng.uniform(-2, 2, (12, 2)), np.zeros(12)]):
        line = hk.line(start, end)
        try:
            many = hk.follow(strategy, line, R3_START, samples=100, limits=False)
        except PathError:
            with pytest.raises(PathError):
                hk.follow(strategy, line, R3_START, samples=1, limits=False)
            continue
        few = hk.follow(strategy, line, R3_START, samples=1, limits=False)
        assert np.abs(few.q[-1] - many.q[-1]).max() < 1e-10
        done += 1
    assert 3 < done < 12


def test_same_pose_same_joints_whatever_the_speed_samples_and_way() -> None:
    strategy = r3(hk.linear([0, 1.0, -1.0]))
    start = tool(strategy, R3_START)
    end = np.array([0.4, 1.6, 0.0])
    ends = [
        hk.follow(strategy, path, R3_START, samples=samples).q[-1]
        for path in (hk.line(start, end), hk.line(start, end, speed=3.0), hk.polyline([start, [1.5, 0.2, 0], end]))
        for samples in (17, 300)
    ]
    assert np.ptp(ends, axis=0).max() < 1e-14


def test_velocity_that_runs_into_a_singularity_keeps_what_was_computed_and_says_so() -> None:
    """q3 held by its frame: the arm stretches at q2 = -q3/2, inside the workspace."""
    task = hk.position(hk.load("planar-3r"))
    strategy = hk.null_basis(task, lambda q: ca.vertcat(ca.horzcat(1, 0), ca.horzcat(0, 1), ca.horzcat(0, 0)))
    start = np.array([0.3, 0.4, 1.2])
    out = tool(strategy, start)
    with pytest.raises((PathSingularityError, TrackingError), match="singular") as caught:
        hk.follow(strategy, hk.line(out, 1.2 * out), start, samples=300, limits=False)
    walk = caught.value.trajectory
    assert walk.status in (hk.motion.Status.SINGULAR, hk.motion.Status.LOST)
    assert walk.q[-1, 1] == pytest.approx(-walk.q[-1, 2] / 2, abs=0.2)
    assert walk.tracking_error() < 1e-3


def test_singularities_are_told_apart() -> None:
    task = hk.position(hk.load("planar-3r"))
    with pytest.raises(SingularityError) as caught:
        hk.moore_penrose(task)(np.zeros(3))
    assert caught.value.kind is SingularityKind.KINEMATIC
    with pytest.raises(SingularityError) as caught:
        hk.moore_penrose(task).batch(np.array([R3_START, np.zeros(3)]))
    assert caught.value.kind is SingularityKind.KINEMATIC
    locked = hk.holonomic(task, hk.lock("q1"))
    with pytest.raises(SingularityError) as caught:
        locked([0.4, 0.9, 0.0])
    assert caught.value.kind is SingularityKind.ALGORITHMIC
    with pytest.raises(SingularityError) as caught:
        hk.curvature(locked, [0.4, 0.9, 0.0])
    assert caught.value.kind is SingularityKind.ALGORITHMIC
    iiwa = hk.load("iiwa14")
    with pytest.raises(SingularityError) as caught:
        hk.moore_penrose(hk.pose(iiwa, "zyz"))([0, 0.5, 0, 0, 0, -0.5, 0.3])
    assert caught.value.kind is SingularityKind.REPRESENTATION


def test_a_region_of_singular_postures_only_cannot_be_judged(planar_3r: hk.Robot) -> None:
    with pytest.raises(hk.base.errors.EmptyRegionError):
        hk.involutivity(hk.moore_penrose(hk.position(planar_3r)), hk.around(np.zeros(3), 0.0))


def test_singular_postures_of_a_region_are_counted_and_left_out(planar_3r: hk.Robot) -> None:
    verdict = hk.involutivity(hk.moore_penrose(hk.position(planar_3r)), hk.around(np.zeros(3), 0.5))
    assert verdict.singular == 1  # the centre
    assert verdict.samples == 63


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda s, p: hk.follow(s, p, PPR_START + np.array([0.1, 0, 0])), StartError),
        (lambda s, p: hk.follow(s, p, [9.0, 0, 0]), JointLimitError),
        (lambda s, p: hk.follow(s, p, [np.nan, 0, 0]), NotFiniteError),
        (lambda s, p: hk.follow(s, p, [0, 0]), ShapeError),
        (lambda s, p: hk.follow(s, p, PPR_START, samples=0), ArgumentError),
        (lambda s, p: hk.follow(s, p, PPR_START, cycles=0), ArgumentError),
        (lambda s, p: hk.follow(s, p, PPR_START, method="euler"), ArgumentError),
        (lambda s, p: hk.follow(s, p, PPR_START, method="leaf"), ArgumentError),
        (lambda s, p: hk.follow(s, p.part(0, 0.5), PPR_START, cycles=2), OpenPathError),
        (lambda s, p: hk.drift(s, p.part(0, 0.5), PPR_START), OpenPathError),
        (lambda s, p: hk.motion.path_spread(s, p.part(0, 0.5), p.part(0, 0.4), PPR_START), ArgumentError),
    ],
)
def test_calls_that_make_no_sense_are_refused(ppr: hk.Robot, call, error: type[Exception]) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    with pytest.raises(error):
        call(strategy, hk.circle([1.6094, 0.4036], PPR_CENTER))


def test_a_trajectory_is_saved_to_the_last_digit(ppr: hk.Robot, tmp_path) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    walk = hk.follow(strategy, hk.circle([1.6094, 0.4036], PPR_CENTER), PPR_START, samples=50, cycles=2)
    walk.save(tmp_path / "walk.csv")
    with (tmp_path / "walk.csv").open() as stream:
        header, *rows = list(csv.reader(stream))
    assert header == ["t", "q1", "q2", "q3", "d_q1", "d_q2", "d_q3", "x_x", "x_y"]
    table = np.array(rows, dtype=float)
    assert np.array_equal(table[:, 0], walk.t)
    assert np.array_equal(table[:, 1:4], walk.q)
    assert np.array_equal(table[:, 4:7], walk.dq)
    assert [p.name for p in tmp_path.iterdir()] == ["walk.csv"]
    assert (np.diff(walk.t) > 0).all()
    assert walk.t[-1] == pytest.approx(2 * 2 * np.pi * 0.4024 / 0.1)


def test_joint_rates_of_a_trajectory_are_the_derivatives_of_the_joints(panda: hk.Robot) -> None:
    start = panda.pose(PANDA_START)[:3, 3]
    walk = hk.follow(hk.moore_penrose(hk.pose(panda)), hk.circle(start, start - [0.1, 0, 0]), PANDA_START, samples=2000)
    middle = (walk.q[2:] - walk.q[:-2]) / (walk.t[2:] - walk.t[:-2])[:, None]
    assert np.abs(walk.dq[1:-1] - middle).max() < 1e-5
    assert walk.drift().shape == (1, 7)
    assert walk.drift_since_start()[0] == pytest.approx(walk.q[-1] - walk.q[0])


@pytest.mark.campaign
def test_a_turning_path_turns_the_tool(panda: hk.Robot) -> None:
    """The tool ends turned by the path's turn, about base axes."""
    start = panda.pose(PANDA_START)
    turn = np.array([0.1, -0.2, 0.3])
    for orientation in ("twist", "rpy", "rotation-vector"):
        task = hk.pose(panda, orientation, reference=start[:3, :3])
        strategy = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))
        walk = hk.follow(
            strategy, hk.line(start[:3, 3], start[:3, 3] + [0, 0.05, 0], turn=turn), PANDA_START, samples=50
        )
        end = panda.pose(walk.q[-1])
        from scipy.spatial.transform import Rotation

        assert np.abs(end[:3, :3] - Rotation.from_rotvec(turn).as_matrix() @ start[:3, :3]).max() < 1e-12
        assert walk.tracking_error("rad") < 1e-12
