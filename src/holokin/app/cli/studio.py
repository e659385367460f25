"""`holokin studio`: a job or a robot as a page in the browser."""

from __future__ import annotations

from typing import Annotated

import typer

from .outcome import Base, MaybeRobotOrJob, Tip, TrustUnits, show


def studio(
    what: MaybeRobotOrJob = None,
    tip: Tip = None,
    base: Base = None,
    trust_units: TrustUnits = False,
    port: Annotated[int, typer.Option(help="Where the page is; the next free one if it is in use.")] = 8080,
    host: Annotated[
        str,
        typer.Option(help="By default this machine alone; another address is open to the network, unencrypted."),
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Do not open the browser.")] = False,
) -> None:
    """Show a job or a robot as a page in the browser: drag the tool or a loop, and see which joints drift.

    Without a name it is the job panda-circle. Every strategy has a robot of its own colour. Ctrl-C in the terminal ends
    the page (exit code 130); 2 is bad input, as of `holokin run`. Needs the extra "studio".
    """
    from ..studio import DEFAULT, open_session
    from ..studio.server import studio as open_page

    session = open_session(what or DEFAULT, tip=tip, base=base, trust_units=trust_units)
    open_page(session, port=port, host=host, browser=not no_browser, progress=show)
