"""Files that people write and send, spoilt, and what holokin does with them: a row of `FORMATS` a kind.

A row makes of a seed the names and bytes of the files of a mutant, and gives the folder with them to holokin.
"""

from __future__ import annotations

import io
import json
import random
import sqlite3
import struct
import tempfile
import tomllib
import zipfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.fuzz import samples
from benchmarks.fuzz.spoil import (
    NAMES,
    among,
    broken,
    hostile,
    mutated,
    mutated_xml,
    toml,
    wrapped_xml,
    written,
)  # fmt: skip
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


def _moved(robot: hk.Robot) -> None:
    """A robot that was read moves a little, by finite numbers."""
    q = np.clip(0.1, robot.lower, robot.upper)
    if not (np.isfinite(robot.jacobian(q)).all() and np.isfinite(robot.pose(q)).all()):
        raise ValueError("kinematics that are not finite")
    hk.position(robot)


@cache
def _jobs() -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(small jobs, of planar arms; the packaged ones)."""
    small = [tomllib.loads(f'title = "t"\n{base}{law}') for base in samples.BASES for law in samples.LAWS]
    for i, text in enumerate(samples.OTHER_PATHS):
        small += [{**small[i], **tomllib.loads(text)}, {**small[-1 - i], **tomllib.loads(text)}]
    return small, [tomllib.loads(packaged_text(name)) for name in packaged_jobs()]


def _job(chance: Chance) -> Files:
    """Wrong, huge, nested and odd values, and broken bytes."""
    table = chance.choice(_jobs()[chance.random() < 0.1])
    kind = chance.random()
    data = toml(mutated(table, chance) if kind < 0.75 else table).encode("utf-8", "replace")
    stem = chance.choice(("job", "job", "job", "..", ".", "", "x" * 240, "x" * 300, "[b]", "é"))
    return {f"{stem}.toml": broken(data, chance) if kind > 0.7 else data}


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


def _urdf(chance: Chance) -> Files:
    """Missing, doubled and moved elements, odd numbers, names, encodings and very deep XML."""
    kind = chance.random()
    if kind < 0.55:
        data = mutated_xml(samples.URDF, chance, samples.URDF_TAGS, samples.URDF_KEYS, samples.XML_VALUES)
    elif kind < 0.8:
        data = broken(samples.URDF.encode(), chance)
    elif kind < 0.9:
        code = chance.choice(samples.CODES)
        text = samples.URDF.replace('"1.0"?>', f'"1.0" encoding="{code}"?>').replace('"arm"', '"ärm 日本"')
        try:
            data = text.encode(chance.choice((code, "utf-8", "gb18030", "shift_jis")), "replace")
        except (LookupError, UnicodeError):
            data = text.encode()
    else:
        data = wrapped_xml(samples.URDF, '<joint name="j1"', chance)
    return {f"{chance.choice(('arm', 'arm', 'x' * 245, '[b]', 'é'))}.urdf": data}


def _read_urdf(file: Path, chance: Chance) -> None:
    tips = hk.robot.model_tips(file)
    held = {chance.choice(("j1", "j2", "j6")): chance.choice((0.0, 0.5, 9.0, 1e300))}
    base = chance.choice(("b", "f", "e")) if chance.random() < 0.3 else None
    locked = held if chance.random() < 0.3 else None
    _moved(hk.from_urdf(file, tip=chance.choice([*tips, "f"]), base=base, locked=locked))


def _mjcf(chance: Chance) -> Files:
    """Missing, doubled and moved elements, odd numbers and names, giants."""
    spoilt = chance.random() < 0.7
    tables = samples.MJCF_TAGS, samples.MJCF_KEYS, samples.XML_VALUES
    return {"arm.xml": mutated_xml(samples.MJCF, chance, *tables) if spoilt else broken(samples.MJCF.encode(), chance)}


def _read_mjcf(file: Path, chance: Chance) -> None:
    _moved(hk.load(file, tip=chance.choice([*hk.robot.model_tips(file), "tool"])))


def _drawing(chance: Chance) -> Files:
    """Odd numbers, commands, units and transforms, uses of uses, very deep XML."""
    kind = chance.random()
    data = mutated_xml(samples.SVG, chance, samples.SVG_TAGS, samples.SVG_KEYS, samples.SVG_VALUES)
    if kind < 0.4:
        data = broken(data, chance)
    return {"drawing.svg": wrapped_xml(samples.SVG, "<path", chance) if kind > 0.9 else data}


def _read_drawing(file: Path, chance: Chance) -> None:
    for path in hk.path.read_svg(file, pixel=chance.choice((None, None, 1e-3))):
        if not 0 < path.length < float("inf"):
            raise ValueError("a path without a length")


def _xacro(chance: Chance) -> Files:
    """Odd expressions, macros, conditions, arguments and files in files. Each is read in a process of its own."""
    texts = dict(samples.XACRO)
    for _ in range(chance.choice((1, 1, 2, 3))):
        odd = chance.choice(samples.XACRO_WORDS)
        put = odd if chance.random() < 0.5 else f"${{{chance.choice(samples.EXPRESSIONS)}}}"
        texts["arm.xacro"] = texts["arm.xacro"].replace(chance.choice(samples.XACRO_PARTS), put, chance.choice((1, -1)))
    spoilt = chance.choice(list(texts)) if chance.random() < 0.3 else ""
    return {name: broken(t.encode(), chance) if name == spoilt else t.encode() for name, t in texts.items()}


def _read_xacro(file: Path, chance: Chance) -> None:
    hk.load(file, args=chance.choice((None, {"length": 0.7}, {"length": "a b"}, {"no": True})))


def _dh(chance: Chance) -> Files:
    """A table as a file; empty where it is to be given as Python's lists."""
    kind = chance.random()
    data = toml(mutated(tomllib.loads(samples.DH), chance) if kind < 0.67 else tomllib.loads(samples.DH))
    text = data.encode("utf-8", "replace")
    return {"arm.toml": broken(text, chance) if kind > 0.6 else text}


def _read_dh(file: Path, chance: Chance) -> None:
    if chance.random() < 0.6:
        _moved(hk.load(file))
        return
    table = mutated({**samples.DH_ARGUMENTS, "rows": samples.DH_ROWS}, chance, among(samples.NO_NUMBERS))
    rows = table.pop("rows", [])
    _moved(hk.from_dh(rows, **{key: value for key, value in table.items() if key in samples.DH_ARGUMENTS}))


def _csv(chance: Chance) -> Files:
    """Headers, separators, numbers, times, encodings and single bytes that are wrong."""
    _, names, table = samples.log()
    cells = among([*samples.CELLS, *samples.HEADERS])
    rows = [list(names), *([repr(float(v)) for v in row] for row in table)]
    for _ in range(chance.randrange(4)):
        spoilt = mutated(rows, chance, cells)
        rows = [[*map(_cell, row)] if isinstance(row, list) else [_cell(row)] for row in spoilt] or [[]]
        if chance.random() < 0.2:
            column, factor = chance.randrange(4), 10.0 ** chance.randrange(-300, 300)
            rows = [rows[0], *(_scaled(row, column, factor) for row in rows[1:])]
        if chance.random() < 0.1:
            chance.shuffle(rows)
    end, delimiter = chance.choice(("\n", "\r\n", "\r")), chance.choice((",", ";", "\t"))
    text = end.join(delimiter.join(row) for row in rows) + chance.choice(("", end, end * 5))
    kind = chance.random()
    if kind < 0.14:
        return {"log.csv": text.encode(chance.choice(samples.CODES_OF_LOGS), "replace")}
    data = text.encode("utf-8", "surrogatepass")
    return {"log.csv": broken(data, chance) if kind < 0.4 else chance.randbytes(3000) if kind < 0.45 else data}


def _cell(value: Any) -> str:
    """As text; what Python does not write as text is left out."""
    try:
        return str(value)
    except (ValueError, RecursionError):
        return "9" * 5000


def _scaled(row: list[Any], column: int, factor: float) -> list[Any]:
    with suppress(ValueError, TypeError, IndexError):
        row[column] = repr(float(row[column]) * factor)
    return row


def _audit_log(path: Path, chance: Chance) -> None:
    robot = samples.log()[0]
    log = hk.read_recording(path, robot, degrees=chance.choice((None, None, True, False)))
    audit = hk.audit_recording(log, robot)
    json.dumps([str(audit), audit.to_dict()], allow_nan=False)


def _bag(chance: Chance) -> Files:
    """rosbag2 folders of either storage, .mcap, .db3 and ROS 1 .bag, broken in bytes and metadata."""
    name = chance.choice(list(samples.bags()))
    files = dict(samples.bags()[name])
    storage = next(file for file in files if file != "metadata.yaml")
    if len(files) == 1 or (chance.random() < 0.4 and "-" not in name):
        return {storage: broken(files[storage], chance)}
    if chance.random() < 0.6:
        lines = files["metadata.yaml"].decode().split("\n")
        lines = mutated(
            lines, chance, lambda c: f"{c.choice(lines).partition(':')[0]}: {c.choice(samples.YAML_VALUES)}"
        )
        files["metadata.yaml"] = "\n".join(map(str, lines)).encode("utf-8", "replace")
    else:
        files[storage] = broken(files[storage], chance)
    return {f"bag/{file}": data for file, data in files.items()}


def _survey(chance: Chance) -> Files:
    """Odd keys and values."""
    if chance.random() < 0.35:
        return {"arms.toml": broken(samples.SURVEY.encode(), chance)}
    table = mutated(tomllib.loads(samples.SURVEY), chance, among(samples.SURVEY_VALUES))
    return {"arms.toml": toml(table).encode("utf-8", "replace")}


@cache
def _results() -> bytes:
    """A results file of a few cases, in one process."""
    with tempfile.TemporaryDirectory() as folder:
        file, results = Path(folder) / "arms.toml", Path(folder) / "arms.sqlite"
        file.write_text(samples.SMALL_SURVEY, "utf-8")
        run_survey(read_survey(file), Path(folder), results, workers=0)
        db = sqlite3.connect(results)
        db.execute("PRAGMA journal_mode = DELETE")  # all of it in the file
        db.close()
        return results.read_bytes()


def _survey_results(chance: Chance) -> Files:
    """Broken bytes, or one or two changes that SQLite takes: of a value, a column, rows, a table, the survey in it."""
    survey = {"arms.toml": samples.SMALL_SURVEY.encode()}
    if chance.random() < 0.35:
        return {"arms.sqlite": broken(_results(), chance), **survey}
    db = sqlite3.connect(":memory:")
    db.deserialize(_results())
    for _ in range(chance.choice((1, 1, 2))):
        table = chance.choice(("cases", "cases", "survey"))
        columns = [row[1] for row in db.execute(f"PRAGMA table_info({table})")]
        if not columns:
            continue
        column, where = chance.choice(columns), " WHERE number = 1" * (table == "cases" and chance.random() < 0.5)
        content = db.execute("SELECT content FROM survey").fetchone() if table == "survey" else None
        value = chance.choice(samples.SQL_VALUES)
        if content and isinstance(content[0], str) and chance.random() < 0.5:
            with suppress(ValueError):
                column, value = "content", written(mutated(json.loads(content[0]), chance), chance).decode()
        change = chance.choice((
            *[f"UPDATE {table} SET {column} = ?{where}"] * 7, f"ALTER TABLE {table} DROP COLUMN {column}",
            f"ALTER TABLE {table} ADD COLUMN extra", f"DELETE FROM {table}", f"DROP TABLE {table}",
        ))  # fmt: skip
        with suppress(sqlite3.DatabaseError):  # a key that may not be twice, a number that may not be missing
            db.execute(change, (value,) if "?" in change else ())
    db.commit()
    return {"arms.sqlite": db.serialize(), **survey}


def _read_results(results: Path, _: Chance) -> None:
    """As report, case and --resume do: each that is refused leaves the others to be tried."""
    refusals = []
    survey = results.with_suffix(".toml")
    for read in (
        _report,
        _repeat,
        lambda file: run_survey(read_survey(survey), file.parent, file, workers=0, resume=True),
    ):
        try:
            read(results)
        except HolokinError as problem:
            refusals.append(problem)
    if refusals:
        raise refusals[0]


def _report(results: Path) -> None:
    with Store.opened(results, None) as store:
        survey, folder, findings = store.content(), store.folder(), Findings.of(store.rows())
    write_survey_report(survey, folder, findings, results.with_suffix(".html"))
    str(findings)


def _repeat(results: Path) -> None:
    with Store.opened(results, None) as store:
        cases, row = case_of(store, "1")
    repeated(cases, row)


@cache
def _leaf() -> tuple[hk.Robot, InverseKinematics]:
    """The robot of the datasets, and the leaf to which one is retargeted."""
    robot = hk.load("panda")
    q0 = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
    return robot, hk.ik(hk.holonomic(hk.pose(robot), hk.lock("panda_joint3")), q0, limits=False)


def _dataset(chance: Chance) -> Files:
    """LeRobot datasets, formats v2.1 and v3.0: broken, missing or changed files."""
    files = dict(samples.dataset(chance.choice(("v2.1", "v3.0"))))
    for name in chance.sample(list(files), chance.choice((1, 1, 2))):
        kind = chance.random()
        if kind < 0.05:
            del files[name]
        elif kind < 0.3:
            files[name] = broken(files[name], chance)
        elif name.endswith(".parquet"):
            files[name] = _parquet(files[name], chance)
        else:  # JSON, or a line of JSON lines
            lines = files[name].decode().split("\n") if files[name].count(b"\n{") else [files[name].decode()]
            i = chance.randrange(len(lines))
            lines[i] = written(mutated(json.loads(lines[i] or "{}"), chance), chance).decode()
            files[name] = "\n".join(lines).encode("utf-8", "replace")
    return {f"d/{name}": data for name, data in files.items()}


def _parquet(data: bytes, chance: Chance) -> bytes:
    """The table with other rows, columns, types or values."""
    import pyarrow as pa
    from pyarrow import parquet

    table = parquet.read_table(io.BytesIO(data))
    for _ in range(chance.choice((1, 1, 2))):
        i = chance.randrange(table.num_columns)
        name, column = table.column_names[i], table.column(i)
        other = pa.array([chance.choice(NAMES)[:99]] * len(table))
        match chance.randrange(7):
            case 0:
                table = table.drop_columns([name])
            case 1:
                table = table.slice(0, chance.randrange(len(table) + 1))
            case 2:
                table = pa.concat_tables([table, table])
            case 3:
                table = table.rename_columns([*table.column_names[:i], "x", *table.column_names[i + 1 :]])
            case 4:
                kinds = pa.string(), pa.float64(), pa.int8(), pa.list_(pa.float32()), pa.null(), pa.bool_()
                with suppress(pa.ArrowException):
                    other = column.cast(chance.choice(kinds), safe=False)
                table = table.set_column(i, name, other)
            case _:
                with suppress(pa.ArrowException, OverflowError, TypeError, ValueError):
                    other = pa.array(mutated(column.to_pylist(), chance, among(samples.ODD_NUMBERS)), column.type)
                if len(other) == len(table):
                    table = table.set_column(i, name, other)
    stream = io.BytesIO()
    parquet.write_table(table, stream, row_group_size=chance.choice((None, 1, 7)))
    return stream.getvalue()


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


def _certificate(chance: Chance) -> Files:
    """Broken bytes, odd values anywhere in the JSON, missing and moved parts."""
    data = samples.certificate()
    if chance.random() < 0.3:
        return {"c.json": broken(data, chance)}
    return {"c.json": written(mutated(json.loads(data), chance, among(samples.JSON_VALUES)), chance)}


def _array(values: np.ndarray, chance: Chance) -> Any:
    """The array of another kind or length, or with odd numbers."""
    kind = chance.random()
    if kind < 0.2:
        return values[: chance.randrange(len(values) + 1)]
    if kind < 0.3:
        return np.concatenate([values, values[: chance.choice((1, 2))]])
    if kind < 0.45:
        return values.astype(chance.choice(("f4", "f8", "i4", "i8", "u1", "?", "c16")))
    if kind < 0.55:
        return np.moveaxis(values, 0, -1) if kind < 0.5 else values.ravel()
    out = values.copy().ravel()
    for i in chance.sample(range(out.size), min(out.size, chance.choice((1, 1, 3, 1000)))):
        if out.dtype.kind == "f":
            near = out[i] + chance.choice((1e-9, 1e-3, 6.3))
            out[i] = chance.choice(samples.ODD_FLOATS) if chance.random() < 0.5 else near
        else:
            out[i] = chance.choice(samples.WHOLE if out.dtype.kind == "i" else range(256))
    return out.reshape(values.shape)


def _sheets(chance: Chance) -> Files:
    """Maps of sheets: arrays of another kind, shape or length, headers, odd numbers and words."""
    _, sound, whole = samples.sheets()
    if chance.random() < 0.3:
        return {"s.npz": broken(whole, chance)}
    arrays = dict(sound)
    if chance.random() < 0.5:
        table = json.loads(arrays["about"].tobytes())
        text = written(mutated(table, chance) if chance.random() < 0.9 else hostile(chance), chance)
        text = chance.choice((b"[" * 100_000, text[:-1], text + b"x")) if chance.random() < 0.1 else text
        arrays["about"] = np.frombuffer(text, np.uint8)
    else:
        for name in chance.sample(list(arrays), chance.choice((1, 1, 2))):
            arrays[name] = _array(arrays[name], chance)
    members = {}
    for name, values in arrays.items():
        stream = io.BytesIO()
        np.save(stream, np.asfortranarray(values) if chance.random() < 0.1 else values)
        members[f"{name}.npy"] = stream.getvalue()
    if chance.random() < 0.25:  # a header that says something else than the numbers below it
        name = chance.choice(list(members))
        kind, shape = chance.choice(samples.ARRAY_KINDS), chance.choice(samples.ARRAY_SHAPES)
        head = chance.choice((f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}", "{" * 90, "x"))
        head = head.ljust(117) + "\n"
        members[name] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + members[name][128:]
    for name in chance.sample(list(members), chance.choice((0, 0, 0, 0, 1))):
        members[chance.choice((f"{name}.npy", "../x", "q.npy"))] = members.pop(name)
    return {"s.npz": _zipped(members, chance)}


def _zipped(members: Files, chance: Chance) -> bytes:
    """A ZIP file, sometimes packed in another way."""
    stream = io.BytesIO()
    how = chance.choice((zipfile.ZIP_DEFLATED,) * 6 + (zipfile.ZIP_STORED, zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2))
    with zipfile.ZipFile(stream, "w", how) as packed:
        for name, data in members.items():
            packed.writestr(name, data)
    data = bytearray(stream.getvalue())
    if chance.random() < 0.15:  # sizes, flags, versions and offsets in its list of members
        data[data.find(b"PK\x01\x02") + chance.randrange(4, 46)] = chance.choice((0, 1, 8, 99, 255))
    return bytes(data)


def _read_sheets(file: Path, _: Chance) -> None:
    """What is read is a map, which answers, is told and is written."""
    task = samples.sheets()[0]
    sheets = hk.read_sheets(file, task)
    str(sheets)
    answers = sheets.batch(sheets.poses)
    T, q = sheets.poses[answers.served], answers.q[answers.served]
    if len(q) and not np.abs(task.error(q, T[:, :3, 3], T[:, :3, :3])).max() < 1e-6:
        raise ValueError("the tool is not at the pose")
    hk.analysis.sheets.write_sheets(sheets, file)


FORMATS: dict[str, tuple[Callable[[Chance], Files], Callable[[Path, Chance], object]]] = {
    "jobs": (_job, _do_job),
    "urdfs": (_urdf, _read_urdf),
    "mjcf_files": (_mjcf, _read_mjcf),
    "xacro_files": (_xacro, _read_xacro),
    "dh": (_dh, _read_dh),
    "drawings": (_drawing, _read_drawing),
    "csv_logs": (_csv, _audit_log),
    "bags": (_bag, _audit_log),
    "datasets": (_dataset, _read_dataset),
    "survey_files": (_survey, lambda file, _: read_survey(file)),
    "survey_results": (_survey_results, _read_results),
    "certificate_files": (_certificate, lambda file, _: recheck(file)),
    "sheets_files": (_sheets, _read_sheets),
}
"""Kind -> (what spoils the files of one, what reads the first of them, or the folder that they are in)."""


def attempt(kind: str, seed: int, folder: Path) -> None:
    """The mutant of a seed: written and read."""
    spoil, read = FORMATS[kind]
    chance = random.Random(seed)
    files = spoil(chance)
    for name, data in files.items():
        with suppress(OSError):  # a name too long for the disk: holokin has to say so
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)
    first = next(iter(files), "d/")
    read(folder / (first.partition("/")[0] if "/" in first else first), chance)
