"""`hk.studio`: a page in the browser. What serves it is loaded when it is called."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...robot import Robot

if TYPE_CHECKING:
    from .server import Studio


@typed
def studio(
    what: Any = None,
    *,
    port: int = 8080,
    host: str = "127.0.0.1",
    browser: bool = True,
    wait: bool = True,
    tell: Callable[[str], Any] = print,
) -> Studio:
    """Open a page in the browser: the robot, a loop to drag, and control laws side by side. Extra `studio`.

    All browsers that open the page share one state. See docs/studio.md.

    Args:
        what: a job (packaged, or a file), a robot (of the catalogue, a file, or a Robot), or a `studios.Session`; by
            default the job panda-circle.
        port: where the page is served; the next free one if it is in use, 0 for any.
        host: "127.0.0.1" is this machine alone; another address of it opens the page to the network, unencrypted, for
            all who know its address.
        browser: False opens none.
        wait: serve until Ctrl-C; False returns at once, and `close()` ends it.
        tell: hears where the page is, and what else is to be known of it, a sentence at a time. The address has a
            token in it: who has it can open the page.

    Returns:
        The studio: `url`, `session`, `open(name)`, `close()`.

    Raises:
        MissingExtraError: viser or trimesh is not installed, or a viser that cannot be guarded.
        ArgumentError: a port or host that cannot be; a robot without a joint to spare.
        HolokinError: what reading the job or robot raises.
    """
    if not callable(tell):
        raise ArgumentError("tell", tell, "give a function of one text")
    from .server import serve
    from .session import Session

    if what is not None and not isinstance(what, str | Path | Robot | Session):
        raise ArgumentError("what the studio shows", what, "give a job, a robot, a file of one, or a studios.Session")
    return serve(what, port, host, browser, wait, tell)
