"""The largest part of a workspace, round its centre, that a law serves from end to end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from itertools import product

import numpy as np

from ...base.types import Array
from ...path.workspaces import PoseRange

HALVINGS = 7
"""Halvings of the share that is looked for: it is right to 1 %."""

TESTED = 128
"""Poses of a part that must all be served; as many others, drawn anew, confirm the last one."""

LEAST = 0.05
"""Share of the sides below which a part is of no use, and turns are shrunk as well."""

SAFER = 0.95
"""By which a part shrinks as long as poses drawn anew are not all served."""

Serves = Callable[[Array], bool]
"""Whether all of some poses (k, 4, 4) are served."""


def largest_part(workspace: PoseRange, serves: Serves) -> tuple[float, PoseRange] | None:
    """(share of its sizes, the part): positions shrunk about the centre, turns kept; both shrunk if these do not allow
    any positions. None where not even that leaves a part.
    """
    for turns_too in (False, True):
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            fits = serves(tested(shrunk(workspace, middle, turns_too), 0))
            low, high = (middle, high) if fits else (low, middle)
        while low > LEAST:
            part = shrunk(workspace, low, turns_too)
            if serves(tested(part, 1)):
                return low, part
            low *= SAFER
    return None


def tested(part: PoseRange, seed: int) -> Array:
    """Poses (k, 4, 4) of a part: even ones, and the corners of a box with the middle orientation."""
    corners = np.array(list(product((0.0, 1.0), repeat=3)))
    return np.concatenate([part.poses(TESTED, seed), part.at(part.solid.points(corners))])


def shrunk(workspace: PoseRange, share: float, turns_too: bool) -> PoseRange:
    """A workspace whose positions, and its turns as well if asked for, reach only so far from its centre."""
    solid = workspace.solid
    lengths = {f.name: share * getattr(solid, f.name) for f in fields(solid) if f.name != "center"}
    turns = {"tilt": share * workspace.tilt, "spin": share * workspace.spin} if turns_too else {}
    return replace(workspace, solid=replace(solid, **lengths), **turns)
