"""Near repeats: points 1e-17 to 1e-8 m from the one before, as CAD programs leave them, change no path at any door."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from holokin.app.job.job_parts import build_path
from holokin.app.job.tables import PathTable
from holokin.app.studio import polygon_loop
from holokin.base.errors import ArgumentError, HolokinError
from holokin.path.editing import AnyPath

Door = Callable[[np.ndarray, Path], AnyPath]


def posed(points: np.ndarray) -> np.ndarray:
    """Poses whose rotations depend smoothly on the place."""
    out = np.tile(np.eye(4), (len(points), 1, 1))
    out[:, :3, :3], out[:, :3, 3] = Rotation.from_rotvec(3 * points).as_matrix(), points
    return out


def filed(points: np.ndarray, folder: Path) -> hk.path.Waypoints:
    file = folder / "w.csv"
    file.write_text("x_m,y_m,z_m\n" + "\n".join(",".join(map(repr, row)) for row in points.tolist()))
    return hk.path.read_waypoints(file)


def drawing(points: np.ndarray, folder: Path) -> hk.Path:
    pytest.importorskip("svgelements")
    at = " ".join(f"{1e3 * x:.17g},{1e3 * y:.17g}" for x, y, _ in points)
    size = 'width="500mm" height="500mm" viewBox="0 0 500 500"'
    (folder / "a.svg").write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size}><path d="M {at} Z"/></svg>')
    return hk.path.read_svg(folder / "a.svg")[0]


def job(kind: str, points: np.ndarray) -> AnyPath:
    robot = hk.load("planar-3r")
    keys = {"kind": kind, "points": points.tolist(), "closed": True, "entry": "joints"}
    return build_path(
        PathTable.model_validate(keys), hk.position(robot), np.array([0.3, 0.8, -0.4]), Path("app.job.toml")
    )


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
    with pytest.raises(ArgumentError, match="points that differ is 1; give at least two"):
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
