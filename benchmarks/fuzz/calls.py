"""Bad calls: every public function, and the methods of what they return, with one or two arguments spoilt.

What a callable of the user's own raises may pass through; all else must be a `HolokinError`.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import random
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from holokin import motion, strategies
from holokin.analysis import curvature
from holokin.analysis.audit import logs
from holokin.motion import control
from holokin.strategies import constraints

from .nouns import MineError, kit
from .path_calls import path_calls
from .spoiling import spoilt

Call = tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]

HEAVY = {
    "audit", "distance_to_repeatable", "winding", "fitted", "radial", "predicted_drift", "filtration", "leaf_function",
    "general_form", "advise", "design", "closest_holonomic",
}  # fmt: skip
"""Calls that take long where a bad argument is none: one in ten."""


def _studio(*given: Any, **named: Any) -> None:
    """A page that is closed again."""
    hk.studio(*given, **named, browser=False, wait=False).close()


@cache
def calls() -> dict[str, Call]:
    """Name -> (function, arguments, named arguments), all good."""
    k = kit()
    robot, task, law, held, q, loop, Q = (k[key] for key in ("robot", "task", "law", "held", "q", "loop", "Q"))
    start, line, walk, region = k["start"], k["line"], k["walk"], k["region"]
    row = {"a": 0.5, "alpha": 0.1, "d": 0.2, "theta": 0.3, "joint": "j", "kind": "revolute", "lower": -1.0,
           "upper": 1.0, "max_velocity": 2.0}  # fmt: skip
    one = np.eye(3)
    following = {"samples": 4, "method": "velocity", "limits": True}
    ball = hk.obstacle("ball", hk.robot.Capsule(0.1), [0.0, 0.0, 1.0])
    around = {"obstacles": [ball], "floor": -1.0, "clearance": 0.01, "self_collision": True,
              "allowed": [("ball", robot.joint_names[0])]}  # fmt: skip
    shapes = {"scene": hk.Scene(**around)}
    t = np.arange(3.0)
    found: dict[str, Call] = {
        "load": (hk.load, ("planar-3r",), {"tip": None, "base": None, "locked": None}),
        "studio": (_studio, ("no such job",), {"port": 0, "host": "127.0.0.1", "progress": str}),
        "from_urdf": (hk.from_urdf, ("no.urdf",), {"tip": None, "base": None, "locked": {"a": 0.0}}),
        "model_tips": (hk.robot.model_tips, ("no.urdf",), {}),
        "from_mjcf": (hk.robot.from_mjcf, ("<mujoco/>",), {"tip": "world", "base": None, "locked": {"a": 0.0}}),
        **{name: (getattr(hk.robot, name), ("no model",), {"tip": None, "base": None, "locked": {"a": 0.0}})
            for name in ("from_pinocchio", "from_yourdfpy", "from_roboticstoolbox")},
        "pose_of": (hk.pose_of, ([0.1, 0.2, 0.3], [1.0, 0.0, 0.0, 0.0]), {"order": "wxyz"}),
        "compose": (hk.compose, (hk.load("rail"), robot), {"name": "n", "order": ["rail_joint", *robot.joint_names]}),
        "Part": (lambda *a, **n: hk.compose(hk.robot.Part(*a, **n)), (robot,), {
            "on": "base", "pose": [0.1, 0.0, 0.0], "rpy": [0.0, 0.0, 0.1], "prefix": "p_"}),
        "with_tool": (hk.with_tool, (robot, [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]), {"tip": None, "name": "t"}),
        "with_limits": (hk.with_limits, (robot,), {"lower": -1.0, "upper": 1.0, "max_velocity": 2.0}),
        "with_base_pose": (hk.with_base_pose, (robot, [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]), {}),
        "to_urdf": (hk.robot.to_urdf, (robot,), {"density": 1000.0, "effort": 100.0}),
        "to_mjcf": (hk.robot.to_mjcf, (robot,), {"servo": hk.robot.servo(robot, "position", q), "density": 1000.0,
                                           "effort": [9.0, 9.0, 9.0]}),
        "servo": (hk.robot.servo, (robot, "position", q), {
            "frequency": 10.0, "damping_ratio": 1.0, "compensated": True}),
        "with_capsules": (hk.robot.with_capsules, (robot, {robot.joint_names[0]: 0.1}), {}),
        "with_shape": (hk.robot.with_shape, (
            robot, "pin", hk.robot.Capsule(0.1, 0.2), [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]), {"tip": None}),
        "obstacle": (hk.obstacle, ("ball", hk.robot.Capsule(0.1), [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]), {}),
        "chain_length": (hk.robot.chain_length, (robot,), {}),
        "Scene": (lambda **named: hk.check(walk, hk.Scene(**named), robot=robot), (), around),
        "check": (hk.check, (walk,), {"robot": robot,
            "task": task, **shapes, "limits": True, "margin": 0.1, "rcond": 0.01}),
        "CheckReport.save": (hk.check(walk, robot=robot).save, ("check.json",), {}),
        **{kind.__name__: (lambda *a, make=kind, **n: hk.obstacle("it", make(*a, **n)), sizes, {}) for kind, sizes in (
            (hk.robot.Box, ([0.1, 0.2, 0.3],)), (hk.robot.Capsule, (0.1, 0.2)), (hk.robot.Cylinder, (0.1, 0.2)),
            (hk.robot.Ellipsoid, ([0.1, 0.2, 0.3],)),
            (hk.robot.Hull, ([[0, 0, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]],)))},
        "reach": (hk.robot.reach, (robot,), {"tip": None}),
        "from_dh": (hk.from_dh, ([dict(row), dict(row, joint="k")],), {
            "convention": "standard", "name": "r", "base": np.eye(4), "tool": np.eye(4), "tip": "t", "source": "s"}),
        "DHRow": (lambda **named: hk.from_dh([hk.robot.DHRow(**named)]), (), row),
        "position": (hk.position, (robot,), {"tip": None, "rows": [0, 1]}),
        "pose": (hk.pose, (robot,), {
            "orientation": "twist", "reference": one, "axis": "z", "tip": None, "rows": [0, 1]}),
        "relative_pose": (hk.strategies.tasks.relative_pose, (k["two"], k["two"].tips[0].name, "elbow"), {
            "orientation": "twist", "reference": one, "axis": "z", "rows": [0, 1]}),
        "line_of_sight": (hk.strategies.tasks.line_of_sight, (robot, [0.1, 0.2, 0.3]), {
            "tip": None, "axis": "x", "name": "sight"}),
        "custom_task": (hk.custom_task, (robot, lambda q: q[:2]), {
            "units": ("rad", "rad"), "names": ("a", "b"), "name": "mine"}),
        "stacked": (hk.stacked, (task, k["elbow"]), {}),
        "coordinates": (hk.robot.coordinates, (("a", "b"),), {
            "lower": -1.0, "upper": [1.0, 2.0], "max_velocity": 1.0, "units": ("N", "rad"), "name": "u"}),
        "arm_angle": (lambda **named: hk.holonomic(task, hk.arm_angle(**named)), (), {
            "definition": "stereographic", "joints": tuple(robot.joint_names), "reference": [0, 0, 1],
            "pole": [1, 0, 0], "tip": None}),
        "height": (lambda joint: hk.holonomic(task, constraints.height(joint)), (robot.joint_names[1],), {}),
        "lock": (lambda *j, **n: hk.holonomic(task, hk.lock(*j, **n)), (0,), {"name": "lock"}),
        "linear": (lambda *a, **n: hk.holonomic(task, hk.linear(*a, **n)), ([1.0, 0.0, -1.0],), {"name": "linear"}),
        "coupled": (lambda *a, **n: hk.holonomic(k["task"], hk.coupled(*a, **n)), (1.0,), {
            "orientation": "rpy", "rows": (2,)}),
        "custom": (lambda *a, **n: hk.holonomic(task, hk.custom(*a, **n)), (lambda x: [x[0]],), {
            "rows": 1, "name": "mine", "angular": False}),
        "stack": (lambda *a: hk.holonomic(task, constraints.stack(*a)), (k["g"],), {}),
        "total": (lambda *a, **n: hk.holonomic(task, constraints.total(*a, **n)), (k["g"], k["g"]),
            {"weights": [1.0, 0.5]}),
        "tilted": (lambda *a, **n: hk.holonomic(task, constraints.tilted(*a, **n)), (k["g"], lambda x: x[0]),
            {"name": "t"}),
        "stationary": (lambda *a, **n: hk.holonomic(task, hk.stationary(*a, **n)), (k["cost"],), {
            "free": (robot.joint_names[0],), "name": "s"}),
        "posture_cost": (lambda *a: hk.holonomic(task, hk.stationary(constraints.posture_cost(*a))), (q, 1.0), {}),
        "gravity_cost": (lambda *a: hk.holonomic(task, hk.stationary(constraints.gravity_cost(*a))), ([0, 0,
            -9.81],), {}),
        "moore_penrose": (hk.moore_penrose, (task,), {"name": "n"}),
        "weighted": (hk.weighted, (task, k["weight"]), {"name": "n"}),
        "null_basis": (lambda *a, **n: hk.null_basis(*a, **n)(q), (task, lambda x: task_frame()), {"name": "n"}),
        "holonomic": (hk.holonomic, (task, k["g"]), {"name": "n"}),
        "pfaffian": (lambda *a, **n: strategies.pfaffian(*a, **n)(q), (task, lambda x: [[1.0, x[0], 0.0]]),
            {"name": "n"}),
        "right_inverse": (strategies.right_inverse, (task, lambda x: task_frame()), {"name": "n"}),
        "coupled_twist": (lambda *a, **n: strategies.coupled_twist(*a, **n)(q), (task, 1.0), {"name": "n"}),
        "inertia_weighted": (strategies.inertia_weighted, (task,), {"name": "n"}),
        "impedance": (lambda *a, **n: strategies.impedance(*a, **n)(q), (task, k["cost"]),
            {"force": "stiffness", "name": "n"}),
        "from_transport": (strategies.from_transport, (task, lambda x, z: z, lambda x, z: z, lambda x: x[0]), {
            "around": q, "inverse": None, "center": [0.0, 0.0], "steps": 1, "name": "n"}),
        "radial": (hk.radial, (law, q), {"steps": 1, "name": "n"}),
        "fitted": (strategies.fitted, (held, Q), {"degree": 1, "rows": (0, 1), "name": "n"}),
        "self_motion": (strategies.self_motion, (task, q), {"step": 0.2, "length": 1.0, "limits": False}),
        "line": (hk.line, (start, start + 0.1), {"turn": [0, 0, 0.1], "speed": 0.1}),
        "arc": (hk.path.arc, ([0, 1, 0], [0, 0, 0], 1.0, [0, 0, 1]), {"turn": [0, 0, 0.1], "speed": 0.1}),
        "circle": (hk.circle, ([0, 1, 0], [0, 0, 0], [0, 0, 1]), {"clockwise": False, "speed": 0.1}),
        "polyline": (hk.polyline, ([[0, 0], [1, 0], [1, 1]],), {
            "turns": [[0, 0, 0.1]] * 3, "closed": True, "speed": 0.1}),
        "join": (hk.path.join, (line, line), {}),
        "synchronized": (hk.path.synchronized, (line, line, [0, 1, 0]), {"duration": 2.0}),
        "through": (hk.path.through, ([[0, 0, 0, 0], [1, 0, 0, 1]],), {"closed": True, "speed": None, "seconds": 1.0}),
        "follow": (hk.follow, (held, loop, q), {**following, "cycles": 1}),
        "certify": (hk.certify, (held, loop, q), {"limits": True, "budget": 60, "progress": str}),
        "retime": (hk.retime, (walk,), {
            "acceleration": 1.0, "jerk": 100.0, "velocity": [1.0, 1.0, 1.0], "profile": "trapezoidal", "speed": 1.0,
            "cycles": 1, "endless": False, "dt": 0.01}),
        "TimedTrajectory.excess": (k["timed"].excess, ("difference",), {}),
        "TimedTrajectory.save": (k["timed"].save, ("timed.csv",), {}),
        "Wiring": (lambda **named: hk.export.to_krl(k["timed"], wiring=hk.export.Wiring(**named)), (), {
            "axes": (*robot.joint_names, 0.1, 0.2, 0.3), "external": (0.4,), "signs": {robot.joint_names[0]: -1},
            "offsets": {robot.joint_names[1]: 0.5}}),
        "to_rapid": (hk.export.to_rapid, (k["timed"],), {
            "name": "n", "about": "a", "wiring": k["wiring"], "tolerance": 0.01, "zone": "z5", "tool": "tool0",
            "base": "wobj0", "payload": "load0", "lines": hk.export.ProcessLines(on=("output 1 on",))}),
        "ProcessLines": (hk.export.ProcessLines, (), {
            "before": ("wait 1",), "on": ("output 1 on",), "off": ("output 1 off",), "after": (),
            "window": (0.0, 1.0)}),
        "ToolTolerance": (hk.export.ToolTolerance, (task,), {
            "position": 1e-3, "rotation": 0.01, "speed": 0.05, "joints": 0.01, "linear": False}),
        "to_krl": (hk.export.to_krl, (k["timed"],), {
            "name": "n", "about": "a", "wiring": k["wiring"], "tolerance": 0.01, "zone": 0.001, "tool": 1, "base": 2,
            "payload": 3, "lines": hk.export.ProcessLines()}),
        "to_urscript": (hk.export.to_urscript, (k["timed"],), {
            "name": "n", "about": "a", "wiring": k["wiring"], "tolerance": 0.01, "zone": 0.0,
            "tool": (0.0, 0.0, 0.1, 0.0, 0.0, 0.0), "payload": 1.0, "lines": hk.export.ProcessLines(),
            "lookahead_time": 0.1, "gain": 300.0}),
        "to_fanuc": (hk.export.to_fanuc, (k["timed"],), {
            "name": "n", "about": "a", "wiring": k["wiring"], "coupled": True, "tolerance": 0.01, "base": 0,
            "tool": 1, "payload": 1, "zone": 50, "lines": hk.export.ProcessLines(), "written": None}),
        "to_inform": (hk.export.to_inform, (k["timed"], [1000.0] * 6), {
            "name": "n", "about": "a", "wiring": k["wiring"], "tolerance": 0.01, "lines": hk.export.ProcessLines(),
            "speeds": [3.0] * robot.n, "zone": 1, "tool": 1, "written": None}),
        "to_val3": (hk.export.to_val3, (k["timed"],), {
            "name": "n", "about": "a", "wiring": k["wiring"], "tolerance": 0.01, "lines": hk.export.ProcessLines(),
            "speeds": [3.0] * robot.n, "zone": 0.001, "tool": "flange", "base": "world"}),
        "to_gcode": (hk.export.to_gcode, (k["timed"],), {
            "name": "n", "about": "a", "wiring": None, "tolerance": 0.01, "lines": hk.export.ProcessLines(),
            "zone": 0.001, "letters": ("A", "B", "C")}),
        "to_ros": (hk.export.to_ros, (k["timed"],), {
            "about": "a", "tolerance": 0.01, "frame": "base", "format": "json"}),
        "drift": (hk.drift, (held, loop, q), {**following, "cycles": 1}),
        "path_spread": (hk.motion.path_spread, (held, loop, loop, q), following),
        "all_postures": (hk.motion.ik.all_postures, (held, k["pose"]), {"level": 0.0, "limits": True, "starts": 16}),
        "obstruction": (hk.analysis.curvature.obstruction, (held, loop, q), {"samples": 8}),
        "winding": (motion.winding, (held, loop, q), following),
        "ik": (hk.ik, (held, q), {}),
        "learning.torch.inverse": (hk.learning.torch.inverse, (k["ik"],), {}),
        "learning.jax.inverse": (hk.learning.jax.inverse, (k["ik"],), {}),
        "numeric": (strategies.numeric, (task, law), {"q0": q, "name": "n", "accuracy": 1e-6}),
        "measured_curvature": (curvature.measured_curvature, (strategies.numeric(task, law), q), {}),
        "move_to_leaf": (hk.motion.ik.move_to_leaf, (held, q), {"level": [0.31]}),
        "controller": (hk.controller, (held,), {
            "dt": 0.01, "q0": q, "gain": 1.0, "constraint_gain": 1.0, "limits": True}),
        "closed_loop": (_begun(control.closed_loop), (law, 10.0), {}),
        "damped": (_begun(control.damped), (task,), {"damping": 0.05, "gain": 1.0, "name": "n"}),
        "gradient_projection": (_begun(control.gradient_projection), (task, k["cost"]), {
            "weight": 1.0, "gain": 1.0, "name": "n"}),
        "repetitive_motion": (_begun(control.repetitive_motion), (task,), {
            "rate": 1.0, "gain": 1.0, "limits": False, "name": "n"}),
        "asymptotically_cyclic": (_begun(control.asymptotically_cyclic), (task, k["g"], [0.3]), {
            "constraint_gain": 1.0, "gain": 1.0, "exact": False, "name": "n"}),
        "impedance_with_memory": (_begun(control.impedance_with_memory), (task, k["cost"]), {
            "force": [0.0, 0.0], "name": "n"}),
        **{name: (getattr(control, name), (held, q), {
            "cost": 1.0, "gain": 0.5, "lm_damping": 0.0, "prefix": "", "joints": list(robot.joint_names)})
            for name in ("pink_task", "mink_task")},
        "simulate": (hk.simulate, (k["closed"], task, loop, q), {"dt": 0.5, "cycles": 1, "patience": None}),
        "audit": (hk.audit, (k["closed"], task, [loop], q), {
            "dt": 0.5, "cycles": 3, "tolerance": 1e-3, "patience": 2.0,
            "metrics": {"length": len}}),
        "around": (hk.around, (q, 0.1), {}),
        "box": (curvature.box, (q - 0.1, q + 0.1), {}),
        "ball": (curvature.ball, (q, 0.1), {"along": 0.0}),
        "ball_postures": (curvature.ball_postures, (law, k["ball"], 2), {"seed": 0}),
        "involutivity": (hk.involutivity, (law, region), {
            "samples": 4, "thorough": False, "tolerance": 1e-9, "seed": 0}),
        "involutivity_of": (curvature.involutivity_of, (lambda x: [[1.0, 0.0], [0.0, 1.0], [x[1], 0.0]], 3), {
            "region": region, "samples": 4, "thorough": False, "tolerance": 1e-9, "seed": 0}),
        "curvature": (hk.curvature, (law, q), {"method": "auto"}),
        "unique_region": (hk.unique_region, (held, q), {"limits": False, "budget": 40, "progress": str}),
        "witness_between": (hk.analysis.curvature.witness_between, (held, q, q), {"via": 8, "limits": False}),
        "why_elsewhere": (hk.analysis.curvature.why_elsewhere, (held, hk.follow(held, loop, q)), {}),
        "cusps": (hk.cusps, (held, q), {"starts": 8, "limits": False}),
        "filtration": (curvature.filtration, (held, q), {"most": 2}),
        "predicted_drift": (curvature.predicted_drift, (law, loop, q), {}),
        "deviation": (curvature.deviation, (law, held, Q), {"columns": 2}),
        "distance_to_repeatable": (curvature.distance_to_repeatable, (law, k["ball"]), {
            "ours": held, "samples": 2, "seed": 0}),
        "leaf_function": (curvature.leaf_function, (held, q), {"radius": 0.01, "samples": 1, "seed": 0}),
        "general_form": (curvature.general_form, (law, q), {"reference": q}),
        "export_c": (hk.export.export_c, (law, "out"), {
            "q0": q, "dt": 0.01, "name": "law", "limits": True, "vectors_count": 1, "origin": "fuzz"}),
        "export_moveit": (hk.export.export_moveit, (held, "out"), {
            "q0": q, "package": "law_plugin", "group": "arm", "name": "law", "limits": True, "vectors_count": 1,
            "origin": "fuzz"}),
        "export_ros2_control": (hk.export.export_ros2_control, (held, "out"), {
            "q0": q, "package": "law_controller", "name": "law", "vectors_count": 1, "origin": "fuzz"}),
        "Recording": (logs.Recording, (("a", "b", "c"), t, np.zeros((3, 3)), "here"), {"notes": ()}),
        "audit_recording": (hk.audit_recording, (logs.Recording(tuple(robot.joint_names), t, np.zeros((3,
            3)), "here"),
            robot), {"tip": None, "orientation": None, "tolerance": 1e-3, "length_scale": 0.1}),
        "read_dataset": (logs.read_dataset, (Path("no folder"),), {}),
        "lerobot_step": (hk.learning.lerobot_step, (k["ik"],), {
            "degrees": True, "step": 0.1, "prefix": "ee", "motors": None}),
        "read_recording": (hk.read_recording, ("no.csv", robot), {
            "degrees": False, "topic": None, "columns": "q_%d", "time": "t"}),
        "workspace": (hk.workspace, (), {
            "box": ([0.5, 0, 0.3], [0.1, 0.1, 0.1]), "cylinder": None, "sphere": None, "rotation": one, "tilt": 0.5,
            "spin": 0.5}),
        "workspace of a cylinder": (hk.workspace, (), {"cylinder": ([0.5, 0, 0.3], 0.1, 0.2)}),
        "workspace of a sphere": (hk.workspace, (), {"sphere": ([0.5, 0], 0.1)}),
        "read_workspace": (
            hk.path.read_workspace, ("no.csv",), {"units": "mm", "angles": "deg", "order": "xyzw", "rotation": one},
        ),
        "coverage": (hk.coverage, (held, q, k["space"]), {
            "samples": 4, "seed": 0, "limits": True, "explain": True, "reach": None}),
        "design": (hk.design, (task, k["space"], q), {
            "objective": hk.analysis.design.Objective(squared_speed=1.0), "base": k["g"], "degree": 1, "limits": True,
            "margin": 0.0, "rcond": 0.0, "samples": 16, "seed": 0, **shapes}),
        "closest_holonomic": (hk.analysis.design.closest_holonomic, (law, region), {
            "base": k["g"], "degree": 1, "samples": 32, "seed": 0, "length": 0.5}),
        "advise": (hk.advise, (task, k["space"]), {
            "q0": q, "progress": lambda _: None, **shapes}),
        "coverage_slices": (hk.analysis.coverage.coverage_slices, (held, q, k["space"]), {"steps": 3, "limits": True}),
        "posture_reach": (hk.analysis.coverage.posture_reach, (task, k["space"], q), {"samples": 4, "seed": 0}),
        "Workspace.poses": (k["space"].poses, (5,), {"seed": 0}),
        "Coverage.save": (k["covered"].save, ("covered.csv",), {}),
        "Robot.pose": (robot.pose, (q,), {"tip": "tool"}),
        "Robot.jacobian": (robot.jacobian, (q,), {"tip": "tool"}),
        "Robot.pose of many": (robot.pose, (Q,), {"tip": "tool"}),
        "Robot.jacobian of many": (robot.jacobian, (Q,), {"tip": "tool"}),
        "Robot.pose_batch": (robot.pose_batch, (Q,), {"tip": None}),
        "Robot.skeleton": (robot.skeleton, (q,), {}),
        "Robot.checked": (robot.checked, (q,), {"what": "q"}),
        "Robot.beyond": (robot.beyond, (q,), {}),
        "Robot.check_limits": (robot.check_limits, (q,), {}),
        "Robot.joint_index": (robot.joint_index, (robot.joint_names[0],), {}),
        "Task": (task, (q,), {}),
        "Task.jacobian": (task.jacobian, (q,), {}),
        "Task of many": (task, (Q,), {}),
        "Task.jacobian of many": (task.jacobian, (Q,), {}),
        "Task.null_space": (task.null_space, (q,), {}),
        "Task.error": (task.error, (q, start, one), {}),
        "Task.value_batch": (task.value_batch, (Q,), {}),
        "Task.jacobian_batch": (task.jacobian_batch, (Q,), {}),
        "Task.error of many": (task.error, (Q[:1], [start], [one]), {}),
        "Task[]": (task.__getitem__, ([0],), {}),
        "Strategy": (law, (q,), {}),
        "Strategy of many": (law, (Q,), {}),
        "Strategy.g": (held.g, (q,), {}),
        "Strategy.g of many": (held.g, (Q,), {}),
        "Strategy.batch": (law.batch, (Q,), {"threads": 1}),
        "Strategy.distribution": (law.distribution, (q,), {}),
        "Strategy.rows": (held.rows, (q,), {}),
        "Strategy.H": (law.H, (q,), {}),
        "Strategy.inverse_weight": (law.inverse_weight, (q,), {}),
        "Path.at": (loop.at, ([0.0, 0.1],), {}),
        "Path.part": (loop.part, (0.1, 0.5), {}),
        "Path.starting_at": (loop.starting_at, ([0.1, 0.2],), {}),
        "Path.at_speed": (loop.at_speed, (0.1, 0.2), {}),
        "Path.counts": (loop.counts, (5,), {}),
        "Path.steps": (loop.steps, (5,), {}),
        "Path+": (line.__add__, (line,), {}),
        "Region.sample": (region.sample, (3,), {"seed": 0}),
        "Trajectory.tracking_error": (walk.tracking_error, ("m",), {}),
        "Trajectory.save": (walk.save, ("walk.csv",), {}),
        "InverseKinematics": (k["ik"], (k["pose"],), {}),
        "InverseKinematics.near": (k["ik"].near, (k["pose"], q), {}),
        "InverseKinematics.batch": (k["ik"].batch, (np.array([k["pose"], k["pose"]]),), {"threads": 1}),
        "InverseKinematics.nearest": (k["ik"].nearest, (k["pose"], q), {
            "length": 0.3, "rcond": 0.1, "limits": False, "step": 0.1}),
        "Controller.step": (k["servo"].step, (q, start, np.zeros(3)), {}),
        "LeafFunction": (k["leaf"], (q,), {}),
        "LeafFunction.gradient": (k["leaf"].gradient, (q,), {}),
        "LeafFunction.disagreement": (k["leaf"].disagreement, (q, q + 0.01), {}),
        "LeafFunction.check": (k["leaf"].check, (q,), {}),
        "survey": (
            hk.survey, (["planar-3r"], {"mp": hk.moore_penrose}, {"loop": {"kind": "circle", "size": 0.1}}),
            {"tasks": "position", "cycles": 1, "samples": 5, "workers": 0, "cases": 1, "seed": 0,
             "metrics": {"length": len}},
        ),
    }  # fmt: skip
    return found | path_calls()


def task_frame() -> np.ndarray:
    """A right inverse at one posture: a frame that `null_basis` takes and `right_inverse` does not."""
    return np.asarray(kit()["law"](kit()["q"]))


def _begun(make: Callable[..., hk.motion.control.ControlLaw]) -> Callable[..., Any]:
    """A control law, and one step of it."""

    def run(*arguments: Any, **named: Any) -> Any:
        k = kit()
        return make(*arguments, **named).begin(k["q"])(k["q"], k["pose"], np.zeros(6), 0.01)

    return run


def mutant(seed: int) -> tuple[str, Callable[[], Any]]:
    """(name, call) of a seed."""
    rng = random.Random(seed)
    table = calls()
    name = rng.choice([key for key in table if key not in HEAVY or rng.random() < 0.1])
    function, arguments, named = table[name]
    arguments, named = list(arguments), dict(named)
    places: list[Any] = [*range(len(arguments)), *named]
    for place in rng.sample(places, min(len(places), rng.choice([1, 1, 2]))):
        holder: Any = arguments if isinstance(place, int) else named
        holder[place] = spoilt(rng, holder[place])
    return name, lambda: function(*arguments, **named)


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    """In the folder, so that names of files mean files there."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def attempt(seed: int, folder: Path) -> None:
    """One call with bad arguments."""
    _, call = mutant(seed)
    with _inside(folder), warnings.catch_warnings(), contextlib.suppress(MineError):
        warnings.simplefilter("ignore")
        try:
            call()
        except TypeError as problem:  # of a callable of ours with another number of arguments
            if "positional argument" not in str(problem):
                raise


def uncalled() -> set[str]:
    """Public functions that the table lacks."""
    functions = {n for n in hk.__all__ if inspect.isfunction(getattr(hk, n))}
    return functions - set(calls()) - {"catalogue", "centring_cost", "manipulability_cost"}  # they take nothing
