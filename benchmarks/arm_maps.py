"""The maps by which `hk.ik(robot)` answers for arms of the catalogue: makes them, or says how those of the package do.

python -m benchmarks.arm_maps                  # makes all again, into src/holokin/robot/data
python -m benchmarks.arm_maps panda fr3        # these
python -m benchmarks.arm_maps --look           # only looks: share, time, what comes home, of UR5e, IRB 140, a rail, too
python -m benchmarks.arm_maps --look panda:axis        # of the task whose tool is free to spin
"""

from __future__ import annotations

import argparse
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

import holokin as hk
from holokin.analysis.sheets.arm_maps import make_arm_map
from holokin.analysis.sheets.station_maps import make_station_map, map_bytes
from holokin.motion.ik import ArmInverse
from holokin.motion.ik.arm_map import map_text

ARMS = ("fr3", "iiwa14", "iiwa7", "openarm-left", "openarm-right", "panda", "xarm7")
"""Those of seven joints that a held joint leaves with a closed form; the signs of six joints are found in no time."""

WITHOUT = ("gen3", "rizon4", "sawyer", "yumi-arm")
"""Those without a closed form."""

OTHERS = ("ur5e", "irb140", "rail-ur10e", "ur5e:axis", "irb140:axis", "rail-ur10e:axis", "panda:axis")
"""What else is looked at."""

LEGS, LOOPS, STEP = 40, 40, 0.002
"""Straight legs, out and back, from a pose to the next, and circles of 0.1 m, in steps [m]."""

FOLDER = Path(hk.__file__).parent / "robot" / "data"

POSES = 4_000


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


def look(name: str) -> None:
    """Asks for poses of random postures: how many are reached, how many by a sheet, the time of a call, and home."""
    robot, rng = hk.load(name.removesuffix(":axis")), np.random.default_rng(20)
    ik = hk.ik(hk.pose(robot, "axis" if name.endswith(":axis") else "twist"))
    poses = robot.pose(rng.uniform(*robot.ranges(np.pi), (POSES, robot.n)))
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
    poses = poses[found.sheet >= 0]
    legs = [leg(*pair) for pair in pairwise(poses[: LEGS + 1])]
    back = [np.concatenate([way, way[-2::-1]]) for way in legs]
    for what, ways in (("legs out and back", back), ("circles", circles(poses))):
        gaps = [gap for way in ways if (gap := home(ik, way)) is not None]
        print(f"  {what}: {len(gaps)} of {len(ways)} whole, home to {max(gaps, default=np.nan):.1e} rad", flush=True)


def leg(first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Poses from one to another: the place along a line, the rotation about one axis."""
    share = np.linspace(0, 1, 2 + int(np.linalg.norm(last[:3, 3] - first[:3, 3]) / STEP))
    way = np.repeat(first[None], len(share), axis=0)
    way[:, :3, 3] += share[:, None] * (last[:3, 3] - first[:3, 3])
    way[:, :3, :3] = Slerp([0, 1], Rotation.from_matrix([first[:3, :3], last[:3, :3]]))(share).as_matrix()
    way[-1] = last
    return way


def circles(poses: np.ndarray) -> list[np.ndarray]:
    """Circles of 0.1 m through poses, each level and at one rotation."""
    angles = np.linspace(0, 2 * np.pi, int(2 * np.pi * 0.1 / STEP))
    ways = np.repeat(poses[:LOOPS, None], len(angles), axis=1)
    ways[:, 1:-1, 0, 3] += 0.1 * (np.cos(angles[1:-1]) - 1)
    ways[:, 1:-1, 1, 3] += 0.1 * np.sin(angles[1:-1])
    return list(ways)


def home(ik: ArmInverse, way: np.ndarray) -> float | None:
    """How far the joints are off at the end of a closed way, but for turns; None where it is not all on one sheet."""
    q = begin = ik(way[0])
    for pose in way[1:]:
        if ik.sheet(pose) is None:
            return None
        q, _, changed = ik.near(pose, q)
        if changed:
            return None
    return float(np.abs((q - begin + np.pi) % (2 * np.pi) - np.pi).max())


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="arms of the catalogue; by default all that have a map")
    parser.add_argument("--look", action="store_true", help="make none, look at those of the package")
    given = parser.parse_args()
    for name in given.names or (*ARMS, *WITHOUT, *OTHERS * given.look):
        (look if given.look else make)(name)


if __name__ == "__main__":
    main()
