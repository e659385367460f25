"""Splines, shapes over patches, blends, leads and passes: against SciPy, closed forms and finite differences."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

import holokin as hk
from holokin.base.errors import ArgumentError, FileError, NotFiniteError, ShapeError
from holokin.path.workspaces import PoseCloud, pose_cloud, sobol

POINTS = np.array([[0.4, 0, 0.3], [0.5, 0.1, 0.32], [0.45, 0.2, 0.3], [0.35, 0.15, 0.25], [0.3, 0.0, 0.3]])
TURNS = np.array([[0, 0, 0], [0.2, 0, 0.1], [0.3, 0.4, 0], [0, 0.2, -0.3], [-0.2, 0, 0]])
TIMES = np.array([0.0, 0.7, 2.0, 2.5, 4.0])
SQUARE = [[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]


def poses() -> np.ndarray:
    out = np.tile(np.eye(4), (len(POINTS), 1, 1))
    out[:, :3, 3], out[:, :3, :3] = POINTS, Rotation.from_rotvec(TURNS).as_matrix()
    return out


def dome(u: float, v: float) -> float:
    """A sphere of 0.5 m, whose pole is the origin and whose middle is 0.5 m above."""
    return 0.5 - np.sqrt(0.25 - u * u - v * v)


SHAPES = {
    "spline": lambda: hk.spline(POINTS),
    "round": lambda: hk.spline(POINTS, closed=True),
    "poses": lambda: hk.spline(poses()),
    "round poses": lambda: hk.spline(poses(), closed=True),
    "timed": lambda: hk.spline(poses(), times=TIMES),
    "lines through poses": lambda: hk.polyline(poses()),
    "function": lambda: hk.path.path_of(lambda t: [np.cos(t), np.sin(t), 0.1 * np.sin(2 * t)], [0, 2 * np.pi]),
    "eight": lambda: hk.path.figure_eight([0.4, 0, 0.3], 0.2, 0.1, [0, 1, 1]),
    "raster": lambda: hk.path.raster(
        [0.4, 0, 0.3], [0.1, 0, 0], [0, 0.05, 0], 0.03, surface=lambda u, v: 2 * u * u - v * v
    ),
    "spiral": lambda: hk.path.spiral([0.4, 0, 0.3], 0.05, 0.02, surface=dome, inward=True),
    "blend": lambda: hk.path.blended(hk.polyline(poses()), 0.005),
    "frame": lambda: hk.spline(poses()).in_frame([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
    "leads": lambda: hk.path.with_leads(hk.spline(POINTS), 0.02, 0.03, retract=0.05),
    "passes": lambda: hk.path.passes(
        hk.polyline(poses()), 3, offset=[0, 0, 0.01], back_and_forth=False, lift=[0, 0, 0.03]
    ),
}
every = pytest.mark.parametrize("path", SHAPES, indirect=True)


@cache
def shape(name: str) -> hk.Path:
    return SHAPES[name]()


@pytest.fixture
def path(request: pytest.FixtureRequest) -> hk.Path:
    return shape(request.param)


@every
def test_velocity_and_angular_velocity_are_the_derivatives_of_the_pose(path: hk.Path) -> None:
    h = 1e-6
    t = np.linspace(0.013, path.duration - 0.017, 57)
    t = t[np.abs(t[:, None] - path.starts).min(axis=1) > 2 * h]
    before, now, after = path.at(t - h), path.at(t), path.at(t + h)
    assert np.abs((after.position - before.position) / (2 * h) - now.velocity).max() < 1e-8
    turns = after.rotation @ before.rotation.transpose(0, 2, 1)
    assert np.abs(Rotation.from_matrix(turns).as_rotvec() / (2 * h) - now.angular).max() < 1e-8


@every
def test_the_reverse_is_the_same_curve_backwards_and_a_part_its_piece(path: hk.Path) -> None:
    t = np.linspace(0, path.duration, 41)
    a, b = path.at(t), path.reversed().at(path.duration - t)
    assert np.abs(a.position - b.position).max() < 1e-14
    assert np.abs(b.rotation - a.rotation @ path.turned.T).max() < 1e-13
    piece = path.part(0.23, 0.81)
    u = np.linspace(0, piece.duration, 37)
    c, d = piece.at(u), path.at(u + 0.23 * path.duration)
    assert np.abs(c.position - d.position).max() < 1e-13
    assert np.abs(c.rotation @ d.rotation[0] - d.rotation).max() < 1e-13
    if path.rotation is not None:
        assert piece.rotation == pytest.approx(d.rotation[0] @ path.rotation, abs=1e-13)
        assert path.reversed().rotation == pytest.approx(path.turned @ path.rotation, abs=1e-13)


@every
def test_the_bounds_of_a_step_hold(path: hk.Path) -> None:
    """They keep a follower on its branch: no second difference of the pose may be above them."""
    u, h = np.linspace(0.01, 0.99, 33), 1e-4
    for i, segment in enumerate(path.segments[:40]):
        index = np.full(len(u), i)
        at = [path.on(index, u + k * h) for k in (-1, 0, 1)]
        second = (at[2].position - 2 * at[1].position + at[0].position) / h**2
        assert np.linalg.norm(second, axis=1).max() <= segment.bend * (1 + 1e-3) + 1e-5
        w = [x.angular * path.durations[i] for x in at]
        swing = np.linalg.norm(w[1], axis=1) ** 2 + np.linalg.norm(w[2] - w[0], axis=1) / (2 * h) / 2
        assert swing.max() <= segment.sway**2 * (1 + 1e-6) + 1e-9


@every
def test_the_area_is_half_the_integral_of_p_x_dp(path: hk.Path) -> None:
    t = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in pairwise(path.starts)])
    p = path.at(np.append(t, path.duration)).position - path.start
    total = np.cross(p[:-1], p[1:]).sum(axis=0) / 2
    assert np.abs(total - path.area).max() < 1e-3 * np.abs(p).max() ** 2


@pytest.mark.parametrize("closed", [False, True])
def test_a_spline_with_times_is_scipys(closed: bool) -> None:
    given, t = (np.vstack([POINTS, POINTS[:1]]), np.append(TIMES, 5.1)) if closed else (POINTS, TIMES)
    path = hk.spline(given, times=t, closed=closed)
    theirs = CubicSpline(t, given, bc_type="periodic" if closed else "not-a-knot")
    s = np.linspace(0, t[-1], 301)
    at = path.at(s)
    assert np.abs(at.position - theirs(s)).max() < 1e-14
    assert np.abs(at.velocity - theirs(s, 1)).max() < 1e-13
    assert path.closed == closed


def test_a_spline_of_poses_with_times_is_scipys() -> None:
    path, s = hk.spline(poses(), times=TIMES + 3.0), np.linspace(0, 4, 301)
    theirs = RotationSpline(TIMES, Rotation.from_rotvec(TURNS))
    at = path.at(s)
    assert path.rotation is not None
    assert np.abs(at.rotation @ path.rotation - theirs(s).as_matrix()).max() < 1e-13
    body = np.einsum("kji,kj->ki", theirs(s).as_matrix(), at.angular)
    assert np.abs(body - theirs(s, 1)).max() < 1e-11
    assert path.corners == ()


rows = st.tuples(st.floats(0.1, 0.3), *[st.floats(-0.1, 0.1)] * 4)
ways = st.lists(rows, min_size=3, max_size=6)


@given(ways, st.booleans(), st.booleans())
def test_a_spline_goes_through_its_waypoints_smoothly_and_closes(rows: list, closed: bool, timed: bool) -> None:
    given, k = np.array(rows), len(rows)
    angle, T = 2 * np.pi * np.arange(k) / k, np.tile(np.eye(4), (k, 1, 1))
    T[:, :3, 3] = np.column_stack([given[:, 0] * np.cos(angle), given[:, 0] * np.sin(angle), given[:, 1]])
    T[:, :3, :3] = Rotation.from_rotvec(4 * given[:, 2:]).as_matrix()
    if closed and timed:
        T = np.concatenate([T, T[:1]])
    times = np.cumsum(1 + np.arange(len(T)) % 3) if timed else None
    path = hk.spline(T, times=times, closed=closed)
    assert path.corners == ()
    assert path.closed == closed
    ends = path.at(path.starts)
    for pose in T:
        k = int(np.argmin(np.linalg.norm(ends.position - pose[:3, 3], axis=1)))
        assert np.abs(ends.position[k] - pose[:3, 3]).max() < 1e-12
        assert np.abs(ends.rotation[k] @ path.rotation - pose[:3, :3]).max() < 1e-12
    inner = np.arange(1, len(path.segments))
    h = 1e-3
    a, b = path.on(inner - 1, np.full(len(inner), 1 - h)), path.on(inner, np.full(len(inner), h))
    ends_of = path.on(inner, np.zeros(len(inner)))
    left = (ends_of.velocity - a.velocity) / (h * path.durations[inner - 1])[:, None]
    right = (b.velocity - ends_of.velocity) / (h * path.durations[inner])[:, None]
    assert np.abs(left - right).max() < 0.02 * max(1.0, np.abs(left).max())  # acceleration has no jump
    if not timed:
        at = path.at(np.linspace(0, path.duration, 500))
        assert (np.linalg.norm(at.velocity, axis=1) < 1.011 * path.speed).all()
        assert (np.linalg.norm(at.angular, axis=1) < 1.011 * path.angular_speed).all()


def test_the_speed_on_a_spline_is_even_to_one_percent() -> None:
    for closed in (False, True):
        path = hk.spline(POINTS, closed=closed, speed=0.25)
        speeds = np.linalg.norm(path.at(np.linspace(0, path.duration, 3001)).velocity, axis=1)
        assert np.abs(speeds / 0.25 - 1).max() < 0.0105
        assert path.at_speed(0.5).duration == pytest.approx(path.duration / 2)


def test_a_function_of_time_is_kept_to_its_tolerance_and_its_time() -> None:
    def wave(t: float) -> np.ndarray:
        T = np.eye(4)
        T[:3, 3], T[:3, :3] = (
            [np.cos(t), np.sin(2 * t), t / 9],
            Rotation.from_rotvec([np.sin(t), 0.3 * t, 0]).as_matrix(),
        )
        return T

    path = hk.path.path_of(wave, [1.0, 6.0], tolerance=1e-5)
    t = np.linspace(0, 5, 777)
    at, wanted = path.at(t), np.array([wave(1.0 + x) for x in t])
    assert path.duration == pytest.approx(5.0, abs=1e-12)
    assert np.abs(at.position - wanted[:, :3, 3]).max() < 2e-5
    assert np.abs(at.rotation @ path.rotation - wanted[:, :3, :3]).max() < 2e-5
    with pytest.raises(ArgumentError, match="corner or jump"):
        hk.path.path_of(lambda t: [0.0 if t < 0.3 else 1.0, 0, 0], [0, 1])


def test_shapes_have_the_lengths_of_their_formulas() -> None:
    assert hk.path.figure_eight([0, 0], 0.3).length == pytest.approx(2.62205755429212 * 0.3, rel=2e-5)
    b, turns = 0.02 / (2 * np.pi), 2 * np.pi * 5
    exact = b / 2 * (turns * np.sqrt(1 + turns**2) + np.arcsinh(turns))
    assert hk.path.spiral([0, 0], 0.1, 0.02).length == pytest.approx(exact, rel=1e-5)
    assert hk.path.raster([0, 0], [0.2, 0, 0], [0, 0.1, 0], 0.03).length == pytest.approx(5 * 0.2 + 0.1)
    parabola = hk.spline([[-1, 1], [0, 0], [1, 1]], times=[0, 1, 2])  # a cubic through three points of one is it
    assert parabola.length == pytest.approx(np.sqrt(5) + np.arcsinh(2) / 2, rel=1e-9)


@pytest.mark.campaign
def test_over_a_sphere_the_tool_looks_along_the_radius() -> None:
    path = hk.path.spiral([0.4, 0, 0.3], 0.1, 0.02, surface=dome)
    at, middle = path.at(np.linspace(0, path.duration, 400)), np.array([0.4, 0, 0.8])
    out = at.position - middle
    assert np.abs(np.linalg.norm(out, axis=1) - 0.5).max() < 2e-6
    assert np.abs((at.rotation @ path.rotation)[:, :, 2] - out / 0.5).max() < 2e-4
    rows = hk.path.raster([0.4, 0, 0.3], [0.1, 0, 0], [0, 0.05, 0], 0.025, surface=dome)
    assert len(rows.corners) == 4  # three lines, two steps across


@pytest.mark.parametrize("tolerance", [1e-4, 2e-3, 5e-3])
@pytest.mark.parametrize("closed", [False, True])
def test_a_blended_corner_stays_within_its_tolerance(tolerance: float, closed: bool) -> None:
    path = hk.polyline(SQUARE, closed=closed)
    smooth = hk.path.blended(path, tolerance)
    at = smooth.at(np.linspace(0, smooth.duration, 8001))
    corners = np.array(SQUARE) if closed else np.array(SQUARE)[1:3]
    for corner in corners:
        assert np.linalg.norm(at.position[:, :2] - corner, axis=1).min() == pytest.approx(tolerance, rel=5e-3)
    assert smooth.corners == () and smooth.closed == closed
    speeds = np.linalg.norm(at.velocity, axis=1)
    assert speeds.min() > 0.98 * path.speed and speeds.max() < 1.02 * path.speed
    old = path.at(np.linspace(0, path.duration, 2001)).position
    gaps = np.linalg.norm(at.position[::8, None] - old, axis=2).min(axis=1)
    assert gaps.max() < tolerance + 1e-4  # 1e-4: the spacing of what it is compared with


def test_a_blend_never_goes_beyond_the_middle_of_a_line_and_may_keep_the_start() -> None:
    wide = hk.path.blended(hk.polyline(SQUARE, closed=True), 1.0)
    assert np.linalg.norm(wide.at([0.0]).position - [0, 0, 0]) < 0.025
    assert wide.corners == ()
    kept = hk.path.blended(hk.polyline(SQUARE, closed=True), 0.005, keep_start=True)
    assert kept.corners == (0,)
    assert np.abs(kept.start).max() == 0
    back = hk.polyline([[0, 0], [0.1, 0], [0.02, 0]])
    assert hk.path.blended(back, 0.01).corners == (1,)  # it turns back on itself


def test_leads_are_tangential_and_passes_end_where_they_should() -> None:
    path = hk.spline(POINTS)
    led = hk.path.with_leads(path, 0.02, 0.03)
    assert led.corners == ()
    assert led.length == pytest.approx(path.length + 0.05)
    tangent = path.at([0.0]).velocity[0]
    assert led.start == pytest.approx(path.start - 0.02 * tangent / np.linalg.norm(tangent))
    drilled = hk.path.with_leads(path, 0.02, along=[0, 0, 2], retract=0.1)
    assert drilled.start - path.start == pytest.approx([0, 0, 0.12])
    assert drilled.end - path.end == pytest.approx([0, 0, 0.12])
    step = np.array([0, 0, 0.01])
    assert hk.path.passes(path, 3, offset=step).end == pytest.approx(path.end + 2 * step)
    assert hk.path.passes(path, 2, offset=step).end == pytest.approx(path.start + step)
    turning = hk.polyline(poses())
    same = hk.path.passes(turning, 4, offset=step, back_and_forth=False, lift=[0, 0, 0.1])
    assert same.end == pytest.approx(path.end + 3 * step)
    assert same.turned == pytest.approx(turning.turned, abs=1e-14)
    assert hk.path.passes(hk.circle([0.1, 0], [0, 0]), 3).closed


def test_a_frame_moves_points_and_turns_alike() -> None:
    F, path = np.eye(4), hk.spline(poses())
    F[:3, :3], F[:3, 3] = Rotation.from_euler("xyz", [0.4, 0.5, 0.6]).as_matrix(), [0.1, 0.2, 0.3]
    moved, t = path.in_frame(F), np.linspace(0, path.duration, 99)
    a, b = path.at(t), moved.at(t)
    assert np.abs(b.position - (a.position @ F[:3, :3].T + F[:3, 3])).max() < 1e-14
    wanted = F[:3, :3] @ a.rotation @ path.rotation
    assert np.abs(b.rotation @ moved.rotation - wanted).max() < 1e-13
    assert np.abs(shape("frame").at(t).position - b.position).max() < 1e-14


def test_joined_paths_must_meet_in_one_orientation() -> None:
    path = hk.spline(poses())
    whole = hk.path.join(hk.line(POINTS[0] - [0.1, 0, 0], POINTS[0]), path)
    assert whole.rotation == pytest.approx(path.rotation)
    with pytest.raises(ArgumentError, match="rotations where two paths meet"):
        hk.path.join(path, path)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: hk.spline([[0, 0]]), ArgumentError, "at least two"),
        (lambda: hk.spline([[0, 0], [1, 0]], times=[0, 0]), ArgumentError, "after the one before"),
        (lambda: hk.spline([[0, 0], [1, 0], [1, 1]], times=[0, 1, 2], closed=True), ArgumentError, "point again"),
        (lambda: hk.spline(2 * np.tile(np.eye(4), (3, 1, 1))), ArgumentError, "0, 0, 0, 1"),
        (lambda: hk.path.path_of(lambda t: [t, 0, 0]), ArgumentError, "start and the end"),
        (lambda: hk.path.raster([0, 0], [1, 0, 0], [1, 1, 0], 0.1), ArgumentError, "perpendicular"),
        (lambda: hk.path.raster([0, 0], [1, 0, 0], [0, 1, 0], 1e-6), ArgumentError, "larger spacing"),
        (lambda: hk.path.figure_eight([0, 0], 0.1, along=[0, 0, 1]), ArgumentError, "not the normal's"),
        (lambda: hk.path.blended(hk.polyline(SQUARE), 0), ArgumentError, "in metres"),
        (lambda: hk.polyline(poses(), turns=TURNS[:4]), ArgumentError, "the poses say"),
    ],
)  # fmt: skip
def test_a_bad_shape_is_refused_with_a_cure(call, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        call()


# --- Sets of tool poses: they hold what they say, evenly, and the same for the same seed.


COUNT = 4096
DOWN = np.diag([1.0, -1.0, -1.0])


def unevenness(values: np.ndarray, *spread: float) -> float:
    """The largest distance of how many lie below a value from how many would (Kolmogorov and Smirnov).

    Args:
        spread: least value and range; by default 0 and 1.
    """
    from scipy.stats import kstest  # here, since it takes long to import

    return float(kstest(values, "uniform", spread).statistic)


def test_the_positions_of_a_box_are_even_in_each_side() -> None:
    p = hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3])).poses(COUNT)[:, :3, 3]
    for i, (middle, half) in enumerate(zip([0.5, 0, 0.3], [0.25, 0.4, 0.3], strict=True)):
        assert unevenness(p[:, i], middle - half, 2 * half) < 2e-3


def test_the_positions_of_a_cylinder_and_of_a_sphere_are_even_in_their_volume() -> None:
    p = hk.workspace(cylinder=([1, 2, 3], 0.5, 0.2)).poses(COUNT)[:, :3, 3] - [1, 2, 3]
    assert unevenness((np.hypot(p[:, 0], p[:, 1]) / 0.5) ** 2) < 2e-3
    assert unevenness(np.arctan2(p[:, 1], p[:, 0]), -np.pi, 2 * np.pi) < 2e-3
    assert unevenness(p[:, 2], -0.2, 0.4) < 2e-3
    p = hk.workspace(sphere=([1, 2, 3], 0.5)).poses(COUNT)[:, :3, 3] - [1, 2, 3]
    assert unevenness((np.linalg.norm(p, axis=1) / 0.5) ** 3) < 2e-3
    half = np.count_nonzero(p[:, 2] > 0.25) / COUNT  # Archimedes: a cap of half the radius holds 5/32 of the ball
    assert half == pytest.approx(5 / 32, abs=3e-3)


def test_the_tool_directions_are_even_on_the_cap_and_the_turns_about_the_tools_own_axis() -> None:
    """A cap's area grows as its height (Archimedes); the turn is what is left after the shortest way to the axis."""
    tilt, spin = np.radians(40), np.radians(90)
    R = hk.workspace(sphere=([0, 0, 0], 1), tilt=tilt, spin=spin).poses(COUNT)[:, :3, :3]
    z = R[:, :, 2]
    height = 1 + z[:, 2]  # above the cap's middle, the tool's z axis straight down
    assert height.max() <= 1 - np.cos(tilt) + 1e-12
    assert unevenness(height / (1 - np.cos(tilt))) < 2e-3
    assert unevenness(np.arctan2(z[:, 1], z[:, 0]), -np.pi, 2 * np.pi) < 2e-3
    turns = []
    for rotation, axis in zip(R[:500], z[:500], strict=True):
        across = np.cross([0, 0, -1], axis)
        leaning = Rotation.from_rotvec(across / np.linalg.norm(across) * np.arccos(-axis[2])).as_matrix() @ DOWN
        turns.append(Rotation.from_matrix(leaning.T @ rotation).as_rotvec())
    turns = np.array(turns)
    assert np.abs(turns[:, :2]).max() < 1e-9
    assert np.abs(turns[:, 2]).max() <= spin
    assert unevenness(turns[:, 2], -spin, 2 * spin) < 5e-3


def test_without_tilt_and_spin_all_poses_have_the_middle_rotation_and_the_centre_has_it() -> None:
    region = hk.workspace(box=([0.5, 0, 0.3], [0.1, 0.1, 0.1]))
    assert np.array_equal(region.center[:3], np.column_stack([DOWN, [0.5, 0, 0.3]]))
    assert np.allclose(region.poses(64)[:, :3, :3], DOWN, atol=1e-15)
    R = Rotation.from_rotvec([0.3, 0.2, 0.1]).as_matrix()
    turned = hk.workspace(box=([0.5, 0, 0.3], [0.1, 0.1, 0.1]), rotation=R)
    assert np.allclose(turned.poses(64)[:, :3, :3], R, atol=1e-15)


def test_the_same_seed_gives_the_same_poses_and_more_of_them_go_on_from_the_first() -> None:
    region = hk.workspace(sphere=([0, 0, 1], 0.3), tilt=0.5, spin=0.5)
    assert np.array_equal(region.poses(100, 3), region.poses(400, 3)[:100])
    assert not np.allclose(region.poses(100, 3), region.poses(100, 4))


def test_a_flat_box_and_a_disc_are_workspaces_of_a_planar_arm() -> None:
    flat = hk.workspace(box=([1, 2], [0.5, 0.2])).poses(64)[:, :3, 3]
    assert np.array_equal(flat[:, 2], np.zeros(64))
    disc = hk.workspace(cylinder=([1, 2], 0.5, 0)).poses(64)[:, :3, 3]
    assert np.array_equal(disc[:, 2], np.zeros(64))


@pytest.mark.parametrize(
    ("kind", "given", "cure"),
    [
        (ArgumentError, {}, "give one of box=, cylinder= and sphere="),
        (ArgumentError, {"box": ([0, 0, 0], [1, -1, 1])}, "not two corners"),
        (ArgumentError, {"box": ([0, 0, 0], [0, 0, 0])}, "not all zero"),
        (ShapeError, {"box": ([0, 0, 0], 0.5)}, "half sides"),
        (NotFiniteError, {"box": ([0, np.nan, 0], [1, 1, 1])}, "a point"),
        (ArgumentError, {"sphere": ([0, 0, 0], 0)}, "positive radius"),
        (ArgumentError, {"cylinder": ([0, 0, 0], 1, -1)}, "not negative"),
        (ArgumentError, {"cylinder": ([0, 0, 0], 1)}, r"the radius, half the height \[m\], as in cylinder=\(\["),
        (ArgumentError, {"box": [0.5, 0, 0.3, 0.1, 0.1, 0.1]}, r"the half sides \(3,\) \[m\], as in box=\(\["),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "tilt": 40}, "angles are in rad"),
        (ArgumentError, {"sphere": ([0, 0, 0], 1), "rotation": np.diag([1.0, 1, -1])}, "a reflection"),
    ],
)
def test_a_workspace_that_is_none_is_refused_with_the_cure(kind: type[Exception], given: dict, cure: str) -> None:
    with pytest.raises(kind, match=cure):
        hk.workspace(**given)


def table(file: Path, header: str, rows: np.ndarray) -> Path:
    file.write_text("\n".join([header, *(", ".join(f"{v:.17g}" for v in row) for row in rows)]), "utf-8")
    return file


@pytest.fixture
def some_poses() -> np.ndarray:
    return hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3]), tilt=0.7, spin=1.5).poses(20)


def test_poses_read_from_a_csv_file_are_those_that_were_written(tmp_path: Path, some_poses: np.ndarray) -> None:
    p, turned = some_poses[:, :3, 3], Rotation.from_matrix(some_poses[:, :3, :3])
    files = {
        "quaternion": table(tmp_path / "a.csv", "x,y,z,qx,qy,qz,qw", np.hstack([p, turned.as_quat()])),
        "angles": table(tmp_path / "b.csv", "x,y,z,roll,pitch,yaw", np.hstack([p, turned.as_euler("xyz")])),
        "matrix": table(
            tmp_path / "c.csv",
            "note;" + ";".join(f"T{i}{j}" for i in range(4) for j in range(4)),
            np.hstack([np.ones((20, 1)), some_poses.reshape(20, 16)]),
        ),
    }
    files["matrix"].write_text(files["matrix"].read_text("utf-8").replace(",", ";"), "utf-8")
    for name, file in files.items():
        cloud = hk.path.read_workspace(file)
        assert np.allclose(cloud.poses(1000), some_poses, atol=1e-14), name
    degrees = table(tmp_path / "d.csv", "yaw,pitch,roll,x,y,z", np.hstack([turned.as_euler("xyz", True)[:, ::-1], p]))
    assert np.allclose(hk.path.read_workspace(degrees, angles="deg").poses(20), some_poses, atol=1e-14)
    with pytest.raises(FileError, match="say angles='deg'"):
        hk.path.read_workspace(degrees)


def test_roll_pitch_and_yaw_turn_about_the_axes_of_the_base_in_this_order(tmp_path: Path) -> None:
    R = hk.path.read_workspace(table(tmp_path / "a.csv", "x,y,z,roll,pitch,yaw", np.array([[0, 0, 0, 0.3, 0.2, 0.1]])))
    one, two, three = (Rotation.from_rotvec(a * np.eye(3)[i]) for i, a in enumerate([0.3, 0.2, 0.1]))
    assert np.allclose(R.center[:3, :3], (three * two * one).as_matrix(), atol=1e-15)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,0,0,0,0,0,1.1\n", "line 3 has a quaternion of length 1.1, 0.1 away"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0\n", "line 2 has a quaternion of length 0, 1 away from 1"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,nan,0,0,0,0,1\n", "line 3, column 'y' holds 'nan'"),
        ("x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,one\n", "line 2, column 'qw' holds 'one'"),
        ("x,y,z,qx,qy,qz,qw\n", "no poses"),
        ("x,y\n0,0\n", "has no column z"),
        ("x,y,z,qx\n0,0,0,0\n", "column 'qx' alone is no orientation"),
        ("x,y,z,x\n0,0,0,0\n", "2 columns 'x'"),
        ("x,y,z\n0,0,0\n0,0,0,1\n", "line 3 has 4 cells, the header 3"),
        ("0,0,0,0,0,0,1\n", "no header"),
        (",".join(f"T{i}{j}" for i in range(3) for j in range(4)) + "\n2,0,0,0,0,1,0,0,0,0,1,0\n", "line 2 has no rot"),
    ],
)
def test_a_table_that_holds_no_poses_is_refused_with_the_line(tmp_path: Path, text: str, fact: str) -> None:
    file = tmp_path / "poses.csv"
    file.write_text(text, "utf-8")
    with pytest.raises(FileError, match=fact):
        hk.path.read_workspace(file)
    with pytest.raises(FileError, match="no such file"):
        hk.path.read_workspace(tmp_path / "none.csv")


def test_a_cloud_gives_its_own_poses_and_of_many_some(some_poses: np.ndarray) -> None:
    cloud = pose_cloud(some_poses)
    assert isinstance(cloud, PoseCloud)
    assert np.array_equal(cloud.poses(1000), some_poses)
    few = cloud.poses(5, 1)
    assert few.shape == (5, 4, 4)
    assert all((some_poses == one).all(axis=(1, 2)).any() for one in few)
    assert np.array_equal(few, cloud.poses(5, 1))
    assert (some_poses == cloud.center).all(axis=(1, 2)).any()
    skewed = some_poses.copy()
    skewed[3, 0, 0] += 0.1
    with pytest.raises(ArgumentError, match="pose 3 of a workspace"):
        pose_cloud(skewed)


@pytest.mark.parametrize("dimension", [1, 6, 10, 11])
def test_the_points_of_workspaces_are_those_of_a_sobol_sequence_of_scipy(dimension: int) -> None:
    from scipy.stats import qmc

    for seed, power in ((0, 5), (7, 10)):
        rng = np.random.default_rng(seed)
        wanted = qmc.Sobol(dimension, scramble=True, rng=rng).random_base2(power)[: 2**power - 3]
        assert np.array_equal(sobol(dimension, 2**power - 3, seed), wanted)
