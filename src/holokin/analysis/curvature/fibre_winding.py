"""How often the redundant joint goes round along a closed path: in turns of the self-motion, against a disc.

Over the disc of straight lines from the path's start to its points a reference section is known: the postures that
least joint motion leads to along them. At each point of the path the law's posture and the reference lie on one
self-motion. Where that is a closed curve, the law is so many turns of it ahead of the reference. Both agree at the
start, so the turns after the path are a whole number. If it is not 0, no law that agrees with this one on the path
goes on continuously over the disc, as long as the self-motions over it are such curves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.types import Array, Matrix, Vector
from ...motion.ik.newton import newton
from ...motion.ik.posture_search import to_poses
from ...path.straight_path import straight
from ...strategies import SelfMotions
from ...strategies.self_motions import joint_gap
from ...strategies.tasks.free_motion import completing, leaves_free
from ...strategies.tasks.task import Task

QUARTER = 0.25
"""Turns of the self-motion from one sample to the next: half a turn could be either way."""

STEP = 0.1
"""Arc length between the postures that a self-motion is traced by [joint units]."""

LONGEST = 40.0
"""Arc length [joint units] after which a self-motion counts as open; a Panda's closes after 13 or less."""

PIECE = 0.05
"""Way of the tool [m or rad] between two postures of the reference."""

NEAR = 1e-6
"""Last correction [joint units] of a posture that counts as found: what is left is of the order of its square."""

CORRECTIONS = 4
"""Newton corrections of a posture: of a step of 0.1 the first leaves 1e-3, the second 1e-6, the third 1e-12."""

LARGE = 0.5
"""Largest correction of a joint [joint units]: what wants more is close to a singular posture."""


@dataclass(frozen=True, eq=False)
class Turns:
    """How far the law is ahead of the reference at the samples (k,) [turns of the self-motion]; why not, if not."""

    ahead: Vector
    missing: str = ""

    @property
    def largest(self) -> float:
        """From one sample to the next [turns]."""
        return float(np.abs(np.diff(self.ahead)).max()) if len(self.ahead) > 1 else np.inf


def turns(task: Task, Q: Matrix) -> Turns:
    """Of a law's postures (k, n) on a closed path of the tool, which begins at the first.

    Args:
        task: leaves one joint redundant.
    """
    p, R = task.poses(Q)
    middle, reference = _references(task, Q[0], p, R)
    if reference is None or middle is None:
        return Turns(np.zeros(0), "a straight path from its start to one of its points meets a singular posture")
    fibres = self_motions(task, reference)
    if any(fibre is None for fibre in [*fibres, *self_motions(task, middle)]):
        return Turns(np.zeros(0), "a self-motion over the disc of straight paths from its start is no closed curve")
    found = [_share(task, fibre, q) for fibre, q in zip(fibres, Q, strict=True) if fibre is not None]
    known = [share for share in found if share is not None]
    if len(known) < len(found):
        return Turns(np.zeros(0), "the law is on another self-motion than the disc of straight paths from its start")
    return Turns(np.unwrap(known, period=1.0))


def _references(task: Task, q0: Vector, p: Matrix, R: Array) -> tuple[Matrix | None, Matrix | None]:
    """The postures (k, n) that least joint motion leads to on straight paths from q0, halfway and at their ends."""
    if leaves_free(task):
        p, R = completing(task).batch(p[0], R[0], p, R)
    lines = straight(p[0], R[0], p, R)
    size = float(np.linalg.norm([lines.move, lines.turn], axis=2).max())
    pieces = 2 * int(np.ceil(size / PIECE / 2)) or 2
    Q, middle = np.tile(q0, (len(p), 1)), None
    for k in range(1, pieces + 1):
        share = k / pieces
        Q, good = newton(to_poses(task, *lines.at(share)), Q, steps=CORRECTIONS, exact=NEAR, longest=LARGE)
        if not good.all():
            return middle, None
        middle = Q if 2 * k == pieces else middle
    return middle, Q


def self_motions(task: Task, Q: Matrix) -> list[Matrix | None]:
    """The self-motions (points, n) through postures (k, n), all at once, each round once; None for those left open."""
    lines = SelfMotions.through(task, Q).traced(Q, step=STEP, length=LONGEST, limits=False)
    return [line.q if line.closed else None for line in lines]


def _share(task: Task, fibre: Matrix, q: Vector) -> float | None:
    """At which share of its length, from 0 to 1, a self-motion comes by a posture; None where it does not."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fibre, axis=0), axis=1))])
    gap = joint_gap(task.robot, q, fibre)
    i = min(int(np.argmin(np.linalg.norm(gap, axis=1))), len(fibre) - 2)
    step = fibre[i + 1] - fibre[i]
    along = float(gap[i] @ step / (step @ step))
    if not np.linalg.norm(gap[i] - along * step) < STEP / 2:
        return None
    return float((lengths[i] + along * (lengths[i + 1] - lengths[i])) / lengths[-1])
