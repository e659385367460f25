"""Paths gone by numerical continuation: which strategies have them, and the numbers and code that continuation.c needs.

Pieces of a path that are shown to keep to the branch of the start take most of the time of an answer. A step of
continuation is not shown. It counts where the prediction is near, Newton's method contracts, [J; J_g] keeps its sign
and is not nearly singular, now or, as rcond falls, in the next step, and where the joints' motion agrees with their
rates at both ends. It was tested on poses over whole arms, with paths that are shown as the referee: docs/inverse.md.

A fold narrower than a step would not be seen. So it is left to strategies whose formulas bend no more than arms do:
those that the library writes down, and polynomials of what a formula reads and of sines and cosines of that.
"""

from __future__ import annotations

from ...strategies import HolonomicStrategy, may_jump
from ...symbolic import Formula, Function, bends_widely, horzcat, symbol

NUMBERS = {
    # Largest joint motion [joint unit] of a step at the rates where it begins; the first one has half of it.
    "STRIDE": 1.0,
    # How far a joint may be from its prediction [joint unit].
    "OFF": 0.2,
    # How far the joints' motion may be from the mean of the rates at its ends, over the largest joint's motion. Without
    # this, 160 of 2,400 answers for folds of a cubic were wrong.
    "BEND": 0.2,
    # By what share rcond may fall in a step, and is expected to. Without this, one answer in 50,000 was beyond a fold.
    "FALL": 0.5,
    # rcond at which a path is left to shown pieces, as a share of that at the start.
    "SLACK": 1e-3,
    # Steps tried at most, and the shortest one, as a share of the path.
    "STRIDES": 120,
    "SHORTEST_STRIDE": 1e-4,
}


def continuation_code(strategy: HolonomicStrategy) -> str:
    """C that continuation.c needs; empty where paths are gone in pieces alone."""
    if not _continues(strategy):
        return ""
    head = "".join(f"#define HK_{key} {value!r}\n" for key, value in NUMBERS.items())
    return f"#define HK_CONTINUED\n{head}{_leaf_ahead(strategy).c('hk_ahead_body')}"


def _continues(strategy: HolonomicStrategy) -> bool:
    """Whether no formula of a strategy may bend twice within a step."""
    if may_jump(strategy) or strategy.looped is not strategy or strategy.transport is not None:
        return False
    c, e = strategy.constraint, strategy.expressions
    whole = Formula(strategy.constraint_expression, e.q, e.q, c.angular)
    formulas = [whole] if c.formulas is None else c.formulas(strategy.task, e.kinematics, e.q)
    return all(bends_widely(formula) for formula in formulas)


def _leaf_ahead(strategy: HolonomicStrategy) -> Function:
    """(q, p, R, c, p', R', c') -> (Newton corrections (n,) towards two tool poses and levels, and what `leaf_step` has
    besides)."""
    e, task = strategy.expressions, strategy.task
    inputs, errors, gaps = {"q": e.q}, [], []
    for mark in ("", "_ahead"):
        (p, R), c = task._target_symbols(), symbol("c" + mark, task.n - task.m)
        p, R = symbol("p" + mark, *p.shape), symbol("R" + mark, *R.shape)
        inputs |= {"p" + mark: p, "R" + mark: R, "c" + mark: c}
        errors.append(task._error_expression(e.kinematics, p, R))
        gaps.append(strategy.leaf_gap(c))
    solution = e.rate(horzcat(*errors), horzcat(*gaps))
    outputs = {"dq": solution.X[:, 0], "ahead": solution.X[:, 1], "rcond": solution.rcond}
    outputs |= {"margin": strategy._margin_expression, "side": solution.orientation}
    return Function("leaf_ahead", inputs, outputs, solution.system)
