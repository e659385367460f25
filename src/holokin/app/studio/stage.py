"""`Stage`: what handles, plots and panels know of the page that they belong to."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol

from ...base.printed_units import PrintedUnits
from .page_scene import Scene
from .session import Session


class Stage(Protocol):
    """See `Page`, which is the only one.

    Attributes:
        server: of viser. session, scene: what is shown, and where. lead: the law whose robot is solid.
        colors: of the laws (#RRGGBB). said: the sentence for everyone. reopen: shows another job, by name.
        units: of what is shown.
        drawn: the number of the snapshot that is drawn, -1 to draw it again. handles: of the scene.
    """

    server: Any
    session: Session
    scene: Scene
    lead: int
    colors: tuple[str, ...]
    said: str
    reopen: Callable[[str], None] | None
    units: PrintedUnits
    drawn: int
    handles: Any

    def attempt(self, action: Callable[[], Any]) -> None:
        """Do something in this thread; what it raises is said in the page."""
        ...

    def alone(self, key: object, action: Callable[[], Any]) -> None:
        """The same, and not while it is being done already, as a key tells."""
        ...

    def clear_traces(self) -> None:
        """Take the lines away that elbows drew."""
        ...

    def ask(self, action: Callable[[], Any], key: object = None) -> None:
        """Have something done by the page's thread; of several with one key only the last is done."""
        ...

    def say(self, sentence: str) -> None:
        """A sentence for everyone, until the next."""
        ...

    def set_units(self, units: PrintedUnits) -> None:
        """In what numbers are shown."""
        ...

    def set_lead(self, index: int) -> None:
        """Whose robot is drawn solid."""
        ...

    def own_drawing(self) -> AbstractContextManager[None]:
        """The page's thread leaves the robots alone."""
        ...
