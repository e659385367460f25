"""All holonomic strategies: the paper's open question, answered by a parametrised inverse and a transport (theory 1.6).

With an inverse K(x, z), f(K(x, z)) = x, over a contractible set of tool poses x, the complete holonomic strategies
are exactly the maps Phi(x, .) of the redundancy coordinates z with Phi(x0, .) = identity: a leaf is
q = K(x, Phi(x, z0)), z0 its label, and G = K_x + K_z dPhi/dx. Nothing is redundant in this description.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..base.arguments import made
from ..base.errors import ArgumentError, ShapeError
from ..base.types import ArrayLike, finite, frozen, whole
from ..robot import Kinematics
from ..symbolic import SX, Function, as_expression, as_map, factorise, jacobian, symbol
from .constraints import Constraint
from .right_inverses import holonomic
from .strategy_kinds import HolonomicStrategy
from .tasks.task import Task

CHECKED = 1e-8
"""Largest error of K, z, Phi and its inverse at the places where they are checked [m, rad]."""


@made
def from_transport(
    task: Task,
    K: Callable[[SX, SX], Any],
    Phi: Callable[[SX, SX], Any],
    z: Callable[[SX], Any],
    *,
    around: ArrayLike,
    inverse: Callable[[SX, SX], Any] | None = None,
    center: ArrayLike | None = None,
    steps: int = 4,
    name: str = "from transport",
) -> HolonomicStrategy:
    """The holonomic strategy whose leaves are q = K(x, Phi(x, z0)): G = K_x + K_z dPhi/dx at z0 = Phi(x, .)^-1(z).

    Its constraint is the label z0(q), so it can be followed by leaf like every other.

    Args:
        K: (x (m,), z (r,)) -> q (n,), an inverse of the task with the redundancy coordinates z left open.
        Phi: (x, z0) -> z (r,), one to one in z0 for every x, the identity at `center`.
        z: q -> (r,), the redundancy coordinates of a posture: z(K(x, z)) = z.
        around: a posture (n,) near which all this is checked.
        inverse: (x, z) -> z0 with Phi(x, z0) = z in closed form. Without it z0 is continued by Newton's method
            from the center in `steps` steps, which asks for a Phi that turns little in each.
        center: x0 (m,); zero by default.

    Raises:
        ArgumentError: K does not invert the task, z does not invert K, Phi is not the identity at the center or
            its inverse is wrong; says by how much. ShapeError.
    """
    r = task.n - task.m
    x0 = np.zeros(task.m) if center is None else frozen(finite("the center", center, (task.m,)))
    whole("steps", steps)
    x, z0 = symbol("x", task.m), symbol("z0", r)
    phi = _sized("Phi", Phi(x, z0), (r, 1))
    transport = as_map([x, z0], phi)
    slope = as_map([x, z0], jacobian(phi, z0))

    def label(at: SX, value: SX) -> SX:
        if inverse is not None:
            return _sized("the inverse of Phi", inverse(at, value), (r, 1))
        found = value  # at the center Phi is the identity
        last = [1.0] * 4  # Newton steps at the end: quadratic, so four reach round-off
        for share in [*((k + 1) / steps for k in range(steps - 1)), *last]:
            here = SX(x0) + share * (at - SX(x0))
            found = found + factorise(slope(here, found)).solve(value - transport(here, found))
        return found

    def expression(bound: Task, k: Kinematics, q: SX) -> SX:
        return label(bound.value_expression(k), _sized("z", z(q), (r, 1)))

    _check(task, K, z, transport, label, x0, task.robot.checked(around, "the posture to check around"))
    # Further research: section VI of the paper, all holonomic strategies
    return holonomic(task, Constraint(name, r, expression, (False,) * r), name=name)


def _check(
    task: Task, K: Callable[[SX, SX], Any], z: Callable[[SX], Any], transport: Callable[..., SX],
    label: Callable[[SX, SX], SX], x0: np.ndarray, around: np.ndarray,
) -> None:  # fmt: skip
    """Raises: ArgumentError when the given maps do not fit each other at a few places near a posture."""
    r = task.n - task.m
    q, x, zs = symbol("q", task.n), symbol("x", task.m), symbol("z", r)
    reached = _sized("K", K(x, zs), (task.n, 1))
    k = task.kinematics(reached)
    errors = Function(
        "check",
        {"x": x, "z": zs},
        {
            "f(K(x, z)) - x": task.value_expression(k) - x,
            "z(K(x, z)) - z": as_expression(z(reached)) - zs,
            "Phi(x0, z) - z": transport(SX(x0), zs) - zs,
            "Phi(x, label(x, z)) - z": transport(x, label(x, zs)) - zs,
        },
    )
    coordinates = Function("z", {"q": q}, {"z": _sized("z", z(q), (r, 1))})
    for posture in around + 0.1 * np.random.default_rng(0).uniform(-1, 1, (4, task.n)):
        found = errors(task(posture), np.atleast_1d(coordinates(posture)))
        for what, error in zip(errors.output_shapes, found, strict=True):
            if not np.abs(error).max() < CHECKED:
                at = np.array2string(posture, precision=3)
                raise ArgumentError(
                    f"|{what}| near q = {at}",
                    float(np.abs(error).max()),
                    "it must be 0 everywhere",
                )


def _sized(what: str, value: Any, shape: tuple[int, int]) -> SX:
    expression = as_expression(value)
    if expression.shape != shape:
        raise ShapeError(what, shape, expression.shape)
    return expression
