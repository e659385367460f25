"""The maps by which `hk.ik(robot)` answers for arms of the catalogue: makes them, or says how those of the package do.

python -m benchmarks.arm_maps                  # makes all again, into src/holokin/robot/data
python -m benchmarks.arm_maps panda fr3        # these
python -m benchmarks.arm_maps --look           # only looks at those of the package: share, time, answers
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import holokin as hk
from holokin.analysis.sheets.arm_maps import make_arm_map
from holokin.analysis.sheets.station_maps import make_station_map, map_bytes
from holokin.motion.ik.arm_map import map_text

ARMS = ("fr3", "iiwa14", "iiwa7", "openarm-left", "openarm-right", "panda", "xarm7")
"""Those of seven joints that a held joint leaves with a closed form; the signs of six joints are found in no time."""

OTHERS = ("gen3", "rizon4", "sawyer", "yumi-arm")
"""Those without a closed form."""

FOLDER = Path(hk.__file__).parent / "robot" / "data"

POSES = 4_000


def make(name: str) -> None:
    """Makes the map of an arm, and writes it."""
    begin = time.process_time()
    task = hk.pose(hk.load(name))
    if name in OTHERS:
        found = make_station_map(task)
        (FOLDER / "stations" / f"{name}.npz").write_bytes(map_bytes(found))
    else:
        found = make_arm_map(task)
        (FOLDER / "maps" / f"{name}.json").write_text(map_text(found), "utf-8")
    seconds = time.process_time() - begin
    print(f"{name}: {len(found)} sheets serve {found.share:.2%}; {seconds:.1f} s of processor time", flush=True)


def look(name: str) -> None:
    """Asks for poses of random postures: how many are reached, how many by a sheet, and the time of a call."""
    robot, rng = hk.load(name), np.random.default_rng(20)
    ik = hk.ik(robot)
    low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    poses = robot.pose(rng.uniform(low, high, (POSES, robot.n)))
    found = ik.batch(poses)
    times = []
    for pose in poses[found.reached]:
        tries = []
        for _ in range(5):
            begin = time.perf_counter()
            ik(pose)
            tries.append(time.perf_counter() - begin)
        times.append(1e6 * min(tries))
    shares = f"{int(found.reached.sum())} of {POSES} reached, {(found.sheet >= 0).mean():.2%} by {len(ik.map)} sheets"
    print(f"{name}: {shares}; {np.median(times):.2f} us, 99 % under {np.percentile(times, 99):.1f} us", flush=True)


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="arms of the catalogue; by default all that have a map")
    parser.add_argument("--look", action="store_true", help="make none, look at those of the package")
    given = parser.parse_args()
    for name in given.names or (*ARMS, *OTHERS):
        (look if given.look else make)(name)


if __name__ == "__main__":
    main()
