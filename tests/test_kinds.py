"""The three kinds of strategies, and what is built of them once."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable

import numpy as np
import pytest

import holokin as hk
from conftest import PPR_START
from holokin.errors import ArgumentError
from holokin.motion.branch import extended_jacobian
from holokin.motion.leaf import leaf_step
from holokin.motion.velocity import path_rate
from holokin.strategies import FrameStrategy, HolonomicStrategy, KernelStrategy, RowStrategy, fitted, pfaffian

LINE = hk.line([0.0, 0.0], [0.1, 0.0])
ASKS_FOR_A_LEAF: dict[str, Callable[[hk.Strategy], object]] = {
    "move_to_leaf": lambda s: hk.move_to_leaf(s, PPR_START),  # type: ignore[arg-type]
    "inverse": lambda s: hk.inverse(s, PPR_START),  # type: ignore[arg-type]
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
    hk.curvature(held, PPR_START), hk.analysis.filtration(held, PPR_START)
    hk.follow(held, hk.line(*(held.task.robot.pose(PPR_START)[:3, 3] + s for s in (0.0, 0.01))), PPR_START, samples=3)
    gone = weakref.ref(held)
    del held
    gc.collect()
    assert gone() is None
