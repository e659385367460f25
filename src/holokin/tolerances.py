"""Every default threshold of the library, in one frozen object, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Tolerances:
    """Thresholds; make a changed copy with `dataclasses.replace(TOLERANCES, ...)`."""

    singular: float = 1e-10
    """Smallest over largest diagonal of R in A = QR below which A is called singular.
    A solve loses log10(1/this) digits; at 1e-10 six remain, still enough to be useful."""

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
    """Largest ratio of two successive Newton corrections that leaf following accepts. By the
    Newton-Kantorovich theorem 1/2 is enough to stay on the branch; we keep a factor of four."""

    smallest_step: float = 2.0**-20
    """Fraction of a sample interval below which leaf following gives up halving."""

    limit: float = 1e-9
    """Overshoot [joint units] of a joint limit that counts as round-off."""


TOLERANCES = Tolerances()
"""The defaults."""
