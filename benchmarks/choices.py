"""Which rule for which arm? What `hk.advise` proposes, and how many sheets a box takes, for docs/measured.md."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

import holokin as hk
from benchmarks.cusps import NAMES
from benchmarks.page import Given, table, versions, wrapped

ADVISED = ("panda", "iiwa14", "xarm7", "openarm-left", "gen3")
BOXED = ("panda", "iiwa14", "xarm7")
BOX = hk.workspace(box=([0.6, 0.0, 0.5], [0.6, 0.6, 0.5]), tilt=np.radians(30))


def advised(names: tuple[str, ...]) -> Iterator[list[str]]:
    """Rows: the best strategy of an arm in the workspace that is proposed for it."""
    for name in names:
        begin = time.process_time()
        best = hk.advise(hk.pose(hk.load(name))).best
        seconds = time.process_time() - begin
        print(best, flush=True)
        yield [NAMES[name], best.name, f"{best.coverage:.1%}", f"{best.speed - 1:.0%}", f"{seconds:.0f} s"]


def boxed(names: tuple[str, ...], samples: int) -> Iterator[list[str]]:
    """Rows: the sheets of the box, and how many of other poses in reach they serve."""
    for name in names:
        robot = hk.load(name)
        begin = time.process_time()
        sheets = hk.sheets(hk.pose(robot), BOX, samples=samples)
        seconds = time.process_time() - begin
        poses = BOX.poses(samples, 1)
        poses = poses[hk.ik(robot).batch(poses).reached]
        served = np.isfinite(sheets.batch(poses).q[:, 0])
        print(f"{name}: {len(sheets)} sheets, {int(served.sum())} of {len(poses)}", flush=True)
        yield [NAMES[name], str(len(sheets)), f"{len(poses):,}", f"{served.mean():.1%}", f"{seconds:.0f} s"]


def section(given: Given) -> tuple[list[str], str]:
    """Ask; the blocks of docs/measured.md, and the versions."""
    names, boxes, samples = (ADVISED[:1], BOXED[1:2], 256) if given.quick else (ADVISED, BOXED, 4096)
    strategies = table(("arm", "best strategy", "served", "joint speed above the least", "took"), advised(names), 2)
    return [
        "## Choices",
        wrapped(
            """What does [`hk.advise`](choose.md#advice) propose, and what does it cost? It is asked for the whole pose
            of the tool in the workspace that it proposes itself for each arm. *Served*: the share of the workspace
            within the joint limits, on one leaf. The least joint speed is that of the best postures found at the same
            poses, whatever their leaves. Times are processor times."""
        ),
        strategies,
        wrapped(
            f"""Where one leaf does not do, [sheets](inverse.md#sheets) may: `hk.sheets` is asked for a box of 1.2 x
            1.2 x 1 m in front of each arm, the tool down and tilted by up to 30 degrees, with {samples:,} sampled
            poses. The share is that of other poses which the arm reaches."""
        ),
        table(("arm", "sheets", "other poses in reach", "served", "took"), boxed(boxes, samples)),
    ], versions("casadi", "numpy", "scipy")
