"""How much of one box of tool poses does each law of a Panda reach, from one posture?

    python -m benchmarks.workspaces            # prints the table of docs/workspaces.md
    python -m benchmarks.workspaces --wrists   # that of docs/theory.md: arm angles by wrists and starts, on three arms

What 400 random poses gave instead of Sobol's, with other code, is in docs/limits.md.
"""

from __future__ import annotations

import argparse

import numpy as np

import holokin as hk
from holokin.analysis.coverage import PoseStatus, posture_reach
from holokin.strategies import HolonomicStrategy

from .advice import located

READY = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
"""The usual ready posture of a Panda; the tool looks down."""

ARMS = {
    "panda": ("panda", READY),
    "iiwa14": ("iiwa14", np.array([0, 0.5, 0, -1.6, 0, np.pi - 2.1, 0])),
    "xarm7": ("xarm7.urdf", np.array([0, 0.3, 0, 0.8, 0, 0.5, 0])),
}
"""Name -> (file of example-robot-data, or name of the catalogue; a posture with the tool down and the elbow above)."""

BOX = hk.workspace(box=([0.5, 0.0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.radians(90))
LOST = (PoseStatus.ALGORITHMIC, PoseStatus.KINEMATIC, PoseStatus.REPRESENTATION, PoseStatus.STOPPED)
HEAD = "law | poses | reached | joint limit | leaf ends | no posture found | rcond, least"


def laws(task: hk.Task) -> list[tuple[str, HolonomicStrategy, np.ndarray]]:
    """(name, law, start) of all."""
    centring = hk.holonomic(task, hk.stationary(hk.strategies.constraints.centring_cost()))
    return [
        ("stationary centring, on its leaf 0", centring, hk.motion.ik.move_to_leaf(centring, READY)),
        ("stationary centring, on the leaf of the start", centring, READY),
        ("q1 - q3 kept", hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0])), READY),
        ("joint 3 locked", hk.holonomic(task, hk.lock(2)), READY),
        ("joint 1 locked", hk.holonomic(task, hk.lock(0)), READY),
        ("arm angle, stereographic", hk.holonomic(task, hk.arm_angle()), READY),
        ("arm angle, conventional", hk.holonomic(task, hk.arm_angle(definition="conventional")), READY),
        ("radial about the start, 4 steps", hk.radial(hk.moore_penrose(task), READY), READY),
        ("radial about the start, 16 steps", hk.radial(hk.moore_penrose(task), READY, steps=16), READY),
    ]


def wrists(count: int) -> None:
    """Print how many poses the arm angle reaches by its wrist, its kind and the elbow's place at the start."""
    swings = (0, 15, 60, -60)
    print(f"| arm | angle | wrist | {' | '.join(f'{s:+d} deg' if s else 'elbow above' for s in swings)} |")
    print(f"|---|---|---|{'---:|' * len(swings)}")
    for name, (file, ready) in ARMS.items():
        task = hk.pose(hk.load(located(file)))
        for kind in ("stereographic", "conventional"):
            for wrist, joints in (("found", None), ("origin of joint 7", (1, 3, 6))):
                law, cells = hk.holonomic(task, hk.arm_angle(definition=kind, joints=joints)), []
                for swing in np.radians(swings):
                    start = hk.motion.ik.move_to_leaf(law, ready, law.g(ready) + swing) if swing else ready
                    found = hk.coverage(law, BOX, start, samples=count, explain=False)
                    aside = int((found.status <= PoseStatus.LIMIT).sum())
                    cells.append(f"{int(found.reached.sum())} ({aside})")
                print(f"| {name} | {kind} | {wrist} | {' | '.join(cells)} |", flush=True)


def main(arguments: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=400)
    parser.add_argument("--wrists", action="store_true", help="arm angles on three arms")
    parser.add_argument("--quick", action="store_true", help="8 poses, two laws")
    asked = parser.parse_args(arguments)
    count = 8 if asked.quick else asked.poses
    if asked.wrists:
        wrists(count)
        return 0
    task = hk.pose(hk.load("panda"))
    reach = posture_reach(task, BOX, READY, samples=count)
    print(f"{BOX}; start {np.round(READY, 4).tolist()}\n\n| {HEAD} |\n|---|{'---:|' * HEAD.count('|')}")
    for name, law, start in laws(task)[2:4] if asked.quick else laws(task):
        found = hk.coverage(law, BOX, start, samples=count, reach=reach)
        lost = sum(found.count(status) for status in LOST)
        none = found.count(PoseStatus.BEYOND_LIMITS) + found.count(PoseStatus.OUT_OF_REACH)
        rcond = found.rcond[found.reached].min(initial=np.inf)
        limit = found.count(PoseStatus.LIMIT)
        cells = (name, count, int(found.reached.sum()), limit, lost, none, f"{rcond:.2g}")
        print(f"| {' | '.join(map(str, cells))} |", flush=True)
    within, anyhow = int(reach.within.sum()), int(reach.anyhow.sum())
    print(f"\nAny posture within the limits: {within} of {count}; limits aside: {anyhow}.")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
