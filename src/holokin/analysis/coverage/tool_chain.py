"""The chain of a robot that is asked about: of a URDF that to the palm at the end of its longest arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ...base.arguments import typed
from ...base.errors import ArgumentError, RobotFileError
from ...base.types import Value
from ...robot import Robot, is_model, load, model_links, model_root

ARM = 4
"""Joints that an arm has at least: what branches behind fewer is a trunk, not a hand."""


@dataclass(frozen=True, eq=False)
class Chain(Value):
    """A robot, and of a URDF the link that stands still, its tool, and the links that might have been the tool instead.

    chosen: whether the tool was not given but chosen here.
    """

    robot: Robot
    base: str | None
    tip: str
    others: tuple[str, ...]
    chosen: bool

    def __str__(self) -> str:
        n, names = self.robot.n, self.robot.joint_names
        ends = f", from {self.base} to the tip {self.tip}" if self.base else f", tip {self.tip}"
        others = f" (other tips: {', '.join(self.others)})" if self.others else ""
        return f"{self.robot.name}: {n} joint{'s' * (n > 1)}, {names[0]} to {names[-1]}{ends}{others}"


@typed
def chain_to_tool(
    robot: Robot | str | Path, tip: str | None = None, base: str | None = None, trust_units: bool = False
) -> Chain:
    """A robot, a name of the catalogue or a file as a chain, of a model by default to the tip of its longest arm.

    Raises:
        RobotFileError: no link moves. ArgumentError: a base for a robot that is loaded already. As `load`.
    """
    if isinstance(robot, Robot):
        if base is not None:
            raise ArgumentError("the base", base, "only files of models take one: give the file, or load it so")
        return Chain(robot, None, tip or robot.tips[0].name, (), False)
    if not is_model(robot):
        loaded = load(robot, tip=tip, base=base, trust_units=trust_units)
        return Chain(loaded, None, loaded.tips[0].name, (), False)
    tips = _arm_tips(robot, base)
    chosen = tip if tip is not None else tips[0]
    loaded = load(robot, tip=chosen, base=base, trust_units=trust_units)
    return Chain(loaded, base or model_root(robot), chosen, tuple(t for t in tips if t != chosen), tip is None)


def _arm_tips(path: str | Path, base: str | None = None) -> tuple[str, ...]:
    """The links of a model that may be tools, one for each arm, that of the longest arm first.

    Fingers do not count: a chain ends where the tree branches into them, that is behind at least 4 joints, and into
    chains no longer than the one before; or before a last joint named like a gripper's. Of chains as long as each
    other the first one in the file comes first; of the links that move with its end that one is the tool whose name
    says so ("tcp", "tool", ...), the last one of several.

    Raises:
        RobotFileError: no link moves. As `model_links`.
    """
    chains = model_links(path, base)
    ends = {link: _palm(chain, chains) for link, chain in chains.items()}
    longest = max(map(len, ends.values()), default=0)
    if longest == 0:
        raise RobotFileError(path, "has no joint that moves", "give a model of an arm")
    inner = {chain[:k] for chain in ends.values() for k in range(len(chain))}
    arms = [end for end in dict.fromkeys(ends.values()) if end not in inner and len(end) >= min(ARM, longest)]
    # Parts of names that links for tools have, the plainest first
    words = [
        "tcp",
        "tool_center",
        "grasp",
        "tool",
        "end_effector",
        "effector",
        "eef",
        "ee_",
        "flange",
        "gripper",
        "hand",
    ]

    def rank(link: str) -> int:
        return next((i for i, word in enumerate(words) if word in link.lower()), len(words))

    tips = [[link for link, chain in chains.items() if chain == end] for end in sorted(arms, key=len, reverse=True)]
    return tuple(min(reversed(links), key=rank) for links in tips)


def _palm(chain: tuple[str, ...], chains: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """A chain of joints without those of fingers: a last joint named like a gripper's does not move the tool."""
    while len(chain) > ARM and any(word in chain[-1].lower() for word in ("finger", "jaw", "gripper", "thumb")):
        chain = chain[:-1]
    for k in range(ARM, len(chain)):
        beyond = [other[k:] for other in chains.values() if len(other) > k and other[:k] == chain[:k]]
        if len({other[0] for other in beyond}) > 1 and max(map(len, beyond)) <= k:
            return chain[:k]
    return chain
