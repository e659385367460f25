"""Who takes part: the packages of each library."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

WORKERS = Path(__file__).parent / "workers"


@dataclass(frozen=True)
class Entry:
    """A library: its name in `workers/libraries.py`, what pip installs into its environment.

    packages: none for the environment of the league itself.
    seconds: how long all its runs may take; on a free machine they take some minutes at most.
    """

    name: str
    packages: tuple[str, ...]
    script: Path = WORKERS / "libraries.py"
    seconds: float = 1800.0


OURS = Entry("holokin", ())
ENTRIES = (
    OURS,
    Entry("pink", ("pin-pink", "daqp")),
    Entry("mink", ("mink", "daqp")),
    Entry("mink-warp", ("mink-warp",)),
    Entry("placo", ("placo",)),
    Entry("OInK", ("roboplan-oink", "pin")),
    Entry("embodik", ("embodik",)),
    Entry("Drake", ("drake",)),
    Entry("pyroboplan", ("pyroboplan",)),
    Entry("PyRoki", ("almond-pyroki",)),
    Entry("ssik", ("ssik",)),
    Entry("frankik", ("frankik",)),
    Entry("TRAC-IK", ("pytracik",)),
    Entry("roboticstoolbox", ("roboticstoolbox-python",)),
)
