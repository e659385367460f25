"""Every command that takes a robot takes a job, too; and all that is said of a job is in its units."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

import holokin as hk
from conftest import Command, sampled
from holokin.app.cli.main import app
from holokin.app.job import robot_of_file

CHAIN = {"--tip": ["hand"], "--base": ["foot"], "--trust-units": []}
"""Options that a job says itself, and what is typed behind them."""


JOB = """title = "a circle"
[robot]
name = "%s"
[start]
q = %s
[path]
kind = "circle"
center = [0.1, 0, 0]
relative = true
samples = 30
[checks]
floor = -0.2
[workspace]
kind = "box"
center = [0.4, 0, 0.4]
half = [0.05, 0.05, 0.05]
samples = 16
[sheets]
samples = 8
seconds = 1
[strategies.one]
"""


def leaves(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """(words, command) of each command that is none of commands."""
    if hasattr(command, "commands"):
        for name, part in command.commands.items():
            yield from leaves(part, (*words, name))
    else:
        yield words, command


def of_robot(command: Any) -> Any:
    """The parameter that takes a robot; None of a command that takes none."""
    return next((given for given in command.params if "ROBOT" in (given.metavar or "")), None)


TAKING = {" ".join(words): command for words, command in leaves(get_command(app)) if of_robot(command) is not None}


def typed(name: str, job: str, folder: Path) -> list[str]:
    """The words of a command with a job for its robot, and something for all else that it needs."""
    words = name.split()
    for given in TAKING[name].params:
        is_robot = given is of_robot(TAKING[name])
        if is_robot or given.required:
            value = job if is_robot else str(folder / "new.toml" if name == "new" else folder / "there.csv")
            words += [value] if given.param_type_name == "argument" else [given.opts[0], value]
    return words


def test_the_family_is_as_large_as_it_was() -> None:
    assert TAKING.keys() >= {
        *("new", "robots", "audit", "retarget", "advise", "sheets", "certify", "check", "studio"),
        *("export web", "check-certificate"),
    }


def test_what_takes_the_options_of_a_chain_takes_a_robot() -> None:
    for words, command in leaves(get_command(app)):
        known = {word for given in command.params for word in given.opts}
        assert (known >= CHAIN.keys()) if " ".join(words) in TAKING else not (known & CHAIN.keys()), words


@pytest.mark.parametrize("name", TAKING)
def test_a_job_says_its_chain_itself(holokin: Command, tmp_path: Path, name: str) -> None:
    for option, value in CHAIN.items():
        done = holokin(*typed(name, "panda-circle", tmp_path), option, *value)
        assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
        assert f"{option} beside a job" in done.err and "write it into panda-circle" in done.err


@pytest.mark.parametrize("name", TAKING)
def test_a_job_stands_for_its_robot(holokin: Command, tmp_path: Path, name: str) -> None:
    """Of a job whose robot is in no catalogue each command speaks of this robot."""
    text = (JOB % ("pandaa", "[0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]")) + 'kind = "moore-penrose"\n'
    (tmp_path / "job.toml").write_text(text, "utf-8")
    done = holokin(*typed(name, str(tmp_path / "job.toml"), tmp_path))
    assert done.code == 2 and done.err.count("\n") == 1 and "pandaa" in done.err and "no file" not in done.err


def test_a_new_job_has_the_robot_of_another_one_in_another_folder(holokin: Command, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    arm = Path(__file__).parents[3] / "docs" / "arm7.urdf"
    (tmp_path / "a" / "arm.urdf").write_text(arm.read_text("utf-8"), "utf-8")
    robot = '"arm.urdf"\nbase_pose = { xyz = [0.5, 0, 0.2], rpy_deg = [0, 0, 90] }'
    text = (JOB % ("panda", "[0, 0.3, 0, 1.2, 0, 0.8, 0]")).replace('"panda"', robot) + 'kind = "moore-penrose"\n'
    (tmp_path / "a" / "job.toml").write_text(text, "utf-8")
    done = holokin("new", tmp_path / "b" / "new.toml", "--robot", tmp_path / "a" / "job.toml")
    assert done.code == 0, done.err
    written = tomllib.loads((tmp_path / "b" / "new.toml").read_text("utf-8"))
    assert written["robot"]["name"] == "../a/arm.urdf"
    q = np.linspace(-0.5, 0.7, 7)
    poses = [robot_of_file(str(tmp_path / file)).pose(q) for file in ("a/job.toml", "b/new.toml")]
    assert np.array_equal(*poses) and np.abs(poses[0] - hk.load(arm).pose(q)).max() > 0.1


# --- All that is printed of a job is in its units: on stdout and stderr, tables, sentences and refusals.

PANDA = "[0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]"
LOCK = 'kind = "lock"\njoints = ["panda_joint3"]\n'
SPOILT = {
    "": [],
    "path out of reach": [("center = [0.1, 0, 0]", "center = [1.5, 0, 0]")],
    "path in mm": [("center = [0.1, 0, 0]", "center = [100, 0, 0]")],
    "start off the path": [("relative = true\n", "")],
    "start outside the limits": [("q = [0.1,", "q = [3.4,")],
    "start near a limit": [("q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7,", "q = [0.1, 0, 0, -0.0698, 0, 0,")],
    "workspace in mm": [("center = [0.4, 0, 0.4]", "center = [400, 0, 400]")],
    "workspace out of reach": [("center = [0.4, 0, 0.4]", "center = [1.4, 0, 0.4]")],
    "under the floor": [("floor = -0.2", "floor = 0.6\nclearance = 0.2")],
    "a wide clearance": [("floor = -0.2", "floor = 0\nclearance = 5")],
    "fast": [("samples = 30\n", "samples = 30\nspeed = 5\n[timing]\nacceleration = 5\n")],
    "a leaf that ends": [(LOCK, 'kind = "height"\njoints = ["panda_joint4"]\nlevel = 2.0\n')],
}
"""What is done to the job: it is refused, or done in part, or checked and found wanting."""

COMMANDS = (
    "run JOB --out out",
    "export gcode JOB --out program --acceleration 5 --anyway",
    "certify JOB --out out --check 0 --budget 60",
    "certify JOB --workspace --out out --check 0 --budget 60",
    "certify JOB --whole-arm --out out --check 0",
    "sheets JOB --out sheets.npz",
    "advise JOB --out advice.toml",
    "check log.csv --robot JOB --floor 0.4 --clearance 0.2",
    "audit log.csv --robot JOB",
    "robots JOB",
)
NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
LEFT = re.compile(r"[\d\])] (?:rad|m)(?:/s(?:\^[23])?)?(?![\w/^]| or )")
"""A number in rad or m; what is "m or rad" is neither."""

FACTORS = {"mm": 1e3, "deg": 180 / np.pi}


def said(holokin: Command, name: str, job: Path, units: str, monkeypatch: pytest.MonkeyPatch) -> tuple[object, str]:
    """(exit code, all that is printed) of a command in a folder of its own, about a job that asks for units."""
    folder = job.parent / ("shop" if units else "plain")
    folder.mkdir()
    (folder / "job.toml").write_text(units + job.read_text("utf-8"), "utf-8")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "4000")
    swing = np.sin(np.linspace(0, 4 * np.pi, 81))[:, None]
    q = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]) + 0.4 * swing * [1, 1, 0, 0.5, 0, 0, 0]
    rows = np.column_stack([np.linspace(0, 8, 81), q]).round(5).tolist()
    header = ",".join(["t", *(f"panda_joint{i}" for i in range(1, 8))])
    (folder / "log.csv").write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]), "utf-8")
    done = holokin(*("job.toml" if word == "JOB" else word for word in name.split()))
    text = re.sub(r"[\d.]+ s\b|cycle 1|after [\d.]+ s", "", done.out + done.err)  # what takes time
    return done.code, text.translate(str.maketrans("┏┓┗┛┡┩╇┳┴━─┃│┌┐└┘├┤┬┼╞╡", " " * 23))


ALONE = ("audit", "robots")
"""Commands that do not look at what is spoilt."""

CASES = [(name, spoilt) for name in COMMANDS for spoilt in SPOILT if not spoilt or not name.startswith(ALONE)]


@sampled(6, ("name", "spoilt"), CASES)
@pytest.mark.usefixtures("sketched")
def test_nothing_that_is_printed_of_a_job_in_mm_and_degrees_is_in_m_or_rad(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, spoilt: str
) -> None:
    """Each number is that of the same job in m and rad, times 1000 or 180 / pi where it is in mm or degrees."""
    text = JOB % ("panda", PANDA) + LOCK
    for old, new in SPOILT[spoilt]:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "any.toml").write_text(text, "utf-8")
    code, plain = said(holokin, name, tmp_path / "any.toml", "", monkeypatch)
    same, shop = said(holokin, name, tmp_path / "any.toml", 'units = "degrees, mm"\n', monkeypatch)
    assert same == code and not LEFT.findall(shop), [shop[m.start() - 60 : m.end()] for m in LEFT.finditer(shop)]
    # What is said in rad and in degrees is said once.
    plain = re.sub(rf"{NUMBER}(?: to {NUMBER})? rad(?:/s)? \(([^()]*)\)", r"\1", plain)
    before, after = (re.findall(NUMBER, part) for part in (plain, shop))
    assert len(before) == len(after)
    places = [match.end() for match in re.finditer(NUMBER, shop)]
    for old, new, end in zip(before, after, places, strict=True):
        unit = re.match(r" (mm|deg)\b", shop[end:])
        factors = [FACTORS[unit[1]]] if unit else [1.0, *FACTORS.values()]  # in a list, or below its heading
        wanted = np.array([float(old) * factor for factor in factors])
        context = shop[end - 60 : end + 9]
        assert old == new or (np.abs(wanted - float(new)) <= 1e-2 * np.abs(wanted) + 1e-12).any(), (old, context)
