"""Programs of random robots, tools, paths and laws in every language, played with Pinocchio's kinematics."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import cKDTree

import controllers
import grammars
import grammars_more
import holokin as hk
from holokin.base.errors import ExportError, HolokinError
from holokin.export import ToolTolerance, Wiring, to_fanuc, to_inform, to_krl, to_rapid, to_urscript, to_val3
from holokin.robot import DHRow

LANGUAGES = ("rapid", "krl", "urscript", "ls", "inform", "val3")
PULSES = 3000.0
CASES = 200


def random_robot(rng: np.random.Generator) -> tuple[hk.Robot, np.ndarray]:
    """A six-axis arm, perhaps on a rail, with a torch, and a posture of it."""
    name = rng.choice(["irb140", "ur5e", "ur10e", "rail-ur10e", "of DH"])
    if name == "of DH":
        a2, d4 = rng.uniform(0.3, 0.7, 2)
        table = [
            (rng.uniform(0, 0.2), np.pi / 2, 0.4, 0.0), (a2, 0.0, 0.0, np.pi / 2),
            (rng.uniform(0, 0.1), np.pi / 2, 0.0, 0.0),
            (0.0, -np.pi / 2, d4, 0.0), (0.0, np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.1, 0.0),
        ]  # fmt: skip
        speeds = rng.uniform(2.0, 6.0, 6)
        robot = hk.from_dh(
            [
                DHRow(*row, joint=f"q{i}", lower=-3.0, upper=3.0, max_velocity=float(speeds[i]))
                for i, row in enumerate(table)
            ]
        )
    else:
        robot = hk.load(name)
    robot = hk.with_tool(robot, rng.uniform(-0.1, 0.1, 3) + [0, 0, 0.15], rng.uniform(-1.0, 1.0, 3))
    q0 = rng.uniform(-1.2, 1.2, robot.n)
    q0[-2] += np.sign(q0[-2]) * 0.4  # away from the wrist's singular posture
    return robot, np.clip(q0, robot.lower + 0.3, robot.upper - 0.3)


def random_motion(rng: np.random.Generator) -> tuple[hk.Task, hk.motion.TimedTrajectory, float]:
    robot, q0 = random_robot(rng)
    start = robot.pose(q0)
    if robot.n == 7:
        task, law = hk.pose(robot), hk.lock(0) if rng.random() < 0.5 else hk.linear(rng.uniform(-1, 1, (1, 7)))
    else:
        task = hk.pose(robot, "axis", reference=start[:3, :3])
        law = hk.lock(int(rng.integers(6)))
    size = rng.uniform(0.03, 0.12)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    at = start[:3, 3]
    path = {
        "line": lambda: hk.polyline(at + size * np.array([np.zeros(3), turn[0]])),
        "corner": lambda: hk.polyline(at + size * np.array([np.zeros(3), turn[0], turn[0] + turn[1]])),
        "arc": lambda: hk.path.arc(at, at + size * turn[0], rng.uniform(0.5, 4.0), turn[2]),
        "spline": lambda: hk.spline(at + size * np.array([np.zeros(3), turn[0], turn[0] + turn[1], 2 * turn[0]])),
    }[rng.choice(["line", "corner", "arc", "spline"])]()
    speed = float(rng.choice([0.005, 0.008, 0.02, 0.1]))
    walk = hk.follow(hk.holonomic(task, law), path.at_speed(speed), q0, samples=300)
    dt = 0.008 if speed > 0.05 else 0.04
    return task, hk.retime(walk, acceleration=8.0, speed=1.0, dt=dt), speed


def written(language: str, timed: hk.motion.TimedTrajectory, robot: hk.Robot, tolerance: ToolTolerance) -> tuple:
    """The program, and what its parser reads, in rad and m, the axes of the robot first."""
    rail = robot.n == 7
    given = {"tolerance": tolerance, "wiring": Wiring(external=robot.joint_names[:1]) if rail else None}
    speeds = np.rad2deg(np.roll(robot.max_velocity, -1) if rail else robot.max_velocity)
    units = np.array([np.pi / 180] * 6 + [1e-3] * rail)
    if rail:
        speeds[6] = 1e3 * robot.max_velocity[0]
    if language == "inform":
        program = to_inform(timed, [PULSES] * robot.n, **given, speeds=robot.max_velocity.tolist())
        read = grammars_more.inform(program.text, np.full(robot.n, PULSES), speeds)
    elif language == "val3":
        program = to_val3(timed, **given, speeds=robot.max_velocity.tolist())
        read = grammars_more.val3(program.text, speeds)
    else:
        write = {"rapid": to_rapid, "krl": to_krl, "urscript": to_urscript, "ls": to_fanuc}[language]
        program = write(timed, **given)
        parse = {"rapid": grammars.rapid, "krl": grammars.krl, "urscript": grammars.urscript, "ls": grammars.listing}
        read = parse[language](*program.files.values())
        units = np.ones(6) if language == "urscript" else units
    read.axes = read.axes * units
    read.via = {i: list(np.array(row) * units) for i, row in read.via.items()}
    return program, read


def pinocchio_pose(robot: hk.Robot) -> controllers.Pose:
    """Pinocchio's pose of the tool, of axes with the rail last."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)
    order = [model.joints[model.getJointId(name)].idx_q for name in robot.joint_names]

    def pose(axes: np.ndarray) -> np.ndarray:
        q = np.zeros(model.nq)
        q[order] = np.roll(axes, 1) if robot.n == 7 else axes
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[frame].homogeneous

    return pose


def check_program(seed: int) -> str:
    """What became of a case: "played", or why there is no motion or no program."""
    rng = np.random.default_rng(seed)
    try:
        task, timed, speed = random_motion(rng)
    except HolokinError as problem:
        return type(problem).__name__
    robot = task.robot
    linear = bool(rng.random() < 0.6)
    tolerance = ToolTolerance(
        task,
        float(rng.uniform(1e-4, 1e-3)),
        float(rng.uniform(0.005, 0.03)),
        float(rng.uniform(0.01, 0.05)),
        0.02,
        linear,
    )
    pose = pinocchio_pose(robot)
    order = np.roll(np.arange(robot.n), -1) if robot.n == 7 else np.arange(robot.n)
    points = cKDTree(np.array([pose(q[order])[:3, 3] for q in timed.q]))
    joints = cKDTree(timed.q[:, order])
    spacing = np.abs(np.diff(timed.q, axis=0)).max()
    done = []
    for language in LANGUAGES:
        try:
            program, read = written(language, timed, robot, tolerance)
        except ExportError:
            assert language == "inform" or (language in ("urscript", "val3") and robot.n == 7), language
            continue
        made = controllers.play(read, pose, count=12, degrees=False)
        off = points.query(np.concatenate([move.p for move in made]))[0].max()
        assert off <= np.hypot(program.tool.position, speed * timed.dt) + 2e-6, (seed, language)
        q = np.concatenate([move.q for move in made])
        assert joints.query(q, p=np.inf)[0].max() <= program.tool.joints + spacing + 1e-4, (seed, language)
        assert program.tool.joints <= tolerance.joints and program.tool.rotation <= tolerance.rotation
        lower, upper = robot.lower[order], robot.upper[order]
        assert ((q >= lower - 0.02) & (q <= upper + 0.02)).all(), (seed, language)
        rounded = (
            1.0 if language == "inform" else tolerance.speed + 0.01
        )  # INFORM's hundredth of a per cent is coarse; it says so
        for move in made:
            rates = np.abs(np.diff(move.q, axis=0)).max(axis=0) * 12 / max(move.seconds, 1e-3)
            assert (rates <= robot.max_velocity[order] * (1.0 + rounded)).all(), (seed, language)
        done.append(language)
    assert len(done) >= (3 if robot.n == 7 else 5), (seed, done)
    return "played"


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, 2 * CASES, 10))
def test_programs_of_random_robots_keep_what_they_state(first: int) -> None:
    """Ten seeds, of which some have no motion: a singular posture, a limit, a path out of reach."""
    outcomes = [check_program(seed) for seed in range(first, first + 10)]
    assert outcomes.count("played") >= 1, outcomes
