"""Makes tests/golden/lerobot-*: datasets that LeRobot itself wrote, and what its loader finds in them.

python tests/golden_lerobot.py v3.0 /path/to/python/with/lerobot-0.4.4
python tests/golden_lerobot.py v2.1 /path/to/python/with/lerobot-0.3.3
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk

HERE, GOLDEN = Path(__file__).parent, Path(__file__).parent / "golden"
Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])


def in_lerobot(python: str, *arguments: str) -> Any:
    """What `in_lerobot.py` prints in an environment with LeRobot."""
    command = [python, str(HERE / "in_lerobot.py"), *arguments]
    source = str(Path(hk.__file__).parents[1])
    more = {"HF_HUB_OFFLINE": "1", "HF_HOME": str(Path(python).parents[1] / "hf"), "PYTHONPATH": source}
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | more, timeout=500)
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    return json.loads(done.stdout) if arguments[0] != "make" else None


def episodes(file: Path, count: int = 2, length: int = 12) -> None:
    """Joints of a Panda that drifts round a circle, episode by episode, and its gripper."""
    robot = hk.load("panda")
    start = robot.pose(Q0)[:3, 3]
    law, circle = hk.moore_penrose(hk.pose(robot)), hk.circle(start, center=start - [0.1, 0, 0])
    walk, arrays = hk.follow(law, circle, Q0, samples=length, cycles=count), {}
    for e in range(count):
        q = walk.q[e * length : (e + 1) * length + 1]
        state = np.hstack([q, np.linspace(0, 40, len(q))[:, None]])
        arrays |= {f"state-{e}": state, f"action-{e}": np.vstack([state[1:], state[-1:]])}
    np.savez(file, **arrays)


def facts(python: str, folder: Path, again: Path) -> dict[str, Any]:
    """What LeRobot finds in a dataset, and the statistics that it finds in the one made from it by `retarget`."""
    found, new = in_lerobot(python, "read", str(folder)), in_lerobot(python, "read", str(again))
    columns = {name: found["columns"][name] for name in ("observation.state", "action", "timestamp")}
    changed = ("observation.state", "action")
    return {
        "frames": found["frames"], "episodes": found["episodes"], "features": found["features"], "columns": columns,
        "episode of each row": [int(e[0]) for e in found["columns"]["episode_index"]],
        "retargeted": {name: new["columns"][name] for name in changed},
        "episode stats": [{name: one[name] for name in changed} for one in new["episode stats"]],
    }  # fmt: skip


if __name__ == "__main__":
    version, python = sys.argv[1:3]
    place = GOLDEN / f"lerobot-{version}"
    shutil.rmtree(place, ignore_errors=True)
    shutil.rmtree(GOLDEN / "again", ignore_errors=True)
    episodes(GOLDEN / "episodes.npz")
    in_lerobot(python, "make", str(place), str(GOLDEN / "episodes.npz"))
    (GOLDEN / "episodes.npz").unlink()
    robot = hk.load("panda")
    from holokin.analysis.audit.logs import joint_feature, read_dataset
    from holokin.learning import retarget

    data = read_dataset(place)
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), Q0, limits=True)
    sources = [joint_feature(data, robot, name) for name in ("observation.state", "action")]
    retarget(data, ik, sources, GOLDEN / "again")
    text = json.dumps(facts(python, place, GOLDEN / "again"))
    (GOLDEN / f"lerobot-{version}.json").write_text(text + "\n")
    shutil.rmtree(GOLDEN / "again")
