"""Files that people write and send, spoilt, and what holokin does with them: a row of `DOORS` a kind.

A row has good files, and what reads the first of them, or the folder that they are in. `spoil` makes of good files bad
ones, by the format that a file's name tells.
"""

from __future__ import annotations

import io
import json
import random
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.fuzz.spoil import mutated, spoilt_files
from holokin.analysis.audit import audit_dataset
from holokin.analysis.audit.logs import STATE, joint_feature, read_dataset
from holokin.app.job import Job, open_job, packaged_jobs, packaged_text, run_job
from holokin.app.report.job_report import print_result
from holokin.app.report.job_result import check_folder
from holokin.app.survey import Findings, Store, repeated, run_survey, write_survey_report
from holokin.app.survey.store import case_of
from holokin.app.survey.survey_file import read_survey
from holokin.base.errors import HolokinError
from holokin.learning import retarget
from holokin.motion.ik import InverseKinematics
from holokin.proof.recheck import recheck

Files = dict[str, bytes]
Chance = random.Random
SAMPLES = Path(__file__).parent / "samples"
GOLDEN = Path(__file__).parents[2] / "tests" / "golden"


def sample(name: str) -> bytes:
    """A good file of the folder `samples`."""
    return (SAMPLES / name).read_bytes()


# --- Good files that are made.


@cache
def jobs() -> list[str]:
    """Every law of the sample on either arm, some on other paths; the packaged jobs."""
    arms, paths, laws = (sample(f"{part}.toml").decode().split("# next\n") for part in ("arms", "paths", "laws"))
    small = [f'title = "t"\n{arm}{paths[0]}{law}' for arm, law in product(arms, laws)]
    small += [f'title = "t"\n{arm}{path}{laws[0]}' for arm, path in product(arms, paths[1:])]
    return 9 * small + [packaged_text(name) for name in packaged_jobs()]


@cache
def log() -> tuple[hk.Robot, np.ndarray]:
    """A robot and three cycles (k, 4) of it, in which the third joint is a function of the tool's place."""
    phase = np.linspace(0, 6 * np.pi, 90)
    x, y = 0.3 * np.cos(phase), 0.3 * np.sin(phase)
    z = 0.5 + 0.4 * x * y
    return hk.load("ppr"), np.column_stack([0.05 * np.arange(90), x - np.cos(z), y - np.sin(z), z])


def csv_log() -> Files:
    """The log as a table."""
    robot, table = log()
    lines = [",".join(["t", *robot.joint_names]), *(",".join(map(repr, row)) for row in table.tolist())]
    return {"log.csv": "\n".join(lines).encode()}


@cache
def bags() -> list[Files]:
    """The log as rosbag2 folders of either storage and as ROS 1 bags, packed in all ways."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    found, modes = [], rosbag2.CompressionMode
    with tempfile.TemporaryDirectory() as name:
        for plugin, mode in (
            ("SQLITE3", modes.NONE),
            ("SQLITE3", modes.MESSAGE),
            ("SQLITE3", modes.FILE),
            ("MCAP", modes.NONE),
            ("MCAP", modes.STORAGE),
        ):
            folder = Path(name) / f"{plugin}-{mode}"
            new = rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
            if mode is not modes.NONE:
                new.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
            with new:
                _fill(new, get_typestore(Stores.ROS2_HUMBLE), ros2=True)
            found.append({f"bag/{file.name}": file.read_bytes() for file in folder.iterdir()})
            if mode is modes.NONE:
                found += [{file.name: file.read_bytes()} for file in folder.iterdir() if file.suffix != ".yaml"]
        for packing in (None, "BZ2", "LZ4"):
            old = rosbag1.Writer(Path(name) / f"{packing}.bag")
            if packing:
                old.set_compression(rosbag1.Writer.CompressionFormat[packing])
            with old:
                _fill(old, get_typestore(Stores.ROS1_NOETIC), ros2=False)
            found.append({"log.bag": (Path(name) / f"{packing}.bag").read_bytes()})
    return found


def _fill(writer: Any, store: Any, *, ros2: bool) -> None:
    """Write the log as messages of joint states."""
    robot, table = log()
    names = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, time = (store.types[name] for name in names)
    link = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
    for k, row in enumerate(table[::3]):
        ns = 10**9 + 50_000_000 * k
        stamp = time(ns // 10**9, ns % 10**9)
        head = header(stamp, "") if ros2 else header(k, stamp, "")
        message = state(head, list(robot.joint_names), row[1:].copy(), np.zeros(0), np.zeros(0))
        serialize = store.serialize_cdr if ros2 else store.serialize_ros1
        writer.write(link, ns, serialize(message, state.__msgtype__))


@cache
def datasets() -> list[Files]:
    """Datasets of a Panda that LeRobot itself wrote, formats v2.1 and v3.0."""
    folders = [GOLDEN / f"lerobot-{version}" for version in ("v2.1", "v3.0")]
    return [{f"d/{f.relative_to(d)}": f.read_bytes() for f in sorted(d.rglob("*")) if f.is_file()} for d in folders]


@cache
def survey_results() -> Files:
    """The results of a survey of a few cases, in one process, and the survey."""
    with tempfile.TemporaryDirectory() as folder:
        file, results = Path(folder) / "arms.toml", Path(folder) / "arms.sqlite"
        file.write_bytes(sample("small_survey.toml"))
        run_survey(read_survey(file), Path(folder), results, workers=0)
        with sqlite3.connect(results) as db:
            db.execute("PRAGMA journal_mode = DELETE")  # all of it in the file
        db.close()
        return {"arms.sqlite": results.read_bytes(), "arms.toml": file.read_bytes()}


@cache
def certificate() -> Files:
    """A certificate of a straight line of a planar arm."""
    q0, task = [0.4, 0.6, 0.5], hk.position(hk.load("planar-3r"))
    start = task.robot.pose(q0)[:3, 3]
    path = hk.polyline([start, start + [-0.01, 0.005, 0.0]])
    with tempfile.TemporaryDirectory() as folder:
        file = hk.certify(hk.holonomic(task, hk.lock(2)), path, q0).save(Path(folder) / "c.json")
        return {"c.json": file.read_bytes()}


@cache
def sheets_task() -> hk.Task:
    """The task of a map of sheets."""
    return hk.position(hk.load("planar-3r"))


@cache
def sheets() -> Files:
    """A map of sheets."""
    found = hk.sheets(sheets_task(), hk.workspace(box=([1.0, 0.6], [0.5, 0.5])), samples=16)
    with tempfile.TemporaryDirectory() as folder:
        hk.analysis.sheets.write_sheets(found, Path(folder) / "s.npz")
        return {"s.npz": (Path(folder) / "s.npz").read_bytes()}


# --- What reads them.


def _moved(robot: hk.Robot) -> None:
    """A robot that was read moves a little, by finite numbers."""
    q = np.clip(0.1, robot.lower, robot.upper)
    if not (np.isfinite(robot.jacobian(q)).all() and np.isfinite(robot.pose(q)).all()):
        raise ValueError("kinematics that are not finite")
    hk.position(robot)


def _short(job: Job) -> Job:
    """The job with few samples, so that a mutant takes little time."""
    path = job.path.model_copy(update={"samples": min(job.path.samples, 8), "cycles": min(job.path.cycles, 2)})
    verdict = job.verdict.model_copy(update={"samples": min(job.verdict.samples, 3)})
    return job.model_copy(update={"path": path, "verdict": verdict})


def _do_job(file: Path, chance: Chance) -> None:
    """Read, and often done and printed, as `holokin run` does; only the figures are left out."""
    from rich.console import Console

    name, job, file = open_job(str(file))
    check_folder(file.parent / "out", name)
    if chance.random() < (0.4 if job.title == "t" else 0.95):  # reading them is cheap, doing them is not
        return
    result = run_job(name, _short(job), file)
    print_result(result, Console(file=io.StringIO(), width=120))
    json.dumps([strategy.to_dict() for strategy in result.strategies], allow_nan=False)
    if any(len(stem.encode()) > 120 for stem in result.stems.values()):
        raise ValueError("a file name that is too long")


def _read_urdf(file: Path, chance: Chance) -> None:
    tips = hk.robot.model_tips(file)
    held = {chance.choice(("j1", "j2", "j6")): chance.choice((0.0, 0.5, 9.0, 1e300))}
    base = chance.choice(("b", "f", "e")) if chance.random() < 0.3 else None
    locked = held if chance.random() < 0.3 else None
    _moved(hk.from_urdf(file, tip=chance.choice([*tips, "f"]), base=base, locked=locked))


def _read_drawing(file: Path, chance: Chance) -> None:
    for waypoints in hk.read_paths(file, pixel=chance.choice((None, None, 1e-3))).paths:
        path = waypoints.path()
        if not 0 < path.length < float("inf"):
            raise ValueError("a path without a length")


def _read_dh(file: Path, chance: Chance) -> None:
    """As a file, or as lists in Python."""
    if chance.random() < 0.6:
        _moved(hk.load(file))
        return
    table = {"base": np.eye(4).tolist(), "tool": np.eye(4).tolist(), "convention": "modified", "name": "n", "tip": "t"}
    rows = [{"a": 0.3, "alpha": 1.5, "lower": -2.0, "upper": 2.0}, {"d": 0.2, "kind": "prismatic"}, {"theta": 0.3}]
    spoilt = mutated({**table, "rows": rows}, chance)
    rows = spoilt.pop("rows", [])
    _moved(hk.from_dh(rows, **{key: value for key, value in spoilt.items() if key in table}))


def _audit_log(path: Path, chance: Chance) -> None:
    log_ = hk.read_recording(path, log()[0], degrees=chance.choice((None, None, True, False)))
    audit = hk.audit_recording(log_, log()[0])
    json.dumps([str(audit), audit.to_dict()], allow_nan=False)


@cache
def _leaf() -> tuple[hk.Robot, InverseKinematics]:
    """The robot of the datasets, and the leaf to which one is retargeted."""
    robot = hk.load("panda")
    q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    return robot, hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), q0, limits=False)


def _read_dataset(folder: Path, chance: Chance) -> None:
    """Audited, and with its joints on a leaf written anew."""
    robot, ik = _leaf()
    dataset = read_dataset(folder)
    joints = joint_feature(dataset, robot, STATE)
    str(audit_dataset(dataset, robot, joints))
    bad = chance.choice(("refuse", "skip", "nearest"))
    done = retarget(dataset, ik, [joints], folder.parent / "new", bad=bad)
    str(done)
    if done.written is not None:
        again = read_dataset(done.written)
        audit_dataset(again, robot, joint_feature(again, robot, STATE))


def _read_results(results: Path, _: Chance) -> None:
    """As report, case and --resume do: each that is refused leaves the others to be tried."""
    refusals = []

    def report() -> None:
        with Store.opened(results, None) as store:
            survey, folder, findings = store.content(), store.folder(), Findings.of(store.rows())
        write_survey_report(survey, folder, findings, results.with_suffix(".html"))
        str(findings)

    def repeat() -> None:
        with Store.opened(results, None) as store:
            cases, row = case_of(store, "1")
        repeated(cases, row)

    def resume() -> None:
        run_survey(read_survey(results.with_suffix(".toml")), results.parent, results, workers=0, resume=True)

    for read in (report, repeat, resume):
        try:
            read()
        except HolokinError as problem:
            refusals.append(problem)
    if refusals:
        raise refusals[0]


def _read_sheets(file: Path, _: Chance) -> None:
    """What is read is a map, which answers, is told and is written."""
    sheets = hk.read_sheets(file, sheets_task())
    str(sheets)
    answers = sheets.batch(sheets.poses)
    T, q = sheets.poses[answers.served], answers.q[answers.served]
    if len(q) and not np.abs(sheets_task().error(q, T[:, :3, 3], T[:, :3, :3])).max() < 1e-6:
        raise ValueError("the tool is not at the pose")
    hk.analysis.sheets.write_sheets(sheets, file)


def _named(stems: str, suffix: str, data: Callable[[Chance], bytes]) -> Callable[[Chance], Files]:
    """A file whose name is now and then an odd one."""
    return lambda chance: {f"{chance.choice([*stems.split(), 'x' * 245, '[b]', 'é'])}.{suffix}": data(chance)}


XACRO = ("arm.xacro", "more.xacro", "props.yaml")
DOORS: dict[str, tuple[Callable[[Chance], Files], Callable[[Path, Chance], object]]] = {
    "jobs": (_named("job job job .. x", "toml", lambda chance: chance.choice(jobs()).encode()), _do_job),
    "urdfs": (_named("arm arm", "urdf", lambda _: sample("arm.urdf")), _read_urdf),
    "mjcf_files": (
        lambda _: {"arm.xml": sample("arm.xml")},
        lambda file, chance: _moved(hk.load(file, tip=chance.choice([*hk.robot.model_tips(file), "tool"]))),
    ),
    "xacro_files": (
        lambda _: {name: sample(name) for name in XACRO},
        lambda file, chance: hk.load(
            file, args=chance.choice((None, {"length": 0.7}, {"length": "a b"}, {"no": True}))
        ),
    ),
    "dh": (lambda _: {"arm.toml": sample("dh.toml")}, _read_dh),
    "drawings": (lambda _: {"drawing.svg": sample("drawing.svg")}, _read_drawing),
    "csv_logs": (lambda _: csv_log(), _audit_log),
    "bags": (lambda chance: chance.choice(bags()), _audit_log),
    "datasets": (lambda chance: chance.choice(datasets()), _read_dataset),
    "survey_files": (lambda _: {"arms.toml": sample("survey.toml")}, lambda file, _: read_survey(file)),
    "survey_results": (lambda _: survey_results(), _read_results),
    "certificate_files": (lambda _: certificate(), lambda file, _: recheck(file)),
    "sheets_files": (lambda _: sheets(), _read_sheets),
}
"""Kind -> (good files, what reads the first of them, or the folder that they are in)."""


def attempt(kind: str, seed: int, folder: Path) -> None:
    """The mutant of a seed: written and read."""
    good, read = DOORS[kind]
    chance = random.Random(seed)
    files = spoilt_files(good(chance), chance)
    for name, data in files.items():
        with suppress(OSError):  # a name too long for the disk: holokin has to say so
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
    first = next(iter(files), "d/")
    read(folder / (first.partition("/")[0] if "/" in first else first), chance)
