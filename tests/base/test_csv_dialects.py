"""Tables of numbers as programs of all countries write them: comments, decimal commas, semicolons and tabs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.base.errors import RecordingError

ARM = hk.load("planar-3r")
COMMENTS = ("# exported by CAM", "# units: mm", "#", "# 12.5.2026, 10:30; part 7, rev. 2.1", "")


def _text(
    draw: np.random.Generator, header: list[str], rows: np.ndarray, mark: str, point: str
) -> tuple[str, list[int]]:
    """A table with comments at random places, and the line of each row."""
    lines = [str(c) for c in draw.choice(COMMENTS, draw.integers(0, 4))]
    lines.append(draw.choice(["", "#"]) + mark.join(header) if lines and rows.size else mark.join(header))
    places = []
    for row in rows:
        if draw.random() < 0.2:
            lines.append(str(draw.choice(COMMENTS)))
        lines.append(mark.join(f"{v:.{draw.integers(3, 7)}f}".replace(".", point) for v in row))
        places.append(len(lines))
    return "\n".join(lines) + "\n", places


def _case(seed: int) -> tuple[np.random.Generator, str, str]:
    draw = np.random.default_rng(seed)
    mark = str(draw.choice([",", ";", "\t"]))
    return draw, mark, "." if mark == "," else str(draw.choice([",", "."]))


@sampled(12, "seed", list(range(200)))
def test_waypoints_and_logs_are_read_in_every_dialect(seed: int, tmp_path: Path) -> None:
    draw, mark, point = _case(seed)
    rows = np.round(draw.uniform(-900, 900, (draw.integers(2, 30), 3)), 3)
    file = tmp_path / "table.csv"
    file.write_text(
        _text(draw, ["X [mm]", "Y [mm]", "Z [mm]"], rows, mark, point)[0], draw.choice(["utf-8", "utf-8-sig"])
    )
    assert np.abs(hk.path.read_waypoints(file).points - rows / 1e3).max() < 1e-12
    q = np.round(draw.uniform(-1, 1, (40, 3)), 3)
    t = np.round(0.01 * np.arange(40), 3)
    file.write_text(_text(draw, ["t", *ARM.joint_names], np.c_[t, q], mark, point)[0])
    log = hk.read_recording(file, ARM)
    assert np.abs(log.q - q).max() < 1e-12 and np.abs(log.t - t).max() < 1e-12


@sampled(8, "seed", list(range(60)))
def test_a_table_with_both_decimal_marks_is_refused_with_both_lines(seed: int, tmp_path: Path) -> None:
    """1,234 beside 0.5 is a thousand and more, or 1.234: nobody can tell."""
    draw, _, _ = _case(seed)
    mark = str(draw.choice([";", "\t"]))
    rows = draw.uniform(100, 900, (12, 3))
    text, places = _text(draw, ["x_mm", "y_mm", "z_mm"], rows, mark, ",")
    i = int(draw.integers(1, 12))
    lines = text.split("\n")
    lines[places[i] - 1] = lines[places[i] - 1].replace(",", ".")
    (tmp_path / "mixed.csv").write_text("\n".join(lines))
    with pytest.raises(
        RecordingError, match=f"line {places[0]} has a decimal comma, line {places[i]} a decimal point; "
    ):
        hk.path.read_waypoints(tmp_path / "mixed.csv")


@sampled(6, "seed", list(range(60)))
def test_a_bad_cell_below_comments_is_named_by_its_line(seed: int, tmp_path: Path) -> None:
    draw, mark, point = _case(seed)
    rows = draw.uniform(100, 900, (12, 3))
    text, places = _text(draw, ["x_mm", "y_mm", "z_mm"], rows, mark, point)
    i = int(draw.integers(0, 12))
    lines = text.split("\n")
    lines[places[i] - 1] = mark.join(["1", "two", "3"])
    (tmp_path / "bad.csv").write_text("\n".join(lines))
    with pytest.raises(RecordingError, match=f"line {places[i]}, column 'y_mm' holds 'two'"):
        hk.path.read_waypoints(tmp_path / "bad.csv")


def test_a_row_whose_name_begins_with_a_number_sign_is_a_row(tmp_path: Path) -> None:
    (tmp_path / "named.csv").write_text("point,x_mm,y_mm,z_mm\n#1,1,2,3\n# the second one\n#2,4,5,6\n")
    assert np.allclose(
        hk.path.read_waypoints(tmp_path / "named.csv").points, [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]]
    )


def test_comments_over_numbers_alone_are_no_header(tmp_path: Path) -> None:
    (tmp_path / "bare.csv").write_text("# exported by CAM\n\n1;2;3\n4;5;6\n")
    with pytest.raises(RecordingError, match="line 3 holds numbers, no header; name the columns"):
        hk.path.read_waypoints(tmp_path / "bare.csv")


@pytest.mark.parametrize("point", [",", "."])
def test_a_log_without_a_header_may_have_decimal_commas(point: str, tmp_path: Path) -> None:
    t, q = 0.01 * np.arange(40), np.round(np.random.default_rng(1).uniform(-1, 1, (40, 3)), 3)
    lines = [";".join(f"{v:.3f}".replace(".", point) for v in row) for row in np.c_[t, q]]
    (tmp_path / "bare.csv").write_text("\n".join(lines) + "\n")
    assert np.abs(hk.read_recording(tmp_path / "bare.csv", ARM).q - q).max() < 1e-12


def test_a_semicolon_in_a_name_ends_no_cell(tmp_path: Path) -> None:
    (tmp_path / "named.csv").write_text("x_mm,y_mm,z_mm,note;s\n1,2,3,a;b\n4.5,5,6,c\n")
    assert np.allclose(
        hk.path.read_waypoints(tmp_path / "named.csv", ignore=["note*"]).points[1], [0.0045, 0.005, 0.006]
    )
