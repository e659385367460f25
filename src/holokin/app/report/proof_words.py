"""What the page of a certificate says in words: its first line, what is claimed, and what is not proven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from ...base.errors import brief
from ...base.types import Vector, kept
from ...base.units import at_least, at_most
from ...motion.checks import PairDistance
from ...motion.checks.clearance import FLOOR, FloorGap, LinkGap
from ...path import Path
from ...path.editing import paths_of
from ...path.workspaces import PoseRange, Workspace
from ...proof import Certificate, Extent, joint_rates
from ...proof.clear_cells import AROUND, MOST_POINTS, ClearCells
from ...proof.kept_apart import gap_distances, looked_at, too_near_along
from ...proof.proven_region import region_of
from ...proof.recheck import CheckerWord, Outcome
from ...robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape
from ...strategies.tasks.task import Task
from .plots import joint_unit

# --- What a certificate says of distances, in words: shapes, pairs, the nearest place, and postures that are too near.


@kept
def refuted_by(certificate: Certificate) -> PairDistance | None:
    """A posture that is nearer than was asked, where what was asked is not proven; None where none was found."""
    if certificate.whole or certificate.demands.clear is None:
        return None
    box = isinstance(certificate.asked, PoseRange)
    return region_of(certificate).parts.worst if box else too_near_along(certificate)


def shapes_of(clear: ClearCells) -> list[LinkShape]:
    """All shapes that the proof is about, obstacles first."""
    gaps = [gap for gap in clear.looked_at.gaps if isinstance(gap, (LinkGap, FloorGap))]
    links = [link for gap in gaps for link in ((gap.link,) if isinstance(gap, FloorGap) else (gap.one, gap.other))]
    once = {id(shape): shape for link in links for shape in link.shapes}
    return sorted(once.values(), key=lambda shape: (not shape.obstacle, shape.joint))


def size_words(shape: Shape) -> str:
    """The kind of a shape, and its sizes."""
    if isinstance(shape, Box):
        return f"box, {_lengths(shape.sides, ' x ')} m"
    if isinstance(shape, Capsule):
        length = f", length {shape.length:.4g} m without its round ends" if shape.length else ""
        return f"{'capsule' if length else 'sphere'}, radius {shape.radius:.4g} m{length}"
    if isinstance(shape, Cylinder):
        return f"cylinder, radius {shape.radius:.4g} m, length {shape.length:.4g} m"
    if isinstance(shape, Ellipsoid):
        return f"ellipsoid, half axes {_lengths(shape.radii, ', ')} m"
    corners = shape.hull.corners if isinstance(shape, Mesh) else shape.corners if isinstance(shape, Hull) else None
    if corners is None:
        return type(shape).__name__.lower()
    kind = f"mesh {shape.file.name}" if isinstance(shape, Mesh) else "convex hull of points"
    return f"{kind}, {_lengths(np.ptp(corners, axis=0), ' x ')} m"


def stand_in_words(shape: Shape) -> str:
    """What stands for a shape in the proof."""
    if isinstance(shape, Cylinder):
        return f"a prism of {AROUND} sides that holds it"
    if isinstance(shape, Ellipsoid):
        return "a box with round edges that holds it"
    corners = shape.hull.corners if isinstance(shape, Mesh) else shape.corners if isinstance(shape, Hull) else ()
    words = []
    if isinstance(shape, Mesh):
        words.append(f"its convex hull{'' if shape.convex else ': the mesh is NOT convex, its hollows count as full'}")
    if len(corners) > MOST_POINTS:
        words.append(f"{MOST_POINTS} of its {len(corners)} corners, with a radius that holds the others")
    return "; ".join(words) or "as it is"


def _lengths(values: Sequence[float] | Vector, between: str) -> str:
    return between.join(f"{float(x):.4g}" for x in values)


def nearest_of(certificate: Certificate) -> tuple[float, PairDistance] | None:
    """The least distance [m] that is proven, and how far apart its pair is in the middle of the cell where it is; None
    where nothing is proven, or no pair is held against the clearance."""
    clear, nearest = certificate.demands.clear, certificate.nearest_pair
    if clear is None or nearest is None:
        return None
    names, bound = nearest
    shapes = [p for p, pair in enumerate(clear.pairs) if pair.names == names]
    i = int(np.argmin(certificate.findings.apart[:, shapes].min(axis=1)))
    q = certificate.cells.q0[i, : certificate.equation.joints]
    distances = gap_distances(clear, q[None])[0]
    gap = min((g for g, of in enumerate(clear.looked_at.gaps) if of.names == names), key=lambda g: distances[g])
    return bound, looked_at(clear).pair_at(certificate.equation.strategy.task, q, gap, float(distances[gap]))


def least_of_pairs(certificate: Certificate) -> list[tuple[tuple[str, str], float, float]]:
    """(names, asked, proven at least) of each pair of things, the nearest first."""
    clear = certificate.demands.clear
    if clear is None or not len(certificate):
        return []
    listed: dict[tuple[str, str], tuple[float, float]] = {}
    for pair, bound in zip(clear.pairs, certificate.findings.apart.min(axis=0).tolist(), strict=True):
        listed[pair.names] = pair.wanted, min(bound, listed.get(pair.names, (0.0, np.inf))[1])
    return sorted(((names, *of) for names, of in listed.items()), key=lambda row: row[2])


def assumed_words(certificate: Certificate) -> str:
    """What is said of the links of a robot for which the capsules of `with_capsules`, named after joints, stand."""
    if certificate.demands.clear is None:
        return ""
    robot = certificate.demands.clear.robot
    names = {"base", *(joint.name for joint in robot.joints)}
    links = [shape for shape in robot.shapes if not (shape.obstacle or shape.carried)]
    if any(not isinstance(s.shape, Capsule) or s.link.removeprefix("base of ") not in names for s in links):
        return ""
    return (
        "The links of the model have no shapes: capsules about the lines from joint to joint stand for its links. That "
        "they hold the real links is assumed, and not proven: compare their radius with the robot"
    )


def floor_words(clear: ClearCells) -> str:
    """The floor, where there is one."""
    heights = [gap.height for gap in clear.looked_at.gaps if isinstance(gap, FloorGap)]
    return f"{FLOOR}: all below z = {heights[0]:.6g} m in the frame of the base" if heights else ""


PROVEN, NOT_PROVEN, DIFFER = "proven", "NOT proven", "NO: they differ"

ALWAYS = (
    "The real robot. The proof is about the lengths and axes of the model, as numbers in the computer. Calibration, "
    "tolerances of manufacture, bending, backlash and temperature are not in it.",
    "The controller. It may not reach the commanded joints, and what it does between two samples of its clock is not "
    "in the proof.",
    "Dynamics: speeds, accelerations, torques, forces, braking distances, and whether the motion can be made in a "
    "given time.",
    "Safety functions of the robot, or that a person near it is safe.",
)
"""What no certificate proves."""

COLLISIONS = "Collisions: of the robot with itself, with its surroundings, of its cables and its load."
"""What is not proven where no distances are asked for."""

MOST_NAMED = 12
"""Pairs that are named in a sentence, at most."""

COMPARE = (
    "That the strategy, the path or the box, and the model are those that you mean: compare them with yours.",
    "That nobody has changed this page. Whoever doubts it verifies the file of the certificate, which the SHA-256 "
    "below tells.",
)
"""What a reader must look at."""


@final
@dataclass(frozen=True)
class Claim:
    """A statement, whether it is proven, and what the checker says of it."""

    text: str
    proven: str
    checked: str


@final
@dataclass(frozen=True)
class Verdict:
    """The first line of the page, the sentence below it, and whether the line is good news."""

    line: str
    sentence: str
    good: bool


def _pose_word(task: Task) -> str:
    """What a task asks of the tool."""
    if not task._spatial:
        return "value of the task"
    if task.frames > 1:
        return "poses of the tools"
    return "tool position" if task.orientation is None else "tool pose"


def proven_time(certificate: Certificate, path: Path) -> float:
    """The time [s] up to which a path is proven."""
    boxes = certificate.proven.boxes
    if not len(boxes):
        return 0.0
    if certificate.covered:
        return path.duration
    last = int(boxes.piece.max())
    share = float(boxes.high[boxes.piece == last, 0].max())
    return float(path.starts[last] + share * path.durations[last])


def share_words(certificate: Certificate) -> str:
    """How much of the path or the box is proven, rounded down."""
    if isinstance(certificate.asked, Workspace):
        share, what = region_of(certificate).share, "of the box"
    else:
        path = paths_of(certificate.asked)[0]
        share, what = proven_time(certificate, path) / path.duration, "of the path, by its time"
    if certificate.covered:
        return f"all {what.partition(',')[0]}"
    return f"{np.floor(1e4 * min(share, 0.9999)) / 100:.4g} % {what}"


def place_words(certificate: Certificate) -> str:
    """What the cells cover."""
    if isinstance(certificate.asked, Workspace):
        return "the box" if certificate.covered else "the part of the box that is proven"
    return "the path" if certificate.covered else "the part of the path that is proven"


def verdict(certificate: Certificate, word: CheckerWord) -> Verdict:
    """What the page says first: never more than the certificate, and nothing good where the checker rejects it."""
    if word.outcome is Outcome.REJECTED:
        line = "NOT VALID: the independent checker rejects this certificate"
        return Verdict(line, "Do not rely on anything that this page says. The reason stands under Checker.", False)
    if not len(certificate):
        return Verdict("NOTHING IS PROVEN", certificate.theorem, False)
    pose = _pose_word(certificate.equation.strategy.task)
    if certificate.extent is Extent.ELSEWHERE:
        line = f"the path meets one {pose} twice, with other joints"
        line = "this closed path ends with other joints" if _ends_elsewhere(certificate) else line
        return Verdict(f"THE JOINTS DO NOT RETURN: {line}", f"It is proven that {certificate.returning}.", False)
    if certificate.extent is Extent.RETURN:
        only = "Only this is proven: along the path the joints do not jump."
        line = "NOT PROVEN that the joints return with the tool"
        return Verdict(line, f"{only} {_capital(certificate.returning)}.", False)
    if not certificate.whole:
        stop = f" The proof came to {certificate.where}." if certificate.where else ""
        worst = refuted_by(certificate)
        if worst is not None:
            stop = f" In the rest it is REFUTED: {worst}."
        line = f"NOT ALL IS PROVEN: only {share_words(certificate)}"
        return Verdict(line, f"{_capital(certificate.cause)}.{stop}", False)
    verified = word.outcome is Outcome.VERIFIED
    known = "PROVEN" if verified else "PROVEN BUT NOT VERIFIED"
    limits = "" if certificate.limits is not None else " Joint limits are not part of the proof."
    line, sentence = _good_news(certificate, pose)
    return Verdict(f"{known}: {line}", sentence + _apart(certificate) + limits, verified)


def _apart(certificate: Certificate) -> str:
    """What is proven of distances, for the sentence below the first line."""
    near, clear = nearest_of(certificate), certificate.demands.clear
    if clear is None or not len(certificate):
        return ""
    if near is None:
        return " There the shapes that are listed below do not touch."
    bound, pair = near
    asked = f" that are to keep {clear.looked_at.wanted:g} m apart or more" if clear.looked_at.wanted else ""
    return (
        f" There the bodies{asked} do so, {pair_words(pair.names)} {clear.as_nearest} by {at_least(bound)} m or more; "
        "they are listed below."
    )


def _ends_elsewhere(certificate: Certificate) -> bool:
    """Whether it is the end of a closed path at which the joints are others, and not a place on the way."""
    closed = not isinstance(certificate.asked, Workspace) and certificate.asked.closed
    return certificate.extent is Extent.ELSEWHERE and closed and not np.isfinite(certificate.gap)


def checker_words(certificate: Certificate, word: CheckerWord) -> str:
    """What the checker says, in the box of the first line."""
    if word.outcome is Outcome.REJECTED:
        return f"REJECTED by the independent checker: {word.text.partition(': ')[2]}"
    if word.outcome is Outcome.NONE:
        return f"NOT verified by the independent checker: {word.text}."
    if word.outcome is Outcome.SAMPLED:
        what = word.text.splitlines()[1].strip()
        return (
            f"NOT verified as a whole: by the independent checker, in {word.seconds:.3g} s, {what}; no fault was found."
        )
    took = f"by the independent checker in {word.seconds:.3g} s"
    if certificate.whole or (_ends_elsewhere(certificate) and _drift_verified(word)):
        return f"Verified {took}."
    if certificate.extent is Extent.ELSEWHERE:
        return f"Verified {took}, except that the joints differ: it does not say so."
    return f"What is proven is verified {took}; it is not all that was asked."


def _drift_verified(word: CheckerWord) -> bool:
    """Whether the checker itself says that a closed path ends with other joints."""
    return word.outcome is Outcome.VERIFIED and "the joints do NOT return" in word.text


def _good_news(certificate: Certificate, pose: str) -> tuple[str, str]:
    """(what is proven as a whole, what follows from it for a reader without mathematics)."""
    if isinstance(certificate.asked, Workspace):
        return f"while the tool stays in this box, the same {pose} has the same joints", (
            "The model of the robot, started at the posture below and moved by the strategy, comes back to the same "
            "joints after every loop of the tool inside the box, at any speed and any number of times."
        )
    if not certificate.asked.closed:
        sentence = f"Where the path meets a {pose} again, the joints are the same, except for whole turns."
        return "along this path the joints do not jump, and return wherever the tool does", sentence
    if certificate.turns.any():
        return "this closed path returns the joints, except for whole turns", (
            "After the path the joints are at their start but for the whole turns that are named below: the robot "
            "looks the same, but cables are wound up, and joints with limits must be turned back."
        )
    return "this closed path returns the joints to their start", (
        "The model of the robot, started at the posture below and moved by the strategy, is at the same posture after "
        "each cycle, at any speed and any number of times."
    )


def claims(certificate: Certificate, word: CheckerWord) -> list[Claim]:
    """The statements of a certificate, one by one, with who says so."""
    says, place = word.outcome.value, place_words(certificate)
    if not len(certificate):
        what = "the box" if isinstance(certificate.asked, Workspace) else "the path"
        return [Claim(f"Anything about {what}.", NOT_PROVEN, says)]
    derivative = certificate.equation.derivative
    proven = PROVEN if word.outcome is not Outcome.REJECTED else "claimed only"
    text = (
        f"For every {'pose' if isinstance(certificate.asked, Workspace) else 'place'} of {place} there is one posture, "
        f"and no other near it. The joints do not jump, and no posture is singular: |det {derivative}| >= "
        f"{at_least(certificate.determinant)}."
    )
    listed = [Claim(text, proven, says), _limit_claim(certificate, proven, says)]
    listed += [*_clear_claims(certificate, proven, says), *_rate_claims(certificate, proven)]
    if isinstance(certificate.asked, Workspace):
        text = f"Every loop of the tool inside {place} that begins with these joints brings them back."
        listed.append(Claim(text, proven, f"{says}: it follows from the first line"))
    else:
        listed += _path_claims(certificate, proven, word)
    robot = brief(certificate.equation.strategy.task.robot.name)
    same = "compared: the same" if word.compared else "not compared"
    what = "The task's rows and the limits" if certificate.limits is not None else "The task's rows"
    listed.append(Claim(f"{what} in the file are those of the model of the robot {robot}.", "-", same))
    return listed


def _limit_claim(certificate: Certificate, proven: str, says: str) -> Claim:
    """How far the joints keep from their limits."""
    if certificate.limits is None or not np.isfinite(certificate.to_limit).any():
        why = f"{NOT_PROVEN}: not asked" if certificate.limits is None else "the model has none"
        return Claim("No joint leaves its limits.", why, "-")
    i, robot = int(np.argmin(certificate.to_limit)), certificate.equation.strategy.task.robot
    joint, near = brief(robot.joint_names[i]), f"{at_least(float(certificate.to_limit[i]))} {robot.coordinates[i].unit}"
    place = place_words(certificate)
    text = f"Over {place} every joint stays within its limits, the nearest ({joint}) by {near} or more."
    return Claim(text, proven, says)


def _clear_claims(certificate: Certificate, proven: str, says: str) -> list[Claim]:
    """The distances of shapes, where they were asked for."""
    clear = certificate.demands.clear
    if clear is None:
        return []
    bounds, place, listed = certificate.findings.apart.min(axis=0), place_words(certificate), []
    for asked in sorted({float(wanted) for wanted in clear.wanted}, reverse=True):
        held = [p for p, wanted in enumerate(clear.wanted) if wanted == asked]
        names = list(dict.fromkeys(clear.pairs[p].names for p in held))
        i = min(held, key=lambda p: bounds[p])
        near = f"the nearest are {pair_words(clear.pairs[i].names)}, {at_least(float(bounds[i]))} m apart or more"
        what = f"at least {asked:g} m apart" if asked else "apart: they do not touch"
        text = f"Over {place} the shapes of {_pairs(names)} are {what}; {near}."
        listed.append(Claim(text, proven, f"{says}: the distance asked for"))
    return listed


def pair_words(names: tuple[str, str]) -> str:
    """Two things that are looked at, by their short names."""
    return f"{brief(names[0])} and {brief(names[1])}"


def _pairs(names: list[tuple[str, str]]) -> str:
    more = f" and {len(names) - MOST_NAMED} more pairs" if len(names) > MOST_NAMED else ""
    return "; ".join(pair_words(of) for of in names[:MOST_NAMED]) + more


def _rate_claims(certificate: Certificate, proven: str) -> list[Claim]:
    """How fast the tool may be, where all joints have speed limits."""
    rates = joint_rates(certificate)
    if not (np.isfinite(rates.tool_speed) and rates.tool_speed > 0):
        return []
    turning = ", if it does not turn" if rates.per_turn.any() else ""
    text = (
        f"Over {place_words(certificate)} no joint is faster than its limit while the tool moves at "
        f"{at_least(rates.tool_speed)} m/s or slower{turning}."
    )
    return [Claim(text, proven, "it does not look at this")]


def _collisions(certificate: Certificate) -> str:
    """What of collisions is not proven."""
    clear = certificate.demands.clear
    if clear is None:
        return COLLISIONS
    known = {pair.names for pair in clear.pairs}
    out: dict[str, list[tuple[str, str]]] = {}
    for entry in clear.looked_at.left_out:
        if entry.pair not in known:
            out.setdefault(entry.reason, []).append(entry.pair)
    bare = sorted({entry.link for entry in clear.looked_at.unseen})
    parts = [
        "Collisions with anything that is not named above, of cables, and of shapes that bend or are held otherwise"
    ]
    parts += [f"Pairs left out, {reason}: {_pairs(pairs)}" for reason, pairs in out.items()]
    parts += [f"Links without a shape: {brief(', '.join(bare))}"] if bare else []
    parts += [assumed] if (assumed := assumed_words(certificate)) else []
    return ". ".join(parts) + "."


def _path_claims(certificate: Certificate, proven: str, word: CheckerWord) -> list[Claim]:
    """That the joints return, at the end of a closed path and elsewhere."""
    listed, robot, says = [], certificate.equation.strategy.task.robot, word.outcome.value
    if certificate.turns.any() or np.isfinite(certificate.gap):
        turns = certificate.turns.astype(int).tolist() if certificate.turns.any() else None
        turned = f", except for the whole turns {turns}" if turns else ""
        within = f"within {at_most(gap_of(certificate))} {joint_unit(robot)}{turned}"
        text = f"At the end of the closed path the joints are those of its beginning, {within}."
        listed.append(Claim(text, proven, says))
    elif not isinstance(certificate.asked, Workspace) and certificate.asked.closed:
        elsewhere = _ends_elsewhere(certificate)
        answer, checked = DIFFER if elsewhere else NOT_PROVEN, says if elsewhere and _drift_verified(word) else "-"
        listed.append(Claim("At the end of the closed path the joints are those of its beginning.", answer, checked))
    again = f"the path meets a {_pose_word(certificate.equation.strategy.task)} again, the joints are the same"
    answer = proven if certificate.whole else NOT_PROVEN
    answer = DIFFER if certificate.extent is Extent.ELSEWHERE and not _ends_elsewhere(certificate) else answer
    listed.append(Claim(f"Wherever else {again}, except for whole turns.", answer, "it does not look at this"))
    return listed


def gap_of(certificate: Certificate) -> float:
    """How far from the start the joints may end on a closed path: what the file claims, and the checker verifies."""
    return float(certificate.data["claims"]["gap"])


def not_proven(certificate: Certificate, word: CheckerWord) -> list[str]:
    """What a reader might think is proven, and is not."""
    box = isinstance(certificate.asked, Workspace)
    others = "loops that leave it" if box else "other paths"
    listed = [
        f"Anything outside {place_words(certificate)}: {others}, another start posture, another tool.",
        *ALWAYS[:2],
        _collisions(certificate),
        *ALWAYS[2:],
    ]
    if certificate.limits is None:
        listed.insert(1, "Joint limits: the proof was made without them.")
    elif not np.isfinite(certificate.to_limit).all():
        joints = zip(certificate.equation.strategy.task.robot.joint_names, certificate.to_limit, strict=True)
        unlimited = brief(", ".join(name for name, room in joints if not np.isfinite(room)))
        listed.insert(1, f"Limits of the joints that have none in the model: {unlimited}.")
    if not box and certificate.covered:
        listed.append(
            "By the checker: places where the path crosses itself or runs along itself. Only the program that made the "
            "certificate looked at them."
        )
    if not word.compared:
        listed.append("By the checker: that the file is about the robot that is named here. The two were not compared.")
    return [*listed, *COMPARE]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
