"""`WholeArm`: the proof that a strategy is one function of the tool pose on the whole arm, at every level."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import NoProofError
from ..base.files import write_text
from ..base.types import Array, NoTruthValue, Value
from ..motion.ik.closed_leaf import held_joints, leaf_class
from ..robot.closed_form import ArmClass, NoClass
from ..robot.closed_form.arm_classes import Link, miss_of_point, screws
from ..robot.closed_form.six_hinges import Family
from ..strategies import HolonomicStrategy, Strategy

FORMAT = "holokin whole-arm certificate 1"

FACTORS = {
    Family.PAIR: "three of its axes meet in a point, and two others lie in one plane",
    Family.PARALLEL: "three of its axes are parallel, and the two at their end meet",
}


@dataclass(frozen=True, eq=False)
class WholeArm(NoTruthValue, Value, ask="`.whole`"):
    """The theorem that the joints of a strategy are one function of the tool pose on the whole arm.

    It holds for every start and every level of the held joints. `arm` is the class of what is left of the arm, with the
    exact model; `seconds` is what it took.
    """

    strategy: HolonomicStrategy
    arm: ArmClass
    seconds: float

    @property
    def whole(self) -> bool:
        """True: the certificate is about the whole arm."""
        return True

    @property
    def title(self) -> str:
        """The names of the strategy, the task and the robot."""
        return f"{self.strategy.name}, {self.strategy.task.name}"

    @property
    def held(self) -> tuple[str, ...]:
        """The names of the held joints."""
        return tuple(self.arm.robot.joint_names[k] for k in self.arm.held)

    @property
    def winding(self) -> tuple[str, ...]:
        """The joints whose range is a turn or more: postures may differ by whole turns of these."""
        robot = self.arm.robot
        wide = robot.hinges & ~((robot.upper - robot.lower) < 2 * np.pi)
        return tuple(name for k, name in enumerate(robot.joint_names) if wide[k] and k not in self.arm.held)

    @cached_property
    def theorem(self) -> str:
        """What is proven, in one sentence."""
        held = f"with {' and '.join(self.held)} held, " if self.held else ""
        turns = f", but for whole turns of {', '.join(self.winding)}" if self.winding else ""
        return (
            f"On the whole arm, for every start{' and level' if self.held else ''}: {held}two postures of the strategy "
            f"{self.strategy.name!r} for the task {self.strategy.task.name!r} that have the same tool pose, and that a "
            f"motion through regular postures of the leaf joins, are the same posture{turns}."
        )

    @property
    def model(self) -> str:
        """What the theorem is about, and how far it is from the robot's own numbers."""
        if max(self.arm.angle, self.arm.distance) < 1e-13:
            return "The model is exact: its numbers are those of the robot."
        return (
            f"The theorem is about an exact model: frames of the robot differ from it by at most "
            f"{self.arm.angle:.1e} rad and {self.arm.distance:.1e} m, each in the frame before."
        )

    @property
    def reason(self) -> str:
        """Why it holds."""
        return (
            f"What is left of the arm is a chain of six hinges: {FACTORS[self.arm.form.family]}. So its inverse takes "
            "three steps, each a root of a cos q + b sin q = d; det [J; J_g] is plus or minus the product of their "
            "slopes s_1 s_2 s_3, and pose and signs of the slopes tell the posture. While [J; J_g] is regular no sign "
            "changes."
        )

    unsaid = (
        "It does not say that a pose is reached, that joints stay within their limits, or that a motion between two "
        "poses stays regular."
    )
    """What the theorem leaves open."""

    def __str__(self) -> str:
        return f"{self.theorem}\n{self.model}\n{self.reason}\n{self.unsaid}"

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, ready for JSON."""
        keys = ("theorem", "whole", "held", "winding", "seconds")
        return {key: getattr(self, key) for key in keys} | {
            "title": self.title,
            "angle": self.arm.angle,
            "distance": self.arm.distance,
        }

    @cached_property
    def data(self) -> dict[str, Any]:
        """What `proof.whole_checker` reads: the exact model as fractions, and the form."""
        links, form = self.arm.links[:-1], self.arm.form
        order = [i for i, link in enumerate(links) if link.coordinate not in self.arm.held]
        order = order[::-1] if form.reversed else order
        last = 3 if form.family is Family.PAIR else 4
        carrier = order[last + 1] if form.reversed else order[last]
        own = _seen_from(self.arm.links, self.arm.held, carrier)
        meeting = [own[i] for i in (order[last:] if form.family is Family.PAIR else order[4:])]
        data: dict[str, Any] = {
            "format": FORMAT,
            "title": self.title,
            "theorem": self.theorem,
            "model": self.model,
            "robot": self.arm.robot.name,
            "joints": [self.arm.robot.joint_names[link.coordinate] for link in links],
            "held": [i for i, link in enumerate(links) if link.coordinate in self.arm.held],
            "form": {"family": form.family.name.lower(), "reversed": form.reversed, "inner": form.inner},
            "distance": [self.arm.angle, self.arm.distance],
            "links": [
                {
                    "rotation": [[str(x) for x in row] for row in link.rotation],
                    "position": [str(x) for x in link.position],
                    "axis": [str(x) for x in link.axis],
                    "slides": link.slides,
                }
                for link in links
            ],
            "center": [str(x) for x in meeting_point(meeting)],
        }
        if form.family is Family.PAIR:
            first, second = (order[2], order[1]) if form.inner else (order[0], order[1])
            seen = _seen_from(self.arm.links, self.arm.held, min(first, second))
            between = [i for i in data["held"] if min(first, second) < i < max(first, second)]
            data["normal"] = [str(x) for x in _normal(seen, first, second, between)]
        return data

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write it as a JSON file. Raises: WriteError."""
        write_text(FilePath(file), json.dumps(self.data, indent=1) + "\n")
        return FilePath(file)


Screws = dict[int, tuple[Array, Array]]


def _seen_from(links: Sequence[Link], held: tuple[int, ...], carrier: int) -> Screws:
    """Direction and point of each joint's axis in the moving frame of one, all free joints at 0, the held ones not."""
    some = (Fraction(3, 5), Fraction(4, 5))
    values = {
        i: ((Fraction(1, 3),) if link.slides else some) for i, link in enumerate(links) if link.coordinate in held
    }
    before = screws(links[: carrier + 1], {i: v for i, v in values.items() if i <= carrier})
    R, p = before[2]
    free, others, _ = screws(links, values)
    both, out = {True: iter(others), False: iter(free)}, {}
    for i, link in enumerate(links):
        if link.coordinate >= 0:
            h, at = next(both[i in values])
            out[i] = R.T @ h, R.T @ (at - p)
    return out


def meeting_point(axes: Sequence[tuple[Array, Array]]) -> Array:
    """The point in which axes meet."""
    found = miss_of_point(axes if len(axes) == 3 else [*axes, axes[0]])
    if found is None:
        raise ValueError
    return found[1]


def _normal(seen: Screws, first: int, second: int, between: list[int]) -> Array:
    """A normal of the plane of two axes; the held axis between them that is square to both, if there is one."""
    (h1, p1), (h2, p2) = seen[first], seen[second]
    for i in between:
        if seen[i][0] @ h1 == 0 and seen[i][0] @ h2 == 0:
            return seen[i][0]
    normal = np.cross(h1, h2)
    return normal if any(normal) else np.cross(h2, p1 - p2)


def whole_arm(strategy: Strategy) -> WholeArm:
    """The proof that a strategy is one function of the tool pose on the whole arm.

    Raises:
        NoProofError: it holds no single joints, or what is left of the arm is in no class; it says how far it is from
            one. A region can be proven all the same.
    """
    from ..motion.ik.leaf import with_leaves

    began, strategy = time.perf_counter(), with_leaves(strategy)
    held, found = held_joints(strategy), leaf_class(strategy)
    region = "prove a region: hk.certify(strategy, path or box, q0), hk.unique_region(strategy, q0)"
    if isinstance(held, str):
        raise NoProofError(strategy.name, f"{held}, so nothing is known of the whole arm: {region}")
    if isinstance(found, NoClass):
        miss = f" (the nearest class is {found.miss:.2g} m or rad away)" if np.isfinite(found.miss) else ""
        raise NoProofError(strategy.name, f"{found.reason}{miss}: {region}")
    return WholeArm(strategy, found, time.perf_counter() - began)
