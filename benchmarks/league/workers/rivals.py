"""The rivals of `hk.ik(robot)`: how each library finds joints of a pose, and how it follows a tool. In its environment:

    python rivals.py COURSE_FOLDER ANSWER_FOLDER LIBRARY

It says on its output which ways it has on an arm, and answers a part of the poses and paths when it is told to.
"""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import libraries
import numpy as np
from libraries import newton_solver, ssik_module
from worker_loop import SAME, Arm, Way, agrees, answer_in_turns, placed

Pose = np.ndarray
Joints = np.ndarray
NEAR = 1e-7
"""A search goes on until its tool [m, rad] is as near."""


SINGLE = 1e-5
"""Forward kinematics in single precision agree to this [m]."""


def middle_of(arm: Arm) -> Joints:
    """The middle of the joint ranges, 0 of an endless joint."""
    endless = np.isinf(arm.upper - arm.lower)
    return sum(np.where(endless, 0.0, side) for side in (arm.lower, arm.upper)) / 2


def with_turns(arm: Arm) -> str:
    """The URDF in which endless joints have two turns: Pinocchio would write each as two numbers."""
    return arm.urdf.replace(".urdf", "-turns.urdf")


def holokin(arm: Arm) -> Iterator[Way]:
    """holokin, in the environment of the benchmark itself."""
    import holokin as hk

    try:
        ik = hk.ik(arm.name)
    except hk.HolokinError as problem:
        raise LookupError(f"`hk.ik(robot)` does not take it yet: {problem}") from problem
    agrees(arm, hk.load(arm.name).pose)

    def found(call: Callable[..., Any], *given: Any) -> Any:
        try:
            return call(*given)
        except hk.HolokinError:
            return None

    def near(pose: Pose, q: Joints) -> Joints | None:
        there = found(ik.near, pose, q)
        return None if there is None else there[0]

    yield Way("`ik(pose)`", "a function of the pose alone", lambda pose: found(ik, pose))
    yield Way("`ik.near(pose, q)`", "from the last answer", follow=lambda q: near)


def ssik(arm: Arm) -> Iterator[Way]:
    """ssik, on what its `ssik build` makes of the URDF; its tracker on an arm that it ships, where that is better."""
    import ssik

    made = ssik_module(arm)
    agrees(arm, made.fk)

    def first(found: list[Any]) -> Joints | None:
        return found[0].q if found else None

    def seeded(pose: Pose, q: Joints) -> Joints | None:
        return first(made.solve(pose, q_seed=q, max_solutions=1))

    def tracked(start: Joints) -> Callable[[Pose, Joints], Joints | None]:
        tracker = robot.tracker(start)

        def step(pose: Pose, q: Joints) -> Joints | None:
            there = tracker.update(base @ pose @ tool)
            return there.q if there.status.name == "OK" else None

        return step

    how = "an arm made by `ssik build`"
    nearest = "all solutions, the nearest to the last answer"
    yield Way(
        "all", f"{how}; {nearest}", lambda pose: first(made.solve(pose)),
        lambda q: lambda pose, q: first(made.solve(pose, q_seed=q)),
    )  # fmt: skip
    yield Way("one", f"{how}; `max_solutions=1`", lambda pose: first(made.solve(pose, max_solutions=1)))
    yield Way("seeded", f"{how}; `max_solutions=1`, seeded with the last answer", follow=lambda q: seeded)
    shipped = {"panda": "franka_panda", "iiwa14": "iiwa14", "xarm7": "xarm7", "gen3": "gen3_ik"}.get(arm.name)
    loose = arm.name in ("xarm7", "gen3")  # of files in which a right angle is 1.5708; its method is faster on these
    if shipped:
        robot = ssik.Manipulator.from_prebuilt(shipped)
    else:
        robot = ssik.Manipulator.from_urdf(arm.urdf, base=arm.base, ee=arm.frame)
    what = "the arm that it ships" if shipped else "an arm of the URDF"
    base, tool = placed(arm, robot.fk, 1e-4 if loose else SAME)
    told = f"{what}{', whose poses are right to 1e-4' if loose else ''}, no limit of speed"
    yield Way("tracker", told, follow=tracked, within=1e-4 if loose else 1e-5)


def roboticstoolbox(arm: Arm) -> Iterator[Way]:
    """roboticstoolbox: its fast `ik_LM`, which draws its starts at random, to a residual of 1e-12."""
    import roboticstoolbox as rtb

    chain = rtb.Robot.URDF(arm.urdf).ets(end=arm.frame)
    agrees(arm, lambda q: np.asarray(chain.eval(q)))

    def solved(pose: Pose, q: Joints | None = None) -> Joints | None:
        there = chain.ik_LM(pose, q0=q, tol=1e-12)
        return there.q if there.success else None

    settings = "`ik_LM` of Chan, up to 100 searches of 30 steps from random starts, tol 1e-12"
    yield Way("`ik_LM`", f"{settings}; the first from the last answer", solved, lambda q: solved)


def tracik(arm: Arm) -> Iterator[Way]:
    """TRAC-IK by pytracik: from a seed, then from random ones until its time is over."""
    from trac_ik import TracIK

    solver = TracIK(arm.base, arm.frame, arm.urdf, timeout=0.02, epsilon=1e-6, solver_type="Speed")
    middle = middle_of(arm)

    def forward(q: Joints) -> Pose:
        pose = np.eye(4)
        pose[:3, 3], pose[:3, :3] = solver.fk(q)
        return pose

    def solved(pose: Pose, q: Joints) -> Joints | None:
        return solver.ik(pose[:3, 3], pose[:3, :3], seed_jnt_values=q)

    agrees(arm, forward)
    settings = "Speed, epsilon 1e-6, 20 ms at most; seeded with the middle of the ranges, or with the last answer"
    yield Way("Speed", settings, lambda pose: solved(pose, middle), lambda q: solved)


def frankik(arm: Arm) -> Iterator[Way]:
    """frankik: the analytical solution of a Franka arm, joint 7 sampled or given."""
    from frankik import FrankaKinematics, ik

    if arm.name not in ("panda", "fr3"):
        raise LookupError("it has the Panda and the FR3 alone")
    robot = FrankaKinematics(robot_type=arm.name)
    hand = np.eye(4)
    hand[:2, :2], hand[2, 3] = np.sqrt(0.5) * np.array([[1, 1], [-1, 1]]), 0.1034  # its own, to the last digit
    base, tool = placed(arm, robot.forward)
    tool = tool @ np.linalg.inv(hand)
    wide, middle, fr3 = {"global_solution": True, "q7_sample_interval": 340}, middle_of(arm), arm.name == "fr3"

    def held(start: Joints) -> Callable[[Pose, Joints], Joints | None]:
        return lambda pose, q: ik(base @ pose @ tool, q, start[6], fr3)

    yield Way(
        "joint 7 sampled", "`inverse(global_solution=True)`, 60 values of joint 7: over its range, or +-20 degrees "
        "from the last answer", lambda pose: robot.inverse(base @ pose @ tool, middle, **wide),
        lambda q: lambda pose, q: robot.inverse(base @ pose @ tool, q, global_solution=True),
    )  # fmt: skip
    yield Way("joint 7 held", "`ik(pose, q, q7)`, the branch of the last answer", follow=held)


def eaik(arm: Arm) -> Iterator[Way]:
    """EAIK: a joint of the seven is held, the six others have a decomposition; the joint's values are gone through."""
    from eaik.IK_HP import HPRobot

    h, steps, turn = arm.check["axes"], arm.check["steps"], arm.check["turn"]
    held = next((k for k in (6, 2, 4, 0) if HPRobot(h, steps, [(k, 0.3)]).hasKnownDecomposition()), None)
    if held is None:
        raise LookupError("it knows no decomposition of it, whatever single joint is held")

    def robot_at(value: float) -> Any:
        return HPRobot(h, steps, [(held, float(value))])

    agrees(arm, lambda q: robot_at(q[held]).fwdKin(q) @ turn)
    middle, low, high, back = middle_of(arm)[held], arm.lower[held], arm.upper[held], np.linalg.inv(turn)
    values = low + (high - low) * (np.arange(32) + 0.5) / 32
    robots = [robot_at(value) for value in values[np.argsort(np.abs(values - middle))]]

    def postures(robot: Any, pose: Pose) -> np.ndarray:
        found = robot.IK(pose @ back)
        q = np.asarray(found.Q, dtype=float).reshape(-1, len(arm.joints))[~np.asarray(found.is_LS, dtype=bool)]
        q = q + 2 * np.pi * np.ceil((arm.lower - 1e-9 - q) / (2 * np.pi))
        return q[(q <= arm.upper + 1e-9).all(axis=1)]

    def swept(pose: Pose) -> Joints | None:
        return next((q[0] for robot in robots if len(q := postures(robot, pose))), None)

    def kept(start: Joints) -> Callable[[Pose, Joints], Joints | None]:
        robot = robot_at(start[held])

        def step(pose: Pose, q: Joints) -> Joints | None:
            there = postures(robot, pose)
            return there[np.abs(there - q).max(axis=1).argmin()] if len(there) else None

        return step

    settings = f"joint {held + 1} held: at 32 values in turn, the first posture within limits"
    yield Way("a joint held", f"{settings}; or at that of the start, the nearest to the last answer", swept, kept)


def newton(arm: Arm) -> Iterator[Way]:
    """newton on the processor: 64 seeds, as in its benchmark, or from the last answer, as in its example of an arm."""
    many, forward = newton_solver(arm, 24, sampler="roberts", n_seeds=64, lambda_factor=4.0)
    one, _ = newton_solver(arm, 24)
    agrees(arm, forward, SINGLE)
    settings = "Levenberg-Marquardt, 24 steps; 64 seeds of a Roberts sequence, or from the last answer alone"
    yield Way("LM", settings, lambda pose: many(pose, middle_of(arm)), lambda q: one)


def pyroki(arm: Arm) -> Iterator[Way]:
    """PyRoki, as in the league: its basic example, and with a cost of the distance to the start along a path."""
    import pyroki as pk
    import yourdfpy
    from jaxlie import SE3

    robot = pk.Robot.from_urdf(yourdfpy.URDF.load(arm.urdf, load_meshes=False))
    link, still = robot.links.names.index(arm.frame), np.zeros(6)
    agrees(arm, lambda q: np.array(SE3(robot.forward_kinematics(q)[link]).as_matrix()), SINGLE)
    basic, resting = (setting.begin for setting in list(libraries.pyroki(arm))[:2])
    find = basic(arm)

    def follow(start: Joints) -> Callable[[Pose, Joints], Joints | None]:
        step = resting(replace(arm, start=start))
        return lambda pose, q: step(q, pose, still, 1.0)

    settings = "its basic example, from its own guess; from the last answer with a posture cost of 0.01 along a path"
    yield Way("least squares", settings, lambda pose: find(still, pose, still, 1.0), follow)


def pink(arm: Arm) -> Iterator[Way]:
    """pink: a frame task and a posture task in a quadratic programme, step after step."""
    import pink
    import pinocchio as pin

    model = pin.buildModelFromUrdf(with_turns(arm))
    data, frame, middle = model.createData(), model.getFrameId(arm.frame), middle_of(arm)

    def forward(q: Joints) -> Pose:
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[frame].homogeneous.copy()

    agrees(arm, forward)

    def steps(start: Joints, rounds: int, stop: bool, lm: float) -> Callable[[Pose, Joints], Joints]:
        tool = pink.FrameTask(arm.frame, position_cost=1.0, orientation_cost=1.0, lm_damping=lm)
        rest = pink.PostureTask(cost=1e-4)
        rest.set_target(start)

        def step(pose: Pose, q: Joints) -> Joints:
            configuration = pink.Configuration(model, data, q)
            tool.set_target(pin.SE3(pose[:3, :3], pose[:3, 3]))
            for _ in range(rounds):
                velocity = pink.solve_ik(configuration, [tool, rest], DT, solver="daqp")
                configuration.integrate_inplace(velocity, DT)
                if stop and np.abs(tool.compute_error(configuration)).max() < NEAR:
                    break
            return configuration.q

        return step

    DT = 0.2
    find = steps(middle, 100, True, 1e-3)
    settings = "frame task and posture task 1e-4, daqp: up to 100 steps from the middle of the ranges, or 8 a sample"
    yield Way("tasks", settings, lambda pose: find(pose, middle), lambda q: steps(q, 8, False, 0.0))


def mink(arm: Arm) -> Iterator[Way]:
    """mink: the same tasks as pink's, on a MuJoCo model."""
    import mink
    import mujoco

    model = mujoco.MjModel.from_xml_path(arm.mjcf)
    configuration, middle, limits = mink.Configuration(model), middle_of(arm), [mink.ConfigurationLimit(model)]

    def forward(q: Joints) -> Pose:
        configuration.update(q)
        return configuration.get_transform_frame_to_world(arm.frame, "site").as_matrix()

    agrees(arm, forward)

    def steps(start: Joints, rounds: int, stop: bool, lm: float) -> Callable[[Pose, Joints], Joints]:
        tool = mink.FrameTask(arm.frame, "site", position_cost=1.0, orientation_cost=1.0, lm_damping=lm)
        rest = mink.PostureTask(model, cost=1e-4)
        rest.set_target(start)

        def step(pose: Pose, q: Joints) -> Joints:
            configuration.update(q)
            tool.set_target(mink.SE3.from_matrix(pose))
            for _ in range(rounds):
                velocity = mink.solve_ik(configuration, [tool, rest], 1.0, "daqp", limits=limits)
                configuration.integrate_inplace(velocity, 1.0)
                if stop and np.abs(tool.compute_error(configuration)).max() < NEAR:
                    break
            return configuration.q.copy()

        return step

    find = steps(middle, 100, True, 1e-3)
    settings = "frame task and posture task 1e-4, daqp: up to 100 steps from the middle of the ranges, or 8 a sample"
    yield Way("tasks", settings, lambda pose: find(pose, middle), lambda q: steps(q, 8, False, 0.0))


def placo(arm: Arm) -> Iterator[Way]:
    """placo: a frame task and a joints task in its kinematics solver."""
    with contextlib.redirect_stdout(io.StringIO()):
        import placo

    robot, middle = placo.RobotWrapper(with_turns(arm), placo.Flags.ignore_collisions), middle_of(arm)

    def put(q: Joints) -> None:
        robot.state.q[7:] = q
        robot.update_kinematics()

    def forward(q: Joints) -> Pose:
        put(q)
        return robot.get_T_world_frame(arm.frame)

    agrees(arm, forward)

    def steps(start: Joints, rounds: int, stop: bool) -> Callable[[Pose, Joints], Joints]:
        put(start)
        solver = placo.KinematicsSolver(robot)
        solver.mask_fbase(True)
        tool = solver.add_frame_task(arm.frame, robot.get_T_world_frame(arm.frame))
        tool.configure("tool", "soft", 1.0, 1.0)
        rest = solver.add_joints_task()
        rest.set_joints(dict(zip(arm.joints, start.tolist(), strict=True)))
        rest.configure("rest", "soft", 1e-8)

        def step(pose: Pose, q: Joints) -> Joints:
            put(q)
            tool.T_world_frame = pose
            for _ in range(rounds):
                solver.solve(True)
                robot.update_kinematics()
                if stop and max(tool.position().error_norm(), tool.orientation().error_norm()) < NEAR:
                    break
            return robot.state.q[7:].copy()

        return step

    find = steps(middle, 100, True)
    settings = "frame task and joints task 1e-8: up to 100 solutions from the middle of the ranges, or 5 a sample"
    yield Way("tasks", settings, lambda pose: find(pose, middle), lambda q: steps(q, 5, False))


LIBRARIES = {
    "holokin": (holokin, ("holokin", "numpy")),
    "ssik": (ssik, ("ssik",)),
    "roboticstoolbox": (roboticstoolbox, ("roboticstoolbox-python",)),
    "TRAC-IK": (tracik, ("pytracik",)),
    "frankik": (frankik, ("frankik",)),
    "EAIK": (eaik, ("EAIK",)),
    "newton": (newton, ("newton", "warp-lang")),
    "PyRoki": (pyroki, ("almond-pyroki", "almond-jaxls", "jax")),
    "pink": (pink, ("pin-pink", "pin", "daqp")),
    "mink": (mink, ("mink", "mujoco", "daqp")),
    "placo": (placo, ("placo", "pin")),
}
"""Name -> (its ways, the packages whose versions the page shows)."""

if __name__ == "__main__":
    answer_in_turns(*LIBRARIES[sys.argv[3]])
