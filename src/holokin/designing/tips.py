"""The link of a URDF that is its tool: the palm at the end of its longest arm."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..arguments import typed
from ..errors import RobotFileError
from ..robot import model_links

WORDS = ("tcp", "tool_center", "grasp", "tool", "end_effector", "effector", "eef", "ee_", "flange", "gripper", "hand")
"""Parts of names that links for tools have, the plainest first."""

ARM = 4
"""Joints that an arm has at least: what branches behind fewer is a trunk, not a hand."""

JAW = ("finger", "jaw", "gripper", "thumb")
"""Parts of names that joints of grippers have: such a joint at the end of a chain does not move the tool."""

Chains = Mapping[str, tuple[str, ...]]


@typed
def choose_tip(path: str | Path, base: str | None = None) -> str:
    """The link that is the tool of a URDF that nobody has seen before.

    Fingers do not count: the chain ends where the tree branches into them, that is behind at least 4 joints, and into
    chains no longer than the one before; or before a last joint named like a gripper's. Of the chains that are left
    it is the longest, the first one in the file; of the links that move with its end it is the one whose name says
    so ("tcp", "tool", ...), the last one of several.

    Raises:
        RobotFileError: no link moves. As `model_links`.
    """
    chains = model_links(path, base)
    ends = [_palm(chain, chains) for chain in chains.values()]
    most = max(map(len, ends), default=0)
    if most == 0:
        raise RobotFileError(path, "has no joint that moves", "give a URDF of an arm")
    end = next(chain for chain in ends if len(chain) == most)
    links = [link for link, chain in chains.items() if chain == end]
    return min(reversed(links), key=_rank)


def _palm(chain: tuple[str, ...], chains: Chains) -> tuple[str, ...]:
    """A chain of joints without those of fingers."""
    while len(chain) > ARM and any(word in chain[-1].lower() for word in JAW):
        chain = chain[:-1]
    for k in range(ARM, len(chain)):
        beyond = [other[k:] for other in chains.values() if len(other) > k and other[:k] == chain[:k]]
        if len({other[0] for other in beyond}) > 1 and max(map(len, beyond)) <= k:
            return chain[:k]
    return chain


def _rank(link: str) -> int:
    return next((i for i, word in enumerate(WORDS) if word in link.lower()), len(WORDS))
