"""Robots, tasks, constraints and strategies are equal when they are made of equal parts, and are keys then."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled, urdf
from holokin import strategies
from holokin.robot.formats.loading import catalogue
from holokin.strategies import constraints


def panda(**more: Any) -> hk.Robot:
    return hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp", **more)


def bend(q: ca.SX) -> ca.SX:
    """A function of a user's."""
    return q[0] - 0.3 * ca.sin(q[2])


ALIKE: dict[str, Callable[[], Any]] = {
    "robot of a URDF": panda,
    "robot with a tool": lambda: hk.with_tool(panda(), [0, 0, 0.1]),
    "robot of a table": lambda: hk.from_dh([{"a": 0.3}, {"a": 0.2, "alpha": 1.0}]),
    "position": lambda: hk.position(panda()),
    "pose": lambda: hk.pose(panda(), "zyz"),
    "axis": lambda: hk.pose(panda(), "axis", axis=[0, 0, 1]),
    "task of your own": lambda: hk.custom_task(panda(), bend, units=("rad",)),
    "four rows of your own": lambda: hk.custom_task(panda(), four, units=("rad",) * 4),
    "stacked": lambda: hk.stacked(hk.position(panda()), hk.custom_task(panda(), bend, units=("rad",))),
    "lock": lambda: hk.lock(2),
    "linear": lambda: hk.linear([1, 0, -1, 0, 0, 0, 0]),
    "custom": lambda: hk.custom(bend),
    "arm angle": hk.arm_angle,
    "stationary": lambda: hk.stationary(constraints.posture_cost(PANDA_START.copy()), free=(4,)),
    "sum": lambda: constraints.total(hk.lock(2), hk.custom(bend), weights=[1.0, 2.0]),
    "pseudo-inverse": lambda: hk.moore_penrose(hk.pose(panda())),
    "weighted": lambda: hk.weighted(hk.pose(panda()), np.diag(np.arange(1.0, 8.0))),
    "held": lambda: hk.holonomic(hk.pose(panda()), hk.arm_angle()),
    "held by a function": lambda: hk.holonomic(hk.pose(panda()), hk.custom(bend)),
    "radial": lambda: hk.radial(hk.moore_penrose(hk.pose(panda())), PANDA_START.copy(), steps=2),
    "rows": lambda: strategies.pfaffian(hk.pose(panda()), bend),
}


def four(q: ca.SX) -> list[Any]:
    """More rows than a frame has coordinates."""
    return [q[0], q[1] + q[2], ca.sin(q[3]), q[4]]


@pytest.mark.parametrize("name", ALIKE)
def test_what_is_made_twice_is_equal_and_one_key(name: str) -> None:
    one, other = ALIKE[name](), ALIKE[name]()
    assert one is not other
    assert one == other
    assert hash(one) == hash(other)
    assert {one: "kept"}[other] == "kept"
    if name not in ("task of your own", "four rows of your own", "stacked"):  # these refuse to be pickled
        assert len({one, other, pickle.loads(pickle.dumps(one))}) == 1


@sampled(5, "name", sorted(catalogue()))
def test_a_robot_of_the_catalogue_loaded_twice_is_equal(name: str) -> None:
    one = hk.load(name)
    again = pickle.loads(pickle.dumps(replace(one, source="elsewhere")))
    assert one == again
    assert hash(one) == hash(again)


def moved(robot: hk.Robot) -> hk.Robot:
    coordinates = (replace(robot.coordinates[0], upper=robot.upper[0] - 1e-9), *robot.coordinates[1:])
    return replace(robot, coordinates=coordinates)


DIFFERENT: dict[str, Callable[[], tuple[Any, Any]]] = {
    "another limit": lambda: (panda(), moved(panda())),
    "another tool": lambda: (hk.with_tool(panda(), [0, 0, 0.1]), hk.with_tool(panda(), [0, 0, 0.1 + 1e-12])),
    "another mounting": lambda: (panda(), hk.with_base_pose(panda(), [0, 0, 1e-9])),
    "another tip": lambda: (panda(), hk.from_urdf(urdf("panda.urdf"), tip="panda_link8")),
    "another name": lambda: (panda(), replace(panda(), name="left")),
    "other shapes": lambda: (panda(), replace(panda(), shapes=())),
    "another orientation": lambda: (hk.pose(panda(), "zyz"), hk.pose(panda(), "rpy")),
    "fewer rows": lambda: (hk.pose(panda()), hk.pose(panda())[:3]),
    "another joint": lambda: (hk.lock(2), hk.lock(3)),
    "another constraint": lambda: (hk.lock(2), hk.linear([0, 0, 1, 0, 0, 0, 0])),
    "another function": lambda: (hk.custom(bend), hk.custom(lambda q: bend(q))),
    "another weight": lambda: (hk.weighted(hk.pose(panda()), np.eye(7)), hk.weighted(hk.pose(panda()), 2 * np.eye(7))),
    "another start": lambda: tuple(
        hk.radial(hk.moore_penrose(hk.pose(panda())), PANDA_START + d, steps=2) for d in (0.0, 1e-12)
    ),
    "another robot below": lambda: (hk.moore_penrose(hk.pose(panda())), hk.moore_penrose(hk.pose(moved(panda())))),
    "no strategy": lambda: (hk.moore_penrose(hk.pose(panda())), "Moore-Penrose"),
}  # fmt: skip


@pytest.mark.parametrize("make", DIFFERENT.values(), ids=DIFFERENT)
def test_what_differs_is_not_equal(make: Callable[[], tuple[Any, Any]]) -> None:
    one, other = make()
    assert one != other
    assert len({one, other}) == 2


def test_a_key_costs_little_after_the_first_time() -> None:
    """It is 32 bytes, kept: a call of a dictionary takes less than what a strategy takes to be evaluated."""
    law = hk.holonomic(hk.pose(panda()), hk.arm_angle())
    kept = {law: 1}
    assert len(law._digest) == 32
    begin = time.process_time()
    for _ in range(10_000):
        kept[law]
    assert time.process_time() - begin < 0.1
    assert pickle.loads(pickle.dumps(law))._digest == law._digest
    assert b"digest" not in pickle.dumps(law.task.robot)  # it is computed again where it is wanted


def test_the_order_and_the_kind_of_numbers_do_not_count_but_their_values_do() -> None:
    assert hk.linear([1, 0, -1]) == hk.linear(np.array([1.0, -0.0, -1.0])) == hk.linear(matrix=(1.0, 0, -1))
    assert hk.linear([1, 0, -1]) != hk.linear([1, -1, 0])
    assert hk.linear([1, 0, -1]) != hk.linear([[1, 0, -1]], name="other")


def test_what_an_equal_robot_was_proven_for_is_taken() -> None:
    """A region belongs to a strategy by value: to the same one made anew, and to no other."""
    task = hk.position(hk.load("planar-3r"))
    q0 = np.array([0.3, 0.6, 0.5])
    law = hk.holonomic(task, hk.lock(2))
    region = hk.unique_region(law, q0)
    anew = hk.holonomic(hk.position(replace(hk.load("planar-3r"))), hk.lock(2))
    ik = hk.ik(anew, q0, region=region)
    assert np.allclose(ik(task.pose(q0)), q0)
    with pytest.raises(hk.HolokinError):
        hk.ik(hk.holonomic(task, hk.lock(1)), q0, region=region)
