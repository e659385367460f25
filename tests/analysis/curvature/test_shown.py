"""How values are shown: one short line each, and in a notebook a small table in which no text is HTML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import cache
from html.parser import HTMLParser
from importlib import import_module
from pkgutil import walk_packages
from typing import Any

import numpy as np
import pytest
from benchmarks.fuzz.calls import things

import holokin as hk
from holokin.analysis.design import Objective, advice_case
from holokin.base.errors import CallError, NoAttributeError
from holokin.base.types import LONGEST, NoTruthValue, Result, Shown
from public_nouns import public_classes

EVIL = "<script>alert(1)</script><img src=x onerror=alert(2)>'\"&\x1b[2J\n\u202e" + 2000 * "long"
"""What a stranger may call a robot."""


def inner(value: Any, depth: int = 4) -> Iterator[Any]:
    """A value, and those that its fields hold."""
    yield value
    if depth and is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from inner(getattr(value, field.name), depth - 1)
    elif depth and isinstance(value, tuple | list):
        for one in value[:20]:
            yield from inner(one, depth - 1)


@cache
def instances() -> dict[type, Any]:
    """A real instance of each class of holokin that is met: nouns, and what verbs answer."""
    robot = hk.load("planar-3r")
    q0 = np.array([0.3, 0.6, 0.5])
    task = hk.position(robot)
    law = hk.holonomic(task, hk.lock(2))
    space = hk.workspace(box=(robot.pose(q0)[:2, 3], [0.05, 0.05]))
    more = [
        hk.design(task, space, q0, degree=1, samples=8), hk.cusps(law, q0), hk.unique_region(law, q0),
        hk.robot.DHRow(a=1.0),
        hk.survey(["ppr"], {"mp": hk.moore_penrose}, {"c": {"kind": "circle", "size": 0.1}}, cycles=1, workers=0),
    ]  # fmt: skip
    found: dict[type, Any] = {}
    for thing in [*things().values(), *more]:
        for one in inner(thing):
            if type(one).__module__.startswith("holokin") and not isinstance(one, Enum):
                found.setdefault(type(one), one)
    return found


@pytest.mark.campaign
def test_every_public_noun_has_one_short_line() -> None:
    public = set(public_classes().values())
    assert len(public & set(instances())) > 60
    for kind, one in instances().items():
        line = repr(one) if isinstance(one, Shown) or kind in public else ""
        assert len(line) <= LONGEST and line.isprintable(), (kind, line)
        if hasattr(one, "_repr_html_"):
            assert one._repr_html_().startswith("<div"), kind


def test_every_public_class_has_the_parent_that_makes_its_line() -> None:
    """Kinds are enumerations, with short names; tensors of other libraries stand in a named tuple, as these want."""
    known = (Shown, Enum, tuple)
    assert not [name for name, one in public_classes().items() if not issubclass(one, known)]


def stranger() -> hk.Robot:
    return replace(hk.load("planar-3r"), name=EVIL)


@cache
def from_a_stranger() -> list[Any]:
    """What is made of a robot with a hostile name."""
    robot, q0 = stranger(), np.array([0.3, 0.6, 0.5])
    task = hk.position(robot)
    law = replace(hk.holonomic(task, hk.lock(2)), name=EVIL)
    start = robot.pose(q0)[:3, 3]
    loop = hk.circle(start, start - [0.05, 0, 0])
    space = hk.workspace(box=(start[:2], [0.02, 0.02]))
    walk, ik = hk.follow(law, loop, q0, samples=20), hk.ik(law, q0)
    return [
        robot, task, law, hk.lock(2, name=EVIL), loop, walk, ik, ik.batch(space.poses(5)), ik.nearest(robot.pose(q0)),
        hk.involutivity(hk.moore_penrose(task), hk.around(q0, 0.1), samples=4), hk.check(walk, robot=robot),
        hk.coverage(law, space, q0, samples=4), hk.audit(law, task, q0=q0, dt=0.1, cycles=3),
        hk.drift(law, loop, q0, samples=20), hk.certify(law, loop, q0),
        hk.design(task, space, q0, degree=0, samples=4),
    ]  # fmt: skip


class Tags(HTMLParser):
    """The tags of a text, with their attributes, and the words between them."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.found: set[str] = set()
        self.words = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found |= {tag, *(f"{tag} {name}" for name, _ in attrs)}

    def handle_data(self, data: str) -> None:
        self.words += data


def test_every_result_is_plain_data_of_its_own_fields() -> None:
    """As JSON writes and reads it, without NaN; a number and a status are what the result has."""
    results = [one for one in from_a_stranger() if hasattr(one, "to_dict")]
    assert len(results) > 6
    for one in results:
        assert json.loads(json.dumps(one.to_dict(), allow_nan=False)), type(one)
    report, verdict = (next(r for r in results if type(r).__name__ == name) for name in ("CheckReport", "Verdict"))
    assert report.to_dict()["samples"] == report.samples and str(report) == report.table()
    assert verdict.to_dict()["holonomic"] == verdict.holonomic


def test_no_text_of_a_stranger_is_html_or_breaks_a_line() -> None:
    seen = 0
    for one in from_a_stranger():
        tags = Tags()
        tags.feed(one._repr_html_())
        assert tags.found <= {"div", "b", "table", "tr", "td", "td style", "p"}, type(one)
        assert not set(tags.words) & {"\x1b", "\u202e"}, type(one)
        seen += "alert(1)" in tags.words
        assert len(repr(one)) <= LONGEST and repr(one).isprintable(), type(one)
    assert seen >= 5  # the name is there, as text


def test_a_table_says_what_was_found() -> None:
    robot, q0 = hk.load("planar-3r"), np.array([0.3, 0.6, 0.5])
    task = hk.position(robot)
    start = robot.pose(q0)[:3, 3]
    law = hk.holonomic(task, hk.lock(2))
    walk = hk.follow(law, hk.circle(start, start - [0.05, 0, 0]), q0, samples=20)
    assert "<td" in walk._repr_html_() and "0.3000 rad" in walk._repr_html_() and "q3" in walk._repr_html_()
    assert "holonomic" in hk.involutivity(law, hk.around(q0, 0.1), samples=4)._repr_html_()
    assert "3.142 rad" in robot._repr_html_()
    solutions = hk.ik(law, q0).batch(np.array([robot.pose(q0), np.full((4, 4), np.nan)]))
    assert repr(solutions) == "Solutions(2 poses, 1 reached)"
    assert "not finite" in solutions._repr_html_()


@pytest.mark.parametrize("value", [1.0, 3, None, True, "x", np.eye(3), [1, 2], {"a": 1}, hk.motion.Status.COMPLETE])
def test_a_part_of_any_kind_is_shown(value: Any) -> None:
    cost = Objective(1.0)
    object.__setattr__(cost, "length", value)
    assert repr(cost).startswith("Objective(squared_speed=1") and cost._repr_html_().startswith("<div>")


# --- Results that may say no are neither True nor False; who asks is told what to ask.


NO_QUESTION = {
    # what is asked about, and settings
    "ArmClass", "ClosedInverse", "GeneralInverse", "GeneralPostures", "Held", "NoClass",
    "Arm", "Constraint", "ControlLaw", "Controller", "Coordinate", "Cost", "DHRow",
    "Dataset", "Episode", "JointFeature", "PoseFeature",
    "HandFollower", "FrameStrategy", "HolonomicStrategy", "InverseKinematics", "JaxInverse", "Joint", "KernelStrategy",
    "NumericStrategy", "TorchInverse", "ArmInverse", "ArmMap", "NearAnswer", "SheetPostures",
    "Kinematics", "Law", "Limits", "LinkShape", "Objective", "Part", "Path", "PathFile",
    "PostureTask", "RatedStrategy", "Recording", "Robot", "RowStrategy", "SelfMotionCurve",
    "SelfMotionArc", "ArcEnd", "EndKind",
    "FrameTask", "StackedTask", "Segment", "Samples",
    "Servo", "Shape", "Sheet", "Strategy", "Task", "Tip", "Visual", "Waypoints", "Wiring", "Workspace",
    "Ball", "Region", "Body", "Box", "Capsule", "Cylinder", "Ellipsoid", "Hull", "Mesh", "Surface", "Unread",
    # numbers, files and sequences: what is found is in them, and an empty sequence is False as a list is
    "NearbyCusps", "CuspWitness", "ProcessLines", "ToolTolerance", "ToolDeviation",
    "Division", "NoSeam", "Seam", "SheetPiece", "UnservedPart",
    "Clearance", "Deviation", "Exported", "GeneralForm", "Jump", "JointLoad",
    "BadFrames", "EqualPoses", "JointRates",
    "MoveItPackage", "Ros2ControlPackage", "LeafFunction", "JointTensors", "Accuracy", "MeasuredCurvature",
    "LeftOut", "PairDistance", "Postures", "Program", "Reach", "RepeatableDistance", "SectionMetrics",
    "Slice", "Slowdown", "TimedTrajectory", "Unseen",
    # a fault that was found, and kinds: none is a no
    "motion.checks.Finding", "motion.checks.Scene", "motion.checks.Clearances", "Evidence", "FindingKind",
}  # fmt: skip
"""Public classes whose truth value nobody takes for the answer to a question."""


def test_every_public_class_is_decided() -> None:
    names = public_classes()
    open_ones = {
        name
        for name, one in names.items()
        if not issubclass(one, NoTruthValue) and not {name, name.rpartition(".")[2]} & NO_QUESTION
    }
    assert open_ones == set(), "may its answer be no? then NoTruthValue is its parent, else it stands in NO_QUESTION"
    both = {n for n, one in names.items() if issubclass(one, NoTruthValue) and n.rpartition(".")[2] in NO_QUESTION}
    assert both == set()
    assert len(names) > 60


def children(one: type) -> set[type]:
    for module in walk_packages(hk.__path__, "holokin."):
        if not module.name.endswith(("__main__", "jax_rules", "torch_rules")):  # without results, and slow to import
            with suppress(ModuleNotFoundError):  # of an extra
                import_module(module.name)  # what nobody has opened yet
    return descendants(one)


def descendants(one: type) -> set[type]:
    return {one, *(grown for child in one.__subclasses__() for grown in descendants(child))}


@pytest.mark.parametrize("one", sorted(children(NoTruthValue) - {NoTruthValue}, key=lambda one: one.__name__))
def test_a_result_is_neither_true_nor_false_and_names_what_to_ask(one: type) -> None:
    with pytest.raises(CallError, match=one.__name__) as told:
        bool(next(iter(one)) if issubclass(one, Enum) else object.__new__(one))
    asked = told.value.cure.split("`")[1]
    if asked.startswith("."):
        top = asked.split(".")[1]
        fields = getattr(one, "__dataclass_fields__", {})
        assert top in fields or hasattr(one, top)
    else:  # a member of an enumeration
        name, member = asked.removeprefix("is ").split(".")
        assert name == one.__name__ and member in one.__members__


def test_what_verbs_answer_is_neither_true_nor_false(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    q0 = np.array([0.4, 0.7, -0.9])
    law = hk.moore_penrose(task)
    verdict = hk.involutivity(law, hk.around(q0, 0.2), samples=8)
    walk = hk.follow(law, hk.line(task(q0), task(q0) + 0.01), q0, samples=4)
    for answer in (verdict, walk, walk.status, hk.ik(hk.holonomic(task, hk.lock(2)), q0).batch(task(q0)[None])):
        with pytest.raises(CallError):
            if answer:
                pass
    assert not verdict.holonomic


# --- What functions of analysis find says its verdict first, and can be written as JSON.


@cache
def results() -> dict[str, Any]:
    """Each public result of curvature, coverage and design: by its name an instance."""
    robot, q0 = hk.load("planar-3r"), np.array([0.3, 0.6, 0.5])
    task, curvature = hk.position(robot), hk.analysis.curvature
    law, given = hk.holonomic(task, hk.lock(2)), hk.moore_penrose(task)
    tool = robot.pose(q0)[:3, 3]
    space = hk.workspace(box=(tool[:2], [0.05, 0.05]))
    design, function = hk.design(task, space, q0, degree=1, samples=8), hk.strategies.numeric(task, given)
    with pytest.MonkeyPatch.context() as few:
        few.setattr(advice_case, "POSES", 16)
        few.setattr(advice_case, "DESIGNED", 16)
        advised = hk.advise(task, hk.workspace(box=(tool[:2] * 1.2, [0.4, 0.4])), q0=q0)
    cusps = hk.cusps(law, q0, starts=100)
    found = [
        hk.involutivity(given, hk.around(q0, 0.1), samples=4),
        hk.involutivity(function, hk.around(q0, 0.1), samples=2).accuracy, curvature.measured_curvature(function, q0),
        curvature.filtration(given, q0), curvature.general_form(law, q0),
        curvature.distance_to_repeatable(given, curvature.ball(q0, 0.05), law, samples=8), cusps, *cusps.witnesses[:1],
        hk.coverage(law, space, q0, samples=8),
        hk.analysis.coverage.posture_reach(task, space, q0, samples=8), advised, advised.best, advised.part,
        *hk.analysis.coverage.coverage_slices(law, space, q0, steps=4), design, design.after, design.cusps,
        hk.analysis.design.level_range(law, space, q0),
    ]  # fmt: skip
    return {type(result).__name__: result for result in found if result is not None}


VERDICT_FIRST = {
    "Accuracy": r"by differences of values with a noise of \S+, over steps down to \S+, it is known to",
    "Advice": r"Take '.+': it reaches [\d.]+% of the workspace",
    "Coverage": r".+: reaches \d+ of 8 poses",
    "CuspWitness": r"round a closed tool path of \S+ m .* the joints do not come back",
    "Cusps": r"(no cusp|cuspidal|\d+ cusps?)\b",
    "Design": r"all hard limits of the design .* are kept at \d+ of \d+ poses",
    "Filtration": r"completely non-holonomic: .*: 2 -> 3 of 3",
    "GeneralForm": r"what is 0 in the general form",
    "LevelRange": r"(levels of .* serve|no level serves)",
    "MeasuredCurvature": r"the largest curvature is \S+ \+- ",
    "NearbyCusps": r"(no cusp|a cusp|the nearest cusp|cusps? of|its leaf)",
    "Part": r"'.+' serves ",
    "RatedStrategy": r".+: it serves [\d.]+% of the workspace",
    "Reach": r"\d of 8 poses are reached within the joint limits",
    "RepeatableDistance": r"difference from the joint rates of the given strategy",
    "SectionMetrics": r"the leaf reaches \d+ of \d+ poses",
    "Slice": r"[\d.]+% of the plane x-y at z = 0 m is reached",
    "Verdict": r".* is NOT holonomic: ",
}
"""How `str` of each result begins."""


@pytest.mark.campaign
def test_every_result_of_analysis_says_its_verdict_first_and_is_plain_data() -> None:
    rooms = ("analysis.curvature.", "analysis.coverage.", "analysis.design.")
    public = {name.rpartition(".")[2] for name, one in public_classes().items()
              if name.startswith(rooms) and issubclass(one, Result) and not issubclass(one, Enum)}  # fmt: skip
    assert public == set(VERDICT_FIRST)
    for name, result in results().items():
        assert re.match(VERDICT_FIRST[name], str(result)), str(result)
        assert json.loads(json.dumps(result.to_dict(), allow_nan=False)), name
    assert set(VERDICT_FIRST) - set(results()) <= {"CuspWitness", "Part"}  # where there is none


def test_an_old_name_of_advice_says_the_new_one() -> None:
    advice = object.__new__(hk.analysis.design.Advice)
    with pytest.raises(NoAttributeError) as told:
        _ = advice.laws
    assert str(told.value).endswith("write advice.strategies")
    assert not hasattr(advice, "laws_of_nobody")
