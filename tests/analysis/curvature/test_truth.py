"""Results that may say no are neither True nor False; who asks is told what to ask."""

from __future__ import annotations

from contextlib import suppress
from enum import Enum
from importlib import import_module
from pkgutil import walk_packages

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import AmbiguousTruthError
from holokin.base.types import NoTruthValue
from public_nouns import public_classes

NO_QUESTION = {
    # what is asked about, and settings
    "Arm", "Constraint", "ControlLaw", "Controller", "Coordinate", "Cost", "DHRow", "Directions",
    "Dataset", "Episode", "JointFeature", "PoseFeature",
    "HandFollower", "FrameStrategy", "HolonomicStrategy", "InverseKinematics", "JaxInverse", "Joint", "KernelStrategy",
    "NumericStrategy", "TorchInverse",
    "Kinematics", "Law", "Limits", "LinkShape", "Objective", "OwnCost", "Part", "Path",
    "PostureTask", "Recording", "Robot", "RowStrategy", "SelfMotion",
    "FrameTask", "StackedTask", "Segment", "Samples",
    "Servo", "Shape", "Sheet", "Strategy", "Task", "Tip", "Visual", "Waypoints", "Wiring", "Workspace",
    "Ball", "Region", "Body", "Box", "Capsule", "Cylinder", "Ellipsoid", "Hull", "Mesh", "Surface", "Unread",
    # numbers, files and sequences: what is found is in them, and an empty sequence is False as a list is
    "DegreeTried", "NearbyCusps", "CuspWitness", "ProcessLines", "ToolTolerance", "ToolDeviation",
    "Division", "NoSeam", "Seam", "SheetPiece", "UnservedPart",
    "Clearance", "Deviation", "DriftPrediction", "Exported", "GeneralForm", "Jump", "JointLoad",
    "BadFrames", "EqualPoses", "JointRates",
    "MoveItPackage", "Ros2ControlPackage", "LeafFunction", "JointTensors", "Accuracy", "MeasuredCurvature",
    "LeftOut", "ClosestHolonomic", "Postures", "Program", "Reach", "RepeatableDistance", "SectionMetrics",
    "Slice", "Slowdown", "TimedTrajectory", "Unseen", "Witness",
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
        if not module.name.endswith("__main__"):
            with suppress(ModuleNotFoundError):  # of an extra
                import_module(module.name)  # what nobody has opened yet
    return descendants(one)


def descendants(one: type) -> set[type]:
    return {one, *(grown for child in one.__subclasses__() for grown in descendants(child))}


@pytest.mark.parametrize("one", sorted(children(NoTruthValue) - {NoTruthValue}, key=lambda one: one.__name__))
def test_a_result_is_neither_true_nor_false_and_names_what_to_ask(one: type) -> None:
    with pytest.raises(AmbiguousTruthError, match=one.__name__) as told:
        bool(next(iter(one)) if issubclass(one, Enum) else object.__new__(one))
    asked = told.value.ask.split("`")[1]
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
        with pytest.raises(AmbiguousTruthError):
            if answer:
                pass
    assert not verdict.holonomic
