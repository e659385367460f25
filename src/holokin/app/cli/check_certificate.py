"""`holokin check-certificate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...base.errors import ArgumentError
from ...base.progress import progress
from .outcome import show
from .robot_options import TrustUnits


def check_certificate(
    file: Annotated[Path, typer.Argument(help="The .json file of a certificate.")],
    robot: Annotated[
        str | None, typer.Option(help="Compare it with a robot: a name of the catalogue, or a file of a model.")
    ] = None,
    tip: Annotated[str | None, typer.Option(help="With --robot: the link of a model that is the tool.")] = None,
    base: Annotated[str | None, typer.Option(help="With --robot: the link of a model that stands still.")] = None,
    trust_units: TrustUnits = False,
    sample: Annotated[
        float | None, typer.Option(help="Verify this share of the cells alone, drawn at random: 0.01 for 1 %.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="With --sample: which cells are drawn; by default others each time.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="Time that it may take.")] = 3600.0,
) -> None:
    """Verify a certificate again, by a small checker that shares no code with what found it. Needs python-flint.

    Prints what was verified, by the checker's own numbers; the file's words are named as such. With --robot the rows of
    the task are written down anew from its model, and compared, and so are the limits.
    With --sample only some cells are verified, each with a neighbour that it is joined to: it says how many of all.
    Exits 0 when it holds, or when the sample shows no fault, 1 when it is rejected, 2 on bad input.
    """
    from ...proof.recheck import recheck

    model = None
    if robot is not None:
        from ...robot import load

        model = load(robot, tip=tip, base=base, trust_units=trust_units)
    elif tip is not None or base is not None:
        raise ArgumentError("--tip or --base", tip or base, "it is of a robot: give --robot, too")
    if seed is not None and sample is None:
        raise ArgumentError("--seed", seed, "it is of a sample: give --sample, too")
    with progress(f"checking {file.name}", 1000) as report:
        rejected, text = recheck(file, report, seconds, model, sample, seed)
    show(text)
    raise typer.Exit(1 if rejected else 0)
