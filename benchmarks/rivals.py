"""Other libraries' control steps, run as their own examples run them. Part of `python -m benchmarks.speed`.

pink and mink update one `Configuration`, set the target of a frame task beside a posture task and call `solve_ik`, with
the limits that they take by default and with none, by the quadratic solvers that they bring; every one is measured.
placo's solver keeps its tasks and sets one target. Pinocchio and roboticstoolbox give a Jacobian for NumPy's pinv.
A step of pink, mink or placo must move the tool as its target says, else it is left out.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from holokin.robot import to_mjcf, to_urdf

Step = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(q, wanted pose (4, 4), wanted twist (6,)) -> dq"""

SOLVERS = ("quadprog", "daqp", "proxqp")
POSTURE = 1e-3
"""Cost of the posture task that their examples put beside the frame task."""


def rivals(robot: hk.Robot, start: np.ndarray, dt: float) -> tuple[list[tuple[str, Step]], list[str]]:
    """(name, step) of all that are installed, and the names of those that are not, or that do not work here."""
    steps: list[tuple[str, Step]] = []
    left_out: list[str] = []
    for name, make in (
        ("pink", _pink), ("mink", _mink), ("placo", _placo), ("roboticstoolbox + pinv", _roboticstoolbox),
        ("Pinocchio + pinv", _pinocchio),
    ):  # fmt: skip
        try:
            with _silence():
                made = list(make(robot, start, dt))
        except ImportError as problem:
            left_out.append(f"{name} ({problem.name or 'a part of it'} is not installed)")
            continue
        for variant, step in made:
            label = f"{name}{variant}"
            if name in ("pink", "mink", "placo") and not _follows(step, robot, start, dt):
                left_out.append(f"{label} (its step does not reach the target)")
            else:
                steps.append((label, step))
    return steps, left_out


def _follows(step: Step, robot: hk.Robot, start: np.ndarray, dt: float) -> bool:
    """True when the step goes to a pose 0.1 mm away within a twentieth."""
    pose = robot.pose(start)
    pose[0, 3] += 1e-4
    moved = robot.jacobian(start) @ np.asarray(step(start, pose, np.zeros(6))) * dt
    return bool(np.abs(moved - [1e-4, 0, 0, 0, 0, 0]).max() < 5e-6)


def _pink(robot: hk.Robot, start: np.ndarray, dt: float) -> Iterator[tuple[str, Step]]:
    pin, pink, qpsolvers = map(importlib.import_module, ("pinocchio", "pink", "qpsolvers"))
    model = pin.buildModelFromXML(to_urdf(robot))
    for solver in [name for name in SOLVERS if name in qpsolvers.available_solvers]:
        for limits, label in ((None, "its limits"), ([], "no limits")):
            configuration = pink.Configuration(model, model.createData(), start.copy())
            tool = pink.tasks.FrameTask(robot.tips[0].name, position_cost=1.0, orientation_cost=1.0)
            rest = pink.tasks.PostureTask(cost=POSTURE)
            rest.set_target(start.copy())

            def step(
                q: np.ndarray, pose: np.ndarray, _twist: np.ndarray,
                configuration: Any = configuration, tool: Any = tool, rest: Any = rest, solver: str = solver,
                limits: Any = limits,
            ) -> np.ndarray:  # fmt: skip
                configuration.update(q)
                tool.set_target(pin.SE3(pose[:3, :3], pose[:3, 3]))
                return pink.solve_ik(configuration, [tool, rest], dt, solver=solver, limits=limits)

            yield f", {label}, {solver}", step


def _mink(robot: hk.Robot, start: np.ndarray, dt: float) -> Iterator[tuple[str, Step]]:
    mink, mujoco, qpsolvers = map(importlib.import_module, ("mink", "mujoco", "qpsolvers"))
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    for solver in [name for name in SOLVERS if name in qpsolvers.available_solvers]:
        for limits, label in ((None, "its limits"), ([], "no limits")):
            configuration = mink.Configuration(model)
            tool = mink.FrameTask(robot.tips[0].name, "site", position_cost=1.0, orientation_cost=1.0)
            rest = mink.PostureTask(model, cost=POSTURE)
            rest.set_target(start.copy())

            def step(
                q: np.ndarray, pose: np.ndarray, _twist: np.ndarray,
                configuration: Any = configuration, tool: Any = tool, rest: Any = rest, solver: str = solver,
                limits: Any = limits,
            ) -> np.ndarray:  # fmt: skip
                configuration.update(q)
                tool.set_target(mink.SE3.from_matrix(pose))
                return mink.solve_ik(configuration, [tool, rest], dt, solver=solver, limits=limits)

            yield f", {label}, {solver}", step


def _placo(robot: hk.Robot, start: np.ndarray, dt: float) -> Iterator[tuple[str, Step]]:
    placo = importlib.import_module("placo")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(to_urdf(robot), "utf-8")
        wrapper = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
    for limited, label in ((True, "its limits"), (False, "no limits")):
        solver = placo.KinematicsSolver(wrapper)
        solver.mask_fbase(True)
        solver.dt = dt
        solver.enable_joint_limits(limited)
        solver.enable_velocity_limits(limited)
        tool = solver.add_frame_task(robot.tips[0].name, np.eye(4))
        tool.configure("tool", "soft", 1.0, 1.0)
        rest = solver.add_joints_task()
        rest.set_joints(dict(zip(robot.joint_names, start.tolist(), strict=True)))
        rest.configure("posture", "soft", POSTURE**2)

        def step(
            q: np.ndarray, pose: np.ndarray, _twist: np.ndarray, solver: Any = solver, tool: Any = tool
        ) -> np.ndarray:
            wrapper.state.q[7:] = q  # behind the pose of its free base
            wrapper.update_kinematics()
            tool.T_world_frame = pose
            return solver.solve(False)[6:] / dt

        yield f", {label}", step


def _pinocchio(robot: hk.Robot, _start: np.ndarray, _dt: float) -> Iterator[tuple[str, Step]]:
    pin = importlib.import_module("pinocchio")
    model = pin.buildModelFromXML(to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)

    def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        here = data.oMf[frame]
        e = np.concatenate([pose[:3, 3] - here.translation, pin.log3(pose[:3, :3] @ here.rotation.T)])
        return np.linalg.pinv(J) @ (twist + 100.0 * e)

    yield "", step


def _roboticstoolbox(_robot: hk.Robot, _start: np.ndarray, _dt: float) -> Iterator[tuple[str, Step]]:
    """Its own Panda, whose hand is elsewhere: for the time alone."""
    rtb = importlib.import_module("roboticstoolbox")
    arm = rtb.models.Panda()

    def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
        e, _ = rtb.angle_axis(arm.fkine(q).A, pose), None
        return np.linalg.pinv(arm.jacob0(q)) @ (twist + 100.0 * e)

    yield "", step


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Some print when they are imported."""
    with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):
        yield
