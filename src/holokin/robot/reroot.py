"""A tree seen from another link: from one hand of a two-armed robot to the other, for instance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .tree import Branch, Tree, above_of


def rerooted(tree: Tree, base: str) -> Tree:
    """The same tree with `base` as its root.

    A joint on the way up, T_parent_child = O M(q) with origin O and motion M about its axis a, turns into M about -a
    from the child, since M(q)^-1 is that, and a fixed step O^-1 to the parent.
    """
    above = above_of(tree)
    taken = {*tree.links, *(joint.name for joint in tree.joints)}
    turned: dict[str, list[Branch]] = {}
    between: dict[str, None] = {}
    link = base
    while link in above and above[link].name not in turned:
        joint = above[link]
        back = np.asarray(np.linalg.inv(joint.origin), dtype=np.float64)
        if joint.kind == "fixed":
            turned[joint.name] = [Branch(joint.name, "fixed", joint.child, joint.parent, back)]
        else:
            name = f"{joint.name} seen from {joint.child}"
            while name in taken:
                name += "'"
            moving = replace(joint, parent=joint.child, child=name, origin=np.eye(4), axis=-joint.axis)
            turned[joint.name] = [moving, Branch(name, "fixed", name, joint.parent, back)]
            between[name] = None
        link = joint.parent
    joints = tuple(new for joint in tree.joints for new in turned.get(joint.name, [joint]))
    return replace(tree, links={**tree.links, **between}, joints=joints)
