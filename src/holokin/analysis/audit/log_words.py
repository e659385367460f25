"""Words for what the audit of a log measured."""

from __future__ import annotations

import numpy as np

from ...base.types import Indices, Vector
from ...robot import Robot
from .cycles import Cycles
from .equal_poses import Distance
from .logs import Recording
from .trend import DriftTrend


def rate_words(value: float) -> str:
    """A drift with its unit."""
    return f"{value:.2g} rad or m a cycle"


def trend_words(trend: DriftTrend, phase: Vector) -> str:
    """A trend, the factor it rests on, and the phase (0 to 1) of the cycle that shows it best."""
    if np.isnan(trend.ratio):
        return trend.trend.value
    low, high = trend.ratio_range
    return (
        f"{trend.trend.value}: each of the last {trend.latest} changes from one cycle to the next is about "
        f"{trend.ratio:.3g} times ({low:.3g} to {high:.3g}) the one before; at {100 * phase[trend.phase]:.0f} % of the "
        "cycle the change stands out most from the noise"
    )


def by_sampling(cycles: Cycles) -> str:
    """What the log's samples alone may make of the residual, where that is a good part of it."""
    share = cycles.residual.max() / max(cycles.sampling, 1e-300)
    return f"; its samples alone may make {cycles.sampling:.2g} m of it" if 0.05 < share < 3 else ""


def ranged(values: Vector) -> str:
    """The least and the greatest of values, or one where they agree."""
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if high - low < 5e-3 * high else f"{low:.3g} to {high:.3g}"


def listed(values: Vector, most: int = 4) -> str:
    """Values, of many the first and the last."""
    shown = [f"{v:.3g}" for v in values]
    return ", ".join(shown if len(shown) <= 2 * most else [*shown[:most], "...", *shown[-most:]])


def distance_words(distance: Distance | None, otherwise: str) -> str:
    """Whether joints differ or agree, by how much and where; `otherwise` where the log does not test it."""
    if distance is None:
        return otherwise
    word = "differ" if distance.beyond else "agree"
    return f"{word}: {distance.value:.2g} ({distance.joint}, at {100 * distance.phase:.0f} % of the cycle)"


def turns_words(log: Recording, places: Indices) -> str:
    """The first step in which a joint may have made a whole turn unseen, how many there are, and the cure."""
    i, steps = places[0, 0], len(np.unique(places[:, 0]))
    joints = ", ".join(log.joint_names[joint] for joint in places[places[:, 0] == i, 1])
    first = f"from {log.t[i]:.6g} to {log.t[i + 1]:.6g} s (samples {i} and {i + 1}) {joints}"
    more = f", and so in {steps - 1} more step{'s' if steps > 2 else ''}" if steps > 1 else ""
    return (
        f"{first} may have made a whole turn that the log does not show, at its largest speed{more}; log more often "
        "and without gaps, give speed limits to a robot that has none, or say --counts-turns (counts_turns=True) if "
        "the values of the joints count whole turns"
    )


def winding_words(change: Vector, robot: Robot, cycles: int, allowed: float) -> list[str]:
    """The hinges whose change over the log (n,) is whole turns, up to a distance that is allowed."""
    turns = np.round(change / (2 * np.pi)) * robot.hinges
    wound = np.flatnonzero((turns != 0) & (np.abs(change - 2 * np.pi * turns) <= allowed))
    many = [f"{abs(turns[i]):.0f} turn{'s' if abs(turns[i]) > 1 else ''}" for i in wound]
    said = zip(wound, many, strict=True)
    return [f"{robot.joint_names[i]} winds up: it has made {turn} in {cycles} cycles" for i, turn in said]
