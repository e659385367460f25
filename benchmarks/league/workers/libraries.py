"""The libraries of the league: how each is asked, as its own examples do and at other settings. Run in its environment:

    python libraries.py COURSE_FOLDER ANSWER_FOLDER LIBRARY

A library is imported by its own function, for the others are not there.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np
from worker_loop import Arm, Setting, Step, placed, serve


def with_options(run: Callable[..., Step]) -> Callable[..., Callable[[Arm], Step]]:
    """Options -> what begins a run of an arm with them, from run(arm, options)."""

    @wraps(run)
    def options(*given: Any, **named: Any) -> Callable[[Arm], Step]:
        return lambda arm: run(arm, *given, **named)

    return options


def holokin(arm: Arm) -> Iterator[Setting]:
    """holokin, in the environment of the league itself: control steps, and a pose in and joints out."""
    import holokin as hk

    @with_options
    def stepped(arm: Arm, make):
        """A run of `hk.controller`, as a control loop calls it."""
        task = hk.pose(hk.from_urdf(Path(arm.urdf), tip=arm.frame))
        loop: list[hk.Controller] = []

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            if not loop:
                loop.append(hk.controller(make(task, arm), dt=h, q0=arm.start))
            return q + h * loop[0].step(q, pose, twist)

        return step

    @with_options
    def solved(arm: Arm, make):
        """A run of `hk.ik`: the joints are asked for at each pose, from the last answer."""
        ik = hk.ik(make(hk.pose(hk.from_urdf(Path(arm.urdf), tip=arm.frame)), arm), arm.start, limits=False)
        return lambda q, pose, twist, h: ik.near(pose, q)

    def tied(task: hk.Task, arm: Arm) -> hk.Strategy:
        """q1 - q3 stays constant."""
        return hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))

    def locked(task: hk.Task, arm: Arm) -> hk.Strategy:
        """Joint 3 stays where it is."""
        return hk.holonomic(task, hk.lock(2))

    def radial(task: hk.Task, arm: Arm) -> hk.Strategy:
        """The holonomic strategy near the pseudo-inverse."""
        return hk.radial(hk.moore_penrose(task), arm.start)

    def resting(task: hk.Task, arm: Arm) -> hk.Strategy:
        """The posture of least distance from the start: what a posture task strives for."""
        return hk.holonomic(task, hk.stationary(hk.strategies.constraints.posture_cost(arm.start)))

    yield Setting("q1 - q3, control step", stepped(tied), example=True, source="docs/loops.md")
    yield Setting("pseudo-inverse, control step", stepped(lambda task, arm: hk.moore_penrose(task)))
    yield Setting("joint 3 locked, control step", stepped(locked))
    yield Setting("radial, control step", stepped(radial))
    yield Setting("stationary posture, control step", stepped(resting))
    yield Setting("stationary posture, pose to joints", solved(resting))
    yield Setting("q1 - q3, pose to joints", solved(tied))
    yield Setting("radial, pose to joints", solved(radial))


def pink(arm: Arm) -> Iterator[Setting]:
    """pink: a frame task, a posture task and a quadratic programme each step."""
    import pink
    import pinocchio as pin
    from pink.tasks import DampingTask, FrameTask, PostureTask

    @with_options
    def begin(arm: Arm, cost: float, gain: float = 1.0, lm: float = 0.0, damping: float = 0.0, rounds: int = 1) -> Step:
        """A run with a posture task of this cost, `damping` that of a damping task, `rounds` steps of it a sample."""
        model = pin.buildModelFromUrdf(arm.urdf)
        configuration = pink.Configuration(model, model.createData(), arm.start.copy())
        tool = FrameTask(arm.frame, position_cost=1.0, orientation_cost=1.0, lm_damping=lm)
        tasks = [tool]
        if cost:
            tasks.append(PostureTask(cost=cost, gain=gain))
            tasks[-1].set_target_from_configuration(configuration)
        if damping:
            tasks.append(DampingTask(cost=damping))

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            tool.set_target(pin.SE3(pose[:3, :3], pose[:3, 3]))
            for _ in range(rounds):
                velocity = pink.solve_ik(configuration, tasks, h, solver="daqp")
                configuration.integrate_inplace(velocity, h)
            return configuration.q

        return step

    example = "examples/arm_panda.py of 4.3"
    yield Setting("posture 1e-3, damping 1e-3, LM 1", begin(1e-3, lm=1.0, damping=1e-3), True, example)
    yield Setting("no posture task", begin(0.0))
    for cost, gain in ((1e-4, 1.0), (1e-3, 0.1), (1e-3, 1.0), (1e-2, 1.0)):
        yield Setting(f"posture {cost:g}, gain {gain:g}", begin(cost, gain))
    for rounds in (2, 5, 8):
        yield Setting(f"posture 0.001, {rounds} steps a sample", begin(1e-3, rounds=rounds))


def mink(arm: Arm) -> Iterator[Setting]:
    """mink: the same tasks as pink's, on a MuJoCo model."""
    import mink
    import mujoco

    THRESHOLD = 1e-4
    """Its examples stop their steps where position [m] and orientation [rad] are nearer."""

    @with_options
    def begin(
        arm: Arm,
        cost: float,
        gain: float = 1.0,
        lm: float = 0.0,
        damping: float = 1e-12,
        rounds: int = 1,
        stop: float = 0.0,
    ) -> Step:
        """A run with a posture task of this cost, and up to `rounds` steps of it a sample, until the tool is near."""
        model = mujoco.MjModel.from_xml_path(arm.mjcf)
        configuration = mink.Configuration(model, q=arm.start.copy())
        tool = mink.FrameTask(arm.frame, "site", position_cost=1.0, orientation_cost=1.0, lm_damping=lm)
        tasks = [tool]
        if cost:
            tasks.append(mink.PostureTask(model, cost=cost, gain=gain))
            tasks[-1].set_target_from_configuration(configuration)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            tool.set_target(mink.SE3.from_matrix(pose))
            for _ in range(rounds):
                velocity = mink.solve_ik(configuration, tasks, h, "daqp", damping=damping)
                configuration.integrate_inplace(velocity, h)
                errors = np.split(tool.compute_error(configuration), 2)
                if stop and max(np.linalg.norm(part) for part in errors) <= stop:
                    break
            return configuration.q

        return step

    example = "examples/arm_iiwa.py at cf1a302"
    as_shown = begin(1e-2, lm=1.0, damping=1e-3, rounds=20, stop=THRESHOLD)
    yield Setting("posture 1e-2, LM 1, up to 20 steps", as_shown, True, example)
    yield Setting("no posture task", begin(0.0))
    for cost, gain in ((1e-4, 1.0), (1e-3, 0.1), (1e-3, 1.0), (1e-2, 1.0)):
        yield Setting(f"posture {cost:g}, gain {gain:g}", begin(cost, gain))
    for rounds in (2, 5, 8):
        yield Setting(f"posture 0.001, {rounds} steps a sample", begin(1e-3, rounds=rounds))


def mink_warp(arm: Arm) -> Iterator[Setting]:
    """mink-warp on the processor: mink's tasks, solved by Warp, one world."""
    import mink_warp
    import mujoco
    import warp

    warp.config.quiet = True

    def quaternion_and_place(pose: np.ndarray) -> np.ndarray:
        """A pose as (7,): w x y z of the rotation, then the position."""
        found = np.empty(4)
        mujoco.mju_mat2Quat(found, pose[:3, :3].flatten())
        return np.concatenate([found, pose[:3, 3]])

    @with_options
    def begin(arm: Arm, cost: float, gain: float, lm: float, damping: float, limits: bool, rounds: int = 1) -> Step:
        """A run with a posture task of this cost, this gain of the tool, and `rounds` steps a sample."""
        model = mujoco.MjModel.from_xml_path(arm.mjcf)
        configuration = mink_warp.Configuration(model, nworld=1, device="cpu")
        configuration.update(q=arm.start[None].astype(np.float32))
        tool = mink_warp.FrameTask(arm.frame, "site", position_cost=1.0, orientation_cost=1.0, gain=gain, lm_damping=lm)
        rest = mink_warp.PostureTask(model, cost=cost)
        tasks = [tool, rest, mink_warp.JointLimitTask(model, cost=1.0)] if limits else [tool, rest]
        tool.set_target_from_configuration(configuration)
        rest.set_target_from_configuration(configuration)
        solver = mink_warp.IKSolver(configuration)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            wanted = quaternion_and_place(pose)[None].astype(np.float32)
            tool.set_target(wanted, configuration=configuration)
            solver.solve_and_integrate(tasks, h, damping=damping, iterations=rounds)
            return configuration.q.numpy()[0].astype(float)

        return step

    example = "examples/01_panda_ik.py of 0.1"
    yield Setting("posture 1e-2, gain 0.8, LM 1", begin(1e-2, 0.8, 1.0, 1e-3, True), True, example)
    for cost in (1e-2, 3e-2):
        yield Setting(f"posture {cost:g}, gain 1", begin(cost, 1.0, 0.0, 1e-9, False))
    yield Setting("posture 0.01, gain 1, 3 steps a sample", begin(1e-2, 1.0, 0.0, 1e-9, False, 3))


def placo(arm: Arm) -> Iterator[Setting]:
    """placo: a frame task and a joints task in its kinematics solver."""
    with contextlib.redirect_stdout(io.StringIO()):
        import placo

    @with_options
    def begin(arm: Arm, weight: float, rounds: int = 1) -> Step:
        """A run with a joints task of this weight, and `rounds` solutions a sample."""
        robot = placo.RobotWrapper(arm.urdf, placo.Flags.ignore_collisions)
        robot.state.q[7:] = arm.start
        robot.update_kinematics()
        solver = placo.KinematicsSolver(robot)
        solver.mask_fbase(True)
        solver.enable_velocity_limits(True)
        tool = solver.add_frame_task(arm.frame, robot.get_T_world_frame(arm.frame))
        tool.configure("tool", "soft", 1.0, 1.0)
        if weight:
            rest = solver.add_joints_task()
            rest.set_joints(dict(zip(arm.joints, arm.start.tolist(), strict=True)))
            rest.configure("rest", "soft", weight)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            solver.dt = h
            tool.T_world_frame = pose
            for _ in range(rounds):
                solver.solve(True)
                robot.update_kinematics()
            return robot.state.q[7:]

        return step

    example = "kinematics/6axis_targets.py of placo-examples, December 2025"
    yield Setting("no posture", begin(0.0), True, example)
    for weight in (1e-8, 1e-7, 1e-6, 1e-5, 1e-4):
        shown = "kinematics/6axis_regularization.py --posture" if weight == 1e-6 else ""
        yield Setting(f"joints task {weight:g}", begin(weight), source=shown)
    for rounds in (2, 5):
        yield Setting(f"joints task 1e-06, {rounds} solutions a sample", begin(1e-6, rounds))


def oink(arm: Arm) -> Iterator[Setting]:
    """roboplan's OInK: a frame task, a configuration task and limits in a quadratic programme each step."""
    from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescription
    from roboplan.optimal_ik import (
        ConfigurationTask,
        ConfigurationTaskOptions,
        FrameTask,
        FrameTaskOptions,
        Oink,
        OinkSettings,
        PositionLimit,
        VelocityLimit,
    )

    @with_options
    def begin(
        arm: Arm,
        weight: float,
        gain: float = 1.0,
        orientation: float = 1.0,
        lm: float = 0.0,
        regularization: float = 1e-12,
        rounds: int = 1,
        tolerance: float | None = None,
    ) -> Step:
        """A run with a configuration task of this weight and gain, `rounds` solutions a sample, to a tolerance."""
        scene = Scene("league", loadUrdfSceneDescription(arm.urdf))
        solver = OinkSettings()
        if tolerance:
            solver.eps_abs = tolerance
        oink = Oink(scene, solver)
        scene.setJointPositions(arm.start)
        limits = [PositionLimit(oink, gain=1.0), VelocityLimit(oink, float(arm.runs["circle"]["h"][0]), arm.speed)]
        goal = CartesianConfiguration(
            arm.base, arm.frame, np.asfortranarray(scene.forwardKinematics(arm.start, arm.frame))
        )
        options = FrameTaskOptions(position_cost=1.0, orientation_cost=orientation, task_gain=1.0, lm_damping=lm)
        tool = FrameTask(oink, scene, goal, options)
        tasks = [tool]
        if weight:
            options = ConfigurationTaskOptions(task_gain=gain, lm_damping=0.0)
            tasks.append(ConfigurationTask(oink, arm.start, np.full(len(arm.joints), weight), options))
        moved = np.zeros(len(arm.joints))

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            tool.setTargetFrameTransform(np.asfortranarray(pose))
            for _ in range(rounds):
                scene.setJointPositions(q)
                scene.forwardKinematics(q, arm.frame)
                oink.solveIk(scene, tasks, limits, moved, regularization)
                q = scene.integrate(q, moved)
            return q

        return step

    example = "roboplan_examples/python/example_oink.py at 0ae8e64, without its filter of the marker"
    as_shown = begin(0.05, 0.1, orientation=0.1, lm=0.01, regularization=1e-6)
    yield Setting("configuration 0.05, gain 0.1", as_shown, True, example)
    yield Setting("no configuration task", begin(0.0))
    for weight, gain in ((1e-5, 1.0), (1e-4, 0.1), (1e-4, 1.0)):
        yield Setting(f"configuration {weight:g}, gain {gain:g}", begin(weight, gain))
    for rounds in (1, 5, 8):
        name = f"configuration 1e-05, tolerance 1e-12, {rounds} a sample"
        yield Setting(name, begin(1e-5, rounds=rounds, tolerance=1e-12))


def embodik(arm: Arm) -> Iterator[Setting]:
    """embodik: a frame task above a posture task, in its stepping solver."""
    import embodik

    ANSWERS = ("SUCCESS", "INFEASIBLE", "NUMERICAL_ERROR", "NO_PROGRESS")
    """Its example goes on with these."""

    @with_options
    def begin(arm: Arm, weight: float, gain: float, rounds: int = 1, as_shown: bool = False) -> Step:
        """A run with a posture task of this weight, this gain of the tool, and `rounds` steps of it a sample."""
        robot = embodik.RobotModel(arm.urdf, floating_base=False)
        solver = embodik.KinematicsSolver(robot)
        solver.dt = float(arm.runs["circle"]["h"][0])
        policy = solver.runtime_config()
        policy.enable_auto_task_layout = policy.weighted_fallback_enabled = True
        solver.configure_runtime(policy)
        tool = solver.add_frame_task("ee_task", arm.frame)
        tool.priority, tool.weight = 0, 1.0
        tool.solve_mode = embodik.TaskSolveMode.SCALE_ELASTIC
        tool.allow_min_error_fallback = False
        rest = solver.add_posture_task("posture_bias")
        rest.priority, rest.weight = 1, weight
        rest.solve_mode = embodik.TaskSolveMode.MIN_ERROR
        rest.allow_min_error_fallback = False
        rest.set_target_configuration(arm.start)
        robot.update_configuration(arm.start)
        options = embodik.PositionStepOptions()
        options.position_gain = options.orientation_gain = gain
        options.max_steps = rounds
        if as_shown:
            options.adaptive_dt, options.adaptive_dt_max_scale = True, 10.0
            options.adaptive_dt_reference_distance = 0.02

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            solver.dt = h
            found = solver.solve_position_step(q, np.asfortranarray(pose), "ee_task", options)
            if found.status.name not in ANSWERS:
                return None
            q = np.asarray(found.q_solution, dtype=float)
            robot.update_configuration(q)
            return q

        return step

    example = "examples/01_basic_ik_simple.py of the wheel"
    yield Setting("posture 1e-2, gain 10", begin(1e-2, 10.0, as_shown=True), True, example)
    whole = 1.0 / float(arm.runs["circle"]["h"][0])
    for weight in (0.0, 1e-2, 1.0, 10.0, 100.0):
        yield Setting(f"posture {weight:g}, gain 1/dt", begin(weight, whole))
    for rounds in (2, 5):
        yield Setting(f"posture 100, gain 1/dt, {rounds} steps a sample", begin(100.0, whole, rounds))


def drake(arm: Arm) -> Iterator[Setting]:
    """Drake: differential inverse kinematics by a quadratic programme with joint centring."""
    from pydrake.math import RigidTransform
    from pydrake.multibody.inverse_kinematics import (
        DifferentialInverseKinematicsParameters,
        DifferentialInverseKinematicsStatus,
        DoDifferentialInverseKinematics,
    )
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    @with_options
    def begin(arm: Arm, centring: float, rounds: int = 1) -> Step:
        """A run with this gain of joint centring [1/s], at the start as the nominal posture."""
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(arm.urdf)
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.base))
        plant.Finalize()
        context, n = plant.CreateDefaultContext(), len(arm.joints)
        parameters = DifferentialInverseKinematicsParameters(n, n)
        parameters.set_nominal_joint_position(arm.start)
        parameters.set_joint_velocity_limits((-arm.speed, arm.speed))
        parameters.set_joint_position_limits((arm.lower, arm.upper))
        if centring:
            parameters.set_joint_centering_gain(centring * np.eye(n))
        tool = plant.GetFrameByName(arm.frame)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            parameters.set_time_step(h)
            wanted = RigidTransform(pose)
            for _ in range(rounds):
                plant.SetPositions(context, q)
                found = DoDifferentialInverseKinematics(plant, context, wanted, tool, parameters)
                if found.status == DifferentialInverseKinematicsStatus.kNoSolutionFound:
                    return None
                q = q + h * found.joint_velocities
            return q

        return step

    example = "examples/manipulation_station/end_effector_teleop_sliders.py"
    yield Setting("no centring", begin(0.0), True, example)
    whole = 1.0 / float(arm.runs["circle"]["h"][0])
    for centring in (1.0, 10.0, whole):
        yield Setting(f"centring {centring:.3g}/s", begin(centring))
    for rounds in (3, 8):
        yield Setting(f"centring 1/dt, {rounds} steps a sample", begin(whole, rounds))


def pyroboplan(arm: Arm) -> Iterator[Setting]:
    """pyroboplan: damped steps with components in the null space, iterated to a pose."""
    import pinocchio as pin
    from pyroboplan.ik.differential_ik import DifferentialIk, DifferentialIkOptions
    from pyroboplan.ik.nullspace_components import joint_limit_nullspace_component

    @with_options
    def begin(arm: Arm, options: dict[str, Any], posture: float = 0.0, one_seed: bool = False) -> Step:
        """A run with these options, and a pull to the start, or from joint limits, in the null space."""
        model = pin.buildModelFromUrdf(arm.urdf)
        solver = DifferentialIk(model, options=DifferentialIkOptions(**options))

        def pull(model: pin.Model, q: np.ndarray) -> np.ndarray:
            return posture * (arm.start - q)

        def from_limits(model: pin.Model, q: np.ndarray) -> np.ndarray:
            return joint_limit_nullspace_component(model, q, gain=0.1, padding=0.025)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            wanted, seed = pin.SE3(pose[:3, :3], pose[:3, 3]), arm.start if one_seed else q
            components = [pull if posture else from_limits]
            return solver.solve(arm.frame, wanted, init_state=seed.copy(), nullspace_components=components)

        return step

    example = "examples/differential_ik.py at 4c35cb7, without its obstacles, from the last answer"
    shown = {"damping": 1e-4, "min_step_size": 0.025, "max_step_size": 0.1, "rng_seed": None}
    full = {"damping": 1e-9, "min_step_size": 1.0, "max_step_size": 1.0, "rng_seed": 0}
    near = full | {"max_translation_error": 1e-8, "max_rotation_error": 1e-8}
    yield Setting("from joint limits, steps of 0.1", begin(shown), True, example)
    yield Setting("from joint limits, full steps to 1e-8", begin(near))
    yield Setting("pull of 1 to the start, full steps to 1e-8", begin(near, 1.0))
    yield Setting("full steps to 1e-8, one seed", begin(near, one_seed=True))


def pyroki(arm: Arm) -> Iterator[Setting]:
    """PyRoki, as Almond publishes it: least squares over the joints, in JAX on the processor."""
    import jax.numpy as jnp
    import jax_dataclasses as jdc
    import jaxlie
    import jaxls
    import pyroki as pk
    import yourdfpy

    @jdc.jit
    def basic(robot: Any, link: Any, wxyz: Any, position: Any) -> Any:
        """The problem of its basic example: the pose and the joint limits, from its own first guess."""
        joints = robot.joint_var_cls(0)
        wanted = jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(wxyz), position)
        costs = [
            pk.costs.pose_cost_analytic_jac(robot, joints, wanted, link, pos_weight=50.0, ori_weight=10.0),
            pk.costs.limit_cost(robot, joints, weight=100.0),
        ]
        problem = jaxls.LeastSquaresProblem(costs, [joints]).analyze()
        solved = problem.solve(
            verbose=False, linear_solver="dense_cholesky", trust_region=jaxls.TrustRegionConfig(lambda_initial=1.0)
        )
        return solved[joints]

    @jdc.jit
    def resting(robot: Any, link: Any, wxyz: Any, position: Any, rest: Any, guess: Any, weight: Any) -> Any:
        """The same with a cost of the distance to a posture, from a guess."""
        joints = robot.joint_var_cls(0)
        wanted = jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(wxyz), position)
        costs = [
            pk.costs.pose_cost_analytic_jac(robot, joints, wanted, link, pos_weight=50.0, ori_weight=10.0),
            pk.costs.limit_cost(robot, joints, weight=100.0),
            pk.costs.rest_cost(joints, rest, weight),
        ]
        problem = jaxls.LeastSquaresProblem(costs, [joints]).analyze()
        end = jaxls.TerminationConfig(cost_tolerance=1e-9, gradient_tolerance=1e-7, parameter_tolerance=1e-8)
        solved = problem.solve(
            initial_vals=jaxls.VarValues.make([joints.with_value(guess)]),
            verbose=False,
            linear_solver="dense_cholesky",
            trust_region=jaxls.TrustRegionConfig(lambda_initial=1e-6),
            termination=end,
        )
        return solved[joints]

    @with_options
    def begin(arm: Arm, robot: pk.Robot, weight: float | None = None, one_seed: bool = False) -> Step:
        """A run of its basic example, or with a posture of this weight from the last answer or from the start."""
        link = jnp.array(robot.links.names.index(arm.frame), jnp.int32)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            turned = jnp.array(jaxlie.SO3.from_matrix(pose[:3, :3]).wxyz)
            if weight is None:
                return np.array(basic(robot, link, turned, jnp.array(pose[:3, 3])))
            guess = arm.start if one_seed else q
            more = jnp.array(arm.start), jnp.array(guess), jnp.array(weight)
            return np.array(resting(robot, link, turned, jnp.array(pose[:3, 3]), *more))

        return step

    example = "examples/01_basic_ik.py of pyroki, June 2025"
    robot = pk.Robot.from_urdf(yourdfpy.URDF.load(arm.urdf, load_meshes=False))  # one: what is compiled is kept for it
    yield Setting("pose and limits, its own guess", begin(robot), True, example)
    yield Setting("posture 0.01, last answer", begin(robot, 1e-2))
    yield Setting("posture 0.1, last answer", begin(robot, 1e-1))
    yield Setting("posture 0.01, one seed", begin(robot, 1e-2, one_seed=True))


def newton_solver(
    arm: Arm, iterations: int, **options: Any
) -> tuple[Callable[[np.ndarray, np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]:
    """(solve(pose, q) -> joints, forward kinematics) of newton on the processor, as its example of a Franka arm."""
    import newton
    import warp as wp
    from newton import ik

    wp.config.quiet = True
    wp.set_device("cpu")
    builder = newton.ModelBuilder()
    builder.add_urdf(arm.urdf, floating=False)
    model = builder.finalize()
    link = next(k for k, name in enumerate(model.body_label) if name.rsplit("/")[-1] == arm.frame)
    state = model.state()
    place = ik.IKObjectivePosition(link, wp.vec3(), wp.zeros(1, dtype=wp.vec3))
    turn = ik.IKObjectiveRotation(link, wp.quat_identity(), wp.array([wp.vec4(0, 0, 0, 1)], dtype=wp.vec4))
    limits = ik.IKObjectiveJointLimit(model.joint_limit_lower, model.joint_limit_upper, weight=10.0)
    solver = ik.IKSolver(model, 1, [place, turn, limits], jacobian_mode=ik.IKJacobianType.ANALYTIC, **options)
    joints = wp.zeros((1, len(arm.joints)), dtype=wp.float32)
    solver.step(joints, joints, iterations=iterations)
    with wp.ScopedCapture() as capture:
        solver.step(joints, joints, iterations=iterations)

    def solve(pose: np.ndarray, q: np.ndarray) -> np.ndarray:
        place.set_target_position(0, wp.vec3(*pose[:3, 3]))
        turn.set_target_rotation(0, wp.vec4(*wp.quat_from_matrix(wp.mat33(pose[:3, :3].astype(np.float32)))))
        joints.assign(q[None].astype(np.float32))
        wp.capture_launch(capture.graph)
        return joints.numpy()[0].astype(float)

    def forward(q: np.ndarray) -> np.ndarray:
        newton.eval_fk(model, wp.array(q, dtype=wp.float32), model.joint_qd, state)
        x, y, z, *quaternion = map(float, state.body_q.numpy()[link])
        pose = np.eye(4)
        pose[:3, :3] = np.array(wp.quat_to_matrix(wp.quat(*quaternion))).reshape(3, 3)
        pose[:3, 3] = x, y, z
        return pose

    return solve, forward


def newton(arm: Arm) -> Iterator[Setting]:
    """newton on the processor: its inverse kinematics of position, rotation and joint limits, in a loop."""

    @with_options
    def begin(arm: Arm, one_seed: bool = False) -> Step:
        """A run from the last answer, or from the start each time."""
        solve, _ = newton_solver(arm, 24)
        return lambda q, pose, twist, h: solve(pose, arm.start if one_seed else q)

    example = "newton/examples/ik/example_ik_franka.py of 1.8"
    yield Setting("24 steps, last answer", begin(), True, example)
    yield Setting("24 steps, one seed", begin(one_seed=True))


def ssik_module(arm: Arm) -> Any:
    """The module that `ssik build` makes of the URDF: solutions in native code for an arm that ssik does not ship."""
    folder = Path(arm.urdf).parent
    file = folder / f"{arm.name.replace('-', '_')}_of_ssik.py"
    command = [str(Path(sys.executable).parent / "ssik"), "build", arm.urdf, "--base", arm.base, "--ee", arm.frame]
    command += ["--out", str(file), "--module-name", file.stem, "--no-validate"]
    subprocess.run(command, check=True, capture_output=True)
    sys.path.insert(0, str(folder))
    return importlib.import_module(file.stem)


def ssik(arm: Arm) -> Iterator[Setting]:
    """ssik: analytical solutions; its tracker on an arm that it ships, if it is ours, and its seeded solution."""
    import ssik

    NAMES = {"panda": "franka_panda", "iiwa14": "iiwa14"}

    def tracked(arm: Arm) -> Step:
        """A run by its tracker."""
        if arm.name in NAMES:
            robot = ssik.Manipulator.from_prebuilt(NAMES[arm.name])
        else:
            robot = ssik.Manipulator.from_urdf(arm.urdf, base=arm.base, ee=arm.frame)
        base, tool = placed(arm, robot.fk)
        tracker = robot.tracker(arm.start)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            found = tracker.update(base @ pose @ tool)
            return found.q if found.status.name == "OK" else None

        return step

    made = ssik_module(arm)

    @with_options
    def nearest(arm: Arm, one_seed: bool) -> Step:
        """A run by the solution nearest to a seed: the last answer, or the start each time."""

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            found = made.solve(pose, q_seed=arm.start if one_seed else q, max_solutions=1)
            return found[0].q if found else None

        return step

    example = "README.md of 8.2, Streaming IK, without a limit of speed"
    yield Setting("its tracker", lambda arm: tracked(arm), True, example)
    yield Setting(
        "one solution, last answer", nearest(False), source="README.md of 8.2, the IK closest to where the robot is"
    )
    yield Setting("one solution, one seed", nearest(True))


def frankik(arm: Arm) -> Iterator[Setting]:
    """frankik: the analytical solution of a Franka arm, joint 7 sampled or given."""
    from frankik import FrankaKinematics, RobotType

    HAND = np.eye(4)
    HAND[:2, :2], HAND[2, 3] = np.sqrt(0.5) * np.array([[1, 1], [-1, 1]]), 0.1034
    """Its `FrankaHandTCPOffset`, to the last digit: its own has 0.707 for the square root of 1/2."""

    @with_options
    def begin(arm: Arm, hold: bool = False, one_seed: bool = False) -> Step:
        """A run by `inverse`: joint 7 sampled near the seed, or held as it was at the start."""
        robot = FrankaKinematics(robot_type=RobotType.PANDA)
        base, tool = placed(arm, robot.forward)
        held = {"q7": float(arm.start[6])} if hold else {}

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            seed = arm.start if one_seed else q
            return robot.inverse(base @ pose @ tool, q0=seed, tcp_offset=HAND, **held)

        return step

    example = "README.md of 1.0, from the last answer"
    if arm.name != "panda":
        return
    yield Setting("joint 7 sampled, last answer", begin(), True, example)
    yield Setting("joint 7 sampled, one seed", begin(one_seed=True))
    yield Setting("joint 7 held", begin(hold=True))


def tracik(arm: Arm) -> Iterator[Setting]:
    """TRAC-IK by pytracik: a pose and a seed in, joints out; asked in a loop."""
    from trac_ik import TracIK

    @with_options
    def begin(arm: Arm, aim: str, epsilon: float = 1e-5, one_seed: bool = False, timeout: float = 0.005) -> Step:
        """A run that asks from the last answer, or from the start each time."""
        solver = TracIK(arm.base, arm.frame, arm.urdf, timeout=timeout, epsilon=epsilon, solver_type=aim)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            return solver.ik(pose[:3, 3], pose[:3, :3], seed_jnt_values=arm.start if one_seed else q)

        return step

    example = (
        "README.md of 0.0.3, from the last answer; its 5 ms are of the clock, also where others have the processor"
    )
    yield Setting("Speed, last answer, 5 ms at most", begin("Speed"), True, example)
    yield Setting("Speed, one seed, 5 ms at most", begin("Speed", one_seed=True))
    yield Setting("Speed, one seed, 50 ms at most", begin("Speed", one_seed=True, timeout=0.05))


def roboticstoolbox(arm: Arm) -> Iterator[Setting]:
    """roboticstoolbox: resolved-rate motion by its servo and Jacobian, and its inverse kinematics, in a loop."""
    import roboticstoolbox as rtb

    def robot_of(arm: Arm) -> rtb.ETS:
        """The chain of the URDF."""
        return rtb.Robot.URDF(arm.urdf).ets(end=arm.frame)

    @with_options
    def servo(arm: Arm, gain: float, centred: float = 0.0) -> Step:
        """A run by `p_servo` and pinv, with a pull to the start in the null space."""
        chain = robot_of(arm)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            v, _ = rtb.p_servo(chain.fkine(q), pose, gain=gain, threshold=0.0)
            J = chain.jacobe(q)
            inverse = np.linalg.pinv(J)
            pull = centred * (arm.start - q)
            return q + h * (inverse @ (v - J @ pull) + pull)

        return step

    @with_options
    def solved(arm: Arm, one_seed: bool, **options: float) -> Step:
        """A run by `ik_LM` from the last answer, or from the start each time."""
        chain = robot_of(arm)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            found = chain.ik_LM(pose, q0=arm.start if one_seed else q, **options)
            return found.q if found.success else None

        return step

    whole = 1.0 / float(arm.runs["circle"]["h"][0])
    yield Setting("resolved rate, gain 1", servo(1.0), True, "README.md of 1.5, the loop of p_servo and pinv")
    yield Setting("resolved rate, gain 1/dt", servo(whole))
    for centred in (1.0, 10.0, whole):
        yield Setting(f"resolved rate, gain 1/dt, pull {centred:.3g}/s", servo(whole, centred))
    yield Setting("ik_LM, last answer", solved(False), source="ik_LM, its defaults")
    yield Setting("ik_LM to 1e-12, last answer", solved(False, tol=1e-12))
    yield Setting("ik_LM to 1e-12, one seed", solved(True, tol=1e-12))


LIBRARIES = {
    "holokin": (holokin, ("holokin", "numpy", "casadi")),
    "pink": (pink, ("pin-pink", "pin", "daqp")),
    "mink": (mink, ("mink", "mujoco", "daqp")),
    "mink-warp": (mink_warp, ("mink-warp", "warp-lang", "mujoco")),
    "placo": (placo, ("placo", "pin")),
    "OInK": (oink, ("roboplan-oink", "roboplan-core", "pin")),
    "embodik": (embodik, ("embodik",)),
    "Drake": (drake, ("drake",)),
    "pyroboplan": (pyroboplan, ("pyroboplan", "pin")),
    "PyRoki": (pyroki, ("almond-pyroki", "almond-jaxls", "jax")),
    "newton": (newton, ("newton", "warp-lang")),
    "ssik": (ssik, ("ssik",)),
    "frankik": (frankik, ("frankik",)),
    "TRAC-IK": (tracik, ("pytracik",)),
    "roboticstoolbox": (roboticstoolbox, ("roboticstoolbox-python",)),
}
"""Name -> (its settings, the packages whose versions the page shows)."""

if __name__ == "__main__":
    serve(*LIBRARIES[sys.argv[3]])
