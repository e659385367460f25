"""The three kinds of strategies, and what is built of them once."""

from __future__ import annotations

import gc
import pickle
import weakref
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PPR_START
from holokin.base.errors import ArgumentError
from holokin.base.types import kept
from holokin.motion.follow_path import path_rate
from holokin.motion.ik.branch import extended_jacobian
from holokin.motion.ik.leaf import leaf_step
from holokin.strategies import FrameStrategy, HolonomicStrategy, KernelStrategy, RowStrategy, fitted, pfaffian

LINE = hk.line([0.0, 0.0], [0.1, 0.0])
ASKS_FOR_A_LEAF: dict[str, Callable[[hk.Strategy], object]] = {
    "move_to_leaf": lambda s: hk.motion.ik.move_to_leaf(s, PPR_START),  # type: ignore[arg-type]
    "inverse": lambda s: hk.ik(s, PPR_START),  # type: ignore[arg-type]
    "fitted": lambda s: fitted(s, PPR_START[None]),  # type: ignore[arg-type]
    "follow by leaf": lambda s: hk.follow(s, LINE, PPR_START, method="leaf"),
}


@pytest.fixture(scope="module")
def ppr_task() -> hk.Task:
    return hk.position(hk.load("ppr"))


def strategies(task: hk.Task) -> list[hk.Strategy]:
    rows = pfaffian(task, lambda q: [[-0.5, -0.5, 1]])
    return [hk.moore_penrose(task), rows, hk.holonomic(task, hk.linear([-0.5, -0.5, 1]))]


def test_every_strategy_is_of_one_final_kind(ppr_task: hk.Task) -> None:
    frame, rows, held = strategies(ppr_task)
    assert [type(s) for s in (frame, rows, held)] == [FrameStrategy, RowStrategy, HolonomicStrategy]
    assert type(hk.radial(frame, PPR_START)) is HolonomicStrategy
    for abstract in (hk.Strategy, KernelStrategy):
        with pytest.raises(TypeError, match="abstract"):
            abstract("mine", ppr_task)
    assert np.abs(rows(PPR_START) - held(PPR_START)).max() < 1e-15


@pytest.mark.parametrize("verb", ASKS_FOR_A_LEAF)
def test_who_needs_a_leaf_refuses_a_strategy_without_one_and_says_how_to_make_one(verb: str, ppr_task: hk.Task) -> None:
    for strategy in strategies(ppr_task)[:2]:
        with pytest.raises(ArgumentError, match=r"hk\.holonomic\(task, g\).*hk\.radial\(G, q0\)"):
            ASKS_FOR_A_LEAF[verb](strategy)


def test_what_is_built_of_a_strategy_is_built_once_and_goes_with_it(ppr_task: hk.Task) -> None:
    held = hk.holonomic(ppr_task, hk.linear([-0.5, -0.5, 1]))
    for verb in (leaf_step, path_rate, extended_jacobian):
        assert verb(held) is verb(held)
    hk.curvature(held, PPR_START), hk.analysis.curvature.filtration(held, PPR_START)
    hk.follow(held, hk.line(*(held.task.robot.pose(PPR_START)[:3, 3] + s for s in (0.0, 0.01))), PPR_START, samples=3)
    gone = weakref.ref(held)
    del held
    gc.collect()
    assert gone() is None


def test_what_is_built_may_hold_its_strategy_and_still_goes_with_it(ppr_task: hk.Task) -> None:
    pair = kept(lambda strategy, more: (strategy, more))
    held = hk.holonomic(ppr_task, hk.linear([-0.5, -0.5, 1]))
    assert pair(held, 1) is pair(held, 1)
    assert pair(held, 1) is not pair(held, 2)
    assert "_kept" not in vars(pickle.loads(pickle.dumps(held)))
    gone = weakref.ref(held)
    del held
    gc.collect()
    assert gone() is None


def test_the_inverse_weight_is_that_of_weighted(ppr: hk.Robot) -> None:
    """W = H H^T of a strategy, inverted, is a weight with which the weighted pseudo-inverse is the strategy."""
    task, q = hk.position(ppr), np.array([0.2, -0.4, 0.7])
    law = hk.weighted(task, np.diag([1.0, 2.0, 5.0]))
    again = hk.weighted(task, np.linalg.inv(law.inverse_weight(q)))
    assert again(q) == pytest.approx(law(q), abs=1e-14)


def test_a_frame_that_is_not_finite_is_told_and_no_singularity(ppr: hk.Robot) -> None:
    law = hk.null_basis(hk.position(ppr), lambda q: [[1 / (q[0] - q[0]), 0], [0, 1], [0, 0]])
    with pytest.raises(hk.base.errors.NotFiniteError, match="division by zero"):
        law([0.1, 0.2, 0.3])


def test_formulas_are_looked_at_within_the_limits() -> None:
    """A slide from 2 to 3 m: at zero, beyond its limits, the weight is not positive."""
    rows = [{"kind": "prismatic", "lower": 2.0, "upper": 3.0}, {"a": 0.4}, {"a": 0.3}]
    task = hk.position(hk.from_dh(rows), rows=[2])
    assert hk.weighted(task, lambda q: ca.diag(ca.vertcat(q[0] - 1.5, 1, 1))).task is task
