"""From a session to a page that needs no installation: which laws, where they begin, and whether they get round."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ...analysis.curvature import cusps
from ...base.arguments import typed
from ...base.errors import ArgumentError, HolokinError, UnknownNameError
from ...base.types import Value, Vector
from ...motion import follow
from ...motion.checks import CheckReport
from ...motion.ik.leaf import with_leaves
from ...motion.trajectory import Trajectory
from ...path import Path
from ...strategies import HolonomicStrategy, Strategy, moore_penrose
from ..job import Job
from .loop_follower import leaf_start, loop_start
from .session import Session
from .session_laws import Law
from .standalone_page import STEPS, PageLoop, WebPage, cusp_loop, web_page
from .wasm_law import check_zig


@dataclass(frozen=True, eq=False)
class PagePlan(Value):
    """What a page of a session shows: two laws, the posture (n,) at which each begins, the closed path, a title."""

    laws: tuple[Law, Law]
    starts: tuple[Vector, Vector]
    path: Path | None
    title: str

    @cached_property
    def strategies(self) -> dict[str, Strategy]:
        """Name -> strategy of each law."""
        return {law.name: _strategy(law) for law in self.laws}

    @cached_property
    def rounds(self) -> dict[str, Trajectory | HolokinError]:
        """Each law's name, and its first round of the path, or why it does not get round; nothing without a path."""
        found: dict[str, Trajectory | HolokinError] = {}
        for (name, law), start in zip(self.strategies.items(), self.starts, strict=True):
            if self.path is not None:
                try:
                    found[name] = follow(law, self.path, start, samples=STEPS)
                except HolokinError as problem:
                    found[name] = problem
        return found

    def checked(self, job: Job) -> CheckReport | None:
        """What the [checks] of a job find of the round of the second law; None where it has none, or gets round not."""
        found = self.rounds.get(self.laws[1].name)
        if job.checks is None or not isinstance(found, Trajectory):
            return None
        task = self.laws[1].task
        return job.checks.checked(found, task.robot, task)

    def cusp_loops(self) -> list[PageLoop]:
        """The smallest loop that is found round a cusp of the second law, if there is one.

        Raises:
            MissingExtraError: there is no zig, so that no page can be made.
        """
        check_zig()
        law = self.strategies[self.laws[1].name]
        if not isinstance(law, HolonomicStrategy):
            return []
        witness = cusps(with_leaves(law), self.starts[1]).witness
        return [] if witness is None else [cusp_loop(witness, self.laws[1].name)]

    def page(self, loops: list[PageLoop] | None = None) -> WebPage:
        """The page, with more loops. Raises: as `web_page`."""
        return web_page(self.strategies, list(self.starts), self.path, title=self.title, loops=loops or [])


@typed
def page_plan(session: Session, name: str | None = None) -> PagePlan:
    """What a page of a session shows: its first law without leaves, else the pseudo-inverse, beside one with leaves.

    Args:
        name: of the second law; by default the first with leaves that is not radial, or else the first with leaves.

    Raises:
        UnknownNameError: of the law. ArgumentError: a session without two laws for a page.
    """
    known = [law for law in session.laws if law.strategy is not None]
    if name is not None and name not in [law.name for law in known]:
        raise UnknownNameError("strategy of a page", name, tuple(law.name for law in known))
    leafed = sorted((law for law in known if law.holonomic), key=lambda law: "radial" in str(law.keys or law.name))
    plain = [law for law in known if not law.holonomic]
    asked = [law for law in known if law.name == name]
    second = next((law for law in asked + leafed if law.holonomic), None)
    if second is None:
        raise ArgumentError(
            "the number of strategies with leaves", 0, "a page shows one beside the pseudo-inverse: add a rule"
        )
    usual = Law("pseudo-inverse", 0, moore_penrose(second.task, name="pseudo-inverse"), second.task)
    first = next((law for law in asked + plain if not law.holonomic and law.task.m == second.task.m), usual)
    loop = session.loop
    closed = loop is not None and isinstance(loop.path, Path) and loop.path.closed
    if loop is not None and isinstance(loop.path, Path) and closed:
        starts, path = (loop_start(first, loop, session.home), loop_start(second, loop, session.home)), loop.path
    else:
        starts, path = (leaf_start(first, session.home), leaf_start(second, session.home)), None
    return PagePlan((first, second), starts, path, _title(session))


def _title(session: Session) -> str:
    """What the session is called, and what to do."""
    return f"{session.title[:100]}: drag the loop"


def _strategy(law: Law) -> Strategy:
    """The strategy of a law of a page. Raises: ArgumentError."""
    if law.strategy is None:
        raise ArgumentError("the law of a page", law.name, "a page shows strategies: take one")
    return law.strategy
