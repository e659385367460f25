"""Rays of a radial law: straight ways of the tool from its center, on whose leaf each pose has one posture.

The transport leads a posture back along the ray to one over the center, and where arc length labels those, no two have
one label but for full turns of joints: a posture with the level of the leaf, within the margins of the label, is taken
for the one that the ray leads to, and no folds are looked for on the way there, as `follow` does. This holds of an
exact transport; that of a few steps was compared with `follow`, not shown.
"""

from __future__ import annotations

import numpy as np

from ..strategies import HolonomicStrategy
from ..types import Vector

LEAP = 0.1
"""Joint motion [joint unit] to an answer near by that Newton's method finds in one go."""


def rays_from(strategy: HolonomicStrategy) -> Vector | None:
    """The center (n,) of a radial law whose leaves have one posture for each pose; None of other laws.

    That is where its label is arc length, and straight ways of the tool are those of its transport.
    """
    transport, task = strategy.looped.transport, strategy.task
    straight = task.turns or task.robot.planar or all(row < 3 for row in task.rows)
    return transport.center if transport is not None and straight and all(strategy.constraint.angular) else None


def on_ray(strategy: HolonomicStrategy, q: Vector) -> bool:
    """True where straight ways from q on its leaf are rays."""
    center = rays_from(strategy)
    return center is not None and np.array_equal(q, center)


def rays_code(strategy: HolonomicStrategy) -> str:
    """C that ray.c needs; empty without rays."""
    center = rays_from(strategy)
    if center is None:
        return ""
    values = ", ".join(f"HK_C({value!r})" for value in center.tolist())
    rows = ", ".join(map(str, strategy.task.rows))
    return (
        f"#define HK_RAYS\n#define HK_LEAP {LEAP}\nstatic const hk_t hk_center[] = {{{values}}};\n"
        f"static const int hk_ray_rows[] = {{{rows}}};\n"
    )
