"""Arguments that are no numbers, out of range or of the wrong kind get an error of holokin's, not NumPy's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PPR_CENTER, PPR_START
from holokin.errors import ArgumentError, OutOfReachError, ShapeError, UnknownNameError
from holokin.trajectory import Status

ARM = """<robot name="arm"><link name="base"/><link name="a"/><link name="b"/><link name="tool"/><link name="side"/>
<joint name="first" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" velocity="1" effort="1"/></joint>
<joint name="second" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <origin xyz="1 0 0"/></joint>
<joint name="flange" type="fixed"><parent link="b"/><child link="tool"/><origin xyz="1 0 0"/></joint></robot>
"""


@pytest.fixture
def pseudo(ppr: hk.Robot) -> hk.Strategy:
    return hk.moore_penrose(hk.position(ppr))


@pytest.fixture
def circle(ppr: hk.Robot) -> hk.Path:
    return hk.circle(ppr.pose(PPR_START)[:3, 3], PPR_CENTER)


@pytest.mark.parametrize("samples", [0, -3, 2.5, "50", None])
def test_samples_are_whole_and_at_least_one(pseudo: hk.Strategy, circle: hk.Path, samples: object) -> None:
    with pytest.raises(ArgumentError, match=r"samples is .*whole number"):
        hk.involutivity(pseudo, hk.around(PPR_START, 0.2), samples=samples)
    with pytest.raises(ArgumentError, match=r"samples is .*whole number"):
        hk.follow(pseudo, circle, PPR_START, samples=samples)


def test_numpys_whole_numbers_are_whole(pseudo: hk.Strategy, circle: hk.Path) -> None:
    assert hk.involutivity(pseudo, hk.around(PPR_START, 0.2), samples=np.int64(4)).samples == 4
    assert len(hk.follow(pseudo, circle, PPR_START, samples=np.int32(8))) == 9


@pytest.mark.parametrize(
    "make",
    [
        lambda: hk.polyline([[0, 0], [1, 0, 0]]),
        lambda: hk.polyline("ab"),
        lambda: hk.polyline([[0, 0], [1, 0]], turns=[["a", 0, 0]]),
        lambda: hk.circle("a", "b"),
        lambda: hk.circle([0, 0], [1, 0], normal="z"),
        lambda: hk.arc([0, 0], [1, 0], "quarter"),
        lambda: hk.circle([0, 0], [1, 0], speed="fast"),
        lambda: hk.line([0, 0], [1, "b", 3]),
    ],
)
def test_a_path_is_made_of_numbers(make) -> None:
    with pytest.raises((ArgumentError, ShapeError)):
        make()


def test_a_normal_that_leans_is_told_by_how_much() -> None:
    with pytest.raises(ArgumentError, match=r"perpendicular.* 0\.02 m off"):
        hk.circle([0.3, 0.0, 0.52], [0.2, 0.0, 0.5])


@pytest.mark.parametrize("t", [20.0, -1e-3, [0.0, 99.0], np.nan, "late"])
def test_a_path_has_no_places_beyond_its_ends(circle: hk.Path, t: object) -> None:
    with pytest.raises(ArgumentError):
        hk.line([0, 0], [1, 0]).at(t)


def test_round_off_at_the_ends_of_a_path_is_forgiven() -> None:
    path = hk.line([0, 0], [1, 0])
    assert path.duration == pytest.approx(10.0)
    ends = path.at([-1e-12, path.duration * (1 + 1e-14)])
    assert ends.position[:, 0].tolist() == [0.0, 1.0]


def test_iterating_a_task_gives_a_task_for_each_row(panda: hk.Robot) -> None:
    task = hk.pose(panda, "rpy")
    rows = list(task)
    assert [single.row_names for single in rows] == [(name,) for name in task.row_names]
    q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    assert np.vstack([single.jacobian(q) for single in rows]) == pytest.approx(task.jacobian(q))


def test_only_a_joint_that_moves_can_be_locked_and_within_its_limits(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace('<link name="side"/>', ""))
    held = hk.from_urdf(file, locked={"first": 2.0})
    assert held.joint_names == ("second",)
    assert held.pose([0.0])[:2, 3] == pytest.approx([2 * np.cos(2.0), 2 * np.sin(2.0)])
    assert hk.from_urdf(file, locked={"second": 100.0}).n == 1  # continuous: no limits
    with pytest.raises(ArgumentError, match=r"'flange'.*fixed"):
        hk.from_urdf(file, locked={"flange": 0.0})
    with pytest.raises(ArgumentError, match=r"'first' is 2\.1.*-1 to 2"):
        hk.from_urdf(file, locked={"first": 2.1})
    for value in (np.inf, "zero", None, True):
        with pytest.raises(ArgumentError, match="finite value"):
            hk.from_urdf(file, locked={"first": value})
    with pytest.raises(UnknownNameError):
        hk.from_urdf(file, locked={"third": 0.0})


def test_a_joint_with_equal_limits_is_held_in_the_search_for_a_reachable_posture() -> None:
    """The last link stands still by its limits and by the constraint: the arm is one of links 0.5 and |(1.0, 0)|."""
    rows = [{"a": 0.5, "joint": name} for name in "abc"]
    rows[2] |= {"lower": 0.0, "upper": 0.0}
    robot = hk.from_dh(rows, "standard", name="stiff")
    strategy = hk.holonomic(hk.position(robot), hk.lock("c"))
    tool = robot.pose([0.1, 0.5, 0.0])[:3, 3]
    with pytest.raises(OutOfReachError, match="out of reach") as caught:
        hk.follow(strategy, hk.line(tool, [5.0, 0, 0]), [0.1, 0.5, 0.0], samples=50)
    walk = caught.value.trajectory
    assert walk.status is Status.OUT_OF_REACH
    assert np.linalg.norm(walk.x[-1]) == pytest.approx(1.5, abs=0.1)  # as far as the arm is long
