"""`holokin export web`: a page on which anyone drags a loop and sees two strategies follow it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .outcome import show
from .robot_options import TrustUnits


def export_web(
    name: Annotated[
        str, typer.Argument(metavar="JOB | ROBOT", help="A job, or a robot: a catalogue name or a model file.")
    ],
    out: Annotated[Path, typer.Option(help="The HTML file to write.")],
    strategy: Annotated[
        str | None, typer.Option(help="The strategy beside the pseudo-inverse; by default the first with leaves.")
    ] = None,
    tip: Annotated[str | None, typer.Option(help="Of a model: the link that is the tool.")] = None,
    base: Annotated[str | None, typer.Option(help="Of a model: the link that stands still.")] = None,
    trust_units: TrustUnits = False,
    cusps: Annotated[
        bool, typer.Option("--cusps", help="Look for a loop after which the joints are elsewhere, and offer it.")
    ] = False,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Write it also where a strategy does not get round, or [checks] fail.")
    ] = False,
) -> None:
    """Write a page in one file: anyone drags a loop in a browser, without an installation, and sees which joints drift.

    The pseudo-inverse (or the job's first strategy without leaves) is at the left, the strategy at the right. Both are
    computed by the browser. Needs the extra "native" for its compiler, which takes about a minute at its first call.

    Exits 0 when the page is written, 1 where a strategy does not get round the path once or fails the job's [checks],
    but with --anyway, 2 on bad input.
    """
    from ...base.errors import HolokinError
    from ..job import is_job, open_one_job
    from ..studio import open_session
    from ..studio.session_page import page_plan

    plan = page_plan(open_session(name, tip=tip, base=base, trust_units=trust_units), strategy)
    stopped = [f"{label}: {found}" for label, found in plan.rounds.items() if isinstance(found, HolokinError)]
    found = plan.checked(open_one_job(name)[1]) if is_job(name) else None
    for line in [*stopped, *(found.table().splitlines() if found is not None else [])]:
        show(line)
    if (stopped or (found is not None and not found.passed)) and not anyway:
        show("nothing was written: cure it, or give --anyway")
        raise typer.Exit(1)
    loops = plan.cusp_loops() if cusps else []
    if cusps and not loops:
        show("no loop round a cusp was found, which is no proof that there is none")
    file = plan.page(loops).save(out)
    show(f"wrote {file}: {' and '.join(plan.strategies)}, {file.stat().st_size / 1000:.0f} kB")
