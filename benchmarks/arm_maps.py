"""Makes the maps by which `hk.ik(robot)` answers for arms of the catalogue again, into src/holokin/robot/data.

python -m benchmarks.arm_maps              # all
python -m benchmarks.arm_maps panda fr3    # these
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import holokin as hk
from holokin.analysis.sheets.arm_maps import make_arm_map
from holokin.analysis.sheets.station_maps import make_station_map, map_bytes
from holokin.motion.ik.arm_map import map_text

ARMS = ("fr3", "iiwa14", "iiwa7", "openarm-left", "openarm-right", "panda", "xarm7")
"""Those of seven joints that a held joint leaves with a closed form; the signs of six joints are found in no time."""

WITHOUT = ("gen3", "rizon4", "sawyer", "yumi-arm")
"""Those without a closed form."""

FOLDER = Path(hk.__file__).parent / "robot" / "data"


def make(name: str) -> None:
    """Makes the map of an arm, and writes it."""
    begin = time.process_time()
    task = hk.pose(hk.load(name))
    if name in WITHOUT:
        found = make_station_map(task)
        (FOLDER / "stations" / f"{name}.npz").write_bytes(map_bytes(found))
    else:
        found = make_arm_map(task)
        (FOLDER / "maps" / f"{name}.json").write_text(map_text(found), "utf-8")
    seconds = time.process_time() - begin
    print(f"{name}: {len(found)} sheets serve {found.share:.2%}; {seconds:.1f} s of processor time", flush=True)


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="arms of the catalogue; by default all that have a map")
    for name in parser.parse_args().names or (*ARMS, *WITHOUT):
        make(name)


if __name__ == "__main__":
    main()
