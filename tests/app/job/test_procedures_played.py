"""Programs of several paths, in every language: read back, in the order of the calls, and played by its rules."""

from __future__ import annotations

import shutil
import subprocess
import time
import tomllib
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import cKDTree

import controllers
import holokin as hk
from conftest import sampled
from grammars import Parsed
from holokin.app.job import read_job
from holokin.app.job.paths_job import PathsPlan, plan_paths
from holokin.app.job.schema import job_of
from holokin.app.job.uses import program_of_plan
from holokin.base.errors import ArgumentError
from holokin.export import Program
from holokin.motion.timed_trajectory import with_entry
from procedures import procedures

# --- Twelve seams on a box of walls with a rib, which stands on a table: rims, feet outside, and seams inside.

SEAMS = {
    "rim front": ((-0.13, -0.103, 0.125), (0.13, -0.103, 0.125)),
    "rim back": ((-0.13, 0.103, 0.125), (0.13, 0.103, 0.125)),
    "rim left": ((-0.143, -0.09, 0.125), (-0.143, 0.09, 0.125)),
    "rim right": ((0.143, -0.09, 0.125), (0.143, 0.09, 0.125)),
    "foot front": ((-0.13, -0.125, 0.035), (0.13, -0.125, 0.035)),
    "foot back": ((-0.13, 0.125, 0.035), (0.13, 0.125, 0.035)),
    "foot left": ((-0.165, -0.09, 0.035), (-0.165, 0.09, 0.035)),
    "foot right": ((0.165, -0.09, 0.035), (0.165, 0.09, 0.035)),
    "inside left": ((-0.12, -0.06, 0.035), (-0.12, 0.06, 0.035)),
    "inside right": ((0.12, -0.06, 0.035), (0.12, 0.06, 0.035)),
    "rib left": ((-0.025, -0.06, 0.035), (-0.025, 0.06, 0.035)),
    "rib right": ((0.025, -0.06, 0.035), (0.025, 0.06, 0.035)),
}
WALLS = (
    ((-200, -150, 0), (200, 150, 20)), ((-150, -110, 20), (150, -95, 110)), ((-150, 95, 20), (150, 110, 110)),
    ((-150, -95, 20), (-135, 95, 110)), ((135, -95, 20), (150, 95, 110)), ((-7.5, -95, 20), (7.5, 95, 70)),
)  # fmt: skip
"""Corners of boxes [mm]."""

ARMS = {
    "ur10e": ("[0, -100, 100, -90, -90, 0]", '["wrist_3_joint"]', "wrist_3_joint", "[-0.75, -0.17, 0.2]"),
    "iiwa14": ("[0, 10, 0, -80, 0, 90, 0]", '["iiwa_joint_3", "iiwa_joint_7"]', "iiwa_joint_7", "[0.55, 0.0, 0.15]"),
}
"""Start [degrees], held joints, the joint that carries the torch, where the box stands."""

LANGUAGES = {
    "ur10e": ("rapid", "ls", "krl", "urscript", "inform", "val3", "gcode"),
    "iiwa14": ("inform", "sunrise", "xarm", "franka", "kinova"),
}


TOOLS = {"rapid": "torch", "ls": 3, "krl": 3, "urscript": [0, 0, 0.25, 0, 0, 0], "inform": 3, "val3": "torch"}
"""Of languages with linear moves."""


def box_job(arm: str, folder: Path, seams: list[str], speed: float, program: str = "") -> Path:
    """A job of some seams; few of them stand beside a box without a pocket."""
    start, held, torch, place = ARMS[arm]
    box = 'kind = "box", sides = [0.3, 0.22, 0.11], xyz = [0, 0, 0.055]'
    if len(seams) > 3:
        trimesh = pytest.importorskip("trimesh")
        trimesh.util.concatenate([trimesh.creation.box(bounds=b) for b in WALLS]).export(folder / "box.stl")
        box = 'kind = "mesh", file = "box.stl", scale = 0.001'
    rows = [f'  {{ name = "{name}", points = {[list(p) for p in SEAMS[name]]} }},' for name in seams]
    lines = [
        'title = "A box"', "path = [", *rows, "]", f'[robot]\nname = "{arm}"\ntool = {{ xyz = [0, 0, 0.25] }}',
        f"[start]\nq = {start}\ndegrees = true", '[task]\nkind = "pose"\norientation = "axis"',
        f'[strategies.wrist]\nkind = "lock"\njoints = {held}', f"[frames.box]\nxyz = {place}",
        f'[every_path]\nkind = "polyline"\nframe = "box"\nspeed = {speed}\nsamples = 60', '[air]\norder = "shortest"',
        "[timing]\nacceleration = 4.0\njerk = 200.0\ndt = 0.01", "[checks]\nclearance = 0.005",
        f"radius = {{ {torch} = 0.006 }}", f'obstacles = [{{ name = "box", frame = "box", {box} }},',
        '{ name = "table", frame = "box", kind = "box", sides = [0.6, 0.5, 0.03], xyz = [0, 0, -0.02] }]',
        f"[program]\n{program}",
    ]  # fmt: skip
    file = folder / f"{arm}.toml"
    file.write_text("\n".join(lines))
    return file


@cache
def planned(file: Path) -> PathsPlan:
    return plan_paths(read_job(file), file, "wrist")


def written(file: Path, language: str, linear: bool) -> tuple[Program, list[Parsed]]:
    """The program of a plan, and its procedures as a controller reads them, joints in rad."""
    plan, keys = planned(file), tomllib.loads(file.read_text())
    keys["program"] |= {"linear": True, "tool": TOOLS[language]} if linear else {}
    if language not in ("franka", "kinova"):
        on, off = (
            ("io.setOut(true);", "io.setOut(false);") if language == "sunrise" else ("output 5 on", "output 5 off")
        )
        keys["program"] |= {"on": [on], "off": [off]}
    program = program_of_plan(plan, "box", job_of(file, keys), file, language)
    robot = plan.paths[0].strategy.task.robot
    speeds, order = np.rad2deg(robot.max_velocity), [0, 1, 3, 4, 5, 6, 2]
    turned = language == "inform" and robot.n == 7
    begin = plan.stages[0][1].q[0]
    out = file.parent / language
    read = procedures(program, language, out, np.full(robot.n, 1e3), speeds[order] if turned else speeds, begin)
    for part in read:
        part.axes = part.axes if language in ("urscript", "franka", "kinova") else np.deg2rad(part.axes)
        part.axes = part.axes[:, np.argsort(order)] if turned else part.axes
        part.via = {i: q if language == "urscript" else np.deg2rad(q).tolist() for i, q in part.via.items()}
    return program, read


def pinocchio_pose(robot: hk.Robot) -> controllers.Pose:
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)

    def pose(q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, np.asarray(q, dtype=float))
        return data.oMf[frame].homogeneous

    return pose


def check_played(file: Path, language: str, joints: float, tool: float, linear: bool = False) -> None:
    """The procedures are the stages of the plan: one goes on where the one before ends, joints [rad] and tool [m] keep
    to the timed motion, the process is switched where a path begins and ends."""
    plan = planned(file)
    _, read = written(file, language, linear)
    stages = [each.timed if each.air.timed is None else with_entry(each.air.timed, each.timed) for each in plan.paths]
    assert plan.home is not None and plan.home.timed is not None
    stages.append(plan.home.timed)
    assert [part.name.lower()[:8] for part in read] == [f"{e.name}".replace(" ", "_")[:8] for e in plan.paths] + [
        "home"
    ]
    for one, other in pairwise(read):
        assert np.abs(one.axes[-1] - other.axes[0]).max() < 1e-4, language
    pose = pinocchio_pose(plan.paths[0].strategy.task.robot)
    for k, (part, timed) in enumerate(zip(read, stages, strict=True)):
        t = np.linspace(0.0, timed.duration, 4 * len(timed))
        ours = CubicHermiteSpline(timed.t, timed.q, timed.dq)(t)
        # Of a stream every row is a posture; else the moves between targets are played.
        streamed = language in ("franka", "kinova")
        q = part.axes[::5] if streamed else np.vstack([m.q for m in controllers.play(part, pose, 8, degrees=False)])
        assert off_way(q, ours).max() < joints, (language, part.name)
        points, goals = (np.array([pose(x)[:3, 3] for x in Q]) for Q in (q[::7], ours))
        assert off_way(points, goals).max() < tool, (language, part.name)
        if set(part.kinds) == {"joint"}:
            assert sum(part.seconds) == pytest.approx(timed.duration, rel=0.02), (language, part.name)
        if language not in ("franka", "kinova"):
            lines = [(i, text) for i, text in part.lines if "CirPathMode" not in text]
            said = [text for _, text in lines]
            assert len(said) == (0 if k == len(read) - 1 else 2), (language, said)
            if said:
                (begins, _), (ends, _) = lines
                seam = plan.paths[k].timed
                assert np.abs(part.axes[begins - 1] - seam.q[0]).max() < 1e-3, language
                assert ends == len(part.axes)


def off_way(q: np.ndarray, way: np.ndarray) -> np.ndarray:
    """The distance of each point from the lines between the nearest point of a way and the two beside it (k,)."""
    i = np.clip(cKDTree(way).query(q)[1], 1, len(way) - 2)
    apart = []
    for a, b in ((way[i - 1], way[i]), (way[i], way[i + 1])):
        line = b - a
        share = np.clip(((q - a) * line).sum(axis=1) / np.maximum((line * line).sum(axis=1), 1e-30), 0.0, 1.0)
        apart.append(np.linalg.norm(q - a - share[:, None] * line, axis=1))
    return np.min(apart, axis=0)


def program_keys(arm: str) -> str:
    count = 6 if arm == "ur10e" else 7
    keys = f"pulses = {[1000.0] * count}\ntool_tolerance = {{ mm = 0.2, degrees = 0.1, percent = 2 }}\n"
    return keys + ('letters = ["X", "Y", "Z", "A", "B", "C"]\n' if count == 6 else "")


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    seams = ["rim front", "foot left", "rim right"]
    return box_job("ur10e", tmp_path_factory.mktemp("three"), seams, 0.05, program_keys("ur10e"))


@sampled(2, "language", LANGUAGES["ur10e"])
def test_each_procedure_of_three_seams_goes_on_where_the_one_before_ended(three: Path, language: str) -> None:
    check_played(three, language, 3e-3, 2e-4)


@pytest.fixture(scope="module")
def three_of_seven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    seams = ["rim front", "foot left", "rim right"]
    return box_job("iiwa14", tmp_path_factory.mktemp("seven"), seams, 0.05, program_keys("iiwa14"))


@sampled(1, "language", LANGUAGES["iiwa14"])
def test_each_procedure_of_an_arm_of_seven_axes_goes_on_where_the_one_before_ended(
    three_of_seven: Path, language: str
) -> None:
    check_played(three_of_seven, language, 3e-3, 2.2e-4)


def test_a_name_that_the_language_has_is_none_for_a_main_program(three: Path) -> None:
    for language, name in (("krl", "loop"), ("rapid", "1up"), ("sunrise", "run")):
        with pytest.raises(ArgumentError, match="name is"):
            program_of_plan(planned(three), "box", read_job(three), three, language, name)


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("javac") is None, reason="needs a JDK")
def test_java_compiles_a_class_of_several_methods_and_runs_them_in_order(three_of_seven: Path, tmp_path: Path) -> None:
    plan = planned(three_of_seven)
    program = program_of_plan(plan, "box", read_job(three_of_seven), three_of_seven, "sunrise", "Box")
    (tmp_path / "Box.java").write_text(program.text, "utf-8")
    stubs = Path(__file__).parents[2] / "export" / "sunrise_stubs"
    sources = [str(tmp_path / "Box.java"), *map(str, stubs.rglob("*.java"))]
    subprocess.run(["javac", "-Xlint:all", "-Werror", "-d", str(tmp_path), *sources], check=True)
    done = subprocess.run(["java", "-cp", str(tmp_path), "Play", "Box"], check=True, capture_output=True, text=True)
    rows = [[float(x) for x in line.split()] for line in done.stdout.splitlines() if line[0] in "-.0123456789"]
    _, read = written(three_of_seven, "sunrise", False)
    np.testing.assert_allclose(np.array(rows)[:, :7], np.vstack([part.axes for part in read]), atol=1e-8)


# --- All twelve seams, under three minutes; and their programs.


@pytest.fixture(scope="module")
def twelve(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("twelve")
    return {arm: box_job(arm, folder, list(SEAMS), 0.01, program_keys(arm)) for arm in ARMS}


@pytest.mark.campaign
@pytest.mark.parametrize("arm", ARMS)
def test_twelve_seams_are_planned_in_three_minutes_without_a_change_of_sheet(twelve: dict[str, Path], arm: str) -> None:
    began = time.process_time()
    plan = planned(twelve[arm])
    assert time.process_time() - began < 180.0
    assert (len(plan.paths), plan.left_out, plan.changes) == (12, {}, 0)


@pytest.mark.campaign
@pytest.mark.parametrize(("arm", "language"), [(arm, language) for arm in ARMS for language in LANGUAGES[arm]])
def test_twelve_seams_are_played_in_every_language(twelve: dict[str, Path], arm: str, language: str) -> None:
    check_played(twelve[arm], language, 3e-3, 2.2e-4)


@pytest.mark.campaign
@pytest.mark.parametrize("language", TOOLS)
def test_twelve_seams_are_played_with_linear_moves(twelve: dict[str, Path], language: str) -> None:
    check_played(twelve["ur10e"], language, 1e-2, 2.2e-4, linear=True)
