"""Certificates of a job: the table for the terminal, and the folder of their files and pages."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Callable, Sequence
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
from ...path.editing import AnyPath, paths_of
from ...path.path import Segment
from ...path.workspaces import PoseRange, Workspace
from ...proof import Certificate, joint_rates
from ...proof.certificate import FORMAT, digest
from ...proof.proven_region import ANOTHER, CAUSES, END, LIMIT, NEAR, UNPROVEN, region_of
from ...proof.recheck import CheckerWord, Outcome, ask_checker, unasked
from ...robot import LinkShape, Robot
from ...version import build
from .html_page import drawn, html_table, page
from .job_report import Column
from .job_result import free_name, renewed, write_facts
from .plots import BAD, GOOD, WARNING
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
    place_words,
    refuted_by,
    shapes_of,
    share_words,
    size_words,
    stand_in_words,
    verdict,
)

# --------------------------------------------------------------------------------------------------
# The parts of a certificate's page that are about distances: shapes, pairs, speeds, and where a box
# is not proven.
# --------------------------------------------------------------------------------------------------

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


def _open_section(found: Certificate) -> list[str]:
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


def _clear_sections(found: Certificate) -> list[str]:
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


# --------------------------------------------------------------------------------------------------
# The page of a certificate: HTML to print, beside the file of the certificate, which it names by
# its SHA-256.
# --------------------------------------------------------------------------------------------------

MOST_PIECES = 12
"""Rows in the table of a path; the file has all pieces."""

PLACES = 8
"""Decimals of a joint in rad or m, so that a bound and the limit next to it are not confused."""

_HEAD = """<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'"><style>
h1 {{ font-size: 1.35rem; margin: 0; }} h2 {{ margin-top: 1.5rem;
border-bottom: 1px solid #c9d1da; }}
.verdict {{ border: 3px solid #a84a00; padding: .7rem 1rem; margin-bottom: 1rem; }} .verdict p {{ margin: .4rem 0 0; }}
.verdict.good {{ border-color: #00664a; }} code {{ overflow-wrap: anywhere; font-size: .88em; }}
.claims th:nth-child(2) {{ width: 8rem; }} .claims th:nth-child(3) {{ width: 11rem; }}
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
def save_with_page(certificate: Certificate, file: str | FilePath, seconds: float = 60.0) -> FilePath:
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


def write_page(certificate: Certificate, file: FilePath, word: CheckerWord) -> FilePath:
    """The page of a certificate that was saved in a file, beside it. Raises: ArgumentError, WriteError."""
    if word.sha256 != digest(certificate.data):
        raise ArgumentError("what the checker says", word.outcome.value, "ask it about this certificate")
    target = file.with_suffix(".html")
    write_text(target, _page(certificate, file, word, datetime.now(UTC)))
    return target


def _page(found: Certificate, file: FilePath, word: CheckerWord, now: datetime) -> str:
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    robot, first = found.equation.strategy.task.robot, verdict(found, word)
    parts = [
        f"<div class='verdict{' good' if first.good else ''}'><h1>{escape(first.line)}</h1>"
        f"<p>{escape(first.sentence)}</p>"
        f"<p class='{_tone(found, word)}'>{escape(checker_words(found, word))}</p></div>",
        f"<p>{_told(found.title)}. Certificate of holokin about the model of the robot {_told(robot.name)}, "
        f"{now:%Y-%m-%d}.</p>",
        "<h2>What is proven</h2>",
        "<div class='claims'>"
        + html_table(
            ["Statement", "Proof", "Checker"],
            [[escape(c.text), _mark(c.proven), _mark(c.checked)] for c in claims(found, word)],
        )
        + "</div>",
        f"<p class='small'>The theorem in the program's words: {escape(found.theorem)}</p>",
        "<h2>What is NOT proven</h2>",
        f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in not_proven(found, word))}</ul>",
        "<h2>File and versions</h2>",
        _facts(_file_facts(file, sha256, now)),
        *_where(found),
        *_open_section(found),
        *_clear_sections(found),
        "<h2>Robot</h2>",
        _facts(_robot_facts(robot)),
        _joints(found),
        "<h2>Strategy and start</h2>",
        _facts(_strategy_facts(found)),
        "<h2>Checker</h2>",
        *_checker(word),
        "<h2>Numbers of the proof</h2>",
        _facts(_numbers(found)),
    ]
    return page(f"{first.line} - {brief(found.title)}", parts, _HEAD.format(sha256=sha256))


def _told(name: str) -> str:
    """A name of somebody else in HTML: short, on one line, and without what HTML or a printer would obey."""
    return escape(brief(name))


def _facts(rows: Sequence[tuple[str, str]]) -> str:
    """A table of two columns: what, in HTML, and its value, in HTML."""
    body = "".join(f"<tr><th scope='row'>{what}</th><td>{value}</td></tr>" for what, value in rows)
    return f"<table><tbody>{body}</tbody></table>"


def _mark(text: str) -> str:
    kind = "yes" if text.startswith((PROVEN, Outcome.VERIFIED.value)) else ""
    kind = "no" if text.startswith(("NO", "REJECTED", "not", "claimed")) else kind
    return f"<span class='{kind}'>{escape(text)}</span>" if kind else escape(text)


def _tone(found: Certificate, word: CheckerWord) -> str:
    """The class of what the checker says: green only where all is proven, too."""
    if word.outcome is not Outcome.VERIFIED:
        return "no"
    return "yes" if found.whole else ""


def _checker(word: CheckerWord) -> list[str]:
    """What it said, word by word."""
    head, *lines = word.text.splitlines()
    said = "".join(f"<li>{escape(line.strip())}</li>" for line in lines)
    facts = [
        ("Outcome", _mark(word.outcome.value)),
        ("Version", escape(word.version)),
        ("Time", f"{word.seconds:.3g} s"),
    ]
    about = (
        "A small program that shares no code with the search for the proof. It reads the file, chooses its own bounds, "
        "and computes them in ball arithmetic."
    )
    return [
        f"<p class='small'>{about}</p>",
        _facts([*facts, ("Its words", escape(head))]),
        f"<ul class='small'>{said}</ul>" if said else "",
    ]


def _where(found: Certificate) -> list[str]:
    """The path or the box, with the picture."""
    figure = [drawn(*_picture(found))] if drawable(found) else []
    if isinstance(found.asked, Workspace):
        return ["<h2>Box of tool poses</h2>", *figure, _facts(_box_facts(found, found.asked))]
    return ["<h2>Path</h2>", *figure, _facts(_path_facts(found, found.asked)), *_pieces(found.asked)]


def _picture(found: Certificate) -> tuple[Callable[[], Any], str]:
    """What draws it, and what to see in it."""
    if isinstance(found.asked, PoseRange) and not (found.whole and found.demands.clear is None):
        return lambda: box_figure(found), box_picture_words(found)
    return lambda: proof_figure(found), picture_words(found)


def _box_facts(found: Certificate, space: Workspace) -> list[tuple[str, str]]:
    if not isinstance(space, PoseRange):
        return [("Poses", escape(str(space)))]
    task, (p, h) = found.equation.strategy.task, (space.solid.center, space.solid.half)
    spans = [f"{axis}: {a - b:.6g} to {a + b:.6g} m" for axis, a, b in zip("xyz", p, h, strict=True)]
    rows = [
        ("Tool positions", ", ".join(spans)),
        ("Centre, half sides", f"{_short(p)} m, {_short(h)} m, along the axes of the base"),
    ]
    if task.orientation is None:
        rows.append(("Orientation", "free: the task is about positions alone"))
    else:
        tilt, spin = np.degrees([space.tilt, space.spin])
        turns = f"leans by up to {tilt:.4g} deg, turns about its z axis by up to +-{spin:.4g} deg"
        rows.append(("Orientation in the middle", _axes(space.rotation)))
        rows.append(("Turns", turns if space.tilt or space.spin else "none: one orientation"))
    return [*rows, ("Proven", share_words(found)), *([("Stopped at", escape(found.where))] if found.where else [])]


def _path_facts(found: Certificate, path: AnyPath) -> list[tuple[str, str]]:
    task = found.equation.strategy.task
    rows = [
        ("Length", f"{path.length:.6g} m in {len(path.durations)} piece{'s' * (len(path.durations) > 1)}"),
        ("Closed", "yes" if path.closed else "no"),
    ]
    for k, one in enumerate(paths_of(path)):
        name = f", tool {k + 1}" if task.frames > 1 else ""
        rows.append((f"Begins{name}", f"at {_short(one.start)} m"))
        if task.orientation is not None and task.frames == 1 and task._spatial:
            R = one.rotation if one.rotation is not None else task.pose(start_of(found))[:3, :3]
            turn = float(sum(segment.turn for segment in one.segments))
            rows.append(("Orientation at the start", _axes(R)))
            rows.append(("The tool turns", f"by {np.degrees(turn):.4g} deg in all" if turn else "not at all"))
        elif task.orientation is None:
            rows.append((f"Orientation{name}", "free: the task is about positions alone"))
    return [
        *rows,
        ("Covered by cells", share_words(found)),
        *([("Stopped at", escape(found.where))] if found.where else []),
    ]


def _pieces(path: AnyPath) -> list[str]:
    """The ends of the pieces of a path."""
    parts: list[str] = []
    several = len(paths_of(path)) > 1
    for k, one in enumerate(paths_of(path)):
        shown = one.segments[:MOST_PIECES]
        begun = one.on(np.arange(len(shown)), np.zeros(len(shown))).position
        ended = one.on(np.arange(len(shown)), np.ones(len(shown))).position
        rows = [
            [str(i + 1), _short(a), _short(b), f"{s.length:.6g}", _shape(s)]
            for i, (s, a, b) in enumerate(zip(shown, begun, ended, strict=True))
        ]
        more = len(one.segments) - len(shown)
        head = ["Piece", "From [m]", "To [m]", "Length [m]", "Shape"]
        parts += [f"<h3>Tool {k + 1}</h3>"] if several else []
        parts += [html_table(head, rows)]
        parts += [f"<p class='small'>The file has {more} more pieces.</p>"] if more else []
    return parts


def _shape(segment: Segment) -> str:
    """A line, an arc with its centre and axis, or a curve."""
    if segment.along[1:].any():
        return "cubic curve"
    if not segment.angle:
        return "line"
    axis = np.sign(segment.angle) * np.cross(segment.x, segment.y)
    radius, axis = np.linalg.norm(segment.x), axis / np.linalg.norm(axis)
    angle = abs(np.degrees(segment.angle))
    return f"arc of {angle:.4g} deg, radius {radius:.6g} m, about {_short(segment.center)}, axis {_short(axis)}"


def _robot_facts(robot: Robot) -> list[tuple[str, str]]:
    rows = [("Model", _told(robot.name)), ("Source", _told(robot.source or "not named"))]
    roots = [joint for joint in robot.joints if joint.parent < 0]
    for joint in roots:
        rows.append(("Mounting", f"joint {_told(joint.name)} in the frame of the base: {_placed(joint.placement)}"))
    for tip in robot.tips:
        on = f"joint {_told(robot.joints[tip.joint].name)}" if tip.joint >= 0 else "the base"
        rows.append(("Tool", f"{_told(tip.name)}, in the frame of {on}: {_placed(tip.placement)}"))
    return rows


def _joints(found: Certificate) -> str:
    """Each joint with its limits in the model, and what is proven of it."""
    robot, some = found.equation.strategy.task.robot, len(found) > 0
    head = ["Joint", "Unit", "Lower limit", "Proven from", "Proven to", "Upper limit", "To a limit"]
    rows = []
    for i, joint in enumerate(robot.coordinates):
        scale = 10.0**PLACES
        hull = [
            f"{np.floor(found.low[i] * scale) / scale:.{PLACES}f}",
            f"{np.ceil(found.high[i] * scale) / scale:.{PLACES}f}",
        ]
        left = at_least(float(found.to_limit[i])) if np.isfinite(found.to_limit[i]) else "no limit"
        values = [*hull, left] if some else ["-", "-", "-"]
        rows.append([_told(joint.name), joint.unit, _number(joint.lower), *values[:2], _number(joint.upper), values[2]])
    asked = (
        ""
        if found.limits is not None
        else " The proof was made without limits: that the joints keep them is not claimed."
    )
    about = f"The joints over {place_words(found)}; bounds are rounded outwards.{asked}"
    return f"<p class='small'>{about}</p>{html_table(head, rows, numbers=True)}"


def _strategy_facts(found: Certificate) -> list[tuple[str, str]]:
    strategy, robot, q = found.equation.strategy, found.equation.strategy.task.robot, start_of(found)
    posture = ", ".join(
        f"{_told(c.name)} {_number(x)} {c.unit}" for c, x in zip(robot.coordinates, q.tolist(), strict=True)
    )
    rows = [
        ("Task", _told(strategy.task.name)),
        ("Rows of the task", _told(", ".join(strategy.task.row_names))),
        ("Strategy", _told(strategy.name)),
        ("Constraint", f"g(q) = c: {_told(strategy.constraint.name)}, {strategy.constraint.rows} row(s)"),
        ("Level c", _vector(found.c)),
        ("Posture", posture),
    ]
    if isinstance(found.asked, Workspace):
        rows.append(
            (
                "The posture is",
                f"on the leaf, at the place {_vector(found.anchors.u[0])} of the box, whose sides are -1 to 1",
            )
        )
    else:
        rows.append(("The posture is", "the start of the path"))
    return rows


def _numbers(found: Certificate) -> list[tuple[str, str]]:
    rows = [
        ("Extent", escape(found.extent.value)),
        ("Cells", f"{len(found):,}"),
        ("Time of the search", f"{found.seconds:.3g} s"),
    ]
    if not len(found):
        return rows
    f = found.findings
    rows += [
        (f"|det {escape(found.equation.derivative)}|", f"at least {at_least(found.determinant)}"),
        ("omega of the theorem", f"at most {at_most(float(f.omega.max()))}"),
        ("Radius of a root's ball", f"at most {at_most(float(f.r.max()))}"),
        ("Alone within", f"at least {at_least(float(f.alone.min()))}"),
    ]
    if np.isfinite(found.gap):
        rows += [("Gap of the closed path", f"at most {at_most(gap_of(found))}"), ("Whole turns", _vector(found.turns))]
    if found.revisit is not None:
        joints = zip(found.equation.strategy.task.robot.coordinates, found.revisit.low, found.revisit.high, strict=True)
        rows += [(f"{_told(c.name)} differs by", f"{low:.9g} to {high:.9g} {c.unit}") for c, low, high in joints]
    return rows


def _file_facts(file: FilePath, sha256: str, now: datetime) -> list[tuple[str, str]]:
    name = escape(file.name)
    return [
        ("Certificate", f"<code>{name}</code>, {file.stat().st_size:,} bytes, format {escape(FORMAT)}"),
        ("SHA-256 of the file", f"<code>{sha256}</code>"),
        ("Compare it by", f"<code>sha256sum {name}</code>"),
        (
            "Verify it by",
            f"<code>holokin check-certificate {name}</code>, 1 % of its cells by <code>--sample 0.01</code>",
        ),
        ("Page made", f"{now:%Y-%m-%d %H:%M} UTC"),
        ("Made by", f"holokin {escape(build())}, Python {platform.python_version()}, NumPy {np.__version__}"),
    ]


def _placed(T: Matrix) -> str:
    return f"at {_short(T[:3, 3])} m, {_axes(T[:3, :3])}"


def _axes(R: Matrix) -> str:
    """An orientation by its axes, which needs no convention of angles."""
    return f"x axis along {_short(R[:, 0])}, z axis along {_short(R[:, 2])}"


def _vector(values: Vector | Array) -> str:
    return f"[{', '.join(map(_number, values))}]"


def _short(values: Vector | Array) -> str:
    """Places and directions, to a micrometre: the file has all digits."""
    return f"[{', '.join(f'{x:.6g}' for x in np.round(values, 6) + 0.0)}]"


def _number(value: Any) -> str:
    if not np.isfinite(value):
        return "none"
    return f"{0.0 if abs(value) < 1e-12 else float(value):.9g}"


COLUMNS: tuple[Column, ...] = (
    ("strategy", "left"), ("proven", "left"), ("cells", "right"), ("seconds", "right"), ("largest\nomega", "right"),
    ("largest\nradius", "right"), ("nearest limit\n[rad or m]", "right"), ("least\n|det D_q E|", "right"),
)  # fmt: skip


CHECKED = {Outcome.VERIFIED: GOOD, Outcome.REJECTED: BAD, Outcome.SAMPLED: WARNING, Outcome.NONE: WARNING}
"""The colour of what the checker says."""


def cells(name: str, found: Certificate | str) -> list[str]:
    """The row of one strategy."""
    if isinstance(found, str):
        return [name, "not done", *["-"] * (len(COLUMNS) - 2)]
    proven = "all" if found.whole else "drifts" if found.revisit else "part" if len(found) else "NO"
    if not len(found):
        return [name, proven, "0", f"{found.seconds:.2g}", *["-"] * (len(COLUMNS) - 4)]
    return [
        name, proven, str(len(found)), f"{found.seconds:.2g}", f"{found.findings.omega.max():.2g}",
        f"{found.findings.r.max():.1e}", f"{found.to_limit.min():.3g}", f"{found.determinant:.1e}",
    ]  # fmt: skip


def print_certificates(
    title: str, found: dict[str, Certificate | str], words: dict[str, CheckerWord], console: Any
) -> None:
    """Print the table of a job's certificates, and below it each theorem, with what the checker says of it."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(brief(title)), title_justify="left", title_style="bold", header_style="dim")
    for heading, justify in COLUMNS:
        table.add_column(Text(heading), justify=justify, no_wrap=heading != "strategy")
    colors = {"all": GOOD, "part": WARNING, "not done": WARNING, "drifts": BAD, "NO": BAD}
    for name, one in found.items():
        table.add_row(*(Text(brief(cell), style=colors.get(cell, "")) for cell in cells(name, one)))
    console.print(table)
    left = [name for name, one in found.items() if isinstance(one, str)]
    for name, one in found.items():
        text = f"not certified: {one}" if isinstance(one, str) else str(one)
        style = GOOD if isinstance(one, Certificate) and one.whole else WARNING
        console.print(f"  {brief(name)}: {text}", style=style, markup=False, highlight=False)
        if isinstance(one, Certificate) and not one.whole:
            console.print(f"    {one.extent.value}", style=WARNING, markup=False, highlight=False)
            worst = refuted_by(one)
            if worst is not None:
                console.print(f"    refuted: {worst}", style=BAD, markup=False, highlight=False)
        if isinstance(one, Certificate):
            text, style = checker_words(one, words[name]), CHECKED[words[name].outcome]
            console.print(f"    {text}", style=style, markup=False, highlight=False)
    if left:
        rest = "the verdict is on the others" if len(left) < len(found) else "nothing is certified"
        text = f"left out: {brief(', '.join(left))}; {rest}"
        console.print(f"  {text}", style=WARNING, markup=False, highlight=False)


def write_certificates(
    name: str, found: dict[str, Certificate | str], words: dict[str, CheckerWord], out: FilePath, version: str,
    stopped: bool,
) -> list[FilePath]:  # fmt: skip
    """Write NAME-certificate.json and its page for each into `out/<name>`, which is replaced whole, see `renewed`.

    Args:
        words: of the checker; where one is missing, as after Ctrl-C, the page says that it was not run.
        stopped: whether the command was stopped before it came to all strategies, as result.json says.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made. WriteError.
    """
    files: list[str] = []
    facts: dict[str, Any] = {"holokin": version, "stopped": stopped, "strategies": {}}
    with renewed(out, name) as work:
        for label, one in found.items():
            if isinstance(one, str):
                facts["strategies"][label] = {"proven": False, "theorem": one}
                continue
            file, word = one.save(work / free_name(label, "-certificate.json", files)), words.get(label) or unasked(one)
            files += [file.name, write_page(one, file, word).name]
            said = {"proven": one.whole, "theorem": one.theorem, "checker": word.outcome.value}
            facts["strategies"][label] = said
            if (worst := refuted_by(one)) is not None:
                said["refuted"] = {
                    "names": worst.names, "distance": worst.distance, "wanted": worst.wanted, "q": worst.q.tolist(),
                    "pose": worst.pose.tolist(),
                }  # fmt: skip
            if isinstance(one.asked, PoseRange) and not one.whole:
                region = region_of(one)
                said["shares"] = {"proven": region.share, **region.parts.shares}
            if one.revisit is not None:
                moved = [one.revisit.low.tolist(), one.revisit.high.tolist()]
                said["drift"] = dict(zip(("least", "most"), moved, strict=True))
        write_facts(work, facts)
    return [out / name / file for file in files]
