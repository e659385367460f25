"""Whether the shapes of a certificate are those of a robot, and of which pairs of them it says nothing."""

from __future__ import annotations

import json
from itertools import chain, combinations, product
from typing import Any

from ..base.errors import brief
from ..motion.checks.gaps import FLOOR
from ..robot import Robot, with_capsules
from .clear_cells import joints_of, shape_of
from .convex_shapes import convex

Body = tuple[str, int, bool]
"""A link or an obstacle: its name, the joint that moves it (-1: none), whether it is a half space."""

MOST_TOLD = 400
"""Letters of a list of pairs or links, at most."""


def other_shapes(clear: dict[str, Any], robot: Robot) -> str:
    """In what the shapes of links in a certificate are not those of a robot; "" where they are.

    Pairs may be left out, see `unsaid`, but not shapes of a link in a pair. Shapes of other names, which stand around
    the robot or which it carries, are the certificate's own.
    """
    clad, own = _clad(robot), _own(robot)
    if clear["joints"] != joints_of(clad):
        return f"its shapes hang on other joints than those of {robot.name}"
    links, texts = {name for name, _, _ in own}, [json.dumps(shape) for shape in clear["shapes"]]
    there: dict[Body, set[str]] = {body: set(of) for body, of in own.items()}
    for shape, text in zip(clear["shapes"], texts, strict=True):
        body, floor = _body(shape), bool(shape["normal"]) and shape["link"] == FLOOR
        if shape["link"] in links and not floor and text not in own.get(body, ()):
            return f"the shape of {shape['link']} is not that of {robot.name}"
        there.setdefault(body, set()).add(text)
    for bodies, tested in _tested(clear, texts).items():
        one, other = sorted(bodies) if len(bodies) == 2 else list(bodies) * 2
        if not {frozenset(of) for of in product(there[one], there[other])} <= tested:
            return f"of {one[0]} and {other[0]} some shapes are left out"
    return ""


def unsaid(data: dict[str, Any], robot: Robot) -> str:
    """In words what a certificate about shapes says nothing of, and which of them are no link's of the robot."""
    if "clear" not in data:
        return ""
    from .clear_checker import digest_of  # which needs python-flint

    own, clear = _own(robot), data["clear"]
    tested = set(_tested(clear, [""] * len(clear["shapes"])))
    links = {name for name, _, _ in own}
    carried = {body for body in map(_body, clear["shapes"]) if body[1] >= 0 and body[0] not in links}
    around = {body for body in map(_body, clear["shapes"]) if body[1] < 0 and (body[0] not in links or body[2])}
    things = {(s.link, s.joint, False) for s in robot.shapes if s.obstacle and not s.shape.fault} | around
    parts = sorted((set(own) - things) | carried)
    moving = (of for of in combinations(parts, 2) if of[0][1] != of[1][1])
    pairs = chain(moving, (of for of in product(parts, sorted(things)) if of[0][1] >= 0))
    left, untold = [], 0  # a stranger's file may have millions
    for pair in (of for of in map(frozenset, pairs) if of not in tested):
        if len(left) < MOST_TOLD:
            left.append(" and ".join(sorted(name for name, _, _ in pair)))
        else:
            untold += 1
    bare = sorted({s.link for s in robot.shapes if s.shape.fault})
    said = [f"\n  the shapes of its links are those of {robot.name}"]
    mine = sorted(f"{s['link']} ({digest_of(s)})" for s in clear["shapes"] if _body(s) in carried)
    said += [f"; its own is {brief(', '.join(mine), MOST_TOLD)}"] if mine else []
    said += [f"\n  it says nothing of {len(left) + untold} pairs: {brief('; '.join(left), MOST_TOLD)}"] if left else []
    said += [f"\n  it says nothing of {brief(', '.join(bare), MOST_TOLD)}, which cannot be read"] if bare else []
    return "".join(said)


def _clad(robot: Robot) -> Robot:
    return with_capsules(robot) if all(shape.obstacle for shape in robot.shapes) else robot


def _own(robot: Robot) -> dict[Body, set[str]]:
    """The shapes of a robot as a certificate has them."""
    found: dict[Body, set[str]] = {}
    for shape in _clad(robot).shapes:
        if not shape.shape.fault:
            found.setdefault((shape.link, shape.joint, False), set()).add(json.dumps(shape_of(convex(shape))))
    return found


def _body(shape: dict[str, Any]) -> Body:
    return shape["link"], shape["joint"], bool(shape["normal"])


def _tested(clear: dict[str, Any], texts: list[str]) -> dict[frozenset[Body], set[frozenset[str]]]:
    """Of each pair of bodies the pairs of their shapes that are held against each other."""
    found: dict[frozenset[Body], set[frozenset[str]]] = {}
    for pair in clear["pairs"]:
        i, j = pair["shapes"]
        bodies = frozenset((_body(clear["shapes"][i]), _body(clear["shapes"][j])))
        found.setdefault(bodies, set()).add(frozenset((texts[i], texts[j])))
    return found
