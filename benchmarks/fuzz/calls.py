"""Bad calls of every public function, of the nouns that users make, and of the methods of what verbs return.

One or two arguments are spoilt, the others are good, so that the bad one is what the call meets; what it returns is
used. What a callable of the user's own raises may pass through; all else must be a `HolokinError`.
"""

from __future__ import annotations

import contextlib
import inspect
import random
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from types import FunctionType
from typing import Any

import mujoco
import numpy as np

import holokin as hk
from holokin import robot as robots
from holokin import strategies
from holokin.analysis import curvature
from holokin.analysis.audit import logs
from holokin.base.errors import MissingExtraError
from holokin.base.units import PrintedUnits
from holokin.motion import control
from holokin.path.workspaces import Box, Cylinder, Sphere, pose_cloud
from holokin.strategies import constraints
from holokin.symbolic import SX, factorise, symbol

from .spoil import spoilt


class MineError(Exception):
    """What a callable of the user's raises."""


def raises(*_: Any) -> Any:
    """A callable of the user's that raises `MineError`."""
    raise MineError


MADE: dict[type, tuple[Any, ...]] = {
    robots.Capsule: (0.1, 0.2), robots.Cylinder: (0.1, 0.2), robots.Box: ([0.1, 0.2, 0.3],),
    robots.Ellipsoid: ([0.1, 0.2, 0.3],), robots.Hull: ([[0, 0, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]],),
    robots.Mesh: (Path("no.stl"),), robots.Unread: ("x", "a plane"), robots.DHRow: (0.5,),
    hk.export.ProcessLines: (("wait 1",),), hk.Scene: (), hk.path.Waypoints: (np.eye(3), None, None, "s", ()),
}  # fmt: skip
"""Nouns that users make, with good arguments."""

SHAPES = (robots.Capsule, robots.Cylinder, robots.Box, robots.Ellipsoid, robots.Hull, robots.Mesh)

SLOW = {
    "studio", "audit", "advise", "design", "coverage", "survey", "distance_to_repeatable",
    "catalogue", "certify", "coverage_slices", "posture_reach", "fitted", "radial",
    "filtration", "leaf_function", "general_form",
}  # fmt: skip
"""Calls that take long where a bad argument is none: one in ten."""

OTHERS = {
    "from_mjcf", "from_pinocchio", "from_roboticstoolbox", "from_urdf", "from_yourdfpy", "read_recording", "read_paths",
    "read_workspace", "model_links", "model_tips", "inertia_weighted", "read_sheets", "retarget",
    "audit_dataset", "chosen_episodes", "has_joints", "is_dataset", "joint_feature", "pose_feature", "read_dataset",
    "read_runs", "studio", "catalogue",
}  # fmt: skip
"""Those whose good arguments would be files, models of other packages or datasets, which `doors` has, or a page."""


@cache
def kit() -> dict[str, Any]:
    """Nouns to call with and on, by the names that arguments of their kind have: small ones, built once."""
    robot = hk.load("planar-3r")
    q = np.array([0.3, 0.7, -0.5])
    task, T = hk.position(robot), robot.pose(q)
    start = T[:3, 3]
    law, held = hk.moore_penrose(task), hk.holonomic(task, hk.lock(0))
    loop, line = hk.circle(start, start + [0.02, 0, 0]), hk.line(start, start + [0.02, 0, 0])
    walk = hk.follow(held, loop, q, samples=8)
    space, ik, cost = hk.workspace(box=(start[:2], [0.2, 0.1])), hk.ik(held, q), constraints.posture_cost(q)
    servo = hk.controller(held, dt=0.01, q0=q)
    frame = {"position": np.zeros(3), "rotation": np.eye(3), "placement": np.eye(4), "frame": T}
    tool = {"pose": T, "poses": np.array([T]), "dx": np.zeros(task.m), "twist": np.zeros(6), "x": task(q)}
    joints = {"joint": robot.joint_names[0], "link": robot.joint_names[0], "order": list(robot.joint_names)}
    return frame | tool | joints | {
        "q": q, "q0": q, "start": q, "near": q, "preferred": q, "reference": q, "Q": q + 0.01 * np.eye(40, 3),
        "configuration": q, "dq": np.zeros(3), "rates": np.zeros(3), "velocity": np.zeros(3), "robot": robot,
        "task": task, "law": law, "given": law, "strategy": held, "other": hk.load("ppr"), "ik": ik, "thing": servo,
        "path": loop, "path_a": line, "path_b": line, "walk": walk, "trajectory": walk, "motion": walk,
        "timed": hk.retime(walk, acceleration=1.0, velocity=1.0, profile="trapezoidal", dt=0.01),
        "region": hk.around(q, 0.1), "workspace": space, "cost": cost, "potential": cost, "g": hk.lock(0),
        "constraint": hk.lock(2), "sheets": hk.sheets(task, space, q0=[q], samples=8, share=0.5, search=False),
        "leaf": [0.3], "level": [0.3], "shape": robots.Capsule(0.1, 0.2), "A": lambda q: [[q[0], 1.0, 0.0]],
        "expression": lambda q: [q[0]], "matrix": [[1.0, 0.0, -1.0]], "rho": lambda x: x[0],
        "N_G": lambda q: [[1, 0], [0, 1], [q[0], 0]], "weight": np.diag([1.0, 2.0, 3.0]), "plane": (0, 1), "rows": (0,),
        "clear": lambda Q: np.ones(len(Q), dtype=bool), "k": robot.kinematics(symbol("q", 3)), "gap": SX(1),
        "points": np.eye(3), "point": np.zeros(3), "positions": np.zeros((2, 3)), "directions": np.eye(3),
        "rotations": np.eye(3), "start_rotation": np.eye(3), "index": np.zeros(2, dtype=int), "u": np.array([0.0, 0.5]),
        "cycles": 1, "samples": 4, "dt": 0.02, "t": 0.0, "tip": None, "joints": None, "folder": "out", "file": "f",
        "speed": 0.1, "name": "n", "unit": "m", "limits": False, "count": 2, "step": 0.02, "seed": 0, "n": 3, "s": 0.0,
        "gain": 1.0, "max_acceleration": 1.0, "servo": "velocity", "stop": 0.5, "free": 3.0, "prefix": "",
        "radius": 0.1, "end": start + 0.1, "center": start + [0.02, 0, 0], "tolerance": 0.01, "spacing": 0.05,
        "model": mujoco.MjModel.from_xml_string(robots.to_mjcf(robot)),
    }  # fmt: skip


@cache
def things() -> dict[str, Any]:
    """What has methods: nouns of every kind and what verbs answer."""
    k = kit()
    found = {key: value for key, value in k.items() if type(value).__module__.startswith("holokin")}
    robot, task, held, law, q, loop = (k[key] for key in ("robot", "task", "strategy", "law", "q", "path"))
    two = replace(robot, tips=(*robot.tips, robots.Tip("elbow", 0, np.eye(4))))
    pair = hk.stacked(hk.position(two, tip=two.tips[0].name, rows=[0]), hk.position(two, tip="elbow", rows=[1]))
    around = hk.follow(held, loop, q, samples=40, cycles=4)
    log = logs.Recording(tuple(robot.joint_names), around.t, around.q, "here")
    wiring = hk.export.Wiring(axes=(*robot.joint_names, 0.0, 0.0, 0.0))
    made: dict[str, Callable[[], Any]] = {
        "two": lambda: two, "turn": lambda: hk.pose(robot), "stacked": lambda: pair, "wiring": lambda: wiring,
        "closed": lambda: control.closed_loop(law), "ball": lambda: curvature.ball(q, 0.05),
        "leaf": lambda: curvature.leaf_function(held, q, samples=1), "log": lambda: log,
        "covered": lambda: hk.coverage(held, k["workspace"], q, samples=4),
        "verdict": lambda: hk.involutivity(held, k["region"], samples=4),
        "check": lambda: hk.check(around, robot=robot),
        "drift": lambda: hk.drift(held, loop, q, samples=4),
        "postures": lambda: hk.motion.ik.all_postures(held, k["pose"], held.g(q)),
        "watch": lambda: hk.motion.LoopWatch(0.1), "status": lambda: hk.motion.Status.COMPLETE,
        "solutions": lambda: k["ik"].batch(k["poses"]), "synchronized": lambda: hk.path.synchronized(loop, loop),
        "rows": lambda: strategies.pfaffian(task, k["A"]), "radial": lambda: hk.radial(law, q),
        "null basis": lambda: hk.null_basis(task, k["N_G"]), "numeric": lambda: strategies.numeric(task, law),
        "arm": lambda: constraints.find_arm(hk.pose(hk.load("panda"))), "cloud": lambda: pose_cloud(k["poses"]),
        "cylinder": lambda: Cylinder(np.zeros(3), 0.1, 0.2), "sphere": lambda: Sphere(np.zeros(3), 0.1),
        "solid": lambda: Box(np.zeros(3), np.ones(3)), "log audit": lambda: hk.audit_recording(log, robot),
        "audit": lambda: hk.audit(control.closed_loop(law), task, [loop], q0=q, dt=0.5, cycles=3),
        "certificate": lambda: hk.certify(held, loop, q, budget=60), "nearest pose": lambda: k["ik"].nearest(k["pose"]),
        "program": lambda: hk.export.to_rapid(k["timed"], wiring=wiring), "excess": lambda: k["timed"].limits,
        "self-motion": lambda: strategies.self_motion_curve(task, q, step=0.2, length=1.0),
        "filtration": lambda: curvature.filtration(held, q),
        "objective": lambda: hk.analysis.design.Objective(squared_speed=1.0),
        "slices": lambda: hk.analysis.coverage.coverage_slices(held, k["workspace"], q, steps=3)[0],
        "hand": lambda: hk.motion.hand_follower(k["ik"], dt=0.01, max_acceleration=1.0),
        "spread": lambda: hk.motion.path_spread(held, k["path_a"], k["path_b"], q),
        "link shape": lambda: hk.obstacle("ball", robots.Capsule(0.1)),
        **{kind.__name__: lambda kind=kind, given=given: kind(*given) for kind, given in MADE.items()},
    }  # fmt: skip
    for key, make in made.items():
        with contextlib.suppress(MissingExtraError):
            found[key] = make()
    return found


def _pseudo_inverse(q: SX) -> SX:
    """J^T (J J^T)^-1 of the kit's task."""
    task = kit()["task"]
    J = task.jacobian_expression(task.kinematics(q), q)
    return J.T @ factorise(J @ J.T).solve(SX.eye(task.m))


@cache
def special() -> dict[str, dict[str, Any]]:
    """Good arguments of functions for which their names do not tell what is meant."""
    k, t = kit(), things()
    robot, task, law, held, q, loop = (k[key] for key in ("robot", "task", "law", "strategy", "q", "path"))
    two, pair, wired, start = t["two"], t["stacked"], {"wiring": t["wiring"]}, k["end"] - 0.1
    kinematics = {"k": pair.kinematics(symbol("q", 3))}
    panda, q7 = hk.pose(hk.load("panda")), symbol("q", 7)
    cube = np.full((2, 3), 0.5)
    patch = {"start": [0.4, 0, 0.2], "along": [0.1, 0, 0], "across": [0, 0.1, 0], "spacing": 0.05}
    square = hk.polyline([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.02]], closed=True)
    none = {"path": "no.csv"}
    straight = {"start": start, "end": start + 0.1}
    return {
        # robots and tasks
        "load": {"name": "planar-3r"}, "compose": {"parts": (hk.load("rail"), robot)},
        "from_dh": {"rows": [{"a": 0.5}]}, "from_urdf": none, "model_tips": none, "model_links": none,
        "pose_of": {"quaternion": [1.0, 0, 0, 0], "order": "wxyz"}, "with_tool": {"pose": [0.1, 0.0, 0.0]},
        "servo": {"kind": "position", "q": q}, "coordinates": {"names": ("a", "b")},
        "custom_task": {"expression": lambda q: q[:2], "units": ("rad", "rad")}, "stacked": {"tasks": (task,)},
        "relative_pose": {"robot": two, "tip": two.tips[0].name, "other": "elbow"},
        "StackedTask.jacobian_expression": kinematics, "StackedTask.value_expression": kinematics,
        "Scene": {"obstacles": [t["link shape"]], "floor": -1.0}, "DHRow": {"a": 0.5},
        "Box": {"sides": [0.1, 0.2, 0.3]}, "Cylinder": {"length": 0.2}, "Ellipsoid": {"radii": [0.1, 0.2, 0.3]},
        "Unread": {"source": "x", "reason": "y"},
        "Mesh.outward": {"faces": np.zeros((1, 3), dtype=int)},
        # constraints and strategies
        "find_arm": {"task": panda}, "Arm.places": {"task": panda},
        "Arm.expressions": {"task": panda, "k": panda.kinematics(q7), "q": q7},
        "lock": {"joints": (0,)}, "height": {"joints": ("q2",)}, "stack": {"constraints": (k["g"],)},
        "total": {"constraints": (k["g"], k["g"]), "weights": (1.0, 2.0)}, "weighted": {"weight": k["weight"]},
        "right_inverse": {"G": _pseudo_inverse}, "inertia_weighted": {"task": panda},
        "numeric": {"G": law}, "from_transport": {
            "task": hk.position(hk.load("ppr")), "K": lambda x, z: [x[0] - np.cos(z), x[1] - np.sin(z), z],
            "Phi": lambda x, z: z, "z": lambda q: q[2], "around": [0.1, 0.2, 0.3]},
        "fitted": {"Q": k["Q"], "degree": 1}, "radial": {"strategy": law},
        # paths and workspaces
        "line": straight, "circle": {"start": [0, 1, 0], "center": [0, 0, 0]},
        "arc": {"start": [0, 1, 0], "center": [0, 0, 0], "angle": 1.0}, "join": {"paths": (loop,)},
        "path_of": {"motion": lambda t: [0.1 * t, t * t, 0.0], "times": [0.0, 1.0]},
        "synchronized": {"paths": (loop, loop), "duration": None}, "blended": {"path": square},
        "with_leads": {"path": square, "lead_in": 0.01, "lead_out": 0.02}, "passes": {"path": square, "count": 2},
        "figure_eight": {"start": [0.4, 0, 0.2], "width": 0.2}, "raster": patch,
        "spiral": {"center": [0.4, 0, 0.2], "radius": 0.05}, "Path.in_frame": {"frame": k["pose"]},
        "SynchronizedPaths.table": {"start_rotation": np.tile(np.eye(3), (2, 1))},
        "SynchronizedPaths.part": {"start": 0.1}, "Path.part": {"start": 0.1}, "Path.cut": {"start": 0.0, "stop": 1.0},
        "workspace": {"box": ([0.5, 0, 0.3], [0.1, 0.1, 0.1])}, "Solid.points": {"u": cube},
        "Solid.contains": {"points": cube},
        # motions
        "check": {"robot": robot}, "controller": {"q0": q},
        "simulate": {"control_law": t["closed"], "task": task, "path": loop, "q0": q, "dt": 0.5},
        "retime": {"acceleration": 1.0}, "Trajectory.printed": {"units": PrintedUnits()},
        "approach": {"path": k["path_a"], "q0": q + 0.01}, "move_to_leaf": {"level": [0.31]},
        "Solutions.count": {"status": hk.motion.ik.InverseStatus.REACHED},
        "asymptotically_cyclic": {"level": [0.3]}, "LeafFunction.disagreement": {"by": q + 0.01},
        # verdicts and searches
        "around": {"radius": 0.1}, "box": {"lower": q - 0.1, "upper": q + 0.1}, "ball": {"start": q, "radius": 0.1},
        "ball_postures": {"strategy": law, "region": t["ball"]}, "involutivity": {"samples": 4},
        "involutivity_of": {"distribution": lambda x: [[1.0, 0.0], [0.0, 1.0], [x[1], 0.0]], "samples": 4},
        "measured_curvature": {"strategy": t["numeric"]}, "leaf_function": {"samples": 1},
        "distance_to_repeatable": {"strategy": law, "region": t["ball"], "samples": 2}, "cusps": {"q0": q, "starts": 8},
        "unique_region": {"budget": 40}, "witness_between": {"first": q, "second": np.array([0.3, 0.2, 0.5])},
        "certify": {"where": loop, "budget": 60},
        "joint_rates": {"certificate": t["certificate"]},
        "region_of": {"certificate": hk.certify(held, k["workspace"], q, budget=60)},
        "audit": {"control_law": t["closed"], "task": task, "path": [loop], "q0": q, "dt": 0.5, "cycles": 3},
        "audit_recording": {"recording": t["log"]}, "joined_turns": {"log": t["log"]},
        "Recording.part": {"first": 0, "last": 1},
        "coverage": {"samples": 4}, "coverage_slices": {"steps": 3}, "Slice.grid": {
            "values": np.zeros(int(t["slices"].inside.sum()))},
        "Coverage.count": {"status": hk.analysis.coverage.PoseStatus.REACHED},
        "design": {"degree": 1, "samples": 8},
        "advise": {"q0": q}, "sheets": {"samples": 8, "share": 0.5, "q0": [q], "search": False},
        "write_sheets": {"path": "sheets.npz"}, "self_motion_between": {"qa": q, "qb": q},
        "survey": {"robots": ["planar-3r"], "laws": {"mp": hk.moore_penrose}, "loops": {"c": {"kind": "circle",
            "size": 0.1}}, "workers": 0, "cases": 1, "cycles": 1, "samples": 5},
        # exports
        **{f"to_{name}": wired for name in ("rapid", "krl", "fanuc", "val3")},
        "to_inform": wired | {"pulses": [1000.0] * 6}, "write_mcap": {"folder": "bag"},
        "to_urscript": wired | {"tolerance": 0.01}, "export_moveit": {"folder": "moveit"},
        "export_ros2_control": {"folder": "ros2"},
        "export_sheets": {"found": k["sheets"], "folder": "sheets"}, "ProcessLines": {"on": ("output 1 on",)},
        **{f"{kind}.save": {"path": "x.csv"} for kind in ("Trajectory", "TimedTrajectory", "Coverage", "CheckReport")},
    }  # fmt: skip


def rooms() -> list[Any]:
    """The package and its public rooms."""
    public = [room for name in hk.__all__ if inspect.ismodule(room := getattr(hk, name))]
    names = [
        m.name
        for room in public
        for m in walk_packages(room.__path__, f"{room.__name__}.")
        if m.ispkg and not m.name.endswith("closed_form")
    ]
    return [hk, *(room for room in (*public, *map(import_module, names)) if hasattr(room, "__all__"))]


@cache
def callables() -> dict[str, Callable[..., Any]]:
    """Name -> every public function, the nouns of `MADE`, and every public method of `things`."""
    found: dict[str, Callable[..., Any]] = {kind.__name__: kind for kind in MADE}
    for room in rooms():
        found |= {name: one for name in room.__all__ if inspect.isfunction(one := getattr(room, name))}
    found["studio"] = lambda job="no such job": hk.studio(job, browser=False, wait=False).close()
    known = set()
    for thing in things().values():
        for name in ("__call__", *(n for n in dir(type(thing)) if not n.startswith("_"))):
            owner = next((c for c in type(thing).__mro__ if name in vars(c)), None)
            if owner is None or not owner.__module__.startswith("holokin") or (owner, name) in known:
                continue
            known.add((owner, name))
            if isinstance(vars(owner)[name], FunctionType | staticmethod | classmethod):
                found[f"{owner.__name__}.{name}"] = getattr(thing, name)
    return found


def good_arguments(name: str) -> dict[str, Any]:
    """Arguments by their names that are good for a callable: its own ones, and what it asks for by their names."""
    k, given = kit()["k"], special().get(name, {})
    expressions = {
        "q": symbol("q", 3), "R": SX.eye(3), "rotation": SX.eye(3), "v": symbol("v", 3), "w": symbol("w", 3),
        "position": symbol("p", 3), "twist": symbol("twist", 6), "c": SX(1), "gap": SX(1), "J": k.jacobian[:2, :],
        "dx": symbol("dx", 2), "x": symbol("x", 2), "G": symbol("G", 3, 2), "weight": symbol("weight", 3),
    }  # fmt: skip
    found = {}
    for p in inspect.signature(callables()[name]).parameters.values():
        known = expressions if p.annotation in ("SX", SX) else kit()
        if p.name in given:
            found[p.name] = given[p.name]
        elif p.default is p.empty and p.name in known:
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


def used(result: Any) -> None:
    """What a call with a bad argument returned is used: some nouns look at their parts only then."""
    k = kit()
    if isinstance(result, hk.Constraint):
        hk.holonomic(k["task"], result)
    elif isinstance(result, hk.Strategy) and result.task.n == 3:
        result(k["q"])
    elif isinstance(result, hk.Scene):
        hk.check(k["walk"], result, robot=k["robot"])
    elif isinstance(result, SHAPES):
        hk.obstacle("it", result)
    elif isinstance(result, robots.DHRow):
        hk.from_dh([result])
    elif isinstance(result, hk.export.Wiring):
        hk.export.to_krl(k["timed"], wiring=result)
    elif callable(getattr(result, "begin", None)):
        result.begin(k["q"])(k["q"], k["pose"], np.zeros(6), 0.01)


def mutant(seed: int | random.Random) -> tuple[str, Callable[[], Any]]:
    """(name, call) of a seed."""
    rng = seed if isinstance(seed, random.Random) else random.Random(seed)
    short = {name: name.rpartition(".")[2] for name in callables()}
    name = rng.choice([name for name in callables() if short[name] not in SLOW or rng.random() < 0.1])
    function, arguments = callables()[name], good_arguments(name)
    known = list(inspect.signature(function).parameters.values())
    nouns = [one for one in kit().values() if not isinstance(one, np.ndarray)]
    for p in rng.sample(known, min(len(known), rng.choice([1, 1, 2]))):
        good = arguments.get(p.name, None if p.default is p.empty else p.default)
        bad = spoilt(rng, good, [*nouns, raises])
        arguments[p.name] = (*(good or ()), bad) if p.kind is p.VAR_POSITIONAL else bad
    return name, lambda: used(call_with(function, arguments))


def attempt(seed: int, folder: Path) -> None:
    """One call with bad arguments, in a folder, so that names of files mean files there."""
    _, call = mutant(seed)
    with contextlib.chdir(folder), warnings.catch_warnings(), contextlib.suppress(MineError):
        warnings.simplefilter("ignore")
        try:
            call()
        except TypeError as problem:  # of a callable of ours with another number of arguments
            if "positional argument" not in str(problem):
                raise


def unreached(folder: Path) -> dict[str, str]:
    """Callables that refuse, or lack, the good arguments of this table, so that a bad one may go unseen, and why."""
    found = {}
    with warnings.catch_warnings(), contextlib.chdir(folder):
        warnings.simplefilter("ignore")
        for name, function in callables().items():
            try:
                if name not in OTHERS:
                    call_with(function, good_arguments(name))
            except MissingExtraError:
                pass
            except Exception as problem:  # noqa: BLE001  whatever it is, the call is not made
                found[name] = f"{type(problem).__name__}: {problem}"
    return found
