"""Files as CAM systems, controllers, drawing programs and spreadsheets write them, read by `hk.read_paths`.

The grammars are those of public documents: CATIA V5, "Syntaxes Interpreted by APT Import"; NX, cutter location source
files; Creo, CL data files; LinuxCNC and FANUC G-code, and Siemens 840D's TRAORI. DXF is written by ezdxf. What is
expected is worked out by hand, and the angles of makers from turns about single axes, multiplied as in Basler's pages
on pose formats, and for Comau and Staubli in RoboDK's robomath.py.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.base.errors import ArgumentError, FileError

DOWN = [0, 0, -1]

NX = """TOOL PATH/WELD_1,TOOL,TORCH
TLDATA/MILL,10.0000,0.0000,50.0000,0.0000,0.0000
MSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000
$$ centerline data
PAINT/PATH
PAINT/SPEED,10
LOAD/TOOL,1
SPINDL/RPM,0,CLW
RAPID
GOTO/0.0000,0.0000,50.0000,0.0000000,0.0000000,1.0000000
FEDRAT/MMPM,600.0000
GOTO/0.0000,0.0000,0.0000
FEDRAT/480.0000
GOTO/100.0000,0.0000,0.0000,0.0000000,0.6000000,0.8000000
CIRCLE/100.0000,20.0000,0.0000,0.0000000,0.0000000,1.0000000,20.0000,0.0600,0.5000,10.0000,0.0000
GOTO/120.0000,20.0000,0.0000
RAPID
GOTO/120.0000,20.0000,50.0000
END-OF-PATH
TOOL PATH/WELD_2,TOOL,TORCH
RAPID
GOTO/0.0000,40.0000,0.0000,0.0000000,0.0000000,1.0000000
FEDRAT/MMPM,300.0000
GOTO/0.0000,90.0000,0.0000
END-OF-PATH
"""

CATIA = """PARTNO PART TO BE MACHINED
COOLNT/ON
CUTCOM/OFF
PPRINT OPERATION NAME : Weld.1
$$*CATIA0
MULTAX
UNITS/MM
RAPID
GOTO  /   0.00000,   0.00000,  10.00000, 0.000000, 0.000000, 1.000000
FEDRAT/  300.0000,MMPM
GOTO  /   0.00000,   0.00000,   0.00000, 0.000000, 0.000000, 1.000000
FEDRAT/  600.0000,MMPM
AUTOPS
INDIRV/ 1.00000, 0.00000, 0.00000
TLON,GOFWD/ (CIRCLE/  0.00000, -10.00000, 0.00000,$
10.00000),ON,(LINE/ 0.00000, -10.00000, 0.00000,$
10.00000, -10.00000, 0.00000)
END
REWIND/0
FINI
"""

CREO = """$$*         Pro/CLfile  Version 10.0
$$-> MFGNO / OP010
PARTNO / OP010
MACHIN / UNCX01, 1
UNITS / INCHES
LOADTL / 1
$$-> CUTTER / 0.5
SPINDL / RPM, 1000.000000,  CLW
RAPID
GOTO / 0.0, 0.0, 1.0
FEDRAT / 12.000000,  IPM
GOTO / 0.0, 0.0, 0.0
CIRCLE / 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 1.0
GOTO / -1.0, 1.0, 0.0
SPINDL / OFF
FINI
"""

LINUXCNC = """%
(seam 7)
G21 G90 G17 G94 G54
T1 M6
G43 H1
G0 Z25.0
G0 X0.0 Y0.0
G1 Z0.0 F300.
X50.0 F480.
G3 X60.0 Y10.0 I0.0 J10.0
G1 Y30.0
G2 X70.0 Y40.0 R10.0
G0 Z25.0
M5
M30
%
"""

FANUC = """O0012
N10 G20 G90 G94 G40 G80
N20 G91 G28 Z0.
N30 G90 G0 X0. Y0. Z1. M3 S100
N40 G1 Z0. F10.
N50 G18 G2 X2. Z0. I1. K0.
N60 G91 G1 X1. Y1.
N70 G90 G0 Z1.
N80 G53 Z0.
N90 M30
"""

SIEMENS = """; WELD 12
N10 G17 G71 G90 G94
N20 G54
N30 G0 X=0 Y=0 Z=0
N40 G1 X40. F600
N50 G2 X60. Y0. CR=-10.
N60 G3 X60. Y0. Z-5. I=AC(50.) J=AC(0.)
N70 M30
"""

FANUC_TABLE = """O0001
N10 G21 G90 G94
N20 G54 G43.4 H1
N30 G0 X0. Y0. Z0. A0. C0.
N40 G1 X50. F480.
N50 X50. Y10. A30. C30.
N60 G49
N70 M30
"""

FANUC_VECTOR = """O0002
G21 G90 G94
G43.5 H1
G0 X0. Y0. Z0. I0. J0. K1.
G1 X50. I0. J0.6 K0.8 F480.
M30
"""

TRAORI = """; WELD 3
N10 G17 G71 G90 G94
N20 TRAORI
N40 G0 X0. Y0. Z0. A3=0 B3=0 C3=1
N60 G1 X40. A3=0.6 B3=0 C3=0.8 F600
N70 TRAFOOF
N80 M30
"""

HEAD = "G21 G90\nG0 X0. Y0. Z0."
XYZ = "x_mm,y_mm,z_mm"


def path(
    points: Any, axes: Any = None, speeds: Any = None, length: float | None = None, on: Any = ()
) -> dict[str, Any]:
    """What is expected of a path, in mm, mm/s: corners, axes, speeds, length, and further points on it."""
    return {"points": points, "axes": axes, "speeds": speeds, "length": length, "on": on}


R2 = 10 / np.sqrt(2)
QUARTER = 5 * np.pi
H = np.sqrt(0.75)
FILES: dict[str, tuple[str, str, dict[str, Any], list[dict[str, Any]]]] = {
    "table, axes i, j, k": (
        "table",
        f"{XYZ},i,j,k,feed_mm_min\n0,0,0,0,0,-1,240\n10,0,0,0,0.6,-0.8,480\n",
        {},
        [path([[0, 0, 0], [10, 0, 0]], [DOWN, [0, 0.6, -0.8]], [8])],
    ),
    "table, normals out of the work": (
        "table",
        "path,X [mm],Y [mm],Z [mm],nx,ny,nz\na,0,0,0,0,0,1\na,9,0,0,0,0,1\nb,0,5,0,0,0.6,0.8\nb,9,5,0,0,0.6,0.8\n",
        {"axis": "out"},
        [path([[0, 0, 0], [9, 0, 0]], [DOWN] * 2), path([[0, 5, 0], [9, 5, 0]], [[0, -0.6, -0.8]] * 2)],
    ),
    "table of Excel in Germany": (
        "table",
        "x_mm;y_mm;z_mm\n0,5;0;0\n10,5;0;-1,25\n",
        {},
        [path([[0.5, 0, 0], [10.5, 0, -1.25]])],
    ),
    "table with tabs and remarks": (
        "table",
        "// from the shop\nx_mm\ty_mm\tz_mm // of the part\n0\t0\t0\n// corner\n1,5\t0\t0 # last\n",
        {},
        [path([[0, 0, 0], [1.5, 0, 0]])],
    ),
    "numbers without a header": (
        "table",
        "0 0 0\n10 0 0\n10 5 0\n",
        {"units": "mm", "columns": ["x", "y", "z"]},
        [path([[0, 0, 0], [10, 0, 0], [10, 5, 0]])],
    ),
    "numbers in inches, with a speed": (
        "table",
        "# seam 3\n0;0;0;12\n1,5;0;0;12\n",
        {"units": "in", "columns": ["x", "y", "z", "feed_in_min"]},
        [path([[0, 0, 0], [38.1, 0, 0]], None, [5.08])],
    ),
    "NX": (
        "APT",
        NX,
        {"units": "mm"},
        [
            path(
                [[0, 0, 50], [0, 0, 0], [100, 0, 0], [120, 20, 0]],
                [DOWN, DOWN, [0, -0.6, -0.8], [0, -0.6, -0.8]],
                [10, 8, 8],
                150 + 2 * QUARTER,
                [[100 + 2 * R2, 20 - 2 * R2, 0]],
            ),
            path([[0, 40, 0], [0, 90, 0]], [DOWN] * 2, [5]),
        ],
    ),
    "CATIA": (
        "APT",
        CATIA,
        {},
        [path([[0, 0, 10], [0, 0, 0], [10, -10, 0]], [DOWN] * 3, [5, 10], 10 + QUARTER, [[R2, R2 - 10, 0]])],
    ),
    "Creo": (
        "APT",
        CREO,
        {},
        [
            path(
                [[0, 0, 25.4], [0, 0, 0], [-25.4, 25.4, 0]],
                None,
                [5.08] * 2,
                25.4 + 2.54 * QUARTER,
                [[-2.54 * R2, 25.4 - 2.54 * R2, 0]],
            )
        ],
    ),
    "LinuxCNC": (
        "G-code",
        LINUXCNC,
        {},
        [
            path(
                [[0, 0, 25], [0, 0, 0], [50, 0, 0], [60, 10, 0], [60, 30, 0], [70, 40, 0]],
                None,
                [5, 8, 8, 8, 8],
                95 + 2 * QUARTER,
                [[50 + R2, 10 - R2, 0], [70 - R2, 30 + R2, 0]],
            )
        ],
    ),
    "FANUC, inches, the plane of z and x": (
        "G-code",
        FANUC,
        {},
        [
            path(
                25.4 * np.array([[0, 0, 1], [0, 0, 0], [2, 0, 0], [3, 1, 0]]),
                None,
                [25.4 / 6] * 3,
                25.4 * (1 + np.pi + np.sqrt(2)),
                [[25.4, 0, -25.4]],
            )
        ],
    ),
    "Siemens": (
        "G-code",
        SIEMENS,
        {},
        [
            path(
                [[0, 0, 0], [40, 0, 0], [60, 0, 0], [60, 0, -5]],
                None,
                None,
                40 + 10 * np.pi + np.hypot(20 * np.pi, 5),
                [[50, 10, 0], [40, 0, -2.5]],
            )
        ],
    ),
    "FANUC, a table C on A": (
        "G-code",
        FANUC_TABLE,
        {"rotary": "CA"},
        [path([[0, 0, 0], [50, 0, 0], [50, 10, 0]], [DOWN, DOWN, [-0.25, H / 2, -H]], [8, 8])],
    ),
    "the same, turns of the table": (
        "G-code",
        FANUC_TABLE,
        {"rotary": "-C-A"},
        [path([[0, 0, 0], [50, 0, 0], [50, 10, 0]], [DOWN, DOWN, [-0.25, -H / 2, -H]], [8, 8])],
    ),
    "FANUC, directions": ("G-code", FANUC_VECTOR, {}, [path([[0, 0, 0], [50, 0, 0]], [DOWN, [0, -0.6, -0.8]], [8])]),
    "Siemens, directions": ("G-code", TRAORI, {}, [path([[0, 0, 0], [40, 0, 0]], [DOWN, [-0.6, 0, -0.8]], [10])]),
}


def check(read: hk.path.Waypoints, wanted: dict[str, Any]) -> None:
    corners = read.points if len(read) == len(wanted["points"]) else read.points[[0, 1, 2, -1]]  # of a helix many
    assert 1e3 * corners == pytest.approx(np.array(wanted["points"], dtype=float), abs=1e-9)
    if wanted["axes"] is None:
        assert read.axes is None and read.rotations is None
    else:
        assert read.axes == pytest.approx(np.array(wanted["axes"], dtype=float), abs=1e-12)
        assert read.rotations is not None
        assert read.rotations[:, :, 2] == pytest.approx(read.axes, abs=1e-12)
        assert np.linalg.det(read.rotations) == pytest.approx(1.0)
    whole = read.path()
    if wanted["speeds"] is not None:
        assert read.speeds is not None
        assert 1e3 * read.speeds == pytest.approx(wanted["speeds"])
        lengths = np.array([segment.length for segment in whole.segments])
        assert whole.durations == pytest.approx(lengths / read.speeds)
    if wanted["length"] is not None:
        assert 1e3 * whole.length == pytest.approx(wanted["length"], rel=1e-5)
    if len(wanted["on"]):
        dense = 1e3 * whole.at(np.linspace(0, whole.duration, 20_001)).position
        for point in wanted["on"]:
            assert np.linalg.norm(dense - point, axis=1).min() < 0.01


@pytest.mark.parametrize("name", FILES)
def test_a_file_of_a_maker_has_its_points_axes_and_speeds(tmp_path: Path, name: str) -> None:
    kind, text, said, wanted = FILES[name]
    file = tmp_path / "seam.txt"
    file.write_text(text)
    read = hk.read_paths(file, **said)
    assert read.kind == kind and len(read) == len(wanted)
    for one, expected in zip(read.paths, wanted, strict=True):
        check(one, expected)


def turn(axis: str, degrees: float) -> np.ndarray:
    """The matrix of a turn about one axis."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i = "xyz".index(axis)
    out = np.zeros((3, 3))
    out[i, i], out[i - 2, i - 2], out[i - 1, i - 1] = 1.0, c, c
    out[i - 1, i - 2], out[i - 2, i - 1] = s, -s
    return out


MAKERS = {
    "FANUC": ("w,p,r", "", lambda a, b, c: turn("z", c) @ turn("y", b) @ turn("x", a)),
    "Kawasaki": ("o,a,t", "", lambda a, b, c: turn("z", a) @ turn("y", b) @ turn("z", c)),
    "Comau": ("a,e,r", "", lambda a, b, c: turn("z", a) @ turn("y", b) @ turn("z", c)),
    "Mitsubishi": ("a,b,c", "Mitsubishi", lambda a, b, c: turn("z", c) @ turn("y", b) @ turn("x", a)),
    "Yaskawa": ("rx,ry,rz", "Yaskawa", lambda a, b, c: turn("z", c) @ turn("y", b) @ turn("x", a)),
    "Staubli": ("rx,ry,rz", "Staubli", lambda a, b, c: turn("x", a) @ turn("y", b) @ turn("z", c)),
}


@pytest.mark.parametrize("maker", MAKERS)
def test_the_angles_of_a_maker_are_its_turns_about_single_axes(tmp_path: Path, maker: str) -> None:
    names, said, matrix = MAKERS[maker]
    angles = np.random.default_rng(3).uniform(-80, 80, (2, 3)).round(3)
    rows = [f"{10 * i},0,0,{a},{b},{c}" for i, (a, b, c) in enumerate(angles)]
    file = tmp_path / "w.csv"
    file.write_text("\n".join([f"X,Y,Z,{names.upper()}", *rows]))
    read = hk.read_paths(file, units="mm", angles="deg", maker=said or None)
    wanted = np.array([matrix(*row) for row in angles])
    assert read.paths[0].rotations == pytest.approx(wanted, abs=1e-12)


def drawing(file: Path, version: str, units: int) -> None:
    """A drawing by ezdxf: an open path of three, a circle, a polyline with bulges, an ellipse, a spline, a block."""
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new(version)
    document.units = units
    model = document.modelspace()
    model.add_line((0, 0), (100, 0), dxfattribs={"layer": "WELD"})
    model.add_arc((100, 20), 20, 270, 360, dxfattribs={"layer": "WELD"})
    model.add_line((120, 60), (120, 20), dxfattribs={"layer": "WELD"})
    model.add_circle((0, 100, 5), 30, dxfattribs={"layer": "CUT"})
    model.add_text("WELD HERE")
    if version == "R12":
        model.add_polyline2d([(0, 0, 0.5), (10, 0, 0), (10, 10, 0)], format="xyb", dxfattribs={"layer": "BULGE"})
        model.add_polyline3d([(0, 0, 0), (1, 2, 3), (4, 4, 4)], dxfattribs={"layer": "SPACE"})
    else:
        model.add_lwpolyline([(0, 0, 0, 0, 0.5), (10, 0, 0, 0, 0), (10, 10)], dxfattribs={"layer": "BULGE"})
        model.add_ellipse((0, 0), (40, 0), 0.5, 0, np.pi / 2, dxfattribs={"layer": "ELLIPSE"})
        weights = [1, np.sqrt(0.5), 1]
        model.add_rational_spline([(10, 0), (10, 10), (0, 10)], weights, degree=2, dxfattribs={"layer": "NURBS"})
        model.add_arc((5, 0), 10, 0, 90, dxfattribs={"layer": "MIRROR", "extrusion": (0, 0, -1)})
        block = document.blocks.new("B")
        block.add_line((0, 0), (1, 0))
        model.add_blockref("B", (5, 5), dxfattribs={"xscale": 10, "rotation": 90, "layer": "0"})
    document.saveas(file)


@pytest.mark.parametrize(
    ("version", "units", "scale"), [("R12", 4, 1), ("R2000", 4, 1), ("R2010", 1, 25.4), ("R2018", 6, 1e3)]
)
def test_a_drawing_of_ezdxf_has_its_lines_arcs_and_curves(
    tmp_path: Path, version: str, units: int, scale: float
) -> None:
    from scipy.special import ellipe

    drawing(tmp_path / "d.dxf", version, units)
    read = hk.read_paths(tmp_path / "d.dxf", units="mm" if version == "R12" else None)
    weld = path(
        scale * np.array([[0, 0, 0], [100, 0, 0], [120, 20, 0], [120, 60, 0]]), length=scale * (140 + 10 * np.pi)
    )
    check(read.named("WELD"), weld)
    circle = read.named("CUT").path()
    assert circle.closed and 1e3 * circle.length == pytest.approx(scale * 60 * np.pi)
    assert 1e3 * circle.start == pytest.approx(scale * np.array([30, 100, 5]))
    bulge = read.named("BULGE").path()
    assert 1e3 * bulge.length == pytest.approx(scale * (25 * np.arctan(0.5) + 10))
    assert 1e3 * bulge.segments[0].position(np.array([0.5]))[0] == pytest.approx(scale * np.array([5, -2.5, 0]))
    assert "left out: 1 TEXT" in read.notes
    assert any("joined" in note and "1 of them turned round" in note for note in read.notes)
    if version == "R12":
        assert 1e3 * read.named("SPACE").points == pytest.approx(np.array([[0, 0, 0], [1, 2, 3], [4, 4, 4]]))
        return
    assert 1e3 * read.named("ELLIPSE").path().length == pytest.approx(scale * 40 * ellipe(0.75), rel=1e-4)
    quarter = read.named("NURBS").path().at(np.linspace(0, 0.1 * scale / 1e3, 9)).position
    assert 1e3 * np.linalg.norm(quarter, axis=1) == pytest.approx(np.full(9, 10 * scale), abs=0.02)
    check(read.named("MIRROR"), path(scale * np.array([[-15, 0, 0], [-5, 10, 0]]), length=scale * QUARTER))
    check(read.paths[-1], path(scale * np.array([[5, 5, 0], [5, 15, 0]])))


SPOILT: dict[str, tuple[str, dict[str, Any], str]] = {
    # Tables.
    "units that are mixed": ("x_mm,y_in,z_mm\n0,0,0\n1,0,0\n", {}, "mixes units: 'x' is in mm, 'y' is in in"),
    "a header and columns=": (f"{XYZ}\n0,0,0\n1,0,0\n", {"columns": ["x", "y", "z"]}, "has a header, x_mm, y_mm, z_mm"),
    "columns that do not fit": ("0 0 0 1\n1 0 0 1\n", {"columns": ["x", "y", "z"]}, "has 4 cells in its first line"),
    "no header": ("0 0 0\n1 0 0\n", {"units": "mm"}, "line 1 holds numbers, no header; name the columns"),
    "an axis that is no direction": (
        f"{XYZ},i,j,k\n0,0,0,0,0,-1\n1,0,0,0,0,-2\n",
        {},
        "line 3 has a tool axis of length 2",
    ),
    "an axis that turns round": (
        f"{XYZ},i,j,k\n0,0,0,0,0,-1\n1,0,0,0,0,1\n",
        {},
        "from line 2 to line 3 the tool turns",
    ),
    "two orientations": (f"{XYZ},i,j,k,nx,ny,nz\n0,0,0,0,0,1,0,0,1\n", {}, "hold more than one orientation"),
    "half an axis": (f"{XYZ},i,j\n0,0,0,0,0\n", {}, "column 'i' alone is no orientation"),
    "a speed of 0": (f"{XYZ},speed_mm_s\n0,0,0,8\n1,0,0,0\n", {}, "line 3 has a speed of 0"),
    "a speed without a unit": (f"{XYZ},feed\n0,0,0,8\n", {}, "column 'feed' is neither"),
    "a maker whose columns these are not": (
        f"{XYZ},w,p,r\n0,0,0,8,0,0\n",
        {"maker": "KUKA"},
        "names its columns w, p, r",
    ),
    "a path of one row": (
        f"path,{XYZ}\na,0,0,0\na,1,0,0\nb,0,0,0\n",
        {},
        "line 4 begins path 'b', which has one waypoint",
    ),
    "both decimal marks": (
        "x_mm;y_mm;z_mm\n0,5;0;0\n0.5;1;0\n",
        {},
        "line 2 has a decimal comma, line 3 a decimal point",
    ),
    # APT.
    "APT without a unit": ("GOTO/0,0,0\nGOTO/1,0,0\n", {}, "line 1 has the first length, and nothing says its unit"),
    "APT in two units": ("UNITS/MM\nGOTO/0,0,0\nUNITS/INCHES\nGOTO/1,0,0\n", {}, "line 3 sets the unit in, and before"),
    "APT in another unit than said": (
        "UNITS/MM\nGOTO/0,0,0\n",
        {"units": "in"},
        "line 1 sets the unit mm, and you say",
    ),
    "APT to a point by name": ("UNITS/MM\nGOTO/PT1\n", {}, "line 2 has 'PT1' where a number belongs"),
    "APT with two numbers": ("UNITS/MM\nGOTO/0,0\n", {}, "line 2 has 2 numbers after GOTO"),
    "APT with a long axis": ("UNITS/MM\nGOTO/0,0,0,0,0,3\n", {}, "line 2 has a tool axis of length 3"),
    "APT whose axis turns round": ("UNITS/MM\nGOTO/0,0,0,0,0,1\nGOTO/1,0,0,0,0,-1\n", {}, "line 3 turns the tool axis"),
    "APT with a feed a turn": ("UNITS/MM\nFEDRAT/0.1,MMPR\n", {}, "line 2 gives a feed that is no speed"),
    "APT off its circle": (
        "UNITS/MM\nGOTO/0,0,0\nCIRCLE/0,5,0,0,0,1,5\nGOTO/5,7,0\n",
        {},
        "line 4 has an arc whose start is 5",
    ),
    "APT with a circle at its end": (
        "UNITS/MM\nGOTO/0,0,0\nGOTO/1,0,0\nCIRCLE/0,5,0,0,0,1,5\n",
        {},
        "line 4 has a CIRCLE that",
    ),
    "APT with a matrix": ("UNITS/MM\nTRACUT/1,0,0,0,0,1,0,0,0,0,1,5\n", {}, "line 2 moves or repeats points"),
    "APT with a loop": ("UNITS/MM\nLOOPST\nGOTO/0,0,0\n", {}, "line 2 is a macro"),
    "APT with a cycle": ("UNITS/MM\nCYCLE/DRILL,5,MMPM,100\n", {}, "line 2 turns on a cycle"),
    "APT with a word": ("UNITS/MM\nGOTO/0,0,0\nGOLFT/L1\n", {}, "line 3 is not understood: 'GOLFT/L1'"),
    # G-code.
    "G-code with variables": (f"{HEAD}\nG1 X#100 F8.\n", {}, "line 3 has a macro or a formula, 'X#100 F8.'"),
    "G-code with a loop": (f"{HEAD}\nWHILE [#1 LT 5] DO1\n", {}, "line 3 has a macro or a formula"),
    "G-code that calls": (f"{HEAD}\nM98 P1000\n", {}, "line 3 calls a subprogram, M98"),
    "G-code with a macro": (f"{HEAD}\nG65 P9810 Z1.\n", {}, "line 3 calls a macro"),
    "G-code in two units": (f"{HEAD}\nG1 X1. F8.\nG20\n", {}, "line 4 sets the unit in, and before them are mm"),
    "G-code without a unit": (
        "G90\nG0 X0. Y0. Z0.\nG1 X1.\n",
        {},
        "line 2 has the first point, and nothing says its unit",
    ),
    "G-code from nowhere": ("G21 G90\nG0 X0.\nG1 Y5. F8.\nZ1.\n", {}, "line 3 cuts where Z is not known"),
    "G-code off its circle": (
        f"{HEAD}\nG2 X10. Y1. I5. J0.\n",
        {},
        "line 3 has an arc whose start is 5 mm from its center",
    ),
    "G-code with a small radius": (
        f"{HEAD}\nG2 X10. R4.\n",
        {},
        "line 3 has an arc of radius 4 mm between points 10 mm",
    ),
    "G-code with a compensation": (f"{HEAD}\nG41 D1\n", {}, "line 3 turns on the compensation of the tool's radius"),
    "G-code with a cycle": (f"{HEAD}\nG81 X1. Z-5. R1.\n", {}, "line 3 has G81, which is a cycle"),
    "G-code in inverse time": (f"{HEAD}\nG93\n", {}, "line 3 gives a feed that is no speed"),
    "G-code with a second frame": (
        "G21 G90 G54\nG0 X0. Y0. Z0.\nG55\n",
        {},
        "line 3 changes the frame of the workpiece",
    ),
    "G-code that turns a table": (
        f"{HEAD}\nG1 X1. A30.\n",
        {},
        "line 3 turns A, and nothing says how the machine is built",
    ),
    "G-code with an unknown word": (f"{HEAD}\nG1 X1. W5.\n", {}, "line 3 has the word W5., which is not understood"),
    "G-code with the turns of an arc": (f"{HEAD}\nG2 Z-5. I5. J0. P3\n", {}, "line 3 has P beside an arc"),
    "G-code that skips": (f"{HEAD}\n/G1 X1.\n", {}, "line 3 begins with /"),
    "G-code without a center": (f"{HEAD}\nG2 X1. Y1.\n", {}, "line 3 has an arc without center or radius"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_is_not_understood_is_refused_with_its_line(tmp_path: Path, name: str) -> None:
    text, said, words = SPOILT[name]
    file = tmp_path / "seam.txt"
    file.write_text(text)
    with pytest.raises(FileError) as caught:
        hk.read_paths(file, **said)
    assert words in str(caught.value) and "; " in str(caught.value)


def test_a_drawing_in_no_unit_with_a_face_or_a_broken_number_is_refused(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    line = "0\nLINE\n8\n0\n10\n0.0\n20\n0.0\n11\n1.0\n21\n0.0\n"
    file = tmp_path / "d.dxf"
    file.write_text(f"0\nSECTION\n2\nENTITIES\n{line}0\nENDSEC\n0\nEOF\n")
    with pytest.raises(FileError, match=r"does not say its unit, by .INSUNITS; say units='mm' or units='in'"):
        hk.read_paths(file)
    assert hk.read_paths(file, units="in").paths[0].points[1] == pytest.approx([0.0254, 0, 0])
    file.write_text(file.read_text().replace("1.0", "one"))
    with pytest.raises(FileError, match=r"cannot be read as DXF .*near line"):
        hk.read_paths(file, units="in")
    document = ezdxf.new()
    document.units = 4
    document.modelspace().add_3dface([(0, 0), (1, 0), (1, 1)])
    document.saveas(file)
    with pytest.raises(FileError, match="3DFACE, which is no line") as caught:
        hk.read_paths(file)
    number = int(str(caught.value).split("line ")[1].split()[0])
    assert file.read_text().splitlines()[number - 1] == "3DFACE"
    with pytest.raises(FileError, match="is in mm, and you say units='in'"):
        drawing(file, "R2010", 4)
        hk.read_paths(file, units="in")


def test_a_table_whose_points_are_called_like_words_is_a_table(tmp_path: Path) -> None:
    file = tmp_path / "w.csv"
    for mark in ",;\t":
        file.write_text("\n".join([f"name,{XYZ}", "G1,0,0,0", "G2,5,0,0"]).replace(",", mark))
        read = hk.read_paths(file)
        assert read.kind == "table" and read.paths[0].points[1] == pytest.approx([0.005, 0, 0])


def test_the_times_of_a_table_are_those_of_its_path(tmp_path: Path) -> None:
    file = tmp_path / "w.csv"
    file.write_text(f"{XYZ},t\n0,0,0,0\n10,0,0,1\n10,0,0,3\n20,0,0,4\n")
    rests = hk.read_paths(file).paths[0].path()
    assert rests.durations == pytest.approx([1, 2, 1])
    assert 1e3 * rests.at([0.5, 2, 3.5]).position[:, 0] == pytest.approx([5, 10, 15])
    file.write_text(f"{XYZ},t,speed_mm_s\n0,0,0,0,8\n10,0,0,1,8\n")
    with pytest.raises(FileError, match="has times and speeds, t, speed_mm_s; leave one of them out"):
        hk.read_paths(file)


def test_what_is_assumed_is_noted(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"

    def notes(text: str, **said: Any) -> str:
        file.write_text(text)
        read = hk.read_paths(file, **said)
        return "; ".join([*read.notes, *(note for one in read.paths for note in one.notes)])

    assert "read as the direction in which the tool's z axis points" in notes(FILES["table, axes i, j, k"][1])
    assert "counter-clockwise about the axis" in notes(NX, units="mm")
    assert "nothing says G90 or G91" in notes("G21\nG0 X0. Y0. Z0.\nG1 X1.\n")
    first = "UNITS/MM\nRAPID\nGOTO/0,0,0\nGOTO/1,0,0\nGOTO/2,0,0,0,0.6,0.8\n"
    assert "2 points before the first tool axis: the tool is read as along z of the file, down" in notes(first)
    assert "no line has Z: read as 0" in notes("G21 G90\nG0 X0. Y0.\nG1 X1.\n")
    assert "line 3 has a number without a decimal point: read as whole mm" in notes("G21 G90\nG0 X0 Y0 Z0\nG1 X10\n")
    assert "read as that of X and Y, G17" in notes("G21 G90\nG0 X0. Y0. Z0.\nG2 X2. I1.\n")
    assert "the path begins where it ends" in notes("G21 G90\nG1 X0. Y0. Z0.\nX1.\n")
    assert "turns the tool, and nothing turns on" in notes(FANUC_TABLE.replace("G43.4 H1", ""), rotary="CA")
    assert "turns the tool" not in notes(FANUC_TABLE, rotary="CA")
    assert "1 rapid moves behind the last path left out" in notes(LINUXCNC)
    assert "1 moves of no length left out" in notes("G21 G90\nG0 X0. Y0. Z0.\nG1 X1.\nX1.\nX2.\n")


def test_rapids_divide_paths_or_are_part_of_them(tmp_path: Path) -> None:
    file = tmp_path / "a.nc"
    file.write_text("G21 G90\nG0 X0. Y0. Z9.\nZ0.\nG1 X8. F480.\nG0 Z9.\nX20.\nZ0.\nG1 X30.\n")
    first, second = hk.read_paths(file).paths
    assert first.name == "path 1" and second.name == "path 2"
    assert first.approach == pytest.approx(np.array([[0, 0, 0.009], [0, 0, 0]]))
    assert second.approach == pytest.approx(np.array([[0.008, 0, 0.009], [0.02, 0, 0.009], [0.02, 0, 0]]))
    (whole,) = hk.read_paths(file, rapid_speed=0.5).paths
    assert whole.points[0] == pytest.approx([0, 0, 0.009])
    assert whole.speeds == pytest.approx([0.5, 0.008, 0.5, 0.5, 0.5, 0.008])
    with pytest.raises(ArgumentError, match=r"a path of the file .* it has path 1, path 2"):
        hk.read_paths(file).named("seam")
    with pytest.raises(ArgumentError, match=r"pixel .* is read as G-code"):
        hk.read_paths(file, pixel=1e-3)


def test_a_spline_or_lines_through_the_points_of_arcs_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.nc"
    file.write_text(LINUXCNC)
    (arcs,) = hk.read_paths(file).paths
    for door in (hk.spline, hk.polyline):
        with pytest.raises(ArgumentError, match=r"take its path\(\)"):
            door(arcs)
    file.write_text(FILES["table, axes i, j, k"][1])
    (straight,) = hk.read_paths(file).paths
    assert hk.polyline(straight).duration == pytest.approx(0.010 / 0.008)
    assert "the speeds of the file are left out" in hk.spline(straight).notes[-1]


@sampled(3, "seed", list(range(100)))
def test_arcs_in_every_plane_unit_and_mode_lie_on_their_circles(seed: int, tmp_path: Path) -> None:
    """Written from center, radius and angles in a plane; read back, they are that circle, by that angle."""
    draw = np.random.default_rng(seed)
    a, b, c, word = [(0, 1, 2, "G17"), (2, 0, 1, "G18"), (1, 2, 0, "G19")][draw.integers(3)]
    inch, relative, radius_form = (bool(draw.integers(2)) for _ in range(3))
    lines = [f"{word} {'G20' if inch else 'G21'} {'G91' if relative else 'G90'} G94"]
    at = np.zeros(3)
    lines.append("G90 G0 X0. Y0. Z0." + (" \nG91" if relative else ""))
    wanted = []
    for _ in range(6):
        radius, first, angle = draw.uniform(2, 30), draw.uniform(0, 2 * np.pi), draw.uniform(0.1, 6.0)
        left = bool(draw.integers(2))
        angle = angle if left else -angle
        center = at.copy()
        center[[a, b]] -= radius * np.array([np.cos(first), np.sin(first)])
        end = center.copy()
        end[[a, b]] += radius * np.array([np.cos(first + angle), np.sin(first + angle)])
        target = end - at if relative else end
        point = " ".join(f"{'XYZ'[i]}{target[i]:.9f}" for i in (a, b))
        arc = f"R{radius if abs(angle) < np.pi else -radius:.9f}"
        if not radius_form:
            arc = " ".join(f"{'IJK'[i]}{center[i] - at[i]:.9f}" for i in (a, b))
        lines.append(f"{'G3' if left else 'G2'} {point} {arc} F600.")
        wanted.append((center, radius, first, angle))
        at = end
    (tmp_path / "a.nc").write_text("\n".join(lines))
    scale = 0.0254 if inch else 1e-3
    segments = hk.read_paths(tmp_path / "a.nc").paths[0].path().segments
    assert len(segments) == len(wanted)
    for segment, (center, radius, first, angle) in zip(segments, wanted, strict=True):
        for u in (0.25, 0.5, 1.0):
            expected = center.copy()
            expected[[a, b]] += radius * np.array([np.cos(first + u * angle), np.sin(first + u * angle)])
            assert segment.position(np.array([u]))[0] / scale == pytest.approx(expected, abs=2e-5 * radius)
        assert c not in (a, b)


def test_the_speeds_comments_and_axes_of_a_file_arrive_in_a_job(tmp_path: Path) -> None:
    from holokin.app.job.runner import open_job, run_job
    from holokin.base.errors import JobError

    (tmp_path / "weld.cls").write_text(NX.replace("$$ centerline data", "PPRINT ROOT PASS"))
    job = """title = "t"
[robot]
name = "panda"
[task]
kind = "pose"
orientation = "axis"
[start]
q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
[strategies.l]
kind = "lock"
joints = ["panda_joint7", "panda_joint3"]
[path]
kind = "file"
file = "weld.cls"
units = "mm"
frame = { xyz = [0.42, 0.1, 0.4] }
entry = "joints"
samples = 100
"""

    def run(keys: str) -> Any:
        (tmp_path / "job.toml").write_text(job + keys)
        return run_job(*open_job(str(tmp_path / "job.toml")))

    result = run('only = "WELD_1"\n')
    assert result.path.durations == pytest.approx([50 / 10, 100 / 8, 10 * np.pi / 8])
    assert result.path.start == pytest.approx([0.42, 0.1, 0.45])
    assert (
        "a comment of line 4: ROOT PASS" in result.about
        and "the rapid moves to its start are left out (1)" in result.about
    )
    (law,) = result.strategies
    assert law.status is hk.motion.Status.COMPLETE and law.metrics["tracking"] < 1e-10
    tool = hk.load("panda").pose(law.cycles.q[-1])
    assert 1e3 * (tool[:3, 3] - [0.42, 0.1, 0.4]) == pytest.approx([120, 20, 0], abs=1e-6)
    assert tool[:3, 2] == pytest.approx([0, -0.6, -0.8], abs=1e-9)
    assert run("only = 2\nspeed = 0.02\n").path.duration == pytest.approx(0.05 / 0.02)
    for keys, words in {
        "": "names none of the 2 paths .'WELD_1': 0.181 m, 'WELD_2': 0.05 m.; say which one",
        'only = "X"\n': "is 'X'; it has WELD_1, WELD_2",
        "only = 1\nclosed = true\n": "path.closed. is of points, and the file has arcs",
    }.items():
        with pytest.raises(JobError, match=words):
            run(keys)


def test_directions_make_a_workspace_for_tasks_of_the_tool_axis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The postures that serve it have the tool's z axis along them: out of the work they are turned round, and said."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    axes = np.array([[0, 0, -1], [0.3, 0, -1], [0, -0.4, -1], [0.2, 0.2, -1]])
    axes = axes / np.linalg.norm(axes, axis=1)[:, None]
    points = np.array([[450, 0, 300], [450, 100, 300], [400, -100, 350], [500, 0, 400]])
    for name, given, axis in (("in.csv", axes, None), ("out.csv", -axes, "out")):
        rows = "\n".join(",".join(map(str, row)) for row in np.hstack([points, given]))
        (tmp_path / name).write_text(f"{XYZ},i,j,k\n{rows}\n")
        space = hk.path.read_workspace(tmp_path / name, axis=axis)
        assert ("into the work" in str(space)) == (axis is None) and "its turn about it free" in str(space)
        task = hk.pose(hk.load("panda"), orientation="axis")
        G = hk.holonomic(task, hk.lock("panda_joint3", "panda_joint7"))
        found = hk.coverage(G, space, PANDA_START, explain=False)
        assert found.share == 1.0
        poses = task.robot.pose(found.q)
        assert np.abs(poses[:, :3, 3] - points / 1000).max() < 1e-6 and np.abs(poses[:, :3, 2] - axes).max() < 1e-6
        whole = hk.pose(hk.load("panda"))
        with pytest.raises(ArgumentError, match='a task with orientation="axis"'):
            hk.coverage(hk.holonomic(whole, hk.lock("panda_joint3")), space, PANDA_START)
        across = hk.pose(hk.load("panda"), orientation="axis", axis="x")
        with pytest.raises(ArgumentError, match="whose axis is z"):
            hk.coverage(hk.holonomic(across, hk.lock("panda_joint3", "panda_joint7")), space, PANDA_START)
    (tmp_path / "p.csv").write_text(f"{XYZ}\n0,0,0\n")
    with pytest.raises(ArgumentError, match="no directions of the tool"):
        hk.path.read_workspace(tmp_path / "p.csv", axis="out")


CALLS = """
import cProfile, sys
import holokin as hk

def calls(name):
    with cProfile.Profile() as profile:
        hk.read_paths(name).paths[0].path()
    return sum(entry.callcount for entry in profile.getstats())

calls(sys.argv[1])  # what is built at the first call
print(*(calls(name) for name in sys.argv[1:]))
"""


@sampled(1, "name", ["p.nc", "p.cls", "p.csv"])
def test_ten_times_as_many_lines_take_ten_times_as_many_calls(tmp_path: Path, name: str) -> None:
    """Of a program, a table and its path: no step is made again for the lines before.

    In a process of its own: profilers and the frames of torch do not go together.
    """
    for count in (100, 1000):
        rows = [f"{100 * np.cos(a):.4f},{100 * np.sin(a):.4f},{a:.4f}" for a in np.arange(count) * 1e-3]
        text = {
            "p.nc": ["G21 G90 G43.5", *("G1 X{} Y{} Z{} I0 J0 K1 F1000".format(*row.split(",")) for row in rows)],
            "p.cls": ["UNITS/MM", "FEDRAT/1000,MMPM", *(f"GOTO/{row},0,0,1" for row in rows)],
            "p.csv": [f"{XYZ},i,j,k", *(f"{row},0,0,1" for row in rows)],
        }
        (tmp_path / f"{count}{name}").write_text("\n".join(text[name]) + "\n")
    files = [str(tmp_path / f"{count}{name}") for count in (100, 1000)]
    done = subprocess.run([sys.executable, "-c", CALLS, *files], check=True, capture_output=True, text=True)
    few, many = map(int, done.stdout.split())
    assert many < 11 * few
