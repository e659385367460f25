"""Coordinates without a robot, for tasks x = f(u) of any other kind, as control allocation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, ShapeError
from ..base.types import ArrayLike, one_or_each
from .joints import Coordinate
from .model import Robot


@typed
def coordinates(
    names: Sequence[str],
    *,
    lower: ArrayLike = -np.inf,
    upper: ArrayLike = np.inf,
    max_velocity: ArrayLike = np.inf,
    units: str | Sequence[str] = "1",
    name: str = "coordinates",
) -> Robot:
    """Coordinates u (n,) with limits and no links, for `custom_task`: the thrusts and angles of a ship's thrusters.

    Whatever needs the pose of a tool is refused.

    Args:
        names: of each coordinate.
        lower, upper: limits, one number for all or one each.
        max_velocity: largest rates [unit/s], likewise.
        units: of each, or one for all: "N", "m", "rad" of an angle; "1" where there is none.
        name: of the whole.

    Raises:
        ArgumentError: no names, two alike, or a bad limit. ShapeError: limits or units that are not one for each.
    """
    known = tuple(names)
    if not known:
        raise ArgumentError("the names of the coordinates", known, "give at least one")
    each = (units,) * len(known) if isinstance(units, str) else tuple(units)
    if len(each) != len(known):
        raise ShapeError("the units of the coordinates", (len(known),), (len(each),))
    bounds = (one_or_each(f"{what} of the coordinates", value, len(known)) for what, value in
              (("lower", lower), ("upper", upper), ("max_velocity", max_velocity)))  # fmt: skip
    rows = zip(known, each, *bounds, strict=True)
    made = tuple(Coordinate(one, "quantity", float(a), float(b), float(v), unit) for one, unit, a, b, v in rows)
    return Robot(name, made, (), (), "coordinates without links")
