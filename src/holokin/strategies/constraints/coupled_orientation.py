"""Orientation coupled to position, the paper's (27), (28)."""

from __future__ import annotations

from collections.abc import Sequence

from ...base.arguments import made
from ...base.errors import ArgumentError
from ...base.types import ArrayLike
from ...robot import Kinematics
from ...symbolic import SX
from ..tasks.orientation_rows import Angles, three_angles
from ..tasks.task import Task
from .constraint import Constraint, as_gain, nothing_jumps


@made
def coupled(gain: ArrayLike, orientation: Angles = "zyz", *, rows: Sequence[int] = (0, 1, 2)) -> Constraint:
    """g(q) = phi(q) + Lambda p(q): orientation angles phi (3,) follow the position p (3,). [ZR11, (28)]

    Args:
        gain: Lambda in rad/m, a number (times the identity) or a matrix (rows, 3); which angle goes with which
            direction is up to it. The paper adds rad and m, a hidden gain of 1 rad/m (theory E6).
        orientation: "zyz", "rpy" or "rotation-vector".
        rows: which of the three angles are coupled; all by default.

    Rows: 3 as a rule, so that it completes a position task (m = 3) of a six-joint arm. Algorithmic singularities: every
    singularity of the full 6-row Jacobian, the wrist's included (theory E5); and where the angles are undefined.

    Raises:
        UnknownNameError: an unknown orientation. ShapeError, NotFiniteError: a bad gain. ArgumentError: bad rows.
    """
    chosen = list(rows)
    if not chosen or len(set(chosen)) != len(chosen) or not set(chosen) <= {0, 1, 2}:
        raise ArgumentError("the rows of a coupling", chosen, "name each of 0, 1, 2 at most once")
    L = as_gain(gain, (len(chosen), 3))
    angles = three_angles(orientation)

    def expression(_task: Task, k: Kinematics, _q: SX) -> SX:
        # (28), (29): its gradient is J_o + Lambda J_p
        return angles.value(k.rotation)[chosen] + SX(L) @ k.position

    def margin(_task: Task, k: Kinematics, _q: SX) -> SX:
        return angles.margin(k.rotation)

    return Constraint(
        f"coupled ({orientation})", len(chosen), expression, (True,) * len(chosen), margin, formulas=nothing_jumps
    )
