"""`holokin simulate`: a job's strategies on physics."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ArgumentError
from ..version import build
from .export import OneJob
from .outcome import ending, show, show_rich


def simulate(
    job: OneJob,
    cycles: Annotated[int | None, typer.Option(help="Runs of a closed path; by default 20.")] = None,
    servo: Annotated[str | None, typer.Option(help="position (by default), velocity or torque.")] = None,
    feedback: Annotated[
        str | None, typer.Option(help="The joints that the law is told: commanded or measured.")
    ] = None,
    noise: Annotated[float | None, typer.Option(help="Of each measurement of a joint [rad, m].")] = None,
    push: Annotated[
        str | None, typer.Option(help="A force in mid-motion [N]: along y, or 'x y z'; 0 for none.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out"),
) -> None:
    """Run a job's strategies on physics (MuJoCo): servos, weight, noise and a push; audit their logs.

    Writes logs, figures and the model to OUT/<job>-physics/. Exits 0 when every run ends and the log of every
    strategy with leaves repeats, 1 when one does not, 2 on bad input.
    """
    from ..job import open_one_job, simulate_job
    from ..reports.physics_report import FOLDER, print_physics, write_physics
    from ..reports.result_folder import check_folder

    name, opened, file = open_one_job(job)
    check_folder(out, FOLDER.format(name))
    given = {"cycles": cycles, "servo": servo, "feedback": feedback, "noise": noise, "push": _force(push)}
    changes = {key: value for key, value in given.items() if value is not None}
    with ending().telling(name) as say:
        result = simulate_job(name, opened, file, changes, say)
        result = write_physics(result, out, build(), say)
    show_rich(lambda console: print_physics(result, console))
    show(f"  logs, figures, model: {out / result.folder}\n")
    raise typer.Exit(result.exit_code)


def _force(text: str | None) -> list[float] | None:
    """[x, y, z] of --push. Raises: ArgumentError."""
    if text is None:
        return None
    try:
        parts = [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        parts = []
    if len(parts) not in (1, 3):
        raise ArgumentError("--push", text, "give newtons along y, like 100, or three numbers, like '0 100 0'")
    return parts if len(parts) == 3 else [0.0, parts[0], 0.0]
