"""The parts of a certificate's page that are about distances: shapes, pairs, speeds, and where a box is not proven."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from ...base.errors import brief
from ...base.types import Matrix, Vector
from ...path.workspaces import PoseRange
from ...proof import Certificate, joint_rates
from ...proof.open_parts import ANOTHER, CAUSES, END, LIMIT, NEAR, UNPROVEN
from ...proof.proven_region import region_of
from ...robot import LinkShape
from .clear_words import (
    assumed_words,
    floor_words,
    least_of_pairs,
    nearest_of,
    refuted_by,
    shapes_of,
    size_words,
    stand_in_words,
)
from .html_page import html_table
from .proof_words import at_least, at_most, place_words

MOST_ROWS = 150
"""Rows of a table; the file has all."""

MEANT = {
    NEAR: "refuted: in each of these parts a posture was found that is nearer than was asked",
    UNPROVEN: "undecided: the leaf goes on, and no posture was found that is too near, but nothing is proven",
    ANOTHER: "the leaf comes there with other joints than those that continue what is proven",
    LIMIT: "a joint is beyond its limit",
    END: "the leaf does not reach the tool pose",
}
"""What is said of the parts of a box, by cause."""


def open_section(found: Certificate) -> list[str]:
    """Where a box is not proven: shares by cause, and the posture that is too near by most."""
    if found.whole or not isinstance(found.asked, PoseRange):
        return [f"<p class='no'>REFUTED: {escape(str(worst))}.</p>"] if (worst := refuted_by(found)) else []
    parts = region_of(found).parts
    rows = [[escape(MEANT[cause]), _percent(parts.shares[CAUSES[cause]])] for cause in MEANT if cause in parts.cause]
    worst = refuted_by(found)
    said = (
        [f"<p>The worst that was found: {escape(str(worst))}. {escape(_posture(found, worst.q))}</p>"] if worst else []
    )
    about = (
        f"The rest of the box was cut into {len(parts):,} parts, and postures of the leaf were sampled in each: what "
        "they show is measured, and not proven. A part is named after the pose in its middle, or after a posture in it "
        "that is too near."
    )
    table = html_table(["Parts of the box that are not proven", "Share of the box"], rows)
    return ["<h2>Where it is not proven</h2>", table, *said, f"<p class='small'>{about}</p>"]


def clear_sections(found: Certificate) -> list[str]:
    """Speeds; and, where distances are proven, the nearest place, the shapes and the pairs."""
    return [*_distances(found), *_speeds(found)]


def _distances(found: Certificate) -> list[str]:
    clear, near = found.demands.clear, nearest_of(found)
    if clear is None:
        return []
    parts = ["<h2>Shapes and distances</h2>"]
    if near is not None:
        parts.append(
            f"<p>The least distance that is proven over {place_words(found)} is {at_least(near.bound)} m, of "
            f"{_pair(near.names)}: in the cell about the tool position {_place(near.pose)} m, at which the "
            f"distance is {near.distance:.4g} m. {escape(_posture(found, near.q))}</p>"
        )
    assumed = assumed_words(found)
    parts += [f"<p class='no'>{escape(assumed)}.</p>"] if assumed else []
    shapes = shapes_of(clear)
    rows = [_shape_row(found, shape) for shape in shapes[:MOST_ROWS]]
    rows += [[escape(floor_words(clear)), "", "", "as it is"]] if floor_words(clear) else []
    parts.append(html_table(["Shape of", "Kind and size", "Place of its frame", "In the proof"], rows))
    parts += [f"<p class='small'>And {len(shapes) - MOST_ROWS} more.</p>"] if len(shapes) > MOST_ROWS else []
    pairs = [
        [_pair(names), f"{asked:g}" if asked else "no contact", at_least(least)]
        for names, asked, least in least_of_pairs(found)[:MOST_ROWS]
    ]
    head = ["Pair that is looked at", "Asked [m]", "Proven, at least [m]"]
    parts += ["<h3>Pairs</h3>", html_table(head, pairs, numbers=True)] if pairs else []
    left = {one.pair: one.reason for one in clear.looked_at.left_out}
    out = [[_pair(pair), escape(reason)] for pair, reason in list(left.items())[:MOST_ROWS]]
    out += [[escape(brief(one.link)), f"no shape: {escape(brief(one.reason))}"] for one in clear.looked_at.unseen]
    parts += ["<h3>Left out</h3>", html_table(["Not looked at", "Why"], out)] if out else []
    return parts


def _speeds(found: Certificate) -> list[str]:
    """Upper bounds of joint speeds over the tool's, of a box or where distances are proven, too."""
    if not len(found) or not (isinstance(found.asked, PoseRange) or found.demands.clear is not None):
        return []
    rates, robot = joint_rates(found), found.equation.strategy.task.robot
    if not np.isfinite(rates.per_speed).all():
        return []
    turning = bool(rates.per_turn.any())
    head = ["Joint", "while the tool moves at 1 m/s, at most", *["while it turns at 1 rad/s, at most"] * turning]
    rows = []
    for i, joint in enumerate(robot.coordinates):
        limit = f"{rates.limits[i]:.4g} {joint.unit}/s" if np.isfinite(rates.limits[i]) else "none"
        each = [_bound(rates.per_speed[i]), *[_bound(rates.per_turn[i])] * turning]
        rows.append([escape(brief(joint.name)), *(f"{x} {joint.unit}/s" for x in each), limit])
    v = rates.tool_speed
    within = (
        f"So no joint is faster than its limit while the tool moves at {at_least(v)} m/s or slower"
        f"{' and does not turn' if turning else ''}."
        if np.isfinite(v) and v > 0
        else "The model does not have the speed limits of all joints that would bound the speed of the tool."
    )
    table = html_table([*head, "Speed limit in the model"], rows, numbers=True)
    about = (
        f"Upper bounds over {place_words(found)}, on any path of the tool. {within} The checker does not look at this."
    )
    return ["<h2>Speeds of the joints</h2>", table, f"<p class='small'>{about}</p>"]


def _bound(value: float) -> str:
    return at_most(float(value)) if value > 1e-12 else "0"


def _shape_row(found: Certificate, shape: LinkShape) -> list[str]:
    robot, T = found.equation.strategy.task.robot, shape.placement
    frame = "the base" if shape.joint < 0 else f"joint {robot.joints[shape.joint].name}"
    turned = "" if np.allclose(T[:3, :3], np.eye(3), atol=1e-9) else f", z axis along {_row(T[:3, 2])}"
    kind = "obstacle" if shape.obstacle else "carried" if shape.carried else "link"
    place = f"{_row(T[:3, 3])} m{turned}, in the frame of {frame}"
    return [
        f"{escape(brief(shape.link))} ({kind})", escape(size_words(shape.shape)), escape(place),
        escape(stand_in_words(shape.shape)),
    ]  # fmt: skip


def _posture(found: Certificate, q: Vector) -> str:
    joints = zip(found.equation.strategy.task.robot.coordinates, q, strict=True)
    return f"Posture: {', '.join(f'{brief(c.name)} {x:.5g} {c.unit}' for c, x in joints)}."


def _pair(names: tuple[str, str]) -> str:
    return escape(f"{brief(names[0])} and {brief(names[1])}")


def _place(pose: Matrix) -> str:
    return _row(pose[:3, 3])


def _row(values: Sequence[float] | Vector) -> str:
    return f"[{', '.join(f'{x:.5g}' for x in np.round(values, 9) + 0.0)}]"


def _percent(share: float) -> str:
    return f"{100 * share:.2f} %" if share >= 5e-5 else "below 0.01 %"
