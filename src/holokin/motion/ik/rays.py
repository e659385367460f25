"""Rays of a radial law: straight paths of the tool from its center, on whose leaf each pose has one posture.

The transport leads a posture back along the ray to one over the center. Where arc length labels those, two with one
label differ by full turns of joints alone, and the transport, which can be gone both ways, keeps that difference. So
of an exact transport the postures of one pose on the leaf, within the margins of the label, are q + 2 pi k, k whole
numbers for the joints, and no folds are looked for on the way there, as `follow` does. What is left to tell is k. In a
piece of the way in which each joint is found to move by less than half a turn, not far from where it was looked for, it
is taken to be 0: wrong only where a joint really makes more than half a turn in that piece.

Two things are not shown: that last one, and that the transport of a few steps leads different postures to different
ones, as the exact transport does. Both were tested: against the given law, integrated along rays of hundreds of poses.
"""

from __future__ import annotations

import numpy as np

from ...base.types import Vector
from ...strategies import HolonomicStrategy

LEAP = 0.1
"""Joint motion [joint unit] to an answer near by that Newton's method finds in one go."""


HALF_TURN = 3.14
"""Joint motion [joint unit] in a piece of a ray from which on a full turn may be missed or made up."""

ASIDE = 1.0
"""Farthest that the answer to a piece may lie from where Newton's method began [joint unit]: as its corrections fall to
an eighth each, the first was no more than 7/6 of this, and such a one leads no joint round."""


SHORTEST = 2.0**-16
"""Share of a ray below which it is given up: where the law ends is then nearer than some 1e-5 m. Poses of a Panda
beyond are refused in half the time that 2^-48 takes, and the same are reached."""


def keeps_turns(q: Vector, begun: Vector, found: Vector) -> bool:
    """True where a piece of a ray from q to a posture that was found, begun somewhere, cannot miss a joint's turn."""
    return bool((np.abs(found - q) < HALF_TURN).all() and (np.abs(found - begun) <= ASIDE).all())


def rays_from(strategy: HolonomicStrategy) -> Vector | None:
    """The center (n,) of a radial law whose leaves have one posture for each pose; None of other laws.

    That is where its label is arc length, and straight paths of the tool are those of its transport.
    """
    transport, task = strategy.looped.transport, strategy.task
    straight = task.turns or task.robot.planar or not any(task.angular)
    return transport.center if transport is not None and straight and all(strategy.constraint.angular) else None


def on_ray(strategy: HolonomicStrategy, q: Vector) -> bool:
    """True where straight paths from q on its leaf are rays."""
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
        f"#define HK_RAYS\n#define HK_LEAP {LEAP}\n#define HK_HALF_TURN {HALF_TURN}\n#define HK_ASIDE {ASIDE}\n"
        f"#define HK_SHORTEST_RAY {SHORTEST!r}\nstatic const hk_t hk_center[] = {{{values}}};\n"
        f"static const int hk_ray_rows[] = {{{rows}}};\n"
    )
