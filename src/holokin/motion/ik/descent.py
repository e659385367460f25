"""The path down to the nearest pose: projected steps of Newton's method, in the tool's own coordinates.

With e, c and their slopes A of `edge`, each step solves

    min  z^T B z / 2 - e^T z   with   A z >= -c,

where B is the second derivative of |e|^2 / 2 - lambda c: that of c is how the edge bends [NW06, section 18.1]. Far from
the edge B = 1. The tool moves by z as far as the distance falls, and goes back onto the edge, which is curved. At the
end e = -A^T lambda with lambda >= 0: what is missing is normal to the edge, and points out of it.
"""

from __future__ import annotations

import numpy as np

from ...base.types import Matrix, Vector
from . import edge as edges
from .edge import Edge, Goal, Look

TRUST = 0.1
"""First step of the tool [m]; steps that succeed double it."""

DONE = 1e-10
"""Step of the tool [m] below which the path down has ended: round-off of a few metres is a ten thousandth of it."""

WITHIN = 1e-10
"""Overshoot of a constraint, in metres of the tool, that counts as none."""

NEAR = 1e-4
"""Overshoot of a constraint [m] with which a step goes on; the next one takes it back. From a larger one the tool goes
back at once, since beyond the margin, some millimetres away, there is a singular posture."""

STEPS = 60
"""Steps of the tool on one path down, at most; some five are usual."""

AMPLE = 1.5
"""A step over how far its joint goes, up to which that is far enough."""

HALVINGS = 30
"""Times that one step is halved before there is none."""

RETURNS = 12
"""Steps back to the edge after one step along it, at most; two are usual, more where a path ends at a fold."""

DESCENT = 1e-4
"""Share of the expected decrease that a step must bring. [NW06, section 3.1]"""

SMALL, CONTRACTION = 1e-5, 0.5
"""A step of the tool [m] that is good where the next one is shorter by this ratio, whatever round-off makes of the
distance."""

FAST = 0.1
"""Ratio of two successive steps up to which the curvature need not be looked at again."""

TIGHT = 0.01
"""Distance of a constraint [m] within which curvatures tell of the edge."""

DEPENDENT = 1e-12
"""What keeps constraints that depend on each other apart, as a share: together they share their multipliers."""

SPREAD = 1e-6
"""Motion of the tool [m] over which slopes are differenced for curvatures, which need but a few digits."""

CURVED = 0.05
"""Least curvature of the model: behind a hollow edge that of the distance may be negative."""

_NAMES = (
    "TRUST DONE WITHIN NEAR STEPS AMPLE HALVINGS RETURNS DESCENT SMALL CONTRACTION FAST TIGHT DEPENDENT SPREAD CURVED"
)
CONSTANTS = {name: globals()[name] for name in _NAMES.split()} | {
    name: getattr(edges, name) for name in ("UNMOVED", "SAME", "NARROW", "COARSE", "LEAP", "BEGUN", "FEW")
}
"""All of them, for native code."""


def projection(look: Look, e: Vector, M: Matrix | None) -> tuple[Vector, Vector]:
    """The z (m,) with the least z^T M^-1 z / 2 - e^T z and A z >= -c, M = 1 by default; its multipliers (k,).

    By active sets: constraints enter one at a time, the most violated first. [LH95, section 23.3]
    """
    A, c = look.A, look.c
    if not len(c):
        return e if M is None else M @ e, c
    # The free optimum, and the forces that hold all constraints.
    free, MA = (e, A.T) if M is None else (M @ e, M @ A.T)
    H, b = A @ MA, A @ free + c
    H[np.diag_indices(len(c))] *= 1 + DEPENDENT
    held: list[int] = []
    forces = np.zeros(len(c))
    for _ in range(3 * len(c) + 3):
        slack = H @ forces + b
        slack[held] = np.inf
        worst = int(np.argmin(slack))
        if not slack[worst] < -1e-14 * (1 + abs(b[worst])):
            break
        held.append(worst)
        while held:
            now, wanted = forces[held], np.linalg.solve(H[np.ix_(held, held)], -b[held])
            if (wanted > 0).all():
                forces[held] = wanted
                break
            shares = np.where(wanted > 0, np.inf, now / np.maximum(now - wanted, 1e-300))
            first = int(np.argmin(shares))
            forces[held] = now + shares[first] * (wanted - now)
            forces[held[first]] = 0.0
            del held[first]
    return free + MA @ forces, forces


def inside(edge: Edge, look: Look | None, goal: Goal, careful: bool) -> Look | None:
    """The nearest posture within the constraints, if a few steps lead to it."""
    longest = TRUST
    for _ in range(RETURNS):
        if look is None or look.excess <= WITHIN:
            return look
        z, _ = projection(look, np.zeros(len(look.e)), None)
        size = float(np.linalg.norm(z))
        moved = edge.moved(look, z, min(1.0, longest / max(size, 1e-300)), goal, careful)
        longest = min(size, longest) / 4 if moved is None else 2 * longest
        look = moved or look
    return look if look is not None and look.excess <= WITHIN else None


def descend(
    edge: Edge, look: Look, goal: Goal, careful: bool, q0: Vector, step: Vector | None = None, least: float = 0.0
) -> tuple[Look, Look | None]:
    """The end of the path down from a posture within the constraints; and the place on it up to which no joint moves
    by more than a step (n,) from its beginning, None where that is its end.

    least: share of the distance below which a step along the edge is not worth it.
    """
    cut, trust, M, fresh, safe = None, TRUST, None, False, look
    z, forces = projection(look, look.e, None)
    for _ in range(STEPS):
        # The step z that lessens the error most without leaving the active constraints; of second order near the end.
        if not fresh:
            held = look.c[forces > 0]
            fresh = bool(held.size) and held.max() <= TIGHT
            M = compliance(edge, look, forces, goal) if fresh else None
            z, forces = projection(look, look.e, M)
        size, weight = float(np.linalg.norm(z)), 2 * float(forces.sum())
        if not size > (max(DONE, least * look.distance) if weight > 0 else DONE):
            break
        # Shorten the step until it stays on the branch and the merit falls as much as hoped.
        along, share = z if weight > 0 else None, min(1.0, trust / size)
        while share * size > DONE:
            end, hoped = edge.moved(look, along, share, goal, careful), DESCENT * share * float(look.e @ z)
            if end is not None and (end.excess > NEAR or look.merit(weight) - end.merit(weight) < hoped):
                small = size <= SMALL and end.excess <= NEAR
                end = end if small else inside(edge, end, goal, careful)
            if end is not None:
                further, forces = projection(end, end.e, M)
                ratio = float(np.linalg.norm(further)) / size
                lower = look.merit(weight) - end.merit(weight) >= hoped
                if lower or (size <= SMALL and share == 1.0 and ratio <= CONTRACTION):
                    break
            share /= 2
        else:
            break
        # Where a joint would move by more than the step, keep the place up to which none does.
        if step is not None and cut is None and least_ratio(end.q, q0, step) < 1.0:
            cut = part(edge, look, along, share, goal, careful, q0, step) or safe
        # Go on from its end; a step of full length widens the region of trust.
        look, z, fresh = end, further, fresh and ratio <= FAST and share == 1.0
        trust = 2 * max(share * size, TRUST / 4)
        safe = look if look.excess <= WITHIN else safe
    return inside(edge, look, goal, careful) or safe, cut


def part(
    edge: Edge, look: Look, z: Vector | None, share: float, goal: Goal, careful: bool, q0: Vector, step: Vector
) -> Look | None:
    """Along a motion of the tool as far as no joint goes farther from its beginning than a step; None for nowhere."""
    best, low, high = None, 0.0, 2.0 * share
    for _ in range(HALVINGS):
        end = inside(edge, edge.moved(look, z, share, goal, careful), goal, careful)
        ratio = 0.0 if end is None else least_ratio(end.q, q0, step)
        if end is not None and ratio >= 1.0:
            best, low = end, share
            if ratio <= AMPLE or share >= 1.0:
                break
        else:
            high = share
        share = min(1.0, 0.99 * ratio * share)
        share = share if low < share < high else (low + high) / 2
    return best


def compliance(edge: Edge, look: Look, forces: Vector, goal: Goal) -> Matrix:
    """The inverse of the second derivative by z of |e|^2 / 2 - forces c, made positive definite."""
    pull = look.e + look.A.T @ forces
    H = np.empty((len(pull), len(pull)))
    for k in range(len(pull)):
        near = edge.look(look.q + SPREAD * look.S[:, k], goal, look)
        H[:, k] = (pull - near.e - near.A.T @ forces) / SPREAD
    H = (H + H.T) / 2
    held = look.A[forces > 0]
    H += 10 * np.linalg.norm(H) * held.T @ held  # which changes nothing while they are held
    values, vectors = np.linalg.eigh(H)
    return vectors / np.maximum(values, CURVED) @ vectors.T


def least_ratio(q: Vector, q0: Vector, step: Vector) -> float:
    """The least ratio of a step to how far its joint is from its beginning: below 1 one is farther than a step."""
    return float(np.min(step / np.maximum(np.abs(q - q0), 1e-300)))
