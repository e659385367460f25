"""`WholeArm`: the proof that a strategy is one function of the tool pose on the whole arm, at every level."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import NoProofError
from ..base.files import write_text
from ..base.types import Array, NoTruthValue, Value, kept
from ..motion.ik.closed_leaf import held_joints, leaf_class
from ..motion.ik.leaf import with_leaves
from ..robot.closed_form import ArmClass, NoClass
from ..robot.closed_form.arm_classes import miss_of_point, screws
from ..robot.closed_form.six_hinges import Family
from ..strategies import HolonomicStrategy, Strategy

FORMAT = "holokin whole-arm certificate 1"

REGION = "prove a region: hk.certify(strategy, path or box, q0), hk.unique_region(strategy, q0)"


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
    def follows(self) -> bool:
        """Whether the held joints follow the tool's pose."""
        return self.strategy.constraint.tilt is not None

    @property
    def winding(self) -> tuple[str, ...]:
        """The joints whose range is a turn or more: postures may differ by whole turns of these."""
        robot = self.arm.robot
        wide = robot.hinges & ~((robot.upper - robot.lower) < 2 * np.pi)
        return tuple(name for k, name in enumerate(robot.joint_names) if wide[k] and k not in self.arm.held)

    @cached_property
    def theorem(self) -> str:
        """What is proven, in one sentence.

        Two postures of a leaf that have the same tool pose, and that a motion through regular postures of the leaf
        joins, are the same posture, but for whole turns of joints.
        """
        names = " and ".join(self.held)
        rule = f"({', '.join(self.held)})" if len(self.held) > 1 else names
        held = f", and at whatever value {names} {'are' if len(self.held) > 1 else 'is'} held" if names else ""
        held = f", with {rule} = h(tool pose) + any level" if self.follows else held
        turns = ", ".join(self.winding) or "none"
        return (
            f"On the whole arm, from whatever start{held}: when the tool, moved by {self.strategy.name!r} for the task "
            f"{self.strategy.task.name!r}, comes back to a pose, and no posture on the way was singular, the joints "
            f"are back, too, but for whole turns (within the limits: {turns})."
        )

    @property
    def model(self) -> str:
        """What the theorem is about, and how far it is from the robot's own numbers."""
        if self.arm.exact:
            return "The proof is about the numbers of the robot as they are."
        return (
            f"The proof is about a robot with exact angles and lengths: each frame of yours differs from it by at most "
            f"{self.arm.angle:.1e} rad and {self.arm.distance:.1e} m, seen from the frame before."
        )

    @property
    def reason(self) -> str:
        """Why it holds.

        The inverse takes three steps, each a root of a cos q + b sin q = d. The determinant of the Jacobian of the six
        is plus or minus the product of the slopes s_1 s_2 s_3, and pose and signs of the slopes tell the posture. While
        [J; J_g] is regular no sign changes. Where the held joints follow the tool, a pose tells h, and
        det [J; e_k - h' J] = det [J; e_k], so this is as if joint k were held.
        """
        six = f"With {' and '.join(self.held)} held, the rest of the arm has" if self.held else "The arm has"
        follows = " The pose tells at which values the held joints are." * self.follows
        return (
            f"{six} six hinges: {self.arm.form.family.value}. So a pose has at most eight postures, which three signs "
            f"tell apart (as shoulder left or right, elbow up or down), whole turns aside, and a sign can change at a "
            f"singular posture only.{follows}"
        )

    unsaid = (
        "It is not proven that a pose is reached, that joints stay within their limits, or that a motion between two "
        "poses meets no singular posture."
    )
    """What the theorem leaves open."""

    def __repr__(self) -> str:
        return f"WholeArm({self.title!r}, held: {', '.join(self.held) or 'none'})"

    def __str__(self) -> str:
        return f"{self.theorem}\n{self.model}\n{self.reason}\n{self.unsaid}"

    def table(self) -> str:
        """Which joints are held, the class, and how far the exact model is from the robot, as lines of text."""
        form = self.arm.form
        return "\n".join(
            [
                "proven: the whole arm, for every start and level",
                f"held: {', '.join(self.held) or 'none'}",
                f"class: {form.family.value}, at the {'base' if form.reversed else 'tool'}",
                f"exact model: {self.arm.angle:.1e} rad and {self.arm.distance:.1e} m from the robot",
                f"whole turns within the limits: {', '.join(self.winding) or 'none'}",
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data, ready for JSON."""
        keys = ("theorem", "whole", "held", "follows", "winding", "seconds")
        return {key: getattr(self, key) for key in keys} | {
            "title": self.title,
            "angle": self.arm.angle,
            "distance": self.arm.distance,
        }

    @cached_property
    def data(self) -> dict[str, Any]:
        """What `proof.whole_checker` reads: the exact model as fractions, and the form."""
        links, form = self.arm.links[:-1], self.arm.form
        return {
            "format": FORMAT,
            "title": self.title,
            "theorem": self.theorem,
            "model": self.model,
            "robot": self.arm.robot.name,
            "joints": [self.arm.robot.joint_names[link.coordinate] for link in links],
            "held": [i for i, link in enumerate(links) if link.coordinate in self.arm.held],
            "follows": self.follows,
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
            **_center_and_normal(self.arm),
        }

    @typed
    def save(self, file: str | FilePath) -> FilePath:
        """Write it as a JSON file. Raises: WriteError."""
        write_text(FilePath(file), json.dumps(self.data, indent=1) + "\n")
        return FilePath(file)


@kept
def _center_and_normal(arm: ArmClass) -> dict[str, Any]:
    """The point in which axes meet, and a normal of the plane of two, each in a link in which it is fixed.

    Raises: NoProofError: there is no such link, since the held joints move it in all of them.
    """
    chain = [i for i, link in enumerate(arm.links[:-1]) if link.coordinate not in arm.held]
    order = chain[::-1] if arm.form.reversed else chain
    if arm.form.family is Family.PARALLEL:
        return _fixed(arm, "center", order[4:], meeting_point)
    pair = (order[2], order[1]) if arm.form.inner else (order[0], order[1])
    return _fixed(arm, "center", order[3:], meeting_point) | _fixed(arm, "normal", list(pair), _normal)


Screws = Sequence[tuple[Array, Array]]


def _fixed(arm: ArmClass, name: str, axes: list[int], of: Callable[[Screws], Array]) -> dict[str, Any]:
    """What axes have in common, seen from a link between the first two, in which it is whatever the held joints are."""
    links = arm.links
    for carrier in range(min(axes[:2]), max(axes[:2])):
        seen = []
        for t in (Fraction(1, 3), Fraction(-2, 5), Fraction(3, 4)):
            spot = ((1 - t * t) / (1 + t * t), 2 * t / (1 + t * t))
            held = {i: (t,) if link.slides else spot for i, link in enumerate(links) if link.coordinate in arm.held}
            R, p = screws(links[: carrier + 1], {i: v for i, v in held.items() if i <= carrier})[2]
            free, others, _ = screws(links, held)
            both = {True: iter(others), False: iter(free)}
            every = [next(both[i in held]) for i in range(len(links) - 1)]
            seen.append(of([(R.T @ every[i][0], R.T @ (every[i][1] - p)) for i in axes]))
        # Of a normal the direction counts alone, and it is 0 where the axes are parallel at these values.
        some = max(seen, key=lambda vector: vector @ vector)
        same = [not any(np.cross(some, v) if name == "normal" else some - v) for v in seen]
        if all(same):
            return {name: {"link": carrier, "vector": [str(x) for x in some]}}
    raise NoProofError(arm.robot.name, f"the {name} of its axes moves in every link with the held joints: {REGION}")


def meeting_point(axes: Screws) -> Array:
    """The point in which axes meet."""
    if (found := miss_of_point(axes if len(axes) == 3 else [*axes, axes[0]])) is None:
        raise ValueError("the class tells that they meet")
    return found[1]


def _normal(axes: Screws) -> Array:
    """A normal of the plane of two axes; 0 where they are parallel."""
    return np.cross(axes[0][0], axes[1][0])


def whole_arm(strategy: Strategy) -> WholeArm:
    """The proof that a strategy is one function of the tool pose on the whole arm.

    Raises:
        NoProofError: it holds no single joints, or what is left of the arm is in no class; it says how far it is from
            one. A region can be proven all the same.
    """
    began, strategy = time.perf_counter(), with_leaves(strategy)
    held, found = held_joints(strategy), leaf_class(strategy)
    if isinstance(held, str):
        raise NoProofError(strategy.name, f"{held}, so that nothing can be proven of the whole arm: {REGION}")
    names = [strategy.task.robot.joint_names[k] for k in found.held]
    rest = f"with {' and '.join(names)} held, " if names else ""
    if isinstance(found, NoClass):
        if found.singular:
            raise NoProofError(strategy.name, f"{rest}{found.reason}: hold another joint")
        miss = f" (an arm of which it is so is {found.miss:.2g} m or rad away)" if np.isfinite(found.miss) else ""
        fact = f"{rest}nothing can be proven of the whole arm, since {found.reason}{miss}"
        raise NoProofError(strategy.name, f"{fact}: {REGION}")
    if not found.proven:
        fact = "a pose may have postures that no signs, as elbow up or down, tell apart"
        raise NoProofError(strategy.name, f"{rest}nothing can be proven of the whole arm, since {fact}: {REGION}")
    _center_and_normal(found)  # raises where no file could be written
    return WholeArm(strategy, found, time.perf_counter() - began)
