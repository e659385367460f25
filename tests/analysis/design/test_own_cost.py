"""Costs of a design that a user writes: what they make less, and what is said of broken ones."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import fails
from holokin.analysis.design import Objective, OwnCost

ROBOT = hk.load("planar-3r")
TASK = hk.position(ROBOT)
Q0 = np.array([0.3, 0.6, 0.5])
SPACE = hk.workspace(box=(ROBOT.pose(Q0)[:2, 3], [0.1, 0.1]))
WISH = np.array([0.2, 0.9, 0.1])


def away(q: Any) -> Any:
    """|q - wish|^2, of numbers."""
    return float(np.sum((q - WISH) ** 2))


EXPRESSED = OwnCost("away", expression=lambda q: ca.sumsqr(q - WISH))
CALLED = OwnCost("away", function=away)


def test_a_design_comes_as_near_to_a_wish_as_any_law_can() -> None:
    """With one redundant joint the nearest posture to a wish at each pose is a law, and the bound is its cost."""
    found = hk.design(TASK, SPACE, Q0, objective=EXPRESSED, degree=2, samples=32)
    assert found.before.own["away"] > 5 * found.after.own["away"]
    assert found.bound <= found.after.own["away"] < 1.01 * found.bound
    mean = np.mean([away(q) for q in hk.ik(found.strategy, found.q0).batch(SPACE.poses(32, 0)).q])
    assert found.after.own["away"] == pytest.approx(mean, rel=1e-6)
    assert f"away {found.checked.own['away']:.5g}" in str(found.checked)
    assert pickle.loads(pickle.dumps(found.checked)).own == found.checked.own  # it is not lost where results are kept


def test_a_function_of_numbers_is_designed_for_as_its_expression_is() -> None:
    one, other = (hk.design(TASK, SPACE, Q0, objective=c, degree=1, samples=16) for c in (EXPRESSED, CALLED))
    assert one.costs == pytest.approx(other.costs, rel=1e-4)
    Q = Q0 + np.random.default_rng(0).uniform(-0.3, 0.3, (5, 3))
    assert EXPRESSED.values(Q) == pytest.approx(CALLED.values(Q))
    assert EXPRESSED.slopes(Q) == pytest.approx(2 * (Q - WISH))
    assert CALLED.slopes(Q) == pytest.approx(2 * (Q - WISH), abs=1e-7)


@pytest.mark.campaign
def test_beside_other_costs_it_counts_by_its_weight() -> None:
    def mixed(weight: float) -> Any:
        own = OwnCost("away", function=None, expression=EXPRESSED.expression, weight=weight)
        goal = Objective(squared_speed=1.0, own=own)
        return hk.design(TASK, SPACE, Q0, objective=goal, degree=1, samples=16).after

    little, much = mixed(0.01), mixed(100.0)
    assert little.squared_speed < much.squared_speed
    assert little.own["away"] > much.own["away"]


BROKEN: dict[str, tuple[Callable[[], OwnCost], str]] = {
    "raises": (lambda: OwnCost("mine", function=lambda q: 1 / 0), "raises ZeroDivisionError: division by zero"),
    "many numbers": (lambda: OwnCost("mine", function=lambda q: q), r"gives an array of shape \(3,\)"),
    "not a number": (lambda: OwnCost("mine", function=lambda q: np.nan), "gives nan"),
    "no number": (lambda: OwnCost("mine", function=lambda q: None), "gives None at q"),
    "text": (lambda: OwnCost("mine", function=lambda q: "far"), "gives 'far'"),
    "many expressions": (lambda: OwnCost("mine", expression=lambda q: q), r"shape \(3, 1\), expected \(1, 1\)"),
    "no logarithm": (lambda: OwnCost("mine", expression=lambda q: ca.log(-1 - q[0] ** 2)), "not finite at q"),
    "negative beside another": (lambda: OwnCost("mine", expression=lambda q: -1 - q[0] ** 2), "above 0"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_cost_is_told_by_its_name(name: str) -> None:
    make, words = BROKEN[name]
    with pytest.raises(hk.HolokinError, match=f"mine.*{words}"):
        hk.design(TASK, SPACE, Q0, objective=Objective(squared_speed=1.0, own=make()), degree=1, samples=8)


def test_a_cost_has_a_name_of_its_own_and_one_way_to_be_given() -> None:
    fails(hk.HolokinError, "expression= or function=", lambda: OwnCost("mine"))
    fails(hk.HolokinError, "names of the costs", lambda: Objective(own=(OwnCost("travel", function=away),)))
    fails(hk.HolokinError, "weight of mine", lambda: OwnCost("mine", function=away, weight=-1.0))
