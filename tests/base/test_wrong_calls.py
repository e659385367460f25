"""Wrong forms of calls, and names that a noun does not have: the message has the right form."""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from benchmarks.fuzz import calls, harness

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin import export, motion
from holokin import robot as robots
from holokin.base.arguments import MAKERS
from holokin.base.errors import FORMS, ArgumentError, CallError, NoAttributeError
from holokin.base.types import Shown
from public_nouns import public_classes, rooms

FUNCTIONS = {
    f"{room.__name__}.{name}": one
    for room in rooms()
    for name in room.__all__
    if inspect.isfunction(one := getattr(room, name)) and (room is hk or hasattr(one, "__wrapped__"))
}
NOUNS = {
    name: one
    for name, one in public_classes().items()
    if issubclass(one, Shown) and not issubclass(one, Enum) and not inspect.isabstract(one)
}


def _wrong(function: Callable[..., Any], draw: np.random.Generator) -> tuple[list[object], dict[str, object]]:
    """Arguments of the wrong number, or one of a name that is not there; of kinds that nobody looks at."""
    known = inspect.signature(function).parameters.values()
    kinds = inspect.Parameter
    places = [one for one in known if one.kind in (kinds.POSITIONAL_ONLY, kinds.POSITIONAL_OR_KEYWORD)]
    needed = [
        one for one in known if one.default is kinds.empty and one.kind not in (kinds.VAR_POSITIONAL, kinds.VAR_KEYWORD)
    ]
    ways = ["name", *["many"] * all(one.kind is not kinds.VAR_POSITIONAL for one in known), *["few"] * bool(needed)]
    way = ways[draw.integers(len(ways))]
    if way == "few":
        return [], {}
    return [None] * (len(places) + int(draw.integers(1, 4))) if way == "many" else [], {
        "no_such_word": 1
    } if way == "name" else {}


@sampled(40, "name", list(FUNCTIONS))
def test_a_call_of_the_wrong_form_is_refused_with_the_right_one(name: str) -> None:
    function = FUNCTIONS[name]
    draw = np.random.default_rng(len(name))
    for _ in range(4):
        arguments, named = _wrong(function, draw)
        with pytest.raises(hk.HolokinError) as told:
            function(*arguments, **named)
        if isinstance(told.value, CallError):  # or a kind was wrong, which is said first
            assert isinstance(told.value, TypeError)
            assert f"; call it as {function.__qualname__}(" in str(told.value)
            assert all(word in told.value.cure for word in inspect.signature(function).parameters)
        else:
            assert arguments, told.value


def test_a_type_error_of_a_function_of_the_users_own_stays_what_it_is(planar_3r: hk.Robot) -> None:
    with pytest.raises(hk.HolokinError) as told:
        hk.holonomic(hk.position(planar_3r), hk.custom(lambda q: q[0] + "1", rows=1))
    assert not isinstance(told.value, CallError)


def _misspelt(name: str, draw: np.random.Generator) -> str:
    """A name with one letter more, fewer, doubled or exchanged with the next."""
    i = int(draw.integers(1, len(name) - 1))
    return str(draw.choice([name[:i] + name[i + 1 :], name[:i] + name[i] + name[i:], name[:i] + "x" + name[i:],
                            name[:i] + name[i + 1] + name[i] + name[i + 2 :]]))  # fmt: skip


def test_a_misspelt_name_of_the_package_is_answered_with_the_right_one() -> None:
    draw = np.random.default_rng(7)
    answered = 0
    for name in draw.choice([name for name in hk.__all__ if len(name) > 4], 20):
        word = _misspelt(str(name), draw)
        if word in hk.__all__:
            continue
        with pytest.raises(AttributeError) as told:
            getattr(hk, word)
        assert isinstance(told.value, NoAttributeError)
        near = re.search(r"did you mean '(\w+)'", str(told.value))
        assert near and near[1] in hk.__all__, told.value
        answered += near[1] == name
        assert not hasattr(hk, word)
    assert answered > 15


def test_the_package_has_few_names_and_says_in_which_folder_the_others_are() -> None:
    assert len(hk.__all__) <= 70
    told = 0
    for room in rooms()[1:]:
        place = room.__name__.removeprefix("holokin.")
        for name in set(room.__all__) - set(hk.__all__):
            if place in hk._ROOMS and inspect.isfunction(getattr(room, name)):
                with pytest.raises(NoAttributeError, match=re.escape(f"write hk.{place}.{name}") + "$|write robot"):
                    getattr(hk, name)
                told += 1
    assert told > 80


def test_a_folder_is_loaded_when_it_is_first_asked_for() -> None:
    """In a process of its own: nothing imported the folders below `analysis` before."""
    code = """
import sys, holokin as hk
assert "holokin.analysis.design" not in sys.modules
print(hk.analysis.curvature.ball.__name__, "holokin.analysis.design" in sys.modules)
print(hk.motion.checks.CheckReport.__name__, hk.strategies.tasks.relative_pose.__name__, hasattr(hk.analysis, "pose"))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["ball", "False", "CheckReport", "relative_pose", "False"]


def test_a_noun_says_what_to_write_for_the_names_of_other_libraries() -> None:
    """Unless it has something of the name; `hasattr` says no, and a console does not offer it."""
    told = 0
    for kind in NOUNS.values():
        one = object.__new__(kind)
        offered = set(dir(one))
        own = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
        own |= {name for parent in kind.__mro__ if parent is not Shown for name in vars(parent)}
        for form, names in FORMS.items():
            for name in set(names.split()) - own:
                assert not hasattr(one, name) and name not in offered
                with pytest.raises(NoAttributeError, match=re.escape(f"has no {name!r}; write {form}")):
                    getattr(one, name)
                told += 1
    assert told > 20 * len(NOUNS)


@pytest.mark.parametrize("form", FORMS)
def test_the_forms_that_messages_give_are_there(form: str, panda: hk.Robot) -> None:
    for owner, name in re.findall(r"\b(hk|robot)\.(\w+)\(", form):
        assert callable(getattr({"hk": hk, "robot": panda}[owner], name))
    for word in FORMS[form].split():
        if word not in hk.__all__:
            with pytest.raises(NoAttributeError, match=re.escape(f"write {form}")):
                getattr(hk, word)


@pytest.mark.parametrize("kind", MAKERS)
def test_what_messages_say_makes_a_noun_makes_it(kind: str) -> None:
    function = getattr(hk, MAKERS[kind].removeprefix("hk.").partition("(")[0])
    made = get_type_hints(inspect.unwrap(function))["return"]
    assert kind in [parent.__name__ for one in get_args(made) or (made,) for parent in one.__mro__]


def test_the_usual_slips_are_answered_with_the_right_form(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    law = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))
    start = panda.pose(PANDA_START)[:3, 3]
    circle = hk.circle(start, center=start - [0.1, 0, 0])
    slips: dict[str, Callable[[], object]] = {
        "write robot.pose(q)": lambda: panda.fk(PANDA_START),  # type: ignore[attr-defined]
        "write hk.load('panda')": lambda: hk.Panda,  # type: ignore[attr-defined]
        "write hk.follow(strategy, path, q0)": lambda: hk.run(law, circle, PANDA_START),  # type: ignore[attr-defined]
        "task is not given; say what the tool must do, as hk.pose(robot)": lambda: hk.audit(lambda q, T, v, dt: q),
        "control_law, task=None, path=None, q0=None, dt=": lambda: hk.audit(law, task, circle, PANDA_START, 0.01),  # type: ignore[call-arg]
        "give a Task, as hk.pose(robot) makes it": lambda: hk.moore_penrose(panda),  # type: ignore[arg-type]
        "hk.retime(trajectory, acceleration=5.0)": lambda: hk.retime(hk.follow(law, circle, PANDA_START, samples=9)),
        "call the function, arm_angle(...)": lambda: hk.holonomic(task, hk.arm_angle),  # type: ignore[arg-type]
        "call it as arm_angle(definition=": lambda: hk.arm_angle(panda),  # type: ignore[call-arg]
        "call it as check(motion, scene=hk.Scene(obstacles=[...]), ": lambda: hk.check(circle, obstacles=[]),  # type: ignore[call-arg]
        "call it as workspace(box=None, ": lambda: hk.workspace([0.5, 0, 0.4]),  # type: ignore[call-arg]
        "where as hk.circle(start, center) or hk.workspace(box=(center, half)) makes it": lambda: hk.certify(
            law,
            box=(start, 0.1),  # type: ignore[call-arg]
        ),
    }
    for words, slip in slips.items():
        with pytest.raises((ArgumentError, CallError, NoAttributeError), match=re.escape(words)):
            slip()


def _named(kind: str, names: Sequence[str], q: np.ndarray) -> Any:
    if kind == "dict":
        return dict(zip(names, q, strict=True))
    pandas = pytest.importorskip("pandas")
    return pandas.Series(q, index=list(names)) if kind == "row" else pandas.DataFrame([q], columns=list(names)).iloc[0]


@pytest.mark.parametrize("kind", ["dict", "row", "line"])
@sampled(1, "seed", range(4))
def test_joints_by_their_names_are_read_by_them_at_every_door(kind: str, seed: int, panda: hk.Robot) -> None:
    """In whatever order, beside whatever else; where one is missing it is named."""
    draw = np.random.default_rng(seed)
    task = hk.pose(panda)
    law = hk.holonomic(task, hk.linear([1, 0, -1, 0, 0, 0, 0]))
    q = PANDA_START + draw.uniform(-0.1, 0.1, 7)
    order = draw.permutation(8)
    names = [[*panda.joint_names, "finger"][i] for i in order]
    given = _named(kind, names, np.append(q, 0.04)[order])
    T, twist = panda.pose(q), draw.normal(size=6) * 0.01
    doors: dict[str, Callable[[Any], object]] = {
        "pose": panda.pose, "jacobian": panda.jacobian, "within": panda.within, "task": task, "J": task.jacobian,
        "error": lambda q: task.error(q, T[:3, 3], T[:3, :3]), "law": law, "g": law.g,
        "inverse": lambda q: hk.ik(law, q)(T),
        "step": lambda q: hk.controller(law, dt=0.01, q0=q).step(q, T, twist),
        "follow": lambda q: hk.follow(law, hk.line(T[:3, 3], T[:3, 3] + 0.01), q, samples=3).q,
    }  # fmt: skip
    for name, door in doors.items():
        assert np.array_equal(door(given), door(q)), name
    lacking = _named(kind, names, np.append(q, 0.04)[order])
    del lacking["panda_joint5"]
    for door in doors.values():
        with pytest.raises(ArgumentError, match="lacks panda_joint5"):
            door(lacking)


def test_many_postures_by_names_are_put_in_order(panda: hk.Robot) -> None:
    pandas = pytest.importorskip("pandas")
    Q = PANDA_START + np.random.default_rng(0).uniform(-0.1, 0.1, (5, 7))
    table = pandas.DataFrame(Q, columns=list(panda.joint_names))[list(panda.joint_names[::-1])]
    assert np.array_equal(panda.postures(table), Q)
    with pytest.raises(hk.HolokinError, match=r"put in order by robot.postures\(Q\)"):
        panda.pose(table)


# --- Bad calls of the whole public surface end in a `HolokinError` or not at all.


@pytest.mark.campaign
def test_every_public_function_and_method_takes_its_good_arguments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So that a bad one among them is what a call meets."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # one call of each takes less time than a compiler
    assert calls.unreached(tmp_path) == {}
    assert len(calls.callables()) > 300


@pytest.mark.parametrize("count", [20, campaign("count", 3000)])
def test_of_many_bad_calls_none_ends_in_a_stranger_s_exception(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    found = [harness.one("calls", seed) for seed in range(count)]
    assert [(seed, calls.mutant(seed)[0], fault) for seed, _, _, fault in found if fault] == []
    assert sum(refused for _, refused, _, _ in found) > 0.6 * count


@pytest.mark.parametrize("rows", [[0.5], 0.5, [True], ["0"], [0, 1.0]])
def test_a_half_is_no_row_of_a_task(planar_3r: hk.Robot, rows: object) -> None:
    with pytest.raises(ArgumentError, match="rows is"):
        hk.position(planar_3r, rows=rows)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError):
        hk.position(planar_3r)[rows]  # type: ignore[index]


def test_numbers_as_text_and_nothing_as_nan_are_no_numbers(planar_3r: hk.Robot) -> None:
    law = hk.moore_penrose(hk.position(planar_3r))
    for q in (["0.1", "0.2", "0.3"], [None, None, None], [1j, 0, 0], [10**400, 0, 0], [[0.1], [0.2, 0.3]]):
        with pytest.raises(ArgumentError, match="q is"):
            law(q)


def test_the_message_names_argument_and_kind(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    with pytest.raises(ArgumentError, match=r"strategy is Task\(.*; give a strategy with leaves"):
        hk.motion.ik.move_to_leaf(task, [0.1, 0.2, 0.3])  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="limits is 'no'; give True or False"):
        hk.follow(hk.moore_penrose(task), hk.line([0, 0], [1, 0]), [0.1, 0.2, 0.3], limits="no")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="joints is not given"):
        hk.lock(None)  # type: ignore[arg-type]


def test_a_call_that_takes_too_long_is_stopped_whatever_it_catches_and_ctrl_c_is_python_s_again() -> None:
    """By no signal that Windows lacks."""
    before, begin = signal.getsignal(signal.SIGINT), time.perf_counter()
    with pytest.raises(harness.TooLongError), harness.limited(0.05):
        while True:
            with contextlib.suppress(Exception):
                sum(range(100))
    assert time.perf_counter() - begin < 5
    with harness.limited(5.0):
        pass
    assert signal.getsignal(signal.SIGINT) is before
    with pytest.raises(KeyboardInterrupt), harness.limited(5.0):
        signal.raise_signal(signal.SIGINT)


# --- Words that are misspelt: each call below is an error of types, and an error that names the words when it is run.


ROBOT = hk.load("planar-3r")
TASK = hk.position(ROBOT)
Q0 = np.array([0.3, 0.6, 0.5])
START = ROBOT.pose(Q0)[:3, 3]
LINE = hk.line(START, START - [0.05, 0.0, 0.0])
LAW = hk.holonomic(TASK, hk.lock(2))
SPACE = hk.workspace(box=(START[:2], [0.1, 0.1]))


def walk() -> hk.Trajectory:
    return hk.follow(LAW, LINE, Q0, samples=20)


def timed() -> motion.TimedTrajectory:
    return hk.retime(walk(), acceleration=4.0)


TYPOS: dict[str, Callable[[], object]] = {
    "orientation of a pose": lambda: hk.pose(ROBOT, orientation="twits"),  # pyright: ignore[reportArgumentType]
    "orientation of a coupling": lambda: hk.coupled(1.0, "zxz"),  # pyright: ignore[reportArgumentType]
    "convention": lambda: hk.from_dh([{"a": 1.0}], convention="modifed"),  # pyright: ignore[reportArgumentType]
    "kind of a row": lambda: hk.from_dh([robots.DHRow(a=1.0, kind="hinge")]),  # pyright: ignore[reportArgumentType]
    "definition": lambda: hk.arm_angle(definition="usual"),  # pyright: ignore[reportArgumentType]
    "method of follow": lambda: hk.follow(LAW, LINE, Q0, method="leave"),  # pyright: ignore
    "method of two paths": lambda: hk.motion.path_spread(LAW, LINE, LINE, Q0, method="leafs"),  # pyright: ignore[reportArgumentType]
    "method of curvature": lambda: hk.curvature(LAW, Q0, method="hesian"),  # pyright: ignore[reportArgumentType]
    "objective": lambda: hk.design(TASK, SPACE, Q0, objective="worst_sped"),  # pyright: ignore[reportArgumentType]
    "profile": lambda: hk.retime(walk(), profile="trapezoid"),  # pyright: ignore[reportArgumentType]
    "by of excess": lambda: timed().excess("differences"),  # pyright: ignore[reportArgumentType]
    "by of approach": lambda: hk.motion.approach(LAW, LINE, Q0, by="hand"),  # pyright: ignore[reportArgumentType]
    "format": lambda: export.to_ros(timed(), format="yml"),  # pyright: ignore[reportArgumentType]
    "servo": lambda: robots.servo(ROBOT, "torques", Q0),  # pyright: ignore[reportArgumentType]
}


@pytest.mark.parametrize("name", TYPOS)
def test_a_word_that_is_misspelt_is_refused_when_it_is_run(name: str) -> None:
    """In words, which name what was given."""
    with pytest.raises(hk.HolokinError, match=r"twits|zxz|modifed|hinge|usual|leave|leafs|hesian|sped|"
                       "trapezoid|differences|hand|yml|torques"):  # fmt: skip
        TYPOS[name]()


@pytest.mark.campaign
@pytest.mark.skipif(find_spec("pyright") is None, reason="no pyright here")
def test_a_word_that_is_misspelt_is_an_error_of_types(tmp_path: Path) -> None:
    """Each of them, and nothing else in this file: as an editor shows it, without the comments that expect it."""
    text = Path(__file__).read_text("utf-8")
    lines = text.partition("@pytest")[0].splitlines()
    (tmp_path / "typos.py").write_text("\n".join(line.partition("  # pyright")[0] for line in lines), "utf-8")
    command = [sys.executable, "-m", "pyright", "--outputjson", "--pythonpath", sys.executable, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    errors = [e for e in json.loads(done.stdout)["generalDiagnostics"] if e["severity"] == "error"]
    places = {e["range"]["start"]["line"] for e in errors}
    expected = {i for i, line in enumerate(lines) if line.lstrip().startswith('"') and "lambda:" in line}
    assert places == expected


# --- The version stands in one place; a checkout says its commit, too.


ROOT = Path(__file__).parents[2]
PACKAGE = Path(hk.__file__).parent


def _checkout(folder: Path) -> Path:
    """A repository with the package's version file as this one has it, and a commit."""
    for name in ("src/holokin/version.py", "pyproject.toml"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text((ROOT / name).read_text("utf-8"), "utf-8")
    for words in (["init", "-q"], ["add", "-A"], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "one"]):
        subprocess.run(["git", "-C", str(folder), *words], check=True, capture_output=True)
    return folder / "src" / "holokin" / "version.py"


def _said(version: Path, **environment: str) -> str:
    code = f"import runpy; print(runpy.run_path({str(version)!r})['build']())"
    asked = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | environment
    )
    return asked.stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="there is no git")
def test_a_checkout_says_its_commit_and_an_environment_in_a_strangers_repository_does_not(tmp_path: Path) -> None:
    version = _checkout(tmp_path / "own")
    commit = subprocess.run(
        ["git", "-C", str(tmp_path / "own"), "rev-parse", "--short=12", "HEAD"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    assert _said(version) == f"{hk.__version__} (commit {commit})"
    (tmp_path / "own" / "pyproject.toml").write_text("# changed", "utf-8")
    assert _said(version) == f"{hk.__version__} (commit {commit}+changes)"
    assert _said(version, PATH=str(tmp_path)) == hk.__version__, "without git"
    _checkout(tmp_path / "theirs")
    inside = tmp_path / "theirs" / "venv" / "lib" / "site-packages" / "holokin" / "version.py"
    inside.parent.mkdir(parents=True)
    inside.write_text((PACKAGE / "version.py").read_text("utf-8"), "utf-8")
    assert _said(inside) == hk.__version__


def test_a_task_in_the_place_of_a_strategy_says_what_makes_one_where_a_joint_is_redundant_and_where_none_is():
    for robot, maker in ((hk.load("panda"), "hk.holonomic(task, constraint)"), (hk.load("ur5e"), "hk.moore_penrose")):
        with pytest.raises(ArgumentError, match=re.escape(maker)):
            hk.ik(hk.pose(robot), np.zeros(robot.n))  # type: ignore[arg-type]
