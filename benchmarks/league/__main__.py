"""Which libraries give the same joints at the same pose? The league: writes docs/league.md and docs/league.png.

    python -m benchmarks.league                            # needs: pip install -e ".[test]"; about 45 minutes, 8 GB
    python -m benchmarks.league --only pink placo --out /somewhere --environments /a/folder

Every library is installed into an environment of its own (venv and pip), gets the robots and the paths as files, and
gives its joints back. The same measure is taken of all. What cannot be installed or run is named with the reason.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.league.courses import CYCLES, DT, TOURS, write_course
from benchmarks.league.league_page import league_figure, league_text
from benchmarks.league.played import ENTRIES, OURS, Played, default_folder, play
from holokin.app.report.plots import write_figure
from holokin.base.errors import HolokinError

ROOT = Path(__file__).resolve().parents[2]


def main(arguments: list[str] | None = None) -> int:
    """Run, write, and say where."""
    names = [entry.name for entry in ENTRIES]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="holokin alone, two cycles, one tour, steps of 0.05 s")
    parser.add_argument("--only", nargs="+", metavar="LIBRARY", choices=names, help="of " + ", ".join(names))
    parser.add_argument("--environments", type=Path, default=default_folder(), help="folder of the environments")
    parser.add_argument(
        "--answers", type=Path, help="keep the answers here; those that are here are not asked for again"
    )
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of league.md and league.png")
    given = parser.parse_args(arguments)
    wanted = [OURS.name] if given.quick else given.only or names
    cycles, dt, tours = (2, 0.05, 1) if given.quick else (CYCLES, DT, TOURS)
    try:
        with tempfile.TemporaryDirectory() as folder:
            found = _all_played(wanted, given.answers or Path(folder), given.environments, cycles, dt, tours)
    except KeyboardInterrupt:
        print("stopped; nothing was written; answers in the folder of --answers are not asked for again")
        return 130
    except HolokinError as problem:
        print(problem)
        return 1
    given.out.mkdir(parents=True, exist_ok=True)
    write_figure(lambda: league_figure(found), given.out / "league.png")
    (given.out / "league.md").write_text(league_text(found, cycles, dt), "utf-8")
    print(f"wrote {given.out / 'league.md'} and league.png")
    return 0


def _all_played(
    wanted: Sequence[str], home: Path, environments: Path, cycles: int, dt: float, tours: int
) -> list[Played]:
    """Ask every library that is wanted, one after the other."""
    course, found = home / "course", []
    if not (course / "course.json").exists():
        write_course(course, cycles=cycles, dt=dt, tours=tours)
    for entry in (entry for entry in ENTRIES if entry.name in wanted):
        print(f"{entry.name} ...", flush=True)
        found.append(play(entry, course, environments, home / entry.name))
        print(f"  {found[-1].left_out or f'{len(found[-1].scores)} answers'}", flush=True)
    return found


if __name__ == "__main__":
    raise SystemExit(main())
