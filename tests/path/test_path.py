"""Paths: constant speed, reversal, joining, parts, the two ways round; turns that cancel close."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from holokin.app.job.job_parts import build_path
from holokin.app.job.tables import PathTable
from holokin.app.studio import polygon_loop
from holokin.base.errors import ArgumentError, HolokinError, OpenPathError, ShapeError
from holokin.path.editing import AnyPath
from holokin.path.path import straight

POINTS = np.array([[0, 0, 0], [0.1, 0, 0.05], [0.1, 0.2, 0], [-0.1, 0.1, 0.1]])
SPIN = np.array([[0.3, 0, 0], [0, 0.2, 0.4], [0, 0, 0.0]])


def paths() -> dict[str, hk.Path]:
    return {
        "line": hk.line([0, 0, 0], [0.1, 0.2, 0.3], turn=[0.1, 0, 0.5]),
        "arc": hk.path.arc([0.1, 0, 0], [0, 0, 0], 1.3, speed=0.2),
        "tilted arc": hk.path.arc([0, 0.1, 0.1], [0, 0, 0.1], -2.0, normal=[1, 0, 2], turn=[0, 0.4, 0]),
        "circle": hk.circle([0.5, 0.1], [0.4, 0.1]),
        "polyline": hk.polyline(POINTS, turns=SPIN),
        "loop": hk.polyline(POINTS, closed=True),
        "joined": hk.path.join(
            hk.line([0, 0], [0.1, 0]), hk.path.arc([0.1, 0], [0.1, 0.1], np.pi), hk.line([3, 3], [3.1, 3])
        ),
    }


every = pytest.mark.parametrize("path", paths().values(), ids=paths().keys())


@every
def test_the_tool_moves_at_constant_speed(path: hk.Path) -> None:
    t = np.linspace(0, path.duration, 501)
    at = path.at(t)
    assert np.linalg.norm(at.velocity, axis=1) == pytest.approx(path.speed, rel=1e-12)
    assert path.duration == pytest.approx(path.length / path.speed)


@every
def test_velocity_and_angular_velocity_are_the_derivatives_of_the_pose(path: hk.Path) -> None:
    h = 1e-6
    t = np.linspace(0.013, path.duration - 0.017, 57)
    before, now, after = path.at(t - h), path.at(t), path.at(t + h)
    assert np.abs((after.position - before.position) / (2 * h) - now.velocity).max() < 1e-8
    turns = after.rotation @ before.rotation.transpose(0, 2, 1)
    assert np.abs(Rotation.from_matrix(turns).as_rotvec() / (2 * h) - now.angular).max() < 1e-8


@every
def test_the_reverse_is_the_same_curve_backwards(path: hk.Path) -> None:
    back = path.reversed()
    t = np.linspace(0, path.duration, 41)
    a, b = path.at(t), back.at(path.duration - t)
    assert a.position == pytest.approx(b.position, abs=1e-14)
    assert np.abs(b.rotation - a.rotation @ path.turned.T).max() < 1e-14
    assert np.abs(back.reversed().at(t).position - a.position).max() < 1e-14


@every
def test_steps_never_straddle_a_corner_and_cover_the_path(path: hk.Path) -> None:
    for samples in (1, 7, 100):
        index, start, stop = path.steps(samples)
        assert len(index) >= samples
        assert (start[0], stop[-1]) == (0.0, 1.0)
        same = index[1:] == index[:-1]
        assert (start[1:][same] == stop[:-1][same]).all()
        assert (stop[:-1][~same] == 1.0).all()
        assert (start[1:][~same] == 0.0).all()


@given(st.sampled_from(list(paths())), st.floats(0.0, 0.9), st.floats(0.05, 1.0))
def test_a_part_is_the_piece_between_two_fractions(name: str, start: float, share: float) -> None:
    path = paths()[name]
    stop = min(1.0, start + share * (1 - start))
    if stop - start < 1e-3:
        return
    piece = path.part(start, stop)
    assert piece.duration == pytest.approx((stop - start) * path.duration)
    t = np.linspace(0, 1, 11) * piece.duration
    assert piece.at(t).position == pytest.approx(
        path.at(np.minimum(t + start * path.duration, path.duration)).position, abs=1e-12
    )


def test_the_two_paths_round_a_loop_meet_half_a_loop_away() -> None:
    for path in (paths()["circle"], paths()["loop"]):
        a, b = path.halves()
        assert a.end == pytest.approx(b.end, abs=1e-15)
        assert a.start == pytest.approx(b.start)
        assert a.length == pytest.approx(path.length / 2)
    with pytest.raises(OpenPathError):
        paths()["line"].halves()


def test_a_closed_path_ends_where_it_starts_to_the_last_bit() -> None:
    path = hk.circle([1.6094, 0.4036], [1.2070, 0.4036])
    assert path.closed
    ends = path.at([0.0, path.duration])
    assert np.array_equal(ends.position[0], ends.position[1])


def test_turns_that_cancel_close_and_others_do_not() -> None:
    square = [[0, 0, 0], [0, 0.1, 0], [0, 0.1, 0.1], [0, 0, 0.1], [0, 0, 0]]
    a, b = np.array([0.3, 0, 0]), np.array([0, 0.2, 0.1])
    assert hk.polyline(square, turns=[a, b, -b, -a]).closed
    assert not hk.polyline(square, turns=[a, b, -a, -b]).closed  # rotations do not commute
    closed = hk.polyline(square, turns=[a, b, -b, -a])
    one, other = closed.halves()
    assert np.abs(one.turned - other.turned).max() < 1e-14


def test_area_vector_of_loops_in_closed_form() -> None:
    assert paths()["circle"].area == pytest.approx([0, 0, np.pi * 0.01])
    assert hk.circle([0.5, 0.1], [0.4, 0.1], clockwise=True).area == pytest.approx([0, 0, -np.pi * 0.01])
    assert paths()["circle"].counter_clockwise
    assert not paths()["circle"].reversed().counter_clockwise
    square = hk.polyline([[1, 1, 1], [1, 1.1, 1], [1, 1.1, 0.9], [1, 1, 0.9]], closed=True)
    assert square.area == pytest.approx([-0.01, 0, 0])
    half_moon = hk.path.arc([0.1, 0], [0, 0], np.pi) + hk.line([0, 0], [0.2, 0])
    assert half_moon.closed
    assert half_moon.area == pytest.approx([0, 0, np.pi * 0.005])


def test_a_path_there_and_back_is_closed() -> None:
    path = paths()["polyline"]
    assert not path.closed
    assert (path + path.reversed()).closed


def test_moving_and_speeding_keep_the_shape() -> None:
    path = paths()["tilted arc"]
    moved = path.starting_at([1, 2, 3])
    assert moved.start == pytest.approx([1, 2, 3])
    assert moved.end - moved.start == pytest.approx(path.end - path.start)
    assert path.at_speed(0.4, 2.0).duration == pytest.approx(path.duration / 4)


def test_turning_on_the_spot_takes_its_time() -> None:
    path = hk.line([0, 0, 0], [1e-6, 0, 0], turn=[0, 0, 1.0])
    assert path.duration == pytest.approx(2.0)  # 1 rad at 0.5 rad/s


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: hk.polyline([[0, 0, 0]]), ArgumentError),
        (lambda: hk.polyline([[0, 0, 0], [0, 0, 0]]), ArgumentError),
        (lambda: hk.polyline([[0, 0, 0, 0], [0, 1, 0, 0]]), ShapeError),
        (lambda: hk.polyline(POINTS, turns=[[0, 0, 0]]), ShapeError),
        (lambda: hk.path.arc([0.1, 0], [0.1, 0], 1.0), ArgumentError),
        (lambda: hk.path.arc([0.1, 0], [0, 0], 1.0, normal=[1, 0, 0]), ArgumentError),
        (lambda: paths()["line"].part(0.5, 0.2), ArgumentError),
        (lambda: paths()["line"].steps(0), ArgumentError),
        (lambda: hk.path.join(), ArgumentError),
    ],
)
def test_paths_that_make_no_sense_are_refused(make, error: type[Exception]) -> None:
    with pytest.raises(error):
        make()


@pytest.mark.parametrize("angular_speed", [0, 0.0, -1.0])
def test_a_path_turns_at_no_angular_speed_that_is_not_positive(angular_speed: float) -> None:
    path = hk.line([0, 0, 0], [0.1, 0, 0], turn=[0, 0, 1.0])
    with pytest.raises(ArgumentError, match="angular_speed"):
        path.at_speed(0.1, angular_speed)


def test_a_straight_way_turns_about_one_axis_and_ends_in_its_pose_alone_or_beside_others() -> None:
    R = Rotation.random(6, rng=np.random.default_rng(3)).as_matrix()
    p = np.random.default_rng(4).normal(size=(6, 3))
    ways = straight(p[:3], R[:3], p[3:], R[3:])
    ends, turned = ways.at(1.0)
    assert ends == pytest.approx(p[3:], abs=1e-12) and turned == pytest.approx(R[3:], abs=1e-12)
    shares = np.array([0.3, 0.8])
    for which, one, at, rotation in zip((2, 0), shares, *ways.at(shares, np.array([2, 0])), strict=True):
        alone = straight(p[which], R[which], p[3 + which], R[3 + which])
        assert (at == alone.at(one)[0]).all() and (rotation == alone.at(one)[1]).all()
        spin = Rotation.from_matrix(rotation @ R[which].T).as_rotvec()
        assert spin == pytest.approx(one * alone.turn, abs=1e-12)
        assert np.linalg.norm(alone.turn) <= np.pi


# --- Near repeats: points 1e-17 to 1e-8 m from the one before, as CAD programs leave them, change no path at any door.


Door = Callable[[np.ndarray, Path], AnyPath]


def posed(points: np.ndarray) -> np.ndarray:
    """Poses whose rotations depend smoothly on the place."""
    out = np.tile(np.eye(4), (len(points), 1, 1))
    out[:, :3, :3], out[:, :3, 3] = Rotation.from_rotvec(3 * points).as_matrix(), points
    return out


def filed(points: np.ndarray, folder: Path) -> hk.path.Waypoints:
    file = folder / "w.csv"
    file.write_text("x_m,y_m,z_m\n" + "\n".join(",".join(map(repr, row)) for row in points.tolist()))
    return hk.read_paths(file).paths[0]


def drawing(points: np.ndarray, folder: Path) -> hk.Path:
    pytest.importorskip("svgelements")
    at = " ".join(f"{1e3 * x:.17g},{1e3 * y:.17g}" for x, y, _ in points)
    size = 'width="500mm" height="500mm" viewBox="0 0 500 500"'
    (folder / "a.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size}><path d="M {at} Z"/></svg>')
    return hk.read_paths(folder / "a.svg").paths[0].path()


def job(kind: str, points: np.ndarray) -> AnyPath:
    robot = hk.load("planar-3r")
    keys = {"kind": kind, "points": points.tolist(), "closed": True, "entry": "joints"}
    return build_path(PathTable.model_validate(keys), hk.position(robot), np.array([0.3, 0.8, -0.4]), Path("job.toml"))


DOORS: dict[str, Door] = {
    "polyline": lambda points, _: hk.polyline(points, closed=True),
    "polyline of poses": lambda points, _: hk.polyline(posed(points), closed=True),
    "spline": lambda points, _: hk.spline(points, closed=True),
    "spline of poses": lambda points, _: hk.spline(posed(points), closed=True),
    "outline given whole": lambda points, _: hk.polyline(np.vstack([points, points[:1] + 1e-9])),
    "through": lambda points, _: hk.path.through(points, closed=True, speed=0.1),
    "file": lambda points, folder: hk.spline(filed(points, folder), closed=True),
    "file of lines": lambda points, folder: hk.polyline(filed(points, folder), closed=True),
    "drawing": drawing,
    "job": lambda points, _: job("polyline", points),
    "job, a spline": lambda points, _: job("spline", points),
    "studio": lambda points, _: polygon_loop(points).path,  # type: ignore[return-value]
}


def outline(rng: np.random.Generator) -> np.ndarray:
    """Corners of a random star about a point, in a plane, in order."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(4, 9))) + np.arange(1.0)
    angles = np.linspace(0, 2 * np.pi, len(angles), endpoint=False) + 0.3 * np.sin(angles)
    radii = rng.uniform(0.05, 0.1, len(angles))
    return np.column_stack([0.2 + radii * np.cos(angles), 0.2 + radii * np.sin(angles), np.zeros(len(angles))])


def repeated(points: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """The outline with some points again, from once to three times, 1e-17 to 1e-8 m away, and how many these are; and
    with an end where it closes, which counts as none."""
    out, added = [], 0
    for point in points:
        out.append(point)
        for _ in range(int(rng.integers(0, 4) * rng.integers(0, 2))):
            step = rng.normal(size=3) * [1, 1, 0]
            out.append(point + step / np.linalg.norm(step) * 10 ** rng.uniform(-17, -8))
            added += 1
    out.append(points[0] + [0, 10 ** rng.uniform(-17, -8), 0])
    return np.array(out), added


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.campaign) for k in range(1, 30))])
def test_an_outline_with_near_repeats_is_the_clean_one_and_says_how_many_were_left_out(
    door: str, seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    clean = outline(rng)
    points, added = repeated(clean, rng)
    want, found = DOORS[door](clean, tmp_path), DOORS[door](points, tmp_path)
    assert found.closed and found.duration == pytest.approx(want.duration, rel=1e-5)
    share = np.linspace(0, 1, 200)
    a, b = (path.at(share * path.duration) for path in (want, found))
    assert np.abs(a.position - b.position).max() < 1e-6 and np.abs(a.rotation - b.rotation).max() < 1e-5
    assert len(found.corners) == len(want.corners)
    added += door == "outline given whole"  # which has two ends then
    assert [note.split()[0] for note in found.notes] == [str(added)] * (added > 0)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.campaign) for k in range(1, 10))])
def test_a_motion_along_it_takes_the_time_of_the_clean_one(seed: int) -> None:
    """Also where the path itself has a piece as short as that, of lines joined by hand."""
    rng = np.random.default_rng(seed)
    panda = hk.load("panda")
    q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    law = hk.holonomic(hk.pose(panda), hk.lock(2))
    clean = outline(rng)
    points, _ = repeated(clean, rng)
    here = panda.pose(q0)[:3, 3] - clean[0]
    size = 10 ** rng.uniform(-17, -8)
    a, b, c = (point + here for point in clean[:3])
    ways = {
        "lines": (hk.polyline(clean + here, closed=True), hk.polyline(points + here, closed=True)),
        "spline": (hk.spline(clean + here, closed=True), hk.spline(points + here, closed=True)),
        "joined": (hk.line(a, b) + hk.line(b, c), hk.line(a, b) + hk.line(b, b + [size, 0, 0]) + hk.line(b, c)),
    }
    for name, paths in ways.items():
        for profile in ("time-optimal", "quintic"):
            want, found = (
                hk.retime(hk.follow(law, path, q0, samples=60), profile=profile, acceleration=10.0)  # type: ignore[arg-type]
                for path in paths
            )
            assert abs(found.duration - want.duration) <= 2e-3 * want.duration + 2e-3, (name, profile)


def test_rests_and_turns_on_the_spot_are_no_repeats() -> None:
    a, b = np.zeros(3), np.array([0.1, 0.0, 0.0])
    rest = hk.spline([a, b, b, a], times=[0, 1, 2, 3])
    assert rest.notes == () and rest.duration == pytest.approx(3)
    turn = hk.polyline([a, b, b, a], turns=[[0, 0, 0], [0, 0, 1], [0, 0, 0]])
    assert turn.notes == () and len(turn.segments) == 3
    again = hk.spline([a, b, b, a], times=[0, 1, 1, 3])
    assert again.notes == ("1 repeated point left out, within 1e-07 m of the one before",)
    slow = np.cumsum(np.full((40, 1), 6e-8), axis=0) * [1, 0, 0]  # each within the tolerance of the one before
    assert hk.polyline(slow).length == pytest.approx(39 * 6e-8, rel=0.05)


def test_points_that_are_all_one_are_refused_and_times_must_rise() -> None:
    with pytest.raises(ArgumentError, match="points that differ is 1"):
        hk.polyline([[0, 0, 0], [1e-9, 0, 0]])
    with pytest.raises(HolokinError, match="after the one before"):
        hk.spline([[0, 0], [1, 0], [2, 0]], times=[0, 1, 1])


@pytest.mark.campaign
def test_a_spline_of_many_points_takes_time_and_memory_in_proportion() -> None:
    """Memory as NumPy counts it; processor time of a tenth of the points, times ten, with room for noise."""
    import time
    import tracemalloc

    def work(n: int) -> tuple[float, float]:
        a = np.linspace(0, 40 * np.pi, n)
        points = np.column_stack([np.cos(a), np.sin(1.7 * a), 0.01 * a])
        began = time.process_time()
        hk.spline(points)
        seconds = time.process_time() - began
        tracemalloc.start()
        hk.spline(points)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return seconds, peak

    few, many = work(1_000), work(10_000)
    assert many[0] < 15 * few[0] and many[1] < 10_000 * 12_000
