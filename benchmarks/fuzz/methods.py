"""Bad calls of every public method and of every function of the rooms, one argument spoilt at a time.

    python -m benchmarks.fuzz.methods

prints how many there were, those that ended in an error that is not holokin's, and what has no good arguments here. The
others of a bad call are good ones, so that the bad one is what it meets. Calls have a limit of time, see `limited`.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from pkgutil import walk_packages
from types import FunctionType
from typing import Any

import mujoco
import numpy as np

import holokin as hk
from holokin import strategies
from holokin.analysis import curvature
from holokin.base.errors import HolokinError, MissingExtraError
from holokin.base.units import PrintedUnits
from holokin.path.workspaces import Box, Cylinder, Sphere, pose_cloud
from holokin.symbolic import SX, factorise, symbol

from .calls import calls
from .harness import TooLongError, limited
from .nouns import kit

BAD: dict[str, Any] = {
    "None": None, "text": "x", "nan": np.full(3, np.nan), "short": np.zeros(1), "empty": [], "object": object(),
    "-1": -1, "1e308": 1e308, "dict": {"a": 1}, "deep": [[[0.0]]], "function of nothing": lambda: 0, "symbol": SX(1),
}  # fmt: skip
"""What an argument is replaced by; another robot's task comes as well."""

QUICK = 53
"""Of so many calls one is made with --quick."""

MOST = 0.0
"""Share of calls that may raise what is not holokin's."""

SECONDS = 5
"""Longest time of one call: longer ones are stopped and not counted."""


@cache
def _good() -> dict[str, Any]:
    """Arguments by their names, where these tell what they are."""
    k = kit()
    robot, task, held, q = k["robot"], k["task"], k["held"], k["q"]
    return {
        "q": q, "q0": q, "start": q, "robot": robot, "task": task, "strategy": held, "law": held, "Q": k["Q"],
        "path": k["loop"], "pose": k["pose"], "poses": np.array([k["pose"]]), "region": k["region"], "cycles": 1,
        "samples": 4, "dt": 0.02, "t": 0.0, "tip": None, "joint": robot.joint_names[0], "folder": "out", "file": "f",
        "path_a": k["line"], "path_b": k["line"], "points": np.eye(3), "point": np.zeros(3), "speed": 0.1,
        "name": "n", "unit": "m", "dx": np.zeros(task.m), "x": task(q), "walk": k["walk"], "trajectory": k["walk"],
        "shape": hk.robot.Capsule(0.1, 0.2), "constraint": hk.lock(2), "limits": False, "count": 2, "step": 0.02,
        "seed": 0, "n": 3, "plane": (0, 1), "twist": np.zeros(6), "position": np.zeros(3), "rotation": np.eye(3),
        "gain": 1.0, "expression": lambda q: [q[0]], "matrix": [[1.0, 0.0, -1.0]],
        "N_G": lambda q: [[1, 0], [0, 1], [q[0], 0]], "cost": k["cost"], "potential": k["cost"], "preferred": q,
        "rho": lambda x: x[0], "timed": k["timed"], "g": k["g"],
        "leaf": [0.3], "level": [0.3], "thing": k["servo"], "ik": k["ik"], "max_acceleration": 1.0, "servo": "velocity",
        "order": list(robot.joint_names), "A": lambda q: [[q[0], 1.0, 0.0]], "placement": np.eye(4),
        "rotations": np.eye(3), "rows": (0,), "stop": 0.5, "index": np.zeros(2, dtype=int), "u": np.array([0.0, 0.5]),
        "start_rotation": np.eye(3), "positions": np.zeros((2, 3)), "directions": np.eye(3), "dq": np.zeros(3),
        "free": 3.0, "s": 0.0, "clear": lambda Q: np.ones(len(Q), dtype=bool),
        "gap": SX(1), "k": robot.kinematics(symbol("q", 3)), "link": robot.joint_names[0],
        "configuration": np.zeros(3), "velocity": np.zeros(3), "rates": np.zeros(3), "prefix": "", "joints": None,
        "near": q, "model": mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot)),
    }  # fmt: skip


def _expressions() -> dict[str, SX]:
    """Those by their names: arguments that are annotated as `SX`."""
    k = _good()["k"]
    return {
        "q": symbol("q", 3), "R": SX.eye(3), "rotation": SX.eye(3), "v": symbol("v", 3), "w": symbol("w", 3),
        "position": symbol("p", 3), "twist": symbol("twist", 6), "c": SX(1), "gap": SX(1), "J": k.jacobian[:2, :],
        "dx": symbol("dx", 2), "x": symbol("x", 2), "G": symbol("G", 3, 2), "weight": symbol("weight", 3),
    }  # fmt: skip


def _pseudo_inverse(q: SX) -> SX:
    """J^T (J J^T)^-1 of the kit's task."""
    task = kit()["task"]
    J = task.jacobian_expression(task.kinematics(q), q)
    return J.T @ factorise(J @ J.T).solve(SX.eye(task.m))


@cache
def _special() -> dict[str, dict[str, Any]]:
    """Arguments of some functions, where their names do not tell what they are."""
    k, pair, cube = kit(), things()["stacked"], {"u": np.full((2, 3), 0.5), "points": np.zeros((2, 3))}
    two = {"k": pair.kinematics(symbol("q", 3))}
    panda, q7 = hk.pose(hk.load("panda")), symbol("q", 7)
    arm = {"task": panda, "k": panda.kinematics(q7), "q": q7}
    return {
        "strategies.constraints.find_arm": {"task": panda}, "Arm.places": {"task": panda}, "Arm.expressions": arm,
        "strategies.inertia_weighted": {"task": panda}, "analysis.curvature.general_form": {"strategy": k["held"],
        "q": k["q"]},
        "StackedTask.jacobian_expression": two, "StackedTask.value_expression": two,
        "Solid.points": cube, "Solid.contains": cube,
        "Slice.grid": {"values": np.zeros(int(things()["slices"].inside.sum()))},
        "SynchronizedPaths.table": {"start_rotation": np.tile(np.eye(3), (2, 1))},
        "SynchronizedPaths.part": {"start": 0.1}, "Path.cut": {"start": 0.0, "stop": 1.0},
        "lock": {"joints": (0,)}, "strategies.constraints.height": {"joints": ("q2",)},
        "strategies.constraints.stack": {"constraints": (k["g"],)},
        "strategies.constraints.total": {"constraints": (k["g"], k["g"]), "weights": (1.0, 2.0)},
        "Coverage.count": {"status": hk.analysis.coverage.PoseStatus.REACHED}, "robot.model_tips": {"path": "no.urdf"},
        "Solutions.count": {"status": hk.motion.ik.InverseStatus.REACHED},
        "robot.model_links": {"path": "no.urdf"},
        "strategies.from_transport": {
            "task": hk.position(hk.load("ppr")), "K": lambda x, z: [x[0] - np.cos(z), x[1] - np.sin(z), z],
            "Phi": lambda x, z: z, "z": lambda q: q[2], "around": [0.1, 0.2, 0.3]},
        "export.write_mcap": {"folder": "bag"}, "export.export_moveit": {"folder": "moveit"},
        "export.export_ros2_control": {"folder": "ros2_control"},
        "export.export_sheets": {"found": k["sheets"], "folder": "sheets"},
        "analysis.sheets.self_motion_between": {"qa": k["q"], "qb": k["q"]},
        "analysis.design.level_range": {"workspace": k["space"]},
        "proof.joint_rates": {"certificate": things()["certificate"]},
        "proof.region_of": {"certificate": hk.certify(k["held"], k["space"], k["q"], budget=60)},
        "Sheets.certified": {"sheet": 0, "workspace": k["space"]},
        "Mesh.outward": {"faces": np.zeros((1, 3), dtype=int)},
        "Trajectory.printed": {"units": PrintedUnits()},
        "analysis.curvature.witness_between": {"first": k["q"], "second": np.array([0.3, 0.2, 0.5])},
        "strategies.right_inverse": {"G": _pseudo_inverse},
    }  # fmt: skip


@cache
def _tables() -> dict[Any, dict[str, Any]]:
    """Function -> arguments by their names, of those that `calls` has a good call of."""
    found: dict[Any, dict[str, Any]] = {}
    for function, given, named in calls().values():
        with contextlib.suppress(TypeError, ValueError):
            known = inspect.signature(function).bind_partial(*given, **named)
            found.setdefault(getattr(function, "__func__", function), dict(known.arguments))
    return found


def rooms() -> list[Any]:
    """The package and its public rooms."""
    public = [room for name in hk.__all__ if inspect.ismodule(room := getattr(hk, name))]
    names = [m.name for room in public for m in walk_packages(room.__path__, f"{room.__name__}.") if m.ispkg]
    return [hk, *(room for room in (*public, *map(import_module, names)) if hasattr(room, "__all__"))]


@cache
def things() -> dict[str, Any]:
    """What has methods: nouns of every kind and what verbs answer."""
    k = kit()
    found = {key: value for key, value in k.items() if type(value).__module__.startswith("holokin")}
    robot, task, held, q = k["robot"], k["task"], k["held"], k["q"]
    two, walk, law, space = k["two"], k["walk"], k["law"], k["space"]
    pair = hk.stacked(hk.position(two, tip=two.tips[0].name, rows=[0]), hk.position(two, tip="elbow", rows=[1]))
    around = hk.follow(held, k["loop"], q, samples=40, cycles=4)
    log = hk.analysis.audit.logs.Recording(tuple(robot.joint_names), around.t, around.q, "here")
    made: dict[str, Callable[[], Any]] = {
        "ik": lambda: hk.ik(held, q), "verdict": lambda: hk.involutivity(held, k["region"], samples=4),
        "controller": lambda: hk.controller(held, dt=0.02, q0=q), "constraint": lambda: hk.lock(2),
        "check": lambda: hk.check(walk, robot=robot),
        "drift": lambda: hk.drift(held, k["loop"], q, samples=4), "timed": lambda: k["timed"],
        "postures": lambda: hk.motion.ik.all_postures(held, robot.pose(q), held.g(q), starts=8),
        "watch": lambda: hk.motion.LoopWatch(0.1), "status": lambda: hk.motion.Status.COMPLETE,
        "pose task": lambda: task,
        "solutions": lambda: hk.ik(held, q).batch(np.array([robot.pose(q)])),
        "stacked": lambda: pair, "synchronized": lambda: hk.path.synchronized(k["loop"], k["loop"]),
        "rows": lambda: strategies.pfaffian(task, lambda q: [[q[0], 1.0, 0.0]]), "radial": lambda: hk.radial(law, q),
        "null basis": lambda: hk.null_basis(task, lambda q: [[1, 0], [0, 1], [q[0], 0]]),
        "arm": lambda: hk.strategies.constraints.find_arm(hk.pose(hk.load("panda"))),
        "other solids": lambda: Cylinder(np.zeros(3), 0.1, 0.2), "sphere": lambda: Sphere(np.zeros(3), 0.1),
        "box": lambda: Box(np.zeros(3), np.ones(3)), "cloud": lambda: pose_cloud(np.array([k["pose"]])),
        "audit": lambda: hk.audit(k["closed"], task, [k["loop"]], q0=q, dt=0.5, cycles=3),
        "log": lambda: log, "log audit": lambda: hk.audit_recording(log, robot),
        "certificate": lambda: hk.certify(held, k["loop"], q, budget=60),
        "nearest pose": lambda: k["ik"].nearest(k["pose"]),
        "obstruction": lambda: hk.analysis.curvature.obstruction(held, k["loop"], q, samples=8),
        "program": lambda: hk.export.to_rapid(k["timed"], wiring=k["wiring"]),
        "self-motion": lambda: strategies.self_motion(task, q, step=0.2, length=1.0),
        "filtration": lambda: curvature.filtration(held, q),
        "deviation": lambda: curvature.deviation(law, held, k["Q"]),
        "predicted": lambda: curvature.predicted_drift(law, k["loop"], q),
        "objective": lambda: hk.analysis.design.Objective(squared_speed=1.0),
        "waypoints": lambda: hk.path.Waypoints(np.eye(3), None, None, "s", ()),
        "slices": lambda: hk.analysis.coverage.coverage_slices(held, space, q, steps=3)[0],
        "hand": lambda: hk.motion.hand_follower(k["ik"], dt=0.01, max_acceleration=1.0),
        "spread": lambda: hk.motion.path_spread(held, k["line"], k["line"], q), "excess": lambda: k["timed"].limits,
        "link shape": lambda: hk.obstacle("ball", hk.robot.Capsule(0.1)),
        **{kind.__name__: lambda kind=kind, sizes=sizes: kind(*sizes) for kind, sizes in SHAPES.items()},
    }  # fmt: skip
    for key, make in made.items():
        with contextlib.suppress(MissingExtraError):
            found[key] = make()
    return found


SHAPES: dict[type, tuple[Any, ...]] = {
    hk.robot.Capsule: (0.1, 0.2), hk.robot.Cylinder: (0.1, 0.2), hk.robot.Box: (np.ones(3),),
    hk.robot.Ellipsoid: (np.ones(3),), hk.robot.Hull: (np.eye(3),), hk.robot.Mesh: (Path("no.stl"),),
    hk.robot.Unread: ("x", "a plane"),
}  # fmt: skip


def callables() -> Iterator[tuple[str, Callable[..., Any]]]:
    """(name, function) of every public function of the rooms and every public method of `things`."""
    seen = set()
    for room in rooms():
        for name in room.__all__:
            one = getattr(room, name)
            if inspect.isfunction(one) and one not in seen:
                seen.add(one)
                yield f"{room.__name__.partition('.')[2]}.{name}".lstrip("."), one
    known = set()
    for thing in things().values():
        for name in ("__call__", *(n for n in dir(type(thing)) if not n.startswith("_"))):
            owner = next((c for c in type(thing).__mro__ if name in vars(c)), None)
            if owner is None or not owner.__module__.startswith("holokin") or (owner, name) in known:
                continue
            known.add((owner, name))
            if isinstance(vars(owner)[name], FunctionType | staticmethod | classmethod):
                method = getattr(thing, name)
                yield f"{owner.__name__}.{name}", method


HEAVY = {
    "studio", "audit", "advise", "design", "closest_holonomic", "coverage", "survey",
    "analysis.curvature.distance_to_repeatable", "analysis.curvature.winding", "motion.winding", "catalogue", "certify",
    "analysis.coverage.coverage_slices", "analysis.coverage.posture_reach",
}  # fmt: skip
"""Calls that take long, or open pages, where a bad argument is none; `calls` has them."""


ABSENT = {
    "audit_recording", "from_mjcf", "from_pinocchio", "from_roboticstoolbox", "from_urdf", "from_yourdfpy",
    "read_recording", "read_svg", "read_waypoints", "read_workspace", "robot.model_links", "robot.model_tips",
    "strategies.inertia_weighted", "read_sheets", "learning.retarget", "analysis.audit.audit_dataset",
    "analysis.audit.logs.chosen_episodes", "analysis.audit.logs.has_joints", "analysis.audit.logs.is_dataset",
    "analysis.audit.logs.joint_feature", "analysis.audit.logs.pose_feature", "analysis.audit.logs.read_dataset",
    "analysis.audit.logs.read_runs",
}  # fmt: skip
"""Those whose good arguments would be files, models of other packages, logs or datasets: other fuzzers have them."""


def good_arguments(name: str, function: Callable[..., Any]) -> dict[str, Any]:
    """Arguments by their names that are good for a function: all of those of `calls`, else what it asks for."""
    special, written = _special().get(name, {}), _expressions()
    own = _tables().get(getattr(function, "__func__", function))
    if own is not None and not special:
        return own
    found = {}
    for p in inspect.signature(function).parameters.values():
        known = special if p.name in special else written if p.annotation in ("SX", SX) else _good()
        if p.default is p.empty and p.name in known:
            found[p.name] = known[p.name]
    return found


def call_with(function: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    """Calls it, with the arguments in their order where they have no names."""
    given, named = [], {}
    for p in inspect.signature(function).parameters.values():
        if p.name not in arguments:
            continue
        if p.kind is p.VAR_POSITIONAL:
            given += arguments[p.name]
        elif p.kind is p.KEYWORD_ONLY or p.default is not p.empty:
            named[p.name] = arguments[p.name]
        else:
            given.append(arguments[p.name])
    return function(*given, **named)


def bad_calls() -> Iterator[tuple[str, Callable[[], Any]]]:
    """(name, call) of all: each argument in turn spoilt in every way, the others good ones."""
    bad = {**BAD, "another robot's": hk.pose(hk.load("irb140"))}
    for name, function in callables():
        if name in HEAVY:
            continue
        good, known = good_arguments(name, function), inspect.signature(function)
        if name in ABSENT and any(p.default is p.empty and p.name not in good for p in known.parameters.values()):
            continue
        for p in known.parameters.values():
            for kind, value in bad.items():
                spoilt = (*good.get(p.name, ()), value) if p.kind is p.VAR_POSITIONAL else value
                yield f"{name}({p.name}={kind})", lambda f=function, a={**good, p.name: spoilt}: call_with(f, a)


def unreached() -> dict[str, str]:
    """Callables that refuse, or lack, the good arguments of this campaign, so that a bad one may go unseen, and why."""
    found = {}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), contextlib.chdir(folder):
        warnings.simplefilter("ignore")
        for name, function in callables():
            try:
                if name not in HEAVY:
                    call_with(function, good_arguments(name, function))
            except MissingExtraError:
                pass
            except Exception as problem:  # noqa: BLE001  whatever it is, the call is not made
                found[name] = f"{type(problem).__name__}: {problem}"
    return found


def campaign(every: int = 1) -> tuple[int, list[tuple[str, str]]]:
    """Of each so many-th call (bad calls, those that raised what is not holokin's: (call, error))."""
    count, faults, before = 0, [], Path.cwd()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        os.chdir(folder)
        try:
            for name, call in islice(bad_calls(), 0, None, every):
                count += 1
                try:
                    with limited(SECONDS):
                        call()
                except (HolokinError, TooLongError):
                    pass
                except BaseException as problem:  # noqa: BLE001  whatever it is, it is what is counted
                    faults.append((name, f"{type(problem).__name__}: {problem}"))
        finally:
            os.chdir(before)
    return count, faults


def main() -> int:
    """Prints what raised; 1 where more than `MOST` of the calls did, or where good arguments are no longer good."""
    total, found = campaign(QUICK if "--quick" in sys.argv else 1)
    for call, error in found:
        print(f"{call}: {' '.join(error.split())[:120]}")
    refused = unreached()
    for name, error in refused.items():
        print(f"{name} refuses its good arguments: {' '.join(error.split())[:120]}")
    print(f"{total} bad calls, {len(found)} raised errors that are not holokin's")
    return int(len(found) > MOST * total or not refused.keys() <= ABSENT)


if __name__ == "__main__":
    sys.exit(main())
