"""A URDF's tree seen from another link: from one hand of a two-armed robot to the other, for instance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np


def rerooted(joints: Sequence[Any], links: Sequence[Any], base: str) -> tuple[list[Any], list[Any]]:
    """(joints, links) of the same tree with `base` as its root.

    A joint on the way up, T_parent_child = O M(q) with origin O and motion M about its axis a, turns into M about -a
    from the child, since M(q)^-1 is that, and a fixed step O^-1 to the parent.
    """
    above = {joint.child: joint for joint in joints}
    by_name = {link.name: link for link in links}
    taken = {*by_name, *(joint.name for joint in joints)}
    turned: dict[str, list[Any]] = {}
    more = []
    link = base
    while link in above and above[link].name not in turned:
        joint = above[link]
        origin = None if joint.origin is None else np.linalg.inv(np.asarray(joint.origin, dtype=float))
        if joint.type == "fixed":
            turned[joint.name] = [replace(joint, parent=joint.child, child=joint.parent, origin=origin)]
        else:
            between = f"{joint.name} seen from {joint.child}"
            while between in taken:
                between += "'"
            axis = -np.asarray([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
            turned[joint.name] = [
                replace(joint, parent=joint.child, child=between, origin=None, axis=axis),
                replace(
                    joint, name=between, type="fixed", parent=between, child=joint.parent, origin=origin, mimic=None
                ),
            ]
            more.append(replace(by_name[joint.parent], name=between, inertial=None, visuals=[], collisions=[]))
        link = joint.parent
    return [new for joint in joints for new in turned.get(joint.name, [joint])], [*links, *more]
