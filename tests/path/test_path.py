"""Paths: constant speed, reversal, joining, parts, the two ways round; turns that cancel close."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from holokin.base.errors import ArgumentError, NotFiniteError, OpenPathError, ShapeError
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
        (lambda: hk.polyline([[0, 0, 0], [0, np.nan, 0]]), NotFiniteError),
        (lambda: hk.polyline([[0, 0, 0, 0], [0, 1, 0, 0]]), ShapeError),
        (lambda: hk.polyline(POINTS, turns=[[0, 0, 0]]), ShapeError),
        (lambda: hk.line([0, 0], [1, 1], speed=-1), ArgumentError),
        (lambda: hk.path.arc([0.1, 0], [0.1, 0], 1.0), ArgumentError),
        (lambda: hk.path.arc([0.1, 0], [0, 0], 1.0, normal=[1, 0, 0]), ArgumentError),
        (lambda: hk.path.arc([0.1, 0], [0, 0], np.inf), ArgumentError),
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
