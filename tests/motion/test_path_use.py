"""New kinds of paths at work: followed natively and not, home again, entered from anywhere, timed, out of reach."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import assert_refused, assert_untouched, sampled, write_job
from holokin.app.job import open_job, run_job
from holokin.base.errors import BranchError, OutOfReachError, StartError

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
    with pytest.raises(StartError, match=r"0\.4 rad from the tool's orientation") as caught:
        hk.follow(laws[0], hk.polyline([turned, turned + np.eye(4, k=3) * 0.1]), Q0)
    assert caught.value.turned == pytest.approx(0.4)


def test_out_of_reach_says_where_and_by_how_much_and_what_is_in_the_way(planar_3r: hk.Robot) -> None:
    task, q = hk.position(planar_3r), np.array([-0.4, 0.8, 0.3])
    length = float(np.linalg.norm(planar_3r.pose(np.zeros(3))[:3, 3]))
    tool = planar_3r.pose(q)[:3, 3]
    out = hk.line(tool, [length + 0.2, 0, 0])
    with pytest.raises(OutOfReachError, match="even without joint limits") as caught:
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
        ('kind = "waypoints"\nfile = "w.csv"\nthrough = "lines"\nclosed = true\n'
         'entry = "joints"\n' + FRAME, 0.2814),
        ('kind = "waypoints"\nfile = "w.csv"\npasses = 2\nlead_in = 0.01\nlead_out = 0.02\nretract = 0.05\n'
         'entry = "joints"\n' + FRAME, 0.6317),
        ('kind = "poses"\nposes = [{ rpy_deg = [180, 0, 0] }, { xyz = [0.1, 0, 0], rpy_deg = [180, 0, 0] }]\n'
         'through = "lines"\nentry = "tool"\n' + FRAME, 0.1),
    ],
)  # fmt: skip
def test_a_job_follows_every_kind_of_path(tmp_path: Path, path: str, length: float) -> None:
    (tmp_path / "w.csv").write_text(CSV)
    (tmp_path / "app.job.toml").write_text(HEAD + path)
    result = run_job(*open_job(str(tmp_path / "app.job.toml")))
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
        ('kind = "waypoints"\nfile = "none.csv"\n', ("none.csv", "no such file")),
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
