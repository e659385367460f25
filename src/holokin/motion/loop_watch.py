"""`LoopWatch`: tells whether joints move as a loop commands them."""

from __future__ import annotations

import logging

from ..base.arguments import typed
from ..base.types import ArrayLike, NoTruthValue, Vector, finite, positive

STARVED = 0.5
"""Share of the commanded motion below which a loop is starved: a servo that merely lags makes up for it."""

FROM = 0.01
"""Sum of dt dq . dq [rad^2/s] from which a watch judges, that of a second at 0.1 rad/s."""


class LoopWatch(NoTruthValue, ask="`.starved`"):
    """Tells whether the joints of a control loop move as they are commanded.

    It sums over the steps share = sum dq . (q_next - q) / sum dt dq . dq, which is 1 where the joints follow. Position
    servos that are sent q + dt dq from the measured q hardly move: they share a few percent. The first time that the
    share is below a half, the log "holokin" gets a warning.

    Args:
        dt: the loop's step [s].
        log: whether to warn.
    """

    @typed
    def __init__(self, dt: float, log: bool = True) -> None:
        self.dt = positive("dt", dt, "give the step in seconds")
        self._made = self._asked = 0.0
        self._last: tuple[Vector, Vector] | None = None
        self._told = not log

    def see(self, q: ArrayLike, dq: ArrayLike) -> None:
        """One step: where the joints are (n,), and the rates (n,) that they are commanded from there.

        Raises: ShapeError: not as many as before. NotFiniteError, ArgumentError.
        """
        here = finite("q", q, ("n",) if self._last is None else self._last[0].shape)
        rates = finite("dq", dq, here.shape)
        if self._last is not None:
            before, asked = self._last
            self._made += float((here - before) @ asked)
            self._asked += self.dt * float(asked @ asked)
        self._last = here.copy(), rates.copy()
        if self.starved and not self._told:
            self._told = True
            logging.getLogger("holokin").warning("%s", self.sentence)

    @property
    def share(self) -> float:
        """The share of the commanded motion that was made; 1 before any."""
        return self._made / self._asked if self._asked else 1.0

    @property
    def starved(self) -> bool:
        """Whether the joints make so little of what is commanded that the loop is fed the wrong joints."""
        return self._asked > FROM and self.share < STARVED

    @property
    def sentence(self) -> str:
        """What is to be said of it, with the cure."""
        if not self.starved:
            return f"the joints make {self.share:.0%} of the motion that is commanded"
        share = max(self.share, 0.0)
        return (
            f"the joints make {share:.0%} of the motion that is commanded: with position servos feed back the "
            "commanded joints, not the measured ones; with others, look whether the drives are on"
        )
