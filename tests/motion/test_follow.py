"""Following: what is kept when it fails, limits, leaves that fold, and files."""

from __future__ import annotations

import csv
import io
import json
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, PPR_START, assert_refused, assert_untouched, sampled, write_job
from holokin.app.job import open_job, run_job
from holokin.app.report.job_report import print_result, rows, write_report
from holokin.app.report.job_result import JobResult
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
from holokin.motion.trajectory import Status

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
    with pytest.raises(OutOfReachError) as caught:
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
    with pytest.raises(hk.base.errors.UndecidedError):
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


# --- New kinds of paths at work: followed natively and not, home again, entered from anywhere, timed, out of reach.


Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])


@cache
def loops(robot: hk.Robot) -> dict[str, hk.Path]:
    """Closed paths of every new kind from the tool's pose at Q0."""
    T = robot.pose(Q0)
    tool, R = T[:3, 3], T[:3, :3]
    rng = np.random.default_rng(3)
    poses = np.tile(T, (5, 1, 1))
    poses[1:, :3, 3] += rng.uniform(-0.08, 0.08, (4, 3))
    poses[1:, :3, :3] = (Rotation.from_rotvec(rng.uniform(-0.3, 0.3, (4, 3))) * Rotation.from_matrix(R)).as_matrix()
    back = np.concatenate([poses, poses[:1]])

    def sway(t: float) -> np.ndarray:
        pose = T.copy()
        pose[:3, 3] += [0.05 * np.sin(t), 0.05 * (np.cos(t) - 1), 0.02 * np.sin(2 * t)]
        pose[:3, :3] = Rotation.from_rotvec([0.2 * np.sin(t), 0, 0.1 * np.sin(2 * t)]).as_matrix() @ R
        return pose

    zigzag = hk.path.raster(tool, [0.08, 0, 0], [0, 0.04, 0], 0.02, surface=lambda u, v: u * u - v * v, tool="start")
    return {
        "poses": hk.spline(poses, closed=True),
        "timed": hk.spline(back, times=[0, 1, 1.5, 3, 4, 6], closed=True),
        "function": hk.path.path_of(sway, [0, 2 * np.pi]),
        "lines": hk.polyline(poses, closed=True),
        "eight": hk.path.figure_eight(tool, 0.12, normal=[0, 0.3, 1]),
        "raster": hk.path.passes(zigzag, 2),
        "spiral": hk.path.passes(hk.path.spiral(tool, 0.05, 0.025), 2),
        "blend": hk.path.blended(hk.polyline(poses, closed=True), 0.01, keep_start=True),
        "leads": hk.path.passes(
            hk.path.blended(hk.path.with_leads(hk.line(tool, tool + [0.06, 0, 0]), 0, 0.02, retract=0.0), 0.01), 2
        ),
    }


@pytest.fixture(scope="module")
def laws(panda: hk.Robot) -> tuple[hk.Strategy, hk.Strategy]:
    task = hk.pose(panda)
    return hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0])), hk.moore_penrose(task)


NAMES = ("poses", "timed", "function", "lines", "eight", "raster", "spiral", "blend", "leads")


@sampled(3, "name", NAMES)
def test_a_holonomic_strategy_comes_home_from_any_closed_path(panda: hk.Robot, laws, name: str) -> None:
    tied, least = laws
    path = loops(panda)[name]
    assert path.closed
    assert float(hk.drift(tied, path, Q0, samples=150, cycles=2).largest[-1]) < 1e-12
    if name in ("poses", "timed", "function", "lines", "blend"):
        assert float(hk.drift(least, path, Q0, samples=150).largest[-1]) > 1e-3


@pytest.mark.campaign
@sampled(1, "name", ["timed", "raster", "blend"])
def test_native_code_and_the_virtual_machine_follow_alike(
    panda: hk.Robot, laws, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from holokin.motion import follow_path as following

    path, walks = loops(panda)[name], []
    for native in (True, False):
        if native:
            monkeypatch.setattr(following, "NATIVE_FROM", 0)
        else:
            monkeypatch.undo()
            monkeypatch.setenv("HOLOKIN_NATIVE", "0")
        task = hk.pose(panda)
        pair = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0])), hk.moore_penrose(task)
        walks.append([hk.follow(law, path, Q0, samples=100).q for law in pair])
    for a, b in zip(*walks, strict=True):
        assert np.abs(a - b).max() < 1e-12


def test_a_controller_follows_a_spline_and_a_timed_one_ends_where_it_should(panda: hk.Robot, laws) -> None:
    tied, _ = laws
    path = loops(panda)["poses"]
    walk = hk.follow(tied, path, Q0, samples=200)
    assert walk.corners == ()
    timed = hk.retime(walk, acceleration=10.0, profile="trapezoidal", dt=0.01)
    assert timed.q[-1] == pytest.approx(walk.q[-1], abs=0)
    assert max(timed.excess().values()) < 1e-9
    run = hk.simulate(hk.controller(tied, dt=0.01, q0=Q0), tied.task, path, Q0, dt=0.01)
    assert run.tracking_error() < 1e-4


@sampled(1, "by", ["joints", "tool"])
@pytest.mark.parametrize("leaf", [None, 0.25])
def test_an_approach_leads_from_anywhere_to_the_start_of_a_path(panda: hk.Robot, laws, by: str, leaf) -> None:
    tied, _ = laws
    path = loops(panda)["poses"].in_frame([0.05, 0.1, 0.02, 0, 0, 0.2])
    with pytest.raises(StartError, match=r"hk\.motion\.approach"):
        hk.follow(tied, path, Q0)
    way = hk.motion.approach(tied, path, Q0, by=by, level=leaf, samples=30)
    assert way.q[0] == pytest.approx(Q0, abs=0)
    begin = panda.pose(way.q[-1])
    assert np.abs(begin[:3, 3] - path.start).max() < 1e-9
    assert np.abs(begin[:3, :3] - path.rotation).max() < 1e-9
    assert tied.g(way.q[-1])[0] == pytest.approx(tied.g(Q0)[0] if leaf is None else leaf, abs=1e-9)
    assert np.abs(way.dq).max() < 0.5 + 1e-9
    if by == "tool" and leaf is None:
        points = np.array([panda.pose(q)[:3, 3] for q in way.q])
        line = points[-1] - points[0]
        assert np.linalg.norm(np.cross(points - points[0], line), axis=1).max() < 1e-9
    if by == "joints":
        moves = np.diff(way.q, axis=0)
        assert np.abs(moves - moves[0]).max() < 1e-12
    assert hk.drift(tied, path, way.q[-1], samples=80).largest[-1] < 1e-12


def test_a_turned_start_is_told_by_its_angle(panda: hk.Robot, laws) -> None:
    T = panda.pose(Q0)
    turned = T.copy()
    turned[:3, :3] = Rotation.from_rotvec([0, 0, 0.4]).as_matrix() @ T[:3, :3]
    with pytest.raises(StartError) as caught:
        hk.follow(laws[0], hk.polyline([turned, turned + np.eye(4, k=3) * 0.1]), Q0)
    assert caught.value.turned == pytest.approx(0.4)


def test_out_of_reach_says_where_and_by_how_much_and_what_is_in_the_way(planar_3r: hk.Robot) -> None:
    task, q = hk.position(planar_3r), np.array([-0.4, 0.8, 0.3])
    length = float(np.linalg.norm(planar_3r.pose(np.zeros(3))[:3, 3]))
    tool = planar_3r.pose(q)[:3, 3]
    out = hk.line(tool, [length + 0.2, 0, 0])
    with pytest.raises(OutOfReachError) as caught:
        hk.follow(hk.moore_penrose(task), out, q, samples=200)
    gone = np.linalg.norm(np.array([length + 0.2, 0, 0]) - tool)
    share = float(str(caught.value).split("% along")[0].split()[-1]) / 100
    at = tool + share * (np.array([length + 0.2, 0, 0]) - tool)
    assert np.linalg.norm(at) == pytest.approx(length, abs=0.01 * gone)
    assert str(caught.value).count("[") == 1  # the place

    from dataclasses import replace

    narrow = replace(
        planar_3r,
        coordinates=tuple(replace(c, lower=-0.9, upper=0.9) for c in planar_3r.coordinates),
    )
    with pytest.raises((OutOfReachError, hk.HolokinError)) as limited:
        inward = hk.line(tool, [0.2 * length, 0, 0])
        hk.follow(hk.moore_penrose(hk.position(narrow)), inward, q, samples=100)
    assert "joint" in str(limited.value) and "% along the path" in str(limited.value)


CSV = "x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n0,0,0,180,0,0\n80,0,0,180,5,0\n80,60,0,180,5,0\n0,60,10,170,0,0\n"
HEAD = """title = "t"
[robot]
name = "panda"
[task]
kind = "pose"
[start]
q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
[strategies.tied]
kind = "custom"
g = ["q1 - q3"]
[verdict]
samples = 2
[path]
samples = 60
"""
FRAME = "frame = { xyz = [0.42, 0.1, 0.45], rpy_deg = [0, 0, 10] }\n"


@sampled(
    4,
    ("path", "length"),
    [
        ('kind = "spline"\nrelative = true\npoints = [[0, 0, 0], [0.05, 0.05, 0], [0.1, 0, 0]]\n'
         'closed = true\n', 0.276),
        ('kind = "figure-eight"\nwidth = 0.1\ncycles = 2\n', 0.2622),
        ('kind = "raster"\nalong = [0.1, 0, 0]\nacross = [0, 0.06, 0]\nspacing = 0.03\n', 0.36),
        ('kind = "spiral"\nradius = 0.05\nspacing = 0.025\nsurface = "u*v"\nentry = "tool"\n', 0.3216),
        ('kind = "file"\nfile = "w.csv"\nthrough = "lines"\nclosed = true\n'
         'entry = "joints"\n' + FRAME, 0.2814),
        ('kind = "file"\nfile = "w.csv"\npasses = 2\nlead_in = 0.01\nlead_out = 0.02\nretract = 0.05\n'
         'entry = "joints"\n' + FRAME, 0.6317),
        ('kind = "poses"\nposes = [{ rpy_deg = [180, 0, 0] }, { xyz = [0.1, 0, 0], rpy_deg = [180, 0, 0] }]\n'
         'through = "lines"\nentry = "tool"\n' + FRAME, 0.1),
    ],
)  # fmt: skip
def test_a_job_follows_every_kind_of_path(tmp_path: Path, path: str, length: float) -> None:
    (tmp_path / "w.csv").write_text(CSV)
    (tmp_path / "job.toml").write_text(HEAD + path)
    result = run_job(*open_job(str(tmp_path / "job.toml")))
    (tied,) = result.strategies
    assert tied.status is hk.motion.Status.COMPLETE
    assert tied.metrics["tracking"] < 1e-10
    assert result.path.length == pytest.approx(length, rel=0.02)
    assert ("enters the path" in result.about) == ("entry" in path)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ('kind = "spline"\n', ("kind = 'spline' needs points",)),
        ('kind = "raster"\nspacing = 0.1\n', ("along and across",)),
        ('kind = "figure-eight"\nwidth = 0.1\nradius = 1\n', ("does not use radius",)),
        ('kind = "file"\nfile = "none.csv"\n', ("none.csv", "no such file")),
        ('kind = "figure-eight"\nwidth = 0.1\noffset = [0, 0, 1]\n', ("several passes",)),
        ('kind = "figure-eight"\nwidth = 0.1\nat = [1, 0, 0]\n', ("away from the start of the path", "entry")),
        ('kind = "spiral"\nradius = 0.1\nspacing = 0.02\ncycles = 3\n', ("closed path",)),
        ('kind = "figure-eight"\nwidth = 0.1\nrelative = true\nframe = {}\n', ("leave out one",)),
        ('kind = "raster"\nalong = [1, 0, 0]\nacross = [0, 1, 0]\nspacing = 0.5\nsurface = "u*w"\n',
         ("'w' is unknown",)),
    ],
)  # fmt: skip
def test_a_job_with_a_path_that_is_none_is_refused(holokin, tmp_path: Path, out: Path, path: str, words) -> None:
    assert_refused(holokin("run", write_job(tmp_path, path="[path]\n" + path), "--out", out), *words)
    assert_untouched(out)


@pytest.mark.campaign
def test_an_entry_that_leads_nowhere_is_told(panda: hk.Robot, laws) -> None:
    far = hk.line([2.0, 0, 0.3], [2.1, 0, 0.3])
    for by in ("tool", "joints"):
        with pytest.raises((OutOfReachError, BranchError)):
            hk.motion.approach(laws[0], far, Q0, by=by, samples=10)


# --- Paths that lead to a pose by one way only, and laws that stop: nothing is said of what was not compared or seen.


JOB = """
title = "a path"
[robot]
name = "planar-3r"
[start]
q = [0.3, 0.8, 0.5]
[path]
kind = "polyline"
points = {points}
relative = true
samples = 40
{more}
[strategies.pseudo-inverse]
kind = "moore-penrose"
[verdict]
samples = 8
[checks]
self_collision = false
limits = false
"""


def done(folder: Path, points: np.ndarray, more: str = "") -> JobResult:
    file = folder / "job.toml"
    file.write_text(JOB.format(points=[[*map(float, point), 0.0] for point in points], more=more))
    return run_job(*open_job(str(file)))


def written(result: JobResult, folder: Path) -> tuple[str, str, dict]:
    """The report, what is printed, and the facts."""
    at = write_report(result, folder, "0")
    out = io.StringIO()
    print_result(result, Console(file=out, width=300))
    facts = json.loads((at / "result.json").read_text("utf-8"))
    return (at / "report.html").read_text("utf-8"), out.getvalue(), facts


@pytest.mark.campaign
@sampled(1, "more", ["", "passes = 2", "closed = true"])
def test_a_path_is_not_compared_with_itself(more: str, tmp_path: Path) -> None:
    """Random points: an open path, the same to and fro, and closed. The pseudo-inverse depends on the way."""
    rng = np.random.default_rng(3)
    points = np.vstack([[0.0, 0.0], rng.uniform(-0.25, 0.0, (3, 2))])
    result = done(tmp_path, points, more)
    (strategy,) = result.strategies
    assert strategy.status is Status.COMPLETE
    page, printed, facts = written(result, tmp_path)
    compared = more == "closed = true"
    assert (strategy.two_paths is not None) == compared == np.isfinite(strategy.metrics["spread"])
    assert (rows(result)[0][3] == "-") != compared
    assert ("do not depend on the path" in page) == compared == (facts["two_paths"] == "compared")
    for text in (page, printed):
        assert ("Two paths were not compared: the path" in text) != compared
        assert ("draw a closed path whose halves" in text) != compared
    if compared:
        assert strategy.metrics["spread"] > 1e-6
    else:
        assert ("runs back on itself" in printed) == (more == "passes = 2")


@pytest.mark.campaign
@sampled(1, "far", [2.5, 6.0])
def test_a_check_of_a_law_that_stopped_says_what_it_saw_and_is_not_green(far: float, tmp_path: Path) -> None:
    """The arm reaches 3 m."""
    result = done(tmp_path, np.array([[0.0, 0.0], [far, 0.0], [0.0, 0.3]]), "closed = true")
    (strategy,) = result.strategies
    assert strategy.status is not Status.COMPLETE and strategy.motion_check is not None
    run = np.linalg.norm(np.diff(strategy.cycles.x[:, :2], axis=0), axis=1).sum()
    assert strategy.followed == pytest.approx(run / result.path.length, abs=0.01) and 0 < strategy.followed < 0.5
    page, printed, facts = written(result, tmp_path)
    said = f"only the first {strategy.followed:.1%} of the path was looked at: there the strategy stopped"
    assert said in printed and "<p class='no'>" in page and said in page
    assert "<p class='yes'>nothing found" not in page and not result.passed
    assert facts["strategies"][0]["followed"] == pytest.approx(strategy.followed)
    assert ("nothing found, but only" in page) == strategy.motion_check.passed
