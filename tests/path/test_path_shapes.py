"""Splines, shapes over patches, blends, leads and passes: against SciPy, closed forms and finite differences."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

import holokin as hk
from holokin.base.errors import ArgumentError, NotFiniteError, ShapeError

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
        (lambda: hk.spline([[0, 0], [1, np.nan]]), NotFiniteError, "NaN"),
        (lambda: hk.spline([[0, 0], [1, 0]], times=[0, 0]), ArgumentError, "after the one before"),
        (lambda: hk.spline([[0, 0], [1, 0]], times=[0, 1, 2]), ShapeError, "one for each waypoint"),
        (lambda: hk.spline([[0, 0], [1, 0], [1, 1]], times=[0, 1, 2], closed=True), ArgumentError, "point again"),
        (lambda: hk.spline(2 * np.tile(np.eye(4), (3, 1, 1))), ArgumentError, "0, 0, 0, 1"),
        (lambda: hk.path.path_of(lambda t: [t, 0, 0]), ArgumentError, "start and the end"),
        (lambda: hk.path.raster([0, 0], [1, 0, 0], [1, 1, 0], 0.1), ArgumentError, "perpendicular"),
        (lambda: hk.path.raster([0, 0], [1, 0, 0], [0, 1, 0], 1e-6), ArgumentError, "larger spacing"),
        (lambda: hk.path.figure_eight([0, 0], 0.1, along=[0, 0, 1]), ArgumentError, "not the normal's"),
        (lambda: hk.path.blended(hk.polyline(SQUARE), 0), ArgumentError, "in metres"),
        (lambda: hk.polyline(poses(), turns=TURNS[:4]), ArgumentError, "the poses say"),
        (lambda: hk.path.passes(hk.polyline(SQUARE), 0), ArgumentError, "whole number"),
        (lambda: hk.path.raster([0, 0], [1, 0, 0], [0, 1, 0], 0.5, surface=lambda u, v: np.nan), NotFiniteError, "NaN"),
    ],
)  # fmt: skip
def test_a_bad_shape_is_refused_with_a_cure(call, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        call()
