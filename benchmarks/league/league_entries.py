"""Who takes part: the packages of each library, and the script that runs it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

WORKERS = Path(__file__).parent / "workers"


@dataclass(frozen=True)
class Entry:
    """A library: its name, what pip installs into its environment, its script in `workers/`.

    packages: none for the environment of the league itself.
    seconds: how long all its runs may take; on a free machine they take some minutes at most.
    """

    name: str
    packages: tuple[str, ...]
    worker: str
    seconds: float = 1800.0

    @property
    def script(self) -> Path:
        """The file to run."""
        return WORKERS / self.worker


OURS = Entry("holokin", (), "with_holokin.py")
ENTRIES = (
    OURS,
    Entry("pink", ("pin-pink", "daqp"), "with_pink.py"),
    Entry("mink", ("mink", "daqp"), "with_mink.py"),
    Entry("mink-warp", ("mink-warp",), "with_mink_warp.py"),
    Entry("placo", ("placo",), "with_placo.py"),
    Entry("OInK", ("roboplan-oink", "pin"), "with_oink.py"),
    Entry("embodik", ("embodik",), "with_embodik.py"),
    Entry("Drake", ("drake",), "with_drake.py"),
    Entry("pyroboplan", ("pyroboplan",), "with_pyroboplan.py"),
    Entry("PyRoki", ("almond-pyroki",), "with_pyroki.py"),
    Entry("ssik", ("ssik",), "with_ssik.py"),
    Entry("frankik", ("frankik",), "with_frankik.py"),
    Entry("TRAC-IK", ("pytracik",), "with_tracik.py"),
    Entry("roboticstoolbox", ("roboticstoolbox-python",), "with_roboticstoolbox.py"),
)
