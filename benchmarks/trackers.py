"""Does ssik's tracker return the joints? Circles from random starts. Part of `python -m benchmarks.drift`.

The tracker is called as ssik's documentation says: `arm.tracker(q)`, then `tracker.update(pose)` for each pose of the
circle, one after the other. Starts are drawn within the joint limits, none is chosen: a circle that leaves the reach
or the limits is refused by the tracker, which says so, and is counted.
"""

from __future__ import annotations

import importlib
from collections import Counter
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

ARMS = {"panda": "Panda", "iiwa14": "iiwa14", "xarm7": "xArm7", "gen3": "Gen3", "yumi_left": "YuMi, left arm"}
"""Names of ssik, and ours."""

RADIUS = 0.1
SAMPLES = 300
"""Poses of a circle: 2.1 mm apart."""

CYCLES = 3
STARTS = 30
SHARE = 0.7
"""Starts are drawn from this share of each joint's range, round its middle; of a joint that turns freely, of a turn."""

REPEATS = 1e-6
"""A last cycle that drifts by less [rad] is called repeated: the tracker answers to 1e-11 m, far from singular."""


@dataclass(frozen=True)
class Tracked:
    """Circles of one arm: drift (done, CYCLES) of the largest joint [rad], and why the others were not done."""

    name: str
    solver: str
    drift: np.ndarray
    held: Counter[str]


def tracked(name: str, starts: int) -> Tracked:
    """Circles at constant orientation, horizontal, from random starts."""
    arm = importlib.import_module("ssik").Manipulator.from_prebuilt(name)
    limits = np.array([pair or (-np.pi, np.pi) for pair in arm.joint_limits], float).clip(-np.pi, np.pi)
    middle, half = limits.mean(axis=1), SHARE * np.ptp(limits, axis=1) / 2
    rng, held, drift = np.random.default_rng(0), Counter(), []
    for q in middle + half * rng.uniform(-1, 1, (starts, len(middle))):
        found = cycles_of(arm, q)
        if isinstance(found, str):
            held[found] += 1
        else:
            drift.append(found)
    return Tracked(name, arm.solver_name, np.array(drift).reshape(-1, CYCLES), held)


def cycles_of(arm: Any, q: np.ndarray) -> list[float] | str:
    """Drift of each circle [rad], or why the tracker held."""
    tracker, first, drift = arm.tracker(q), arm.fk(q), []
    for _ in range(CYCLES):
        before = q
        for angle in np.linspace(0, 2 * np.pi, SAMPLES + 1)[1:]:
            pose = first.copy()
            pose[:2, 3] += RADIUS * np.array([np.cos(angle) - 1, np.sin(angle)])
            step = tracker.update(pose)
            if step.status.name != "OK":
                return step.reason or step.status.name.lower()
            q = step.q
        drift.append(float(np.abs(q - before).max()))
    return drift


def tracker_page(quick: bool) -> list[str]:
    """Lines of a page."""
    try:
        found = [tracked(name, 2 if quick else STARTS) for name in ARMS]
    except ImportError as problem:
        return ["## ssik's tracker\n", f"Left out: ssik ({problem.name or 'a part of it'} is not installed).\n"]
    starts = 2 if quick else STARTS
    lines = [
        "## ssik's tracker\n",
        f"ssik {version('ssik')} gives joints, not joint rates, so it is measured on its own: `arm.tracker(q)`, then",
        f"`tracker.update(pose)` at {SAMPLES} poses of a horizontal circle of {RADIUS} m at constant orientation,",
        f"{CYCLES} cycles, from {starts} starts drawn in {SHARE:.0%} of the joint ranges, on the arms that it ships.",
        "Done: starts with status OK all along; the tracker refuses the others, with the reason. Repeats: the last",
        f"cycle drifts by less than {REPEATS:g} rad. Drift: of the largest joint in a cycle [rad], of those done.\n",
        "By its documentation the tracker holds a coordinate of the redundancy on arms whose solver is",
        "`seven_r.spherical_shoulder` (joint 7) or `seven_r.srs` (the swivel), and where it cannot, and on all other",
        "arms, takes the solution nearest to its last.\n",
        "| arm | solver of ssik | done | refused | repeats | first cycle, median | most | last cycle, median | most |",
        "|---|---|---:|---|---:|---:|---:|---:|---:|",
    ]
    for t in found:
        why = ", ".join(f"{count} {reason}" for reason, count in sorted(t.held.items())) or "-"
        cells = [f"{f(t.drift[:, k]):.1e}" if len(t.drift) else "-" for k in (0, -1) for f in (np.median, np.max)]
        repeats = int((t.drift[:, -1] < REPEATS).sum())
        lines.append(f"| {ARMS[t.name]} | `{t.solver}` | {len(t.drift)} | {why} | {repeats} | {' | '.join(cells)} |")
    return [*lines, ""]
