"""Waypoints from CSV and outlines from SVG: what is read, what is repaired and said, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ellipe

import holokin as hk
from conftest import sampled
from holokin.base.errors import ArgumentError, FileError

ROWS = np.array([[400, 0, 300], [450, 20, 300], [500, 0, 310]])
TURNS = Rotation.from_euler("xyz", [[180, 0, 0], [170, 5, 10], [160, 0, 20]], degrees=True)


def table(file: Path, header: str, *columns: np.ndarray) -> Path:
    rows = np.column_stack(columns)
    file.write_text(header + "\n" + "\n".join(",".join(f"{v:.17g}" for v in row) for row in rows) + "\n")
    return file


def forms() -> dict[str, tuple[str, list[np.ndarray], dict[str, str]]]:
    q, rpy = TURNS.as_quat(), TURNS.as_euler("xyz", degrees=True)
    return {
        "quaternion": ("x_mm,y_mm,z_mm,qx,qy,qz,qw", [ROWS, q], {}),
        "scalar first by name": ("qw,x [mm],y [mm],z [mm],qx,qy,qz", [q[:, 3:], ROWS, q[:, :3]], {}),
        "numbered": ("x,y,z,q1,q2,q3,q4", [ROWS, q[:, [3, 0, 1, 2]]], {"units": "mm", "order": "wxyz"}),
        "degrees": ("x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg", [ROWS / 1e3, rpy], {}),
        "radians": ("x,y,z,roll,pitch,yaw", [ROWS / 1e3, np.deg2rad(rpy)], {"units": "m", "angles": "rad"}),
        "rotation vector": ("X(mm),Y(mm),Z(mm),rx_rad,ry_rad,rz_rad", [ROWS, TURNS.as_rotvec()], {}),
    }


@pytest.mark.parametrize("seed", range(5))
def test_the_angles_of_kuka_turn_about_z_then_the_new_y_then_the_new_x(tmp_path: Path, seed: int) -> None:
    abc = np.random.default_rng(seed).uniform([-180, -90, -180], [180, 90, 180], (3, 3))
    Rz, Ry, Rx = (Rotation.from_euler(axis, abc[:, [i]], degrees=True).as_matrix() for i, axis in enumerate("zyx"))
    for header, said in (("X_mm,Y_mm,Z_mm,A_deg,B_deg,C_deg", {}), ("x,y,z,a,b,c", {"units": "mm", "angles": "deg"})):
        read = hk.read_paths(table(tmp_path / "w.csv", header, ROWS, abc), **said).paths[0]  # type: ignore[arg-type]
        assert read.rotations is not None
        assert np.abs(read.rotations - Rz @ Ry @ Rx).max() < 1e-14
        assert "KUKA's angles: a about z" in read.notes[0]
    same = table(tmp_path / "v.csv", "x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", ROWS, abc[:, ::-1])
    assert np.abs(hk.read_paths(same).paths[0].rotations - Rz @ Ry @ Rx).max() < 1e-14
    poses = hk.path.read_workspace(table(tmp_path / "w.csv", "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg", ROWS, abc)).poses(3)
    assert np.abs(poses[:, :3, :3] - Rz @ Ry @ Rx).max() < 1e-14


STRANGE = {
    "two of three angles": ("x_mm,y_mm,z_mm,a_deg,b_deg", "column 'a' alone is no orientation"),
    "angles by no name": (
        "x_mm,y_mm,z_mm,alpha_deg,beta_deg,gamma_deg",
        "its column 'alpha_deg' is neither a position",
    ),
    "two of three angles of FANUC": ("x_mm,y_mm,z_mm,w_deg,p_deg", "column 'w' alone is no orientation"),
    "a speed": (
        "x_mm,y_mm,z_mm,speed",
        r"its column 'speed' is neither .* leave it out on purpose with ignore=\['speed'\]",
    ),
    "status and turn": ("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,s", "its column 's' is neither"),
    "a misspelt quaternion": ("x_mm,y_mm,z_mm,quat_x,quat_y,quat_z,quat_w", "its column 'quat_x' is neither"),
    "joints": ("x_mm,y_mm,z_mm,joint_1", "its column 'joint_1' is neither"),
    "external axes": ("x_mm,y_mm,z_mm,e1", "its column 'e1' is neither"),
}


@pytest.mark.parametrize("name", STRANGE)
def test_a_column_that_is_not_understood_is_refused_by_name(tmp_path: Path, name: str) -> None:
    header, words = STRANGE[name]
    many = header.count(",") - 2
    file = table(tmp_path / "w.csv", header, ROWS, np.arange(1.0, 1 + 3 * many).reshape(3, -1))
    for read in (hk.read_paths, hk.path.read_workspace):
        with pytest.raises(FileError, match=words):
            read(file)
    named = header.split(",")[3:]
    assert hk.read_paths(file, ignore=named).paths[0].rotations is None
    assert hk.path.read_workspace(file, ignore=[name.upper() for name in named]).size == 3


def test_remarks_are_passed_over_and_what_is_left_out_must_be_there(tmp_path: Path) -> None:
    file = tmp_path / "w.csv"
    file.write_text(",Name,x_mm,y_mm,z_mm,tool_a,tool_b\n0,first,1,2,3,4,5\n1,second,4,5,6,7,8\n")
    assert hk.read_paths(file, ignore=["tool_*"]).paths[0].points[1] == pytest.approx([0.004, 0.005, 0.006])
    with pytest.raises(ArgumentError, match=r"ignore .*there is no such column"):
        hk.read_paths(file, ignore=["tool_*", "sped"]).paths[0]
    with pytest.raises(FileError, match="no column x"):
        hk.read_paths(file, ignore=["x_mm", "tool_*"]).paths[0]


@pytest.mark.parametrize("form", forms())
def test_all_forms_of_a_pose_are_one_path(tmp_path: Path, form: str) -> None:
    header, columns, said = forms()[form]
    read = hk.read_paths(table(tmp_path / "w.csv", header, *columns), **said).paths[0]  # type: ignore[arg-type]
    assert np.abs(read.points - ROWS / 1e3).max() < 1e-15
    assert read.rotations is not None
    assert np.abs(read.rotations - TURNS.as_matrix()).max() < 1e-14
    assert read.notes == () and read.times is None
    path = hk.spline(read)
    assert path.start == pytest.approx(ROWS[0] / 1e3)
    assert path.rotation == pytest.approx(TURNS.as_matrix()[0])


def test_times_make_a_timed_path(tmp_path: Path) -> None:
    read = hk.read_paths(table(tmp_path / "w.csv", "t_ms,x_mm,y_mm,z_mm", np.array([5000, 5500, 7000]), ROWS)).paths[0]
    path = hk.spline(read)
    assert path.duration == pytest.approx(2.0)
    assert path.at([0.5]).position[0] == pytest.approx(ROWS[1] / 1e3, abs=1e-15)
    assert hk.path.path_of(read).duration == pytest.approx(2.0)


def test_a_quaternion_that_flips_sign_is_repaired_and_said(tmp_path: Path) -> None:
    q = TURNS.as_quat() * [[1], [-1], [-1]]
    read = hk.read_paths(table(tmp_path / "w.csv", "x_mm,y_mm,z_mm,qx,qy,qz,qw", ROWS, q)).paths[0]
    (note,) = read.notes
    assert "1 quaternion changes sign (line 3)" in note
    at = hk.spline(read)
    assert float(sum(segment.turn for segment in at.segments)) < np.deg2rad(60)


@sampled(6, "seed", list(range(60)))
def test_half_a_turn_between_two_waypoints_is_refused_for_its_direction_is_by_chance(seed: int, tmp_path: Path) -> None:
    """The rows are named, at every door; a turn of somewhat less goes the way that it says."""
    draw = np.random.default_rng(seed)
    k, i = 6, int(draw.integers(0, 5))
    axis = draw.normal(size=3)
    axis /= np.linalg.norm(axis)
    points = draw.uniform(100, 500, (k, 3)).round(3)

    def poses(angle: float) -> np.ndarray:
        turns = [Rotation.random(random_state=seed)]
        for j in range(1, k):
            turns.append(Rotation.from_rotvec((angle if j == i + 1 else 0.3) * axis) * turns[-1])
        T = np.tile(np.eye(4), (k, 1, 1))
        T[:, :3, :3], T[:, :3, 3] = Rotation.concatenate(turns).as_matrix(), points / 1e3
        return T

    half = poses(np.pi + draw.choice([0.0, 1e-15, -1e-12, 1e-9, -1e-6, 3e-5]))
    doors = (
        hk.polyline,
        hk.spline,
        hk.path.path_of,
        lambda T: hk.spline(T, times=np.arange(k)),
        lambda T: hk.polyline(T, closed=True),
        lambda T: hk.polyline(np.roll(T, -1 - i, axis=0), closed=True),
    )
    for door in doors[:-1]:
        with pytest.raises(ArgumentError, match=rf"turn from waypoint {i}, counted from 0, to the next one .* between"):
            door(half)
    with pytest.raises(ArgumentError, match=rf"turn from waypoint {k - 1}, "):
        doors[-1](half)
    file = table(
        tmp_path / "w.csv", "x_mm,y_mm,z_mm,qx,qy,qz,qw", points, Rotation.from_matrix(half[:, :3, :3]).as_quat()
    )
    with pytest.raises(FileError, match=f"from line {i + 2} to line {i + 3} the tool turns by 180 degrees; .* between"):
        hk.read_paths(file).paths[0]
    turned = hk.polyline(poses(np.pi - 2e-3)).segments[i].turning[1]
    assert turned == pytest.approx((np.pi - 2e-3) * axis, abs=1e-9)


BAD = {
    "unit": ("x,y,z\n1,2,3\n2,3,4\n", "does not say in which unit 'x' is; say units='mm'"),
    "column": ("x_mm,y_mm\n1,2\n2,3\n", "has no column z"),
    "metres": ("x_m,y_m,z_m\n400,1,1\n300,1,1\n", "this looks like millimetres; say units="),
    "time": ("x_mm,y_mm,z_mm,t\n1,1,1,1\n2,2,2,0.5\n", "time runs backward from line 2 (1 s) to line 3 (0.5 s)"),
    "rest": ("x_mm,y_mm,z_mm,t\n1,1,1,1\n2,2,2,1\n", "time stands still from line 2"),
    "text": ("x_mm,y_mm,z_mm\n1,1,1\n1,a,2\n", "line 3, column 'y_mm' holds 'a'"),
    "nan": ("x_mm,y_mm,z_mm\n1,1,nan\n2,2,2\n", "line 2, column 'z_mm' holds 'nan'"),
    "quaternion": ("x_mm,y_mm,z_mm,qx,qy,qz,qw\n1,1,1,1,0,0,0\n1,1,2,1,0,0,0.1\n", "line 3 has a quaternion"),
    "degrees": ("x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad\n1,1,1,90,0,0\n1,1,2,1,0,0\n", "line 2 has an angle of 90 rad"),
    "angles": ("x_mm,y_mm,z_mm,roll,pitch,yaw\n1,1,1,1,0,0\n1,1,2,1,0,0\n", "say angles='deg'"),
    "order": ("x_mm,y_mm,z_mm,q1,q2,q3,q4\n1,1,1,1,0,0,0\n", "say order='xyzw' or order='wxyz'"),
    "repeat": ("x_mm,y_mm,z_mm\n1,1,1\n1,1,1\n", "has one waypoint; give two at least that differ"),
    "short": ("x_mm,y_mm,z_mm\n1,1\n1,1,1\n", "line 2 has 2 cells, the header 3"),
    "header": ("1,2,3\n3,4,5\n", "line 1 holds numbers, no header"),
    "inch": ("x_mm,y_mm,z_deg\n1,1,1\n1,1,2\n", "column 'z' is in deg"),
    "one": ("x_mm,y_mm,z_mm\n1,1,1\n", "one waypoint"),
    "empty": ("", "is empty"),
}  # fmt: skip


@pytest.mark.parametrize("fault", BAD)
def test_a_file_with_a_fault_is_refused_with_line_and_cure(tmp_path: Path, fault: str) -> None:
    text, words = BAD[fault]
    file = tmp_path / "w.csv"
    file.write_text(text)
    with pytest.raises(FileError) as caught:
        hk.read_paths(file).paths[0]
    assert words in str(caught.value)
    assert str(caught.value).startswith(f"{file}: ") and "; " in str(caught.value)


def test_what_you_say_and_what_the_header_says_must_agree(tmp_path: Path) -> None:
    file = table(tmp_path / "w.csv", "x_mm,y_mm,z_mm", ROWS)
    with pytest.raises(FileError, match="header says mm for 'x', and you m"):
        hk.read_paths(file, units="m").paths[0]
    small = table(tmp_path / "s.csv", "x,y,z", ROWS / 1e3)
    assert "are they metres?" in hk.read_paths(small, units="mm").paths[0].notes[0]


SVG = '<svg xmlns="http://www.w3.org/2000/svg" {}>{}</svg>'
SIZE = 'width="100mm" height="50mm" viewBox="0 0 200 100"'


def drawn(tmp_path: Path, body: str, size: str = SIZE, **said: Any) -> list[hk.Path]:
    pytest.importorskip("svgelements")
    file = tmp_path / "a.svg"
    file.write_text(SVG.format(size, body))
    return [path.path() for path in hk.read_paths(file, **said).paths]


def test_outlines_have_the_lengths_of_their_formulas(tmp_path: Path) -> None:
    body = """<circle cx="50" cy="25" r="10"/><ellipse cx="100" cy="50" rx="40" ry="20"/>
    <rect x="1" y="2" width="30" height="20" rx="3"/><g transform="translate(10 0) scale(2)"><path d="M0 0h10v5z"/></g>
    <polygon points="0,0 20,0 20,10"/><path d="M 0 100 Q 20 60 40 100"/>"""
    circle, ellipse, rectangle, triangle, polygon, parabola = drawn(tmp_path, body)
    assert circle.length == pytest.approx(2 * np.pi * 0.005, rel=1e-9)
    assert len(circle.segments) == 4 and circle.corners == ()
    assert circle.start == pytest.approx([0.03, 0.0375, 0])  # y up from the lower edge of the page
    assert ellipse.length == pytest.approx(4 * 0.02 * ellipe(1 - 0.25), rel=1e-4)
    assert rectangle.length == pytest.approx(2 * (0.012 + 0.007) + 2 * np.pi * 0.0015, rel=1e-9)
    assert rectangle.corners == ()
    assert triangle.length == pytest.approx((10 + 5 + np.sqrt(125)) * 1e-3, rel=1e-6)
    assert len(triangle.corners) == 3 and len(polygon.corners) == 3
    assert parabola.length == pytest.approx(0.02 * (np.sqrt(5) / 2 + np.arcsinh(2) / 4), rel=1e-4)
    assert not parabola.closed
    for path in (circle, ellipse, rectangle, triangle, polygon):
        assert path.closed


@pytest.mark.campaign
def test_curves_stay_within_their_tolerance_of_the_drawing(tmp_path: Path) -> None:
    svgelements = pytest.importorskip("svgelements")
    text = "M 10 10 C 20 20 40 20 50 10 S 80 0 90 10 A 30 10 20 0 1 150 40 T 180 80"
    (path,) = drawn(tmp_path, f'<path d="{text}"/>', tolerance=1e-6)
    theirs = svgelements.Path(text)
    points = np.array(
        [
            [p.x, p.y]
            for s in theirs
            if not isinstance(s, svgelements.Move)
            for p in map(s.point, np.linspace(0, 1, 2000))
        ]
    )
    wanted = np.column_stack([points[:, 0], 100 - points[:, 1]]) * 5e-4
    at = path.at(np.linspace(0, path.duration, 400)).position[:, :2]
    a, b = wanted[:-1], np.diff(wanted, axis=0)
    size = np.maximum(np.sum(b * b, axis=1), 1e-30)
    share = np.clip(np.einsum("kij,ij->ki", at[:, None] - a, b) / size, 0, 1)
    gaps = np.linalg.norm(at[:, None] - a - share[..., None] * b, axis=2).min(axis=1)
    assert gaps.max() < 3e-6


@pytest.mark.parametrize(
    ("body", "size", "words"),
    [
        ("<circle r='3'/>", 'width="100" height="50"', "say pixel="),
        ("<circle r='3'/>", "", "gives no width"),
        ("<text>hello</text>", SIZE, "has no outlines"),
        ("<path d='M0 0", SIZE, "cannot be read as SVG"),
    ],
)
def test_a_drawing_without_size_or_outlines_is_refused(tmp_path: Path, body: str, size: str, words: str) -> None:
    with pytest.raises(FileError, match=words):
        drawn(tmp_path, body, size)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<svg width="9mm"><path d="L 5 5"/></svg>', r"has a <path> that cannot be drawn \(.*correct its numbers"),
        ('<g><svg width="9mm"/></g>', "root is no <svg>"),
        ('<svg width="1.2.3mm" height="9mm"><circle r="5"/></svg>', r"gives its width as '1\.2\.3mm'"),
        ('<svg width="+-emm" height="9mm"><circle r="5"/></svg>', "gives its width as"),
    ],
)
def test_a_drawing_that_the_library_cannot_draw_is_refused(tmp_path: Path, text: str, words: str) -> None:
    pytest.importorskip("svgelements")
    (tmp_path / "d.svg").write_text(text.replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"'))
    with pytest.raises(FileError, match=words):
        hk.read_paths(tmp_path / "d.svg")


def test_a_drawing_in_pixels_has_the_size_that_you_say(tmp_path: Path) -> None:
    (circle,) = drawn(tmp_path, "<circle r='3'/>", 'width="100" height="50"', pixel=1e-3)
    assert circle.length == pytest.approx(2 * np.pi * 0.003)
