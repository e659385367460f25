"""Robots from Denavit-Hartenberg tables, standard or modified (Craig), by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args, get_type_hints

import numpy as np

from ...base.arguments import check, typed
from ...base.errors import ArgumentError, NotFiniteError, UnknownNameError
from ...base.poses import PoseLike, pose_cure, pose_numbers
from ...base.types import Matrix, Shown, number
from ...symbolic.rotations import exact_rotation
from ..chains import TRUST, check_radians, plausible
from ..joints import FARTHEST, MOST_MOVING, Coordinate, Joint, Tip
from ..model import Robot

Convention = Literal["standard", "modified"]
"""Where the frames of a DH table stand."""


@dataclass(frozen=True)
class DHRow(Shown):
    """One row: lengths a, d [m], angles alpha, theta [rad]; the joint adds to theta (revolute) or d (prismatic).

    standard:  T_i = Rz(theta) Tz(d) Tx(a) Rx(alpha);   modified:  T_i = Rx(alpha) Tx(a) Rz(theta) Tz(d),
    with a, alpha of row i in Craig's numbering a_{i-1}, alpha_{i-1}. [SHV06, section 3.2; Cra05, section 3.4]
    """

    a: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    joint: str = ""
    kind: Literal["revolute", "prismatic"] = "revolute"
    lower: float = -np.inf
    upper: float = np.inf
    max_velocity: float = np.inf

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(DHRow).items():
            check(f"{name} of a DH row", kind, getattr(self, name))


@typed
def from_dh(
    rows: Sequence[DHRow | Mapping[str, Any]],
    convention: Convention = "standard",
    *,
    name: str = "robot",
    base: PoseLike | None = None,
    tool: PoseLike | None = None,
    tip: str = "tool",
    source: str = "",
    trust_units: bool = False,
) -> Robot:
    """A serial robot from a DH table.

    Args:
        rows: one `DHRow` (or mapping with its fields) a joint, SI and rad.
        convention: "standard" or "modified".
        base: pose (4, 4) of frame 0 in the base frame; identity by default.
        tool: pose (4, 4) of the tool in the last frame; identity by default.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        UnknownNameError: an unknown convention or field. ArgumentError: an unknown joint kind; numbers that look like
        degrees (an angle over a turn, limits of many turns on most hinges) or millimetres (links of over 20 m on
        average, along the axes: a and d may be large where they cancel, as of calibrated axes nearly parallel).
        NotFiniteError: a number that is not finite.
    """
    if convention not in get_args(Convention):
        raise UnknownNameError("DH convention", convention, get_args(Convention))
    if len(rows) > MOST_MOVING:
        raise ArgumentError(f"the number of joints of {name!r}", len(rows), f"give at most {MOST_MOVING:,}")
    before = np.eye(4) if base is None else _pose("base", base)
    foot, joints = before[:3, 3], list[Joint]()
    coordinates: list[Coordinate] = []
    for i, row in enumerate(_row(r) for r in rows):
        label = row.joint or f"q{i + 1}"
        if row.kind not in ("revolute", "prismatic"):
            raise ArgumentError(f"the kind of joint {label!r}", row.kind, "use 'revolute' or 'prismatic'")
        given = (row.a, row.alpha, row.d, row.theta)
        if not np.isfinite(given).all():
            raise NotFiniteError(f"DH row of joint {label!r} (a, alpha, d, theta)", given)
        if not trust_units:
            check_radians(f"alpha and theta of joint {label!r}", np.array([row.alpha, row.theta]), TRUST)
        link = _screw("x", row.alpha, row.a)
        motion = _screw("z", row.theta, row.d)
        # theta and d commute with the joint's own motion about or along z, so they go before it.
        placement = before @ (motion if convention == "standard" else link @ motion)
        joints.append(Joint(label, row.kind, i - 1, placement, np.array([0.0, 0.0, 1.0]), i, foot=None if i else foot))
        coordinates.append(Coordinate(label, row.kind, row.lower, row.upper, row.max_velocity))
        before = link if convention == "standard" else np.eye(4)
    end = before @ (np.eye(4) if tool is None else _pose("tool", tool))
    robot = Robot(name, tuple(coordinates), tuple(joints), (Tip(tip, len(joints) - 1, end),), source)
    return robot if trust_units else plausible(robot)


def _row(row: DHRow | Mapping[str, Any]) -> DHRow:
    if isinstance(row, DHRow):
        row = vars(row)
    if not isinstance(row, Mapping):
        raise ArgumentError("a DH row", row, "give a DHRow, or a mapping with its fields")
    known = tuple(DHRow.__dataclass_fields__)
    for key in row:
        if key not in known:
            raise UnknownNameError("field of a DH row", str(key), known)
    texts, label = ("joint", "kind"), row.get("joint", "")
    values: Any = {key: v if key in texts else number(f"{key} of DH row {label!r}", v) for key, v in row.items()}
    return DHRow(**values)


def _screw(axis: Literal["x", "z"], angle: float, length: float) -> Matrix:
    T = np.eye(4)
    T[:3, :3] = exact_rotation(axis, angle)
    T["xyz".index(axis), 3] = length
    return T


def _pose(what: str, value: PoseLike) -> Matrix:
    T = pose_numbers(what, value)
    right = T.shape == (4, 4) and bool((np.abs(T) <= FARTHEST).all()) and np.allclose(T[3], [0, 0, 0, 1])
    if not right or not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9) or np.linalg.det(T[:3, :3]) < 0:
        cure = pose_cure(T) or "give a 4x4 pose: a right-handed rotation, a translation, 0 0 0 1"
        raise ArgumentError(what, T.tolist(), cure)
    return T
