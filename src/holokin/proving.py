"""`holokin check-certificate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .outcome import show
from .progress import progress


def check_certificate(
    file: Annotated[Path, typer.Argument(help="The .json file of a certificate.")],
) -> None:
    """Verify a certificate again, by a small checker that shares no code with what found it. Needs python-flint.

    Exits 0 when it holds, 1 when it is rejected, 2 on bad input.
    """
    from .proof.recheck import recheck

    with progress(f"checking {file.name}", 1000) as report:
        rejected, text = recheck(file, report)
    show(text)
    raise typer.Exit(1 if rejected else 0)
