"""Values keep what they were given: copies of arrays, that nobody can write to; values are copied and pickled."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin import motion
from holokin.analysis import curvature
from holokin.analysis.audit import logs
from holokin.app import survey
from holokin.base.errors import HolokinError
from holokin.motion import control, ik
from holokin.strategies import constraints

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
        "self-motion": hk.strategies.self_motion(task, Q, length=0.2), "verdict": hk.involutivity(law,
        hk.around(Q, 0.1)),
        "inverse": ik, "leaf function": leaf, "servo": hk.controller(held, dt=0.01, q0=Q),
        "walk": hk.follow(law, loop, Q, samples=8), "drift": hk.drift(held, loop, Q, samples=8),
        "spread": hk.motion.path_spread(law, loop, loop.reversed(), Q, samples=8),
        "predicted drift": curvature.predicted_drift(law, loop, Q),
        "winding": motion.winding(law, loop, Q, samples=8), "general form": curvature.general_form(held, Q),
        "simulate": hk.simulate(control.closed_loop(law), task, loop, Q, dt=0.1),
        "controller": control.closed_loop(law),
        "distance_to_repeatable": curvature.distance_to_repeatable(law, curvature.ball(Q, 0.02), samples=2),
        "deviation": curvature.deviation(law,
        held, [Q]),
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
    with pytest.raises(HolokinError, match=r"cannot be pickled: .*; pickle what you made it from") as caught:
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
