"""Certificates of a job: the table for the terminal, and the folder of their files and pages."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Callable
from datetime import UTC, datetime
from html import escape
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, brief
from ...base.files import write_text
from ...base.types import Array, Matrix, Vector
from ...base.units import at_least, at_most
from ...path import Path
from ...path.editing import AnyPath, paths_of
from ...path.path import Segment
from ...path.workspaces import PoseRange, Workspace
from ...proof import Certificate, WholeArm, joint_rates
from ...proof.certificate import FORMAT, digest
from ...proof.proven_region import ANOTHER, CAUSES, END, LIMIT, NEAR, UNPROVEN, region_of
from ...proof.recheck import CheckerWord, Outcome, ask_checker, unasked
from ...proof.whole_arm import FORMAT as WHOLE_ARM
from ...robot import LinkShape, Robot
from ...version import build
from .html_page import page
from .job_result import free_name, renewed, write_facts
from .proof_picture import box_figure, box_picture_words, drawable, picture_words, proof_figure, start_of
from .proof_words import (
    PROVEN,
    assumed_words,
    checker_words,
    claims,
    floor_words,
    gap_of,
    least_of_pairs,
    nearest_of,
    not_proven,
    pair_words,
    place_words,
    refuted_by,
    shapes_of,
    share_words,
    size_words,
    stand_in_words,
    verdict,
)
from .section import Note, Section, Tone, drawn, right

# --- The page of a certificate: HTML to print, beside the file of the certificate, which it names by its SHA-256.

MOST_ROWS = 150
"""Rows of a table; the file has all."""

PLACES = 8
"""Decimals of a joint in rad or m, so that a bound and the limit next to it are not confused."""

_HEAD = """<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'"><style>
h1 {{ font-size: 1.35rem; margin: 0; }} h2 {{ margin-top: 1.5rem;
border-bottom: 1px solid #c9d1da; }}
.verdict {{ border: 3px solid #a84a00; padding: .7rem 1rem; margin-bottom: 1rem; }} .verdict p {{ margin: .4rem 0 0; }}
.verdict.good {{ border-color: #00664a; }} code {{ overflow-wrap: anywhere; font-size: .88em; }}
h2:first-of-type + .wide th:nth-child(2) {{ width: 8rem; }} h2:first-of-type + .wide th:nth-child(3) {{ width: 11rem; }}
td {{ overflow-wrap: anywhere; }} td.n {{ overflow-wrap: normal; }}
th[scope=row] {{ width: 11rem; overflow-wrap: anywhere; }}
figure {{ margin: .8rem auto; max-width: 44rem; }} figure img {{ width: 100%; }}
@page {{ size: A4; margin: 14mm 14mm 17mm;
@bottom-left {{ content: "SHA-256 {sha256}"; font: 6.5pt monospace; color: #4b5563; }}
@bottom-right {{ content: counter(page) " / " counter(pages); font: 8pt sans-serif; color: #4b5563; }} }}
@media print {{ html {{ font-size: 9.5pt; }} body {{ font-size: 9.5pt;
line-height: 1.35; max-width: none; margin: 0; padding: 0; }}
h2 {{ break-after: avoid; margin-top: 1.1rem; }} tr, figure, .verdict, li {{ break-inside: avoid; }}
.wide {{ overflow: visible; }} figure {{ max-width: 150mm; }} th, td {{ padding: .22rem .4rem; }}
* {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }} }}
</style>"""


@typed
def save_with_page(certificate: Certificate | WholeArm, file: str | FilePath, seconds: float = 60.0) -> FilePath:
    """Save a certificate as JSON, have it checked, and write its page beside it: NAME.json and NAME.html.

    Args:
        file: of the certificate; its name ends with .json.
        seconds: that the checker may take; with 0, or without python-flint, it is not run, and the page says so.

    Returns:
        The file of the page.

    Raises:
        ArgumentError: negative seconds, or another ending of the file. WriteError.
    """
    if FilePath(file).suffix != ".json":
        raise ArgumentError("the file of the certificate", str(file), "let its name end with .json")
    word = ask_checker(certificate, seconds)
    return write_page(certificate, certificate.save(file), word)


def write_page(certificate: Certificate | WholeArm, file: FilePath, word: CheckerWord) -> FilePath:
    """The page of a certificate that was saved in a file, beside it. Raises: ArgumentError, WriteError."""
    if word.sha256 != digest(certificate.data):
        raise ArgumentError("what the checker says", word.outcome.value, "ask it about this certificate")
    target = file.with_suffix(".html")
    now = datetime.now(UTC)
    if isinstance(certificate, WholeArm):
        write_text(target, _whole_arm_page(certificate, file, word, now))
    else:
        write_text(target, _page(certificate, file, word, now))
    return target


def _page(certificate: Certificate, file: FilePath, word: CheckerWord, now: datetime) -> str:
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    robot, first = certificate.equation.strategy.task.robot, verdict(certificate, word)
    # The box with the verdict; what the checker says is green only where all is proven, too.
    verified = word.outcome is Outcome.VERIFIED
    kind = "" if verified and not certificate.whole else f" class='{'yes' if verified else 'no'}'"
    box = (
        f"<div class='verdict{' good' if first.good else ''}'><h1>{escape(first.line)}</h1>"
        f"<p>{escape(first.sentence)}</p><p{kind}>{escape(checker_words(certificate, word))}</p></div>"
    )
    # The sections: the statements and their limits first, then what they are about, then how they were found.
    about = f"Certificate of holokin about the model of the robot {brief(robot.name)}, {now:%Y-%m-%d}."
    statements = [[claim.text, _mark(claim.proven), _mark(claim.checked)] for claim in claims(certificate, word)]
    theorem = Note(f"The theorem in the program's words: {certificate.theorem}", "small")
    parts = [
        box,
        Section(notes=[f"{brief(certificate.title)}. {about}"]),
        Section("What is proven", head=["Statement", "Proof", "Checker"], rows=statements, remarks=[theorem]),
        Section("What is NOT proven", points=not_proven(certificate, word)),
        Section("File and versions", rows=_file_facts(file, sha256, now)),
        _asked_section(certificate),
        _open_section(certificate),
        _distance_section(certificate),
        _speed_section(certificate),
        Section("Robot", rows=_robot_facts(robot), parts=[_joint_section(certificate)]),
        Section("Strategy and start", rows=_strategy_facts(certificate)),
        _checker_section(word),
        Section("Numbers of the proof", rows=_numbers(certificate)),
    ]
    return page(f"{first.line} - {brief(certificate.title)}", parts, _HEAD.format(sha256=sha256))


def _whole_arm_page(certificate: WholeArm, file: FilePath, word: CheckerWord, now: datetime) -> str:
    """The page of a proof on the whole arm: the theorem, what it does not say, its model and its reason."""
    sha256, robot = hashlib.sha256(file.read_bytes()).hexdigest(), certificate.arm.robot
    first = _WHOLE_ARM[word.outcome]
    good = word.outcome is Outcome.VERIFIED
    box = (
        f"<div class='verdict{' good' if good else ''}'><h1>{escape(first)}</h1>"
        f"<p>{escape(certificate.theorem)}</p><p class='{'yes' if good else 'no'}'>{escape(_said(word))}</p></div>"
    )
    about = f"Certificate of holokin about the model of the robot {brief(robot.name)}, {now:%Y-%m-%d}."
    parts = [
        box,
        Section(notes=[f"{brief(certificate.title)}. {about}"]),
        Section("What is NOT proven", points=[certificate.unsaid, *NOT_OF_THE_ARM]),
        Section("Why it holds", notes=[certificate.reason]),
        Section("Model", notes=[certificate.model], rows=_robot_facts(robot)),
        Section("Numbers", rows=[line.split(": ", 1) for line in certificate.table().splitlines()]),
        _checker_section(word, "and computes with polynomials in exact"),
        Section("File and versions", rows=_file_facts(file, sha256, now, WHOLE_ARM, "")),
    ]
    return page(f"{first} - {brief(certificate.title)}", parts, _HEAD.format(sha256=sha256))


_RETURN = "on the whole arm the joints return with the tool, wherever the motion is regular"

_WHOLE_ARM = {
    Outcome.VERIFIED: f"PROVEN: {_RETURN}",
    Outcome.REJECTED: "NOT VALID: the checker rejects the certificate",
    Outcome.NONE: f"PROVEN BUT NOT VERIFIED: {_RETURN}",
}
"""The first line, by what the checker says."""

NOT_OF_THE_ARM = (
    "Distances to obstacles, and of links to each other.",
    "What a controller does between two poses, and where it stops.",
    "Anything about the robot itself: the theorem is about the model.",
)


def _said(word: CheckerWord) -> str:
    """What the checker says of a whole arm, in the box of the first line."""
    if word.outcome is Outcome.VERIFIED:
        return f"Verified by the independent checker in {word.seconds:.3g} s."
    if word.outcome is Outcome.REJECTED:
        return f"REJECTED by the independent checker: {word.text.partition(': ')[2]}"
    return f"NOT verified by the independent checker: {word.text}."


def _mark(text: str) -> Note:
    """What is proven or verified in green, what is not in red."""
    if text.startswith((PROVEN, Outcome.VERIFIED.value)):
        return Note(text, "good")
    return Note(text, "bad" if text.startswith(("NO", "REJECTED", "not", "claimed")) else "")


def _file_facts(
    file: FilePath,
    sha256: str,
    now: datetime,
    written: str = FORMAT,
    sample: str = ", with --sample 0.01 1 % of its cells",
) -> list[tuple[str, Note | str]]:
    return [
        ("Certificate", Note(file.name, "code", f", {file.stat().st_size:,} bytes, format {written}")),
        ("SHA-256 of the file", Note(sha256, "code")),
        ("Compare it by", Note(f"sha256sum {file.name}", "code")),
        ("Verify it by", Note(f"holokin check-certificate {file.name}", "code", sample)),
        ("Page made", f"{now:%Y-%m-%d %H:%M} UTC"),
        ("Made by", f"holokin {build()}, Python {platform.python_version()}, NumPy {np.__version__}"),
    ]


def _asked_section(certificate: Certificate) -> Section:
    """The path or the box, with the picture."""
    figure = drawn(*_picture(certificate)) if drawable(certificate) else None
    if isinstance(certificate.asked, Workspace):
        return Section("Box of tool poses", figure=figure, rows=_box_facts(certificate, certificate.asked))
    facts, paths = _path_facts(certificate, certificate.asked), paths_of(certificate.asked)
    tools = [f"Tool {k + 1}" if len(paths) > 1 else "" for k in range(len(paths))]
    return Section("Path", figure=figure, rows=facts, parts=list(map(_piece_section, tools, paths)))


def _picture(certificate: Certificate) -> tuple[Callable[[], Any], str]:
    """What draws it, and what to see in it."""
    if isinstance(certificate.asked, PoseRange) and not (certificate.whole and certificate.demands.clear is None):
        return lambda: box_figure(certificate), box_picture_words(certificate)
    return lambda: proof_figure(certificate), picture_words(certificate)


MEANT = {
    NEAR: "refuted: in each of these parts a posture was found that is nearer than was asked",
    UNPROVEN: "undecided: the robot can go there, and no posture was found that is too near, but nothing is proven",
    ANOTHER: "the robot comes there with other joints than those that go on from what is proven",
    LIMIT: "a joint is beyond its limit",
    END: "the strategy does not lead the robot there",
}
"""What is said of the parts of a box, by cause."""


def _box_facts(certificate: Certificate, space: Workspace) -> list[tuple[str, str]]:
    if not isinstance(space, PoseRange):
        return [("Poses", str(space))]
    task, (p, h) = certificate.equation.strategy.task, (space.solid.center, space.solid.half)
    spans = [f"{axis}: {a - b:.6g} to {a + b:.6g} m" for axis, a, b in zip("xyz", p, h, strict=True)]
    rows = [
        ("Tool positions", ", ".join(spans)),
        ("Centre, half sides", f"{_point_text(p)} m, {_point_text(h)} m, along the axes of the base"),
    ]
    if task.orientation is None:
        rows.append(("Orientation", "free: the task is about positions alone"))
    else:
        tilt, spin = np.degrees([space.tilt, space.spin])
        turns = f"leans by up to {tilt:.4g} deg, turns about its z axis by up to +-{spin:.4g} deg"
        rows.append(("Orientation in the middle", _axes(space.rotation)))
        rows.append(("Turns", turns if space.tilt or space.spin else "none: one orientation"))
    return [*rows, ("Proven", share_words(certificate)), *_stop(certificate)]


def _path_facts(certificate: Certificate, path: AnyPath) -> list[tuple[str, str]]:
    task = certificate.equation.strategy.task
    rows = [
        ("Length", f"{path.length:.6g} m in {len(path.durations)} piece{'s' * (len(path.durations) > 1)}"),
        ("Closed", "yes" if path.closed else "no"),
    ]
    for k, part in enumerate(paths_of(path)):
        name = f", tool {k + 1}" if task.frames > 1 else ""
        rows.append((f"Begins{name}", f"at {_point_text(part.start)} m"))
        if task.orientation is not None and task.frames == 1 and task._spatial:
            R = part.rotation if part.rotation is not None else task.pose(start_of(certificate))[:3, :3]
            turn = float(sum(segment.turn for segment in part.segments))
            rows.append(("Orientation at the start", _axes(R)))
            rows.append(("The tool turns", f"by {np.degrees(turn):.4g} deg in all" if turn else "not at all"))
        elif task.orientation is None:
            rows.append((f"Orientation{name}", "free: the task is about positions alone"))
    return [*rows, ("Covered by cells", share_words(certificate)), *_stop(certificate)]


def _stop(certificate: Certificate) -> list[tuple[str, str]]:
    """Where the proof ended early."""
    return [("Stopped at", certificate.where)] if certificate.where else []


def _piece_section(title: str, path: Path) -> Section:
    """The ends of the pieces of a path."""
    # Rows in the table of a path; the file has all pieces.
    shown = path.segments[:12]
    begun = path.on(np.arange(len(shown)), np.zeros(len(shown))).position
    ended = path.on(np.arange(len(shown)), np.ones(len(shown))).position
    rows = [
        [str(i + 1), _point_text(a), _point_text(b), f"{s.length:.6g}", _shape(s)]
        for i, (s, a, b) in enumerate(zip(shown, begun, ended, strict=True))
    ]
    more = len(path.segments) - len(shown)
    remarks = [Note(f"The file has {more} more pieces.", "small")] if more else []
    return Section(title, head=["Piece", "From [m]", "To [m]", "Length [m]", "Shape"], rows=rows, remarks=remarks)


def _shape(segment: Segment) -> str:
    """A line, an arc with its centre and axis, or a curve."""
    if segment.along[1:].any():
        return "cubic curve"
    if not segment.angle:
        return "line"
    axis = np.sign(segment.angle) * np.cross(segment.x, segment.y)
    radius, axis = np.linalg.norm(segment.x), axis / np.linalg.norm(axis)
    angle = abs(np.degrees(segment.angle))
    place = f"about {_point_text(segment.center)}, axis {_point_text(axis)}"
    return f"arc of {angle:.4g} deg, radius {radius:.6g} m, {place}"


def _open_section(certificate: Certificate) -> Section:
    """Where a box is not proven: shares by cause, and the posture that is too near by most."""
    worst = refuted_by(certificate)
    if certificate.whole or not isinstance(certificate.asked, PoseRange):
        return Section(notes=[Note(f"REFUTED: {worst}.", "bad")] if worst else [])
    parts = region_of(certificate).parts
    shares = {cause: parts.shares[CAUSES[cause]] for cause in MEANT if cause in parts.cause}
    rows = [
        [MEANT[cause], f"{100 * share:.2f} %" if share >= 5e-5 else "below 0.01 %"] for cause, share in shares.items()
    ]
    about = (
        f"The rest of the box was cut into {len(parts):,} parts, and postures were sampled in each: what they show is "
        "measured, and not proven. A part is named after the pose in its middle, or after a posture in it "
        "that is too near."
    )
    remarks = [f"The worst that was found: {worst}. {_posture(certificate, worst.q)}"] if worst else []
    head = ["Parts of the box that are not proven", "Share of the box"]
    return Section("Where it is not proven", head=head, rows=rows, remarks=[*remarks, Note(about, "small")])


def _distance_section(certificate: Certificate) -> Section:
    """Where distances are proven: the nearest place, the shapes and the pairs."""
    clear, near = certificate.demands.clear, nearest_of(certificate)
    if clear is None:
        return Section()
    # The nearest place, and what is assumed of the shapes.
    notes: list[Note | str] = []
    if near is not None:
        bound, pair = near
        notes.append(
            f"Proven over {place_words(certificate)}: {pair_words(pair.names)} {clear.as_nearest} are "
            f"{at_least(bound)} m apart or more. In the middle of the cell where this is, {pair}. "
            f"{_posture(certificate, pair.q)}"
        )
    if assumed := assumed_words(certificate):
        notes.append(Note(f"{assumed}.", "bad"))
    # The shapes.
    shapes, floor = shapes_of(clear), floor_words(clear)
    rows = [_shape_row(certificate, shape) for shape in shapes[:MOST_ROWS]]
    rows += [[floor, "", "", "as it is"]] if floor else []
    more = [Note(f"And {len(shapes) - MOST_ROWS} more.", "small")] if len(shapes) > MOST_ROWS else []
    # The pairs that are looked at, and those that are not.
    pairs = [
        [pair_words(names), f"{asked:g}" if asked else "no contact", at_least(bound)]
        for names, asked, bound in least_of_pairs(certificate)[:MOST_ROWS]
    ]
    reasons = {entry.pair: entry.reason for entry in clear.looked_at.left_out}
    out = [[pair_words(pair), reason] for pair, reason in list(reasons.items())[:MOST_ROWS]]
    out += [[brief(entry.link), f"no shape: {brief(entry.reason)}"] for entry in clear.looked_at.unseen]
    head = ["Pair that is looked at", *right("Asked [m]", "Proven, at least [m]")]
    parts = [Section("Pairs", head=head, rows=pairs)] if pairs else []
    parts += [Section("Left out", head=["Not looked at", "Why"], rows=out)] if out else []
    head = ["Shape of", "Kind and size", "Place of its frame", "In the proof"]
    return Section("Shapes and distances", notes, head=head, rows=rows, remarks=more, parts=parts)


def _speed_section(certificate: Certificate) -> Section:
    """Upper bounds of joint speeds over the tool's, of a box or where distances are proven, too."""
    asked = isinstance(certificate.asked, PoseRange) or certificate.demands.clear is not None
    if not len(certificate) or not asked:
        return Section()
    rates, robot = joint_rates(certificate), certificate.equation.strategy.task.robot
    if not np.isfinite(rates.per_speed).all():
        return Section()
    # The bounds of each joint.
    turning = bool(rates.per_turn.any())
    rows = []
    for i, joint in enumerate(robot.coordinates):
        limit = f"{rates.limits[i]:.4g} {joint.unit}/s" if np.isfinite(rates.limits[i]) else "none"
        bounds = [rates.per_speed[i], *[rates.per_turn[i]] * turning]
        bounds = [at_most(float(bound)) if bound > 1e-12 else "0" for bound in bounds]
        rows.append([brief(joint.name), *(f"{bound} {joint.unit}/s" for bound in bounds), limit])
    # The speed of the tool that follows.
    v = rates.tool_speed
    within = (
        f"So no joint is faster than its limit while the tool moves at {at_least(v)} m/s or slower"
        f"{' and does not turn' if turning else ''}."
        if np.isfinite(v) and v > 0
        else "The model does not have the speed limits of all joints that would bound the speed of the tool."
    )
    bounds = f"Upper bounds over {place_words(certificate)}, on any path of the tool."
    about = Note(f"{bounds} {within} The checker does not look at this.", "small")
    moves = ["while the tool moves at 1 m/s, at most", *["while it turns at 1 rad/s, at most"] * turning]
    head = ["Joint", *right(*moves, "Speed limit in the model")]
    return Section("Speeds of the joints", head=head, rows=rows, remarks=[about])


def _shape_row(certificate: Certificate, shape: LinkShape) -> list[str]:
    robot, T = certificate.equation.strategy.task.robot, shape.placement
    frame = "the base" if shape.joint < 0 else f"joint {robot.joints[shape.joint].name}"
    turned = "" if np.allclose(T[:3, :3], np.eye(3), atol=1e-9) else f", z axis along {_point_text(T[:3, 2])}"
    kind = "obstacle" if shape.obstacle else "carried" if shape.carried else "link"
    place = f"{_point_text(T[:3, 3])} m{turned}, in the frame of {frame}"
    return [f"{brief(shape.link)} ({kind})", size_words(shape.shape), place, stand_in_words(shape.shape)]


def _posture(certificate: Certificate, q: Vector) -> str:
    joints = zip(certificate.equation.strategy.task.robot.coordinates, q, strict=True)
    return f"Posture: {', '.join(f'{brief(c.name)} {x:.5g} {c.unit}' for c, x in joints)}."


def _robot_facts(robot: Robot) -> list[tuple[str, str]]:
    rows = [("Model", brief(robot.name)), ("Source", brief(robot.source or "not named"))]
    roots = [joint for joint in robot.joints if joint.parent < 0]
    for joint in roots:
        rows.append(("Mounting", f"joint {brief(joint.name)} in the frame of the base: {_pose_text(joint.placement)}"))
    for tip in robot.tips:
        on = f"joint {brief(robot.joints[tip.joint].name)}" if tip.joint >= 0 else "the base"
        rows.append(("Tool", f"{brief(tip.name)}, in the frame of {on}: {_pose_text(tip.placement)}"))
    return rows


def _joint_section(certificate: Certificate) -> Section:
    """Each joint with its limits in the model, and what is proven of it."""
    robot, some = certificate.equation.strategy.task.robot, len(certificate) > 0
    columns = ("Unit", "Lower limit", "Proven from", "Proven to", "Upper limit", "To a limit")
    rows, scale = [], 10.0**PLACES
    for i, joint in enumerate(robot.coordinates):
        low, high, room = "-", "-", "-"
        if some:
            low, high = np.floor(certificate.low[i] * scale) / scale, np.ceil(certificate.high[i] * scale) / scale
            low, high = f"{low:.{PLACES}f}", f"{high:.{PLACES}f}"
            room = at_least(float(certificate.to_limit[i])) if np.isfinite(certificate.to_limit[i]) else "no limit"
        rows.append([brief(joint.name), joint.unit, _number(joint.lower), low, high, _number(joint.upper), room])
    asked = " The proof was made without limits: that the joints keep them is not claimed."
    asked = asked if certificate.limits is None else ""
    about = f"The joints over {place_words(certificate)}; bounds are rounded outwards.{asked}"
    return Section(notes=[Note(about, "small")], head=["Joint", *right(*columns)], rows=rows)


def _strategy_facts(certificate: Certificate) -> list[tuple[str, str]]:
    strategy, robot, q = certificate.equation.strategy, certificate.equation.strategy.task.robot, start_of(certificate)
    posture = ", ".join(
        f"{brief(c.name)} {_number(x)} {c.unit}" for c, x in zip(robot.coordinates, q.tolist(), strict=True)
    )
    rows = [
        ("Task", brief(strategy.task.name)),
        ("Rows of the task", brief(", ".join(strategy.task.row_names))),
        ("Strategy", brief(strategy.name)),
        ("Constraint", f"g(q) = c: {brief(strategy.constraint.name)}, rows: {strategy.constraint.rows}"),
        ("Level c", _vector(certificate.c)),
        ("Posture", posture),
    ]
    place = "the start of the path"
    if isinstance(certificate.asked, Workspace):
        place = f"at the place {_vector(certificate.anchors.u[0])} of the box, whose sides are -1 to 1"
    return [*rows, ("The posture is", place)]


def _checker_section(word: CheckerWord, how: str = "chooses its own bounds, and computes them in ball") -> Section:
    """What the checker said, word by word."""
    head, *lines = word.text.splitlines()
    about = f"A small program that shares no code with the search for the proof. It reads the file, {how} arithmetic."
    facts = [("Outcome", _mark(word.outcome.value)), ("Version", word.version), ("Time", f"{word.seconds:.3g} s")]
    points = [Note(line.strip(), "small") for line in lines]
    return Section("Checker", [Note(about, "small")], rows=[*facts, ("Its words", head)], points=points)


def _numbers(certificate: Certificate) -> list[tuple[str, str]]:
    rows = [
        ("Extent", certificate.extent.value),
        ("Cells", f"{len(certificate):,}"),
        ("Time of the search", f"{certificate.seconds:.3g} s"),
    ]
    if not len(certificate):
        return rows
    f = certificate.findings
    rows += [
        (f"|det {certificate.equation.derivative}|", f"at least {at_least(certificate.determinant)}"),
        ("omega of the theorem", f"at most {at_most(float(f.omega.max()))}"),
        ("Joints off the predicted ones", f"by at most {at_most(float(f.r.max()))}"),
        ("No other posture within", f"at least {at_least(float(f.alone.min()))}"),
    ]
    if np.isfinite(certificate.gap):
        rows.append(("Gap of the closed path", f"at most {at_most(gap_of(certificate))}"))
        rows.append(("Whole turns", _vector(certificate.turns)))
    if (moved := certificate.revisit) is not None:
        joints = zip(certificate.equation.strategy.task.robot.coordinates, moved.low, moved.high, strict=True)
        rows += [(f"{brief(c.name)} differs by", f"{low:.9g} to {high:.9g} {c.unit}") for c, low, high in joints]
    return rows


def _pose_text(T: Matrix) -> str:
    return f"at {_point_text(T[:3, 3])} m, {_axes(T[:3, :3])}"


def _axes(R: Matrix) -> str:
    """An orientation by its axes, which needs no convention of angles."""
    return f"x axis along {_point_text(R[:, 0])}, z axis along {_point_text(R[:, 2])}"


def _vector(values: Vector | Array) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _point_text(values: Vector | Array) -> str:
    """Places and directions, to a micrometre: the file has all digits."""
    return f"[{', '.join(f'{x:.6g}' for x in np.round(values, 6) + 0.0)}]"


def _number(value: Any) -> str:
    if not np.isfinite(value):
        return "none"
    return f"{0.0 if abs(value) < 1e-12 else float(value):.9g}"


# --- The table of a job's certificates, and the folder of their files.

_COLUMNS = [
    "strategy",
    "proven",
    *right("cells", "seconds", "nearest limit\n[rad or m]", "least\ndeterminant"),
]

_PROVEN: dict[str, Tone] = {"all": "good", "part": "warning", "not done": "warning", "drifts": "bad", "NO": "bad"}

_CHECKED: dict[Outcome, Tone] = {Outcome.VERIFIED: "good", Outcome.REJECTED: "bad"}


def _table_row(name: str, certificate: Certificate | WholeArm | str) -> list[Note]:
    """The row of one strategy."""
    proven, numbers = "not done", []
    if isinstance(certificate, WholeArm):
        proven = "all"
    elif not isinstance(certificate, str):
        proven = "all" if certificate.whole else "drifts" if certificate.revisit else "part"
        proven = proven if certificate.revisit or len(certificate) else "NO"
        numbers = [str(len(certificate)), f"{certificate.seconds:.2g}"]
    if isinstance(certificate, Certificate) and len(certificate):
        numbers += [f"{certificate.to_limit.min():.3g}", f"{certificate.determinant:.1e}"]
    cells = [name, proven, *numbers, *["-"] * (len(_COLUMNS) - 2 - len(numbers))]
    return [Note(cell, _PROVEN.get(cell, "")) for cell in cells]


def print_certificates(
    title: str, certificates: dict[str, Certificate | WholeArm | str], words: dict[str, CheckerWord], console: Any
) -> None:
    """Print the table of a job's certificates, and below it each theorem, with what the checker says of it."""
    remarks: list[Note] = []
    for name, certificate in certificates.items():
        if isinstance(certificate, str):
            remarks.append(Note(f"{brief(name)}: not certified: {certificate}", "warning"))
            continue
        if isinstance(certificate, WholeArm):
            theorem, *more = str(certificate).splitlines()
            tone = _CHECKED.get(words[name].outcome, "warning")
            remarks += [Note(f"{brief(name)}: {theorem}", "good"), *(Note(f"  {line}") for line in more)]
            remarks.append(Note(f"  {_said(words[name])}", tone))
            continue
        remarks.append(Note(f"{brief(name)}: {certificate}", "good" if certificate.whole else "warning"))
        if not certificate.whole:
            remarks.append(Note(f"  what helps: {certificate.extent.cure}", "warning"))
        if worst := refuted_by(certificate):
            remarks.append(Note(f"  refuted: {worst}", "bad"))
        tone = _CHECKED.get(words[name].outcome, "warning")
        remarks.append(Note(f"  {checker_words(certificate, words[name])}", tone))
    if left := [name for name, certificate in certificates.items() if isinstance(certificate, str)]:
        rest = "the verdict is on the others" if len(left) < len(certificates) else "nothing is certified"
        remarks.append(Note(f"left out: {brief(', '.join(left))}; {rest}", "warning"))
    rows = [_table_row(name, certificate) for name, certificate in certificates.items()]
    whole_arm = any(isinstance(certificate, WholeArm) for certificate in certificates.values())
    head = _COLUMNS[:2] if whole_arm else _COLUMNS  # which has no cells
    rows = [row[: len(head)] for row in rows]
    Section(brief(title), head=head, rows=rows, remarks=remarks).rich(console)


def write_certificates(
    name: str,
    certificates: dict[str, Certificate | WholeArm | str],
    words: dict[str, CheckerWord],
    out: FilePath,
    version: str,
    stopped: bool,
) -> list[FilePath]:
    """Write NAME-certificate.json and its page for each into `out/<name>`, which is replaced whole, see `renewed`.

    Args:
        words: of the checker; where one is missing, as after Ctrl-C, the page says that it was not run.
        stopped: whether the command was stopped before it came to all strategies, as result.json says.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made. WriteError.
    """
    files: list[str] = []
    strategies: dict[str, Any] = {}
    with renewed(out, name) as work:
        for label, certificate in certificates.items():
            if isinstance(certificate, str):
                strategies[label] = {"proven": False, "theorem": certificate}
                continue
            # The files.
            word = words.get(label) or unasked(certificate)
            file = certificate.save(work / free_name(label, "-certificate.json", files))
            files += [file.name, write_page(certificate, file, word).name]
            # What result.json says of it.
            facts: dict[str, Any] = {"proven": certificate.whole, "theorem": certificate.theorem}
            facts["checker"] = word.outcome.value
            strategies[label] = facts
            if isinstance(certificate, WholeArm):
                continue
            if (worst := refuted_by(certificate)) is not None:
                facts["refuted"] = {"names": worst.names, "distance": worst.distance, "wanted": worst.wanted}
                facts["refuted"] |= {"q": worst.q.tolist(), "pose": worst.pose.tolist()}
            if isinstance(certificate.asked, PoseRange) and not certificate.whole:
                region = region_of(certificate)
                facts["shares"] = {"proven": region.share, **region.parts.shares}
            if certificate.revisit is not None:
                low, high = certificate.revisit.low, certificate.revisit.high
                facts["drift"] = {"least": low.tolist(), "most": high.tolist()}
        write_facts(work, {"holokin": version, "stopped": stopped, "strategies": strategies})
    return [out / name / file for file in files]
