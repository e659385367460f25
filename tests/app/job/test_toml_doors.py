"""TOML as people write it: every door that takes a file reads it with one reader, which names what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.app.job import is_job, open_job, robot_of_file
from holokin.app.job.advice_job import question
from holokin.app.job.strategy_tables import leaf_of_words
from holokin.app.studio import open_session
from holokin.base.errors import HolokinError

DOORS: dict[str, Callable[[str], object]] = {
    "load": hk.load,
    "robots": robot_of_file,
    "run": open_job,
    "studio": open_session,
    "advise": question,
}


def _nested(depth: int, draw: np.random.Generator) -> str:
    if draw.random() < 0.5:
        return f"a = {'[' * depth}{']' * depth}\n"
    return f"a = {'{b = ' * depth}1{'}' * depth}\n"


@pytest.mark.parametrize("door", DOORS)
def test_tables_nested_however_deep_are_refused_in_a_sentence(door: str, tmp_path: Path) -> None:
    draw = np.random.default_rng(3)
    file = tmp_path / "deep.toml"
    for depth in (17, *np.exp(draw.uniform(np.log(18), np.log(20_000), 3)).astype(int)):
        for head in ("", '[robot]\nname = "panda"\n'):
            file.write_text(head + _nested(int(depth), draw))
            with pytest.raises(HolokinError, match="deeper than 16 levels"):
                DOORS[door](str(file))


@pytest.mark.parametrize("door", DOORS)
def test_a_windows_path_in_double_quotes_is_told_how_to_write_it(door: str, tmp_path: Path) -> None:
    """TOML takes some of its backslashes for other characters, the rest for mistakes."""
    draw = np.random.default_rng(5)
    file = tmp_path / "windows.toml"
    for _ in range(6):
        parts = draw.choice(["Users", "arm", "data", "me", "home", "xarm", "Ulm", "u2", "dir"], 3)
        file.write_text('[robot]\nname = "' + "\\".join(["C:", *parts, "m.urdf"]) + '"\n')
        with pytest.raises(HolokinError, match=r"write paths in single quotes, 'C:\\Users\\me', or with /"):
            DOORS[door](str(file))


def test_a_path_of_which_toml_made_control_characters_is_told_so(tmp_path: Path) -> None:
    for name in (r"C:\robots.urdf", r"C:\tools.toml", r"D:\new.xml", r"D:\fanuc.urdf"):
        (tmp_path / "job.toml").write_text(
            open_job("panda-circle")[2].read_text("utf-8").replace('"panda"', f'"{name}"')
        )
        with pytest.raises(HolokinError, match="control characters"):
            robot_of_file(str(tmp_path / "job.toml"))


def test_a_byte_order_mark_changes_nothing(tmp_path: Path) -> None:
    with_mark = tmp_path / "marked.toml"
    _, job, file = open_job("panda-circle")
    with_mark.write_text(file.read_text("utf-8"), "utf-8-sig")
    assert with_mark.read_bytes()[:3] == b"\xef\xbb\xbf"
    assert is_job(str(with_mark)) and open_job(str(with_mark))[1] == job
    for door in ("robots", "studio", "advise"):
        assert DOORS[door](str(with_mark))


def test_a_strategy_that_is_typed_with_nested_lists_is_refused(planar_3r: hk.Robot) -> None:
    for depth in (20, 3000):
        with pytest.raises(HolokinError, match="deeper than 16 levels"):
            leaf_of_words(f"lock joints={'[' * depth}{']' * depth}", hk.position(planar_3r), np.zeros(3))
