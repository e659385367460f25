"""The thresholds that several folders share, in one frozen object, each with its reason.

A threshold of one file alone is a constant of that file, with its reason.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tolerances:
    """Thresholds; make a changed copy with `dataclasses.replace(TOLERANCES, ...)`."""

    singular: float = 1e-10
    """Smallest over largest diagonal of R in A = QR below which A is called singular.
    A solve loses log10(1/this) digits; at 1e-10 six remain, still enough to be useful."""

    rank: float = 1e-8
    """Smallest over largest singular value of J below which the arm is called singular, and not the law: half the
    digits of a double, so that what a law adds is not taken for the arm's own."""

    holonomic: float = 1e-9
    """Scale-free bracket defect [1/rad] up to which a strategy is called holonomic. Round-off of
    the derivatives is 1e-15 to 1e-12 on arms; the weakest real defect we know is above 1e-3."""

    representation: float = 1e-6
    """Distance [-] of an orientation representation from its singularity (sin theta of ZYZ, cos of
    the pitch, pi minus the rotation angle) below which its rates are refused: they grow as 1/this."""

    start: float = 1e-6
    """Distance [m or rad] between the tool at the start posture and the start of the path above
    which `follow` refuses to begin: well under any robot's accuracy, well over round-off."""

    tracking: float = 1e-3
    """Task error [m or rad] at which `follow` by velocity stops: integration has lost the path."""

    contraction: float = 0.125
    """Largest ratio of two successive Newton corrections that leaf following goes on with: a larger one tells a step
    that is too long before it costs a closer look. Whether a step keeps to its branch is for `change` to say."""

    change: float = 0.5
    """Largest ||1 - Y A|| of the extended Jacobian A over a tube of postures, Y its inverse in the middle, up to which
    a step in it is accepted. Below 1 a tool pose has one posture there; 1/2 leaves room to show that it is reached.
    """

    smallest_step: float = 2.0**-48
    """Share of a sample interval below which leaf following gives up: a fold is then nearer than 1e-7 rad as a rule,
    since near it the tool moves as the square of the joints."""

    limit: float = 1e-9
    """Overshoot [joint units] of a joint limit that counts as round-off."""


TOLERANCES = Tolerances()
"""The defaults."""
