"""What each robot of the catalogue is compared with: published poses and closed forms."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk

PUBLISHED = tomllib.loads((Path(__file__).parent / "published.toml").read_text("utf-8"))


@dataclass(frozen=True)
class Referee:
    """Whose poses they are in words, the rounding of their position [m], and the poses.

    `pose(q)` is that of the tip, asked at the `postures`, or at random ones; `turned` is the rounding of its rotation.
    """

    robot: str
    words: str
    within: float
    pose: Callable[[np.ndarray], np.ndarray]
    postures: tuple[tuple[float, ...], ...] = ()
    tip: str | None = None
    turned: float = 1e-12

    def differences(self) -> tuple[float, float]:
        """The largest differences of a position [m] and of an element of the rotation from the catalogue's."""
        robot = hk.load(self.robot)
        Q = self.postures or np.clip(
            np.random.default_rng(0).uniform(-1.5, 1.5, (10, robot.n)), robot.lower, robot.upper
        )
        apart = np.abs([robot.pose(q, self.tip) - self.pose(np.asarray(q)) for q in Q]).max(axis=0)
        return apart[:3, 3].max(), apart[:3, :3].max()


def at(position: np.ndarray | tuple[float, ...], turn: float = 0.0) -> np.ndarray:
    """The pose at a position, turned about z."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("z", turn).as_matrix(), position
    return T


def published(entry: dict) -> Callable[[np.ndarray], np.ndarray]:
    """The poses of an entry of published.toml."""
    table = {tuple(q): (p, R) for q, p, R in entry["at"]}

    def pose(q: np.ndarray) -> np.ndarray:
        T = np.eye(4)
        T[:3, 3], T[:3, :3] = table[tuple(q)][0], np.reshape(table[tuple(q)][1], (3, 3))
        return T

    return pose


def on(base: Callable[[np.ndarray], np.ndarray], joints: int, arm: str) -> tuple[Callable, tuple]:
    """Published poses of an arm on a base of so many joints, and postures of both."""
    (entry,) = [e for e in PUBLISHED["poses"] if e["robot"] == arm]
    carried, rng = published(entry), np.random.default_rng(1)
    postures = tuple((*rng.uniform(0, 1, joints), *q) for q, _, _ in entry["at"])
    return lambda q: base(q[:joints]) @ carried(q[joints:]), postures


def planar_3r(q: np.ndarray) -> np.ndarray:
    """x = sum cos(q1 + ... + qi), y = sum sin(q1 + ... + qi)."""
    turns = np.cumsum(q)
    return at((np.cos(turns).sum(), np.sin(turns).sum(), 0.0), turns[-1])


def irb140(q: np.ndarray) -> np.ndarray:
    """P. Corke's table, mdl_irb140 of robotics-toolbox-matlab, whose joints 2, 3 and 5 turn the other way round."""
    # its last row turns the frame of the tip by another 90 deg about x: 0 here
    table = ((0.352, 0.07, -90), (0, 0.36, 0), (0, 0, 90), (0.38, 0, -90), (0, 0, 90), (0.065, 0, 0))
    T = at((0, 0, -0.352))  # its floor; Table I of the paper counts from axis 2
    for (d, a, alpha), theta in zip(table, q * [1, -1, -1, 1, -1, 1] + [0, 0, np.pi, 0, 0, np.pi], strict=True):
        link = at((a * np.cos(theta), a * np.sin(theta), d))
        link[:3, :3] = Rotation.from_euler("ZX", [theta, np.deg2rad(alpha)]).as_matrix()
        T = T @ link
    return T


def rail(q: np.ndarray) -> np.ndarray:
    return at((q[0], 0, 0))


def planar_base(q: np.ndarray) -> np.ndarray:
    return at((q[0], q[1], 0.5), q[2])


def referees() -> list[Referee]:
    """All of them: one or more a robot."""
    found = [
        Referee("planar-3r", "closed form", 1e-12, planar_3r),
        Referee(
            "ppr",
            "closed form: section IV of the paper",
            1e-12,
            lambda q: at((q[0] + np.cos(q[2]), q[1] + np.sin(q[2]), 0), q[2]),
        ),
        Referee("irb140", "robotics-toolbox-matlab: mdl_irb140", 1e-12, irb140),
        Referee("rail", "closed form", 1e-12, rail),
        Referee("planar-base", "closed form", 1e-12, planar_base),
        Referee("rail-ur10e", "closed form of the rail, ur-analytic-ik 0.1.0.post3", 1e-12, *on(rail, 1, "ur10e")),
        Referee(
            "mobile-ur5e", "closed form of the base, ur-analytic-ik 0.1.0.post3", 1e-12, *on(planar_base, 3, "ur5e")
        ),
    ]
    for entry in PUBLISHED["poses"]:
        postures = tuple(tuple(q) for q, _, _ in entry["at"])
        found.append(
            Referee(
                entry["robot"],
                entry["words"],
                entry["position"],
                published(entry),
                postures,
                entry["tip"],
                entry["rotation"],
            )
        )
    return found
