"""Robots, tasks, constraints and strategies are equal when they are made of equal parts, and are keys then."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled, urdf
from holokin import strategies
from holokin.analysis import curvature
from holokin.analysis.audit import logs
from holokin.app import survey
from holokin.base.errors import HolokinError
from holokin.motion import control, ik
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


# --- Values keep what they were given: copies of arrays, that nobody can write to; values are copied and pickled.


Q = np.array([0.3, 0.7, -0.5])


def values(robot: hk.Robot) -> dict[str, Any]:
    """Public values by name, each looked at from all sides so that what they keep computed is there."""
    task, start = hk.pose(robot, rows=[0, 1]), robot.pose(Q)[:3, 3]
    law, held = hk.moore_penrose(task), hk.holonomic(task, hk.lock(0))
    loop = hk.circle(start, start + [0.02, 0, 0])
    ik, leaf = hk.ik(held, Q), curvature.leaf_function(held, Q, samples=1)
    found = {
        "robot": robot, "task": task, "pseudo-inverse": law, "held": held, "circle": loop,
        "polyline": hk.polyline([[0, 0], [1, 0], [1, 1]], turns=[[0, 0, 0.1]] * 2), "region": hk.around(Q, 0.1),
        "ball": curvature.ball(Q, 0.1), "weighted": hk.weighted(task, np.diag([1.0, 2.0, 3.0])),
        "self-motion": hk.strategies.self_motion_curve(task, Q, length=0.2), "verdict": hk.involutivity(law,
        hk.around(Q, 0.1)),
        "inverse": ik, "leaf function": leaf, "servo": hk.controller(held, dt=0.01, q0=Q),
        "walk": hk.follow(law, loop, Q, samples=8), "drift": hk.drift(held, loop, Q, samples=8),
        "spread": hk.motion.path_spread(law, loop, loop.reversed(), Q, samples=8),
        "general form": curvature.general_form(held, Q),
        "simulate": hk.simulate(control.closed_loop(law), task, loop, Q, dt=0.1),
        "controller": control.closed_loop(law),
        "distance_to_repeatable": curvature.distance_to_repeatable(law, curvature.ball(Q, 0.02), samples=2),
        "filtration": curvature.filtration(law, Q),
        "audit": hk.audit(control.closed_loop(law), task, [loop], q0=Q, dt=0.2),
        "recording": logs.Recording(tuple(robot.joint_names), np.arange(3.0), np.zeros((3, 3)), "here"),
        "radial": hk.radial(law, Q), "stack": constraints.stack(hk.lock(0), hk.linear([1, 0, 0])),
        "stationary": hk.stationary(constraints.posture_cost(Q)), "impedance": hk.strategies.impedance(task,
        constraints.posture_cost(Q)),
    }  # fmt: skip
    ik(robot.pose(Q)), leaf(Q), leaf.gradient(Q)
    for value in found.values():
        if isinstance(value, hk.Strategy):  # some of its functions are of strategies given by rows alone
            continue
        for name in dir(type(value)):
            if (
                isinstance(getattr(type(value), name, None), property)
                or "cached" in type(getattr(type(value), name, None)).__name__
            ):
                getattr(value, name)
    return found


def kept(value: Any, where: str, seen: set[int]) -> Iterator[tuple[str, np.ndarray]]:
    """Every array that a public value, or a value of ours in it, keeps."""
    if id(value) in seen:
        return
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        yield where, value
    elif isinstance(value, tuple | list):
        for k, part in enumerate(value):
            yield from kept(part, f"{where}[{k}]", seen)
    elif type(value).__module__.startswith("holokin") and hasattr(value, "__dict__"):
        fields = {f.name for f in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else set()
        for name, part in vars(value).items():
            if name in fields or not name.startswith("_") or "cached" in type(getattr(type(value), name, 0)).__name__:
                yield from kept(part, f"{where}.{name}", seen)


@pytest.fixture(scope="module")
def everything(planar_3r: hk.Robot) -> dict[str, Any]:
    return values(planar_3r)


def test_no_array_that_a_value_keeps_can_be_written_to(everything: dict[str, Any]) -> None:
    found = [pair for name, value in everything.items() for pair in kept(value, name, set())]
    assert len(found) > 100
    assert {where for where, array in found if array.flags.writeable} == set()


@pytest.mark.parametrize(
    ("array", "use"),
    [
        (np.diag([1.0, 2.0, 3.0]), lambda task, W: hk.weighted(task, W)),
        (np.array([1.0, 0.0, -1.0]), lambda task, A: hk.linear(A)),
        (np.array([0.1, 0.2, 0.3]), lambda task, q: hk.stationary(constraints.posture_cost(q))),
        (np.array([1.0, 2.0, 3.0]), lambda task, k: hk.stationary(constraints.posture_cost(Q, k))),
        (Q.copy(), lambda task, q: hk.radial(hk.moore_penrose(task), q)),
        (
            Q + 0.01 * np.arange(30).reshape(10, 3),
            lambda task, Q: hk.strategies.fitted(hk.holonomic(task, hk.lock(0)), Q, degree=1),
        ),
        (np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]]), lambda task, P: hk.polyline(P)),
        (np.array([0.0, 0.0, 1.0]), lambda task, p: hk.line(p, p + 1)),
        (Q.copy(), lambda task, q: hk.ik(hk.holonomic(task, hk.lock(0)), q)),
        (Q.copy(), lambda task, q: curvature.leaf_function(hk.holonomic(task, hk.lock(0)), q, samples=1)),
        (Q.copy(), lambda task, q: curvature.ball(q, 0.1)),
        (np.eye(3), lambda task, R: hk.pose(task.robot, "rotation-vector", reference=R, rows=[0, 1, 2])),
        (np.zeros((3, 3)), lambda task, q: logs.Recording(("a", "b", "c"), np.arange(3.0), q, "here")),
    ],
)
def test_a_value_does_not_change_with_the_array_that_it_was_made_from(
    planar_3r: hk.Robot, array: np.ndarray, use: Callable[[hk.Task, np.ndarray], Any]
) -> None:
    task, before = hk.position(planar_3r), array.copy()
    meant = answer(task, use(task, before))
    given = use(task, array)
    array += 0.25  # what a caller may do with an array of his own
    assert answer(task, given) == meant


def answer(task: hk.Task, value: Any) -> Any:
    """What a value says, asked now."""
    if isinstance(value, hk.Constraint):
        value = hk.holonomic(task, value)
    if isinstance(value, hk.Strategy):
        return value(Q + 0.05).tolist()
    if isinstance(value, hk.Task):
        return value(Q).tolist()
    if isinstance(value, hk.Path):
        return value.at(np.linspace(0, value.duration, 5)).position.tolist()
    if isinstance(value, ik.InverseKinematics):
        return value(task.robot.pose(Q + 0.02)).tolist()
    if isinstance(value, curvature.LeafFunction):
        return value(Q + 0.02).tolist()
    return [np.asarray(getattr(value, f.name)).tolist() for f in dataclasses.fields(value)]


def test_public_values_are_pickled_and_copied_and_answer_as_before(
    planar_3r: hk.Robot, everything: dict[str, Any]
) -> None:
    task = hk.position(planar_3r)
    for name, value in everything.items():
        there, twin, same = pickle.loads(pickle.dumps(value)), copy.deepcopy(value), copy.copy(value)
        for other in (there, twin, same):
            assert type(other) is type(value), name
            assert all(not array.flags.writeable for _, array in kept(other, name, set())), name
        asked = hk.Strategy | hk.Constraint | ik.InverseKinematics | curvature.LeafFunction | hk.Path
        if isinstance(value, asked):
            if isinstance(value, hk.Constraint) and value.rows != 1:
                continue
            assert answer(there.task if isinstance(there, hk.Strategy) else task, there) == answer(task, value), name


def test_a_robot_from_another_process_stands_where_the_first_does(panda: hk.Robot) -> None:
    q = np.linspace(-0.5, 0.5, panda.n) + [0, 0, 0, -1.5, 0, 1.5, 0]
    panda.pose(q)  # so that it keeps compiled functions
    other = pickle.loads(pickle.dumps(panda))
    assert np.array_equal(other.pose(q), panda.pose(q)) and other.joint_names == panda.joint_names
    assert np.array_equal(other.lower, panda.lower)
    task = pickle.loads(pickle.dumps(hk.pose(panda, "rpy", rows=[0, 1, 2])))
    assert np.array_equal(task(q), hk.pose(panda, "rpy", rows=[0, 1, 2])(q))


def test_a_trajectory_is_pickled_with_its_figures(planar_3r: hk.Robot) -> None:
    start = planar_3r.pose(Q)[:3, 3]
    walk = hk.follow(hk.moore_penrose(hk.position(planar_3r)), hk.circle(start, start + [0.02, 0, 0]), Q, samples=8)
    other = pickle.loads(pickle.dumps(walk))
    for name in ("t", "q", "dq", "x", "error", "sigma", "residual"):
        assert np.array_equal(getattr(other, name), getattr(walk, name)), name
    assert other.status is walk.status


@pytest.mark.parametrize(
    "value",
    [
        lambda task: hk.custom(lambda q: q[0]),
        lambda task: hk.holonomic(task, hk.custom(lambda q: q[0])),
        lambda task: hk.null_basis(task, lambda q: np.eye(3)[:, :2]),
        lambda task: dataclasses.replace(hk.moore_penrose(task), name="by hand"),
    ],
)
def test_a_law_made_with_a_function_of_ones_own_says_why_it_is_not_pickled(
    planar_3r: hk.Robot, value: Callable[[hk.Task], Any]
) -> None:
    made = value(hk.position(planar_3r))
    with pytest.raises(HolokinError, match="cannot be pickled:") as caught:
        pickle.dumps(made)
    assert "\n" not in str(caught.value)
    assert copy.deepcopy(made) is made


def test_an_error_comes_from_another_process_as_it_was(planar_3r: hk.Robot) -> None:
    """Of arguments, of a walk that stops, of a survey: with their message, their facts and the walk so far."""
    tool = planar_3r.pose(Q)[:3, 3]
    law = hk.moore_penrose(hk.pose(planar_3r, rows=[0, 1]))
    asked: list[Callable[[], Any]] = [
        lambda: hk.load("pandda"),
        lambda: hk.circle(tool, center=[0, 0, 0], speed=-1.0),
        lambda: hk.follow(law, hk.polyline([tool, 9 * tool]), Q),
        lambda: survey.Store.opened(Path("nowhere.sqlite"), None).__enter__(),
    ]
    for ask in asked:
        with pytest.raises(HolokinError) as told:
            ask()
        problem = told.value
        sent = pickle.loads(pickle.dumps(problem))
        assert (type(sent), str(sent), set(vars(sent))) == (type(problem), str(problem), set(vars(problem)))
        if (walk := getattr(problem, "trajectory", None)) is not None:
            np.testing.assert_array_equal(sent.trajectory.q, walk.q)
