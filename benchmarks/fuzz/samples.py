"""Good files and nouns of which `formats` makes bad ones, and the odd words and numbers that it puts into them."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk

GOLDEN = Path(__file__).parents[2] / "tests" / "golden"
PATH = '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 8\ncycles = 2\n[verdict]\nsamples = 3\n'
PPR = '[robot]\nname = "ppr"\n[start]\nq = [0.9, -0.3, 0.8]\n' + PATH
BARS = '[robot]\nname = "planar-3r"\n[start]\nq = [0.2, 0.8, 0.9]\n' + PATH
LAWS = """[strategies.mp]
kind = "moore-penrose"
[expect.mp]
holonomic = false
drift = { above = 0.001, below = 3 }
""", """[strategies.w]
kind = "weighted"
weight = [[1, 0, 0], [0, 2, 0], [0, 0, "1 + 0.1*cos(q2)"]]
invariant = ["q1 + q2"]
""", """[strategies.g]
kind = "custom"
g = ["q1 - sin(q3)"]
level = 0.1
""", """[strategies.l]
kind = "linear"
matrix = [[1, -1, 1]]
method = "velocity"
""", """[strategies.lock]
kind = "lock"
joints = ["q3"]
""", """[strategies.n]
kind = "null-basis"
N_G = [[1, 0], [0, 1], ["q1", "q2"]]
""", """[strategies.p]
kind = "pfaffian"
A = [["q2", 1, "-q1"]]
""", """[strategies.s]
kind = "stationary"
cost = "posture"
preferred = [0, 0.5, 0.5]
stiffness = [1, 2, 3]
""", """[strategies.h]
kind = "height"
joints = ["q2"]
""", """[strategies.i]
kind = "impedance"
preferred = [0, 0.5, 0.5]
stiffness = 2
""", """[strategies.r]
kind = "radial"
steps = 2
[strategies.f]
kind = "fitted"
of = "r"
radius = 0.05
degree = 2
samples = 40
"""  # fmt: skip
BASES = PPR, BARS
FEW = "relative = true\nsamples = 8\n"
OTHER_PATHS = (
    '[path]\nkind = "polyline"\npoints = [[0, 0], [0.05, 0], [0.05, 0.05]]\nclosed = true\n' + FEW,
    '[path]\nkind = "arc"\ncenter = [-0.1, 0]\nangle_deg = 40\nclockwise = true\n' + FEW,
    '[path]\nkind = "polyline"\npoints = [[0, 0], [0, 9]]\n' + FEW,
)
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
<origin xyz="0.1 0 0.3" rpy="0 0.4 0"/><axis xyz="{4}"/>{5}</joint>"""
LINK = """<link name="{0}"><inertial><origin xyz="0 0 0.1"/><mass value="1.5"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="package://a/b.stl"/></geometry></visual></link>"""
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="1"/>'
URDF = (
    '<?xml version="1.0"?>\n<robot name="arm">'
    + "".join(LINK.format(name) for name in "abcdefg")
    + JOINT.format("j1", "revolute", "a", "b", "0 0 1", LIMIT)
    + JOINT.format("j2", "prismatic", "b", "c", "1 0 0", LIMIT)
    + JOINT.format("j3", "continuous", "c", "d", "0 1 0", "")
    + JOINT.format("j4", "fixed", "d", "e", "0 1 0", "")
    + JOINT.format("j5", "revolute", "e", "f", "0 1 1", LIMIT + '<mimic joint="j1" multiplier="-2" offset="0.1"/>')
    + JOINT.format("j6", "revolute", "c", "g", "0 0 1", LIMIT)
    + "</robot>"
)
URDF_TAGS = ("joint", "link", "mimic", "axis", "limit", "origin", "x", "gazebo")
URDF_KEYS = ("lower", "velocity", "multiplier", "rpy", "xyz", "value", "ixx", "link")
CODES = (
    "utf-8", "UTF-16", "latin-1", "cp1252", "GB2312", "Shift_JIS", "euc-jp", "no-such", "utf-7", "idna",
    "punycode", "unicode_escape", "rot13", "cp037", "utf-8-sig", "ascii", "hz", "undefined", "UTF-32",
)  # fmt: skip
MJCF = """<mujoco model="arm"><compiler angle="radian" meshdir="meshes"/><option timestep="0.01"/>
<default><joint damping="1"/><default class="a"><geom rgba="1 0 0 1"/></default></default>
<asset><texture name="t" type="2d" builtin="flat" width="4" height="4"/><material name="m" texture="t"/>
<mesh name="s" builtin="sphere" params="1"/><hfield name="h" nrow="3" ncol="3" size="1 1 1 1"/></asset>
<worldbody><body name="b1" pos="0 0 0.3"><joint name="j1" axis="0 0 1" range="-2 2"/>
<inertial pos="0 0 0.1" mass="2" diaginertia="0.1 0.1 0.1"/>
<body name="b2" pos="0 0 0.3" euler="0.1 0 0"><joint name="j2" type="slide" axis="1 0 0" range="-1 1"/>
<geom type="capsule" size="0.03 0.1" material="m"/><body name="b3" pos="0.4 0 0" quat="1 0 0.1 0">
<joint name="j3" axis="0 1 0" ref="0.2"/><geom type="mesh" mesh="s" class="a"/><site name="tool" pos="0 0 0.1"/>
<replicate count="2" offset="0.1 0 0"><geom size="0.01"/></replicate></body></body></body>
<body name="b4" pos="1 0 0"><joint name="j4"/><geom size="0.1"/></body></worldbody>
<equality><joint joint1="j4" joint2="j1" polycoef="0 1 0 0 0"/></equality>
<actuator><motor joint="j1"/></actuator><keyframe><key name="k" qpos="0 0 0 0"/></keyframe></mujoco>"""
MJCF_TAGS = (
    "body", "joint", "geom", "site", "freejoint", "frame", "replicate", "attach", "include", "composite", "flexcomp",
    "inertial", "camera", "light", "weld", "connect", "tendon", "x", "mesh", "size", "default", "compiler",
)  # fmt: skip
MJCF_KEYS = ("name", "class", "count", "range", "pos", "quat", "type", "size", "mass", "file")
XML_VALUES = (
    "", "0", "1", "-1", "nan", "inf", "1e200", "-1e308", "1e400", "9" * 5000, "0 0 0", "1 2", "1 2 3 4", "a", "g", "j1",
    "b3", "revolute", "planar", "fixed", "ball", "free", "hinge", "100000", "3000000", "x" * 5000, "[/red]", "日本",
    "0x10", "1_0", "true", "&#10;", "１", "../../etc/passwd",
)  # fmt: skip
SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="80mm" viewBox="0 0 100 80">
<rect x="5" y="5" width="20" height="9" rx="2" transform="rotate(30)"/><circle cx="30" cy="30" r="12"/>
<g transform="scale(2 -1)"><ellipse cx="30" cy="30" rx="12" ry="7"/><polygon points="0,0 20,0 20,20"/></g>
<defs><circle id="c" r="5"/></defs><use href="#c" x="9"/><g id="g" display="inline"><use href="#c"/></g>
<line x1="0" y1="1" x2="30" y2="3" style="a:b;"/><path d="M 10 10 L 60 10 L 60 40 Z" transform="matrix(1 0 0 1 5 5)"/>
<path d="M 10 80 C 40 10, 65 10, 95 80 S 150 150, 180 80"/><path d="M 30 80 A 45 45 0 0 0 75 125 L 75 80 Z"/></svg>"""
SVG_TAGS = ("g", "path", "use", "rect", "circle", "line", "polygon", "polyline", "defs", "symbol", "text", "x")
SVG_KEYS = ("d", "transform", "x", "r", "rx", "points", "href", "display", "style", "viewBox", "width")
SVG_VALUES = (
    "0", "-1", "nan", "inf", "1e9", "1e200", "1e400", "1e-300", "", "a", "9" * 400, "50%", "3mm", "1 2", "-0", "none",
    "#c", "#g", "#x", "rotate(inf)", "scale(0)", "matrix(1 1 1 1 0 0)", "skewX(89.99)", "skewX(90)", "translate(nan)",
    "scale(1e200)", "scale(1e-200)", "turn(3)", "matrix(1 2)", "rotate(30", "m5,5 h 20 v 10 h -20 z", "M0 0 L0 0",
    "M10 80 Q 52 10 95 80 T 180 80", "M 10 10 A 30 50 0 0 1 16 21", "M 1 1", "L 1 1", "Z", "M 0 0 C 0 0 0 0 0 0",
    "M 0 0 A 0 0 0 0 0 1 1", "M 0 0 A 5 5 0 1 1 0 0", "M 0 0 L nan 1 L 1e300 5 Z",
)  # fmt: skip
ARM = """<?xml version="1.0"?><robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="length" default="0.5"/><xacro:property name="L" value="$(arg length)"/>
<xacro:property name="props" value="${xacro.load_yaml('props.yaml')}"/>
<xacro:macro name="arm" params="name parent child z:=0.1 *block"><link name="${child}"/>
<joint name="${name}" type="revolute"><parent link="${parent}"/><child link="${child}"/>
<xacro:insert_block name="block"/><axis xyz="0 ${1 if z else 0} 1"/>
<limit lower="${-pi}" upper="${radians(props.upper)}" velocity="2" effort="1"/></joint></xacro:macro>
<link name="base"/><xacro:arm name="j1" parent="base" child="upper"><origin xyz="0 0 ${2 * L}"/></xacro:arm>
<xacro:if value="${L > 0.1 and 'up' in props}"><xacro:arm name="j2" parent="upper" child="lower" z="${L ** 2}">
<origin xyz="${'0 0 1'.split()[2]} 0 0"/></xacro:arm></xacro:if><xacro:include filename="more.xacro"/></robot>"""
MORE = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="x" value="1"/></robot>'
YAML = "upper: !degrees 90\nup: [1, 2, {a: b}]\n"
XACRO = {"arm.xacro": ARM, "more.xacro": MORE, "props.yaml": YAML}
EXPRESSIONS = (
    "", "1/0", "L", "L.x", "props.nothing", "props.up[5]", "9**9**9", "lambda: 1", "[i for i in [1]]", "().__class__",
    "'a' * 10**9", "xacro.load_yaml('more.xacro')", "xacro.load_yaml('/etc/passwd')", "python.vars(1)", "f'{L}'",
    "xacro.fatal('x')", "xacro.warning('x')", "None", "True", "{}", "(1,", "'", "1 +", "nan", "-" * 3000 + "1",
    "list(range(10))", "'%s' % L", "'%d' % 'a'", "max()", "min(1, 'a')", "sin('a')", "float('x')",
    "日本", "1 if", "x y",
)  # fmt: skip
XACRO_PARTS = (
    "${2 * L}", "${-pi}", "$(arg length)", "xacro:if", "xacro:macro", "more.xacro", "props.yaml",
    "value=", "name=", "0.5",
    "${L ** 2}", "*block", "z:=0.1", "params=", "<xacro:insert_block name=\"block\"/>",
    "base", "upper", "</xacro:macro>",
)  # fmt: skip
XACRO_WORDS = (
    "$(find nowhere)", "$(env NOTHING)", "$(eval 1 + 1)", "$(eval lambda: 1)", "$(cwd)", "$(", "${",
    "$${x}", "xacro:call",
    "xacro:unless", "arm.xacro", "**block", "z:=${z}", "z:=^|1", "xacro:x", "", "\0", "$(arg nothing)", "xacro:element",
)  # fmt: skip
DH = """name = "arm"
source = "made up"
convention = "standard"
tip = "tool"
base = { xyz = [0, 0, 0.1], rpy_deg = [0, 0, 90] }
tool = { xyz = [0.1, 0, 0], rpy_deg = [0, 10, 0] }
[[joints]]
joint = "one"
a = 0.3
alpha_deg = 90
lower = -170
upper = 170
max_velocity = 100
degrees = true
[[joints]]
kind = "prismatic"
d = 0.2
theta_deg = 30
lower = -1
upper = 1.5
[[joints]]
a = 0.25
alpha_deg = -90
theta_deg = 10
[[joints]]
a = 0.1
d = 0.05
"""
DH_ROWS = [
    {"a": 0.3, "alpha": 1.5, "lower": -2.0, "upper": 2.0, "joint": "one"},
    {"d": 0.2, "kind": "prismatic", "max_velocity": 1.0},
    {"a": 0.2, "theta": 0.3},
]
DH_ARGUMENTS: dict[str, Any] = {
    "base": np.eye(4).tolist(), "tool": np.eye(4).tolist(), "convention": "modified", "name": "n", "tip": "t",
}  # fmt: skip
NO_NUMBERS: tuple[Any, ...] = (
    None,
    1j,
    object(),
    np.nan,
    np.ones(3),
    np.float64(0.2),
    b"x",
    {1: 2},
    10**400,
    (),
    range(3),
)
LOG_ROWS = 90
CELLS = [
    "", " ", "nan", "NaN", "inf", "-inf", "1e308", "-1e308", "1e400", "1e-320", "0", "-0", "9" * 400, "9" * 5000, "1_0",
    "0x10", "1,5", "1.5.2", "None", "null", '"', '""', '"a\nb"', "\x00", "\x1b[31m", "[/red]", "٣", "１", "1e6", "1e7",
    "6.5", "400", str(2**63), str(-(2**63)), str(10**18), "1700000000123456789", "a" * 3000, "\u202e1", "#", "+", "1e",
]  # fmt: skip
HEADERS = [
    "", "t", "time", "stamp", "secs", "nsecs", "timestamp", "header.stamp", "ppr_1", "q", "\ufeff", "é", "時間",
    "[/red]",
    "\x1b[2J", "a" * 5000, '"', "'", "#", "velocity.", "position.", "x/y", "1", "nan", "\u2028", "\x85",
]  # fmt: skip
CODES_OF_LOGS = ("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "utf-7", "shift_jis", "gb2312", "cp1252", "cp037")
YAML_VALUES = [
    "0", "-1", "9", "10", "1e400", "9" * 400, "9" * 5000, "~", "[]", "{}", "[[[]]]", "'a'", '"', "&a [1]", "*a", ".nan",
    "zstd", "message", "file", "FILE", "mcap", "sqlite3", "cdr", "json", "sensor_msgs/msg/JointState", "2020-01-01",
    "!!",
    "!!python/object:os.system",
    "[" * 3000, "{a: " * 500, "\x00", "../../etc/passwd",
    "/dev/zero", ".", "true", "99999999999",
    str(2**63), str(2**64), "- a", "|", "%", "@",
]  # fmt: skip
SURVEY = """title = "Arms"
robots = ["planar-3r", {name = "panda", tool = {xyz = [0, 0, 0.1]}}]
cycles = 2
samples = 20
cases = 30
[tasks.position]
kind = "position"
[starts]
regular = 1
random = 2
margin = 0.1
[loops.circles]
kind = "circle"
size = [0.05, 0.2]
plane = "random"
direction = "random"
speed = 0.1
[loops.raster]
kind = "raster"
share = [0.02, 0.1]
[laws.p]
kind = "moore-penrose"
[laws.l]
kind = "best-lock"
[laws.w]
kind = "weighted"
weight = [[2, 0, 0], [0, 1, 0], [0, 0, 1]]
"""
SURVEY_VALUES: tuple[Any, ...] = (
    "", "x", "panda", "circle", "random", "*", "[", "no.urdf", "a\0b", "x" * 5000, 0, -1, 1, 10**12, 2**62, 0.5, -0.5,
    1e300, float("nan"), float("inf"), True, [], [0, 0], [1, 0], ["a"], [[1]], {}, {"kind": "circle"}, {"kind": "x"},
    {"name": "panda"}, {"kind": "import", "function": "no:no"}, {"kind": "lock"}, [0.2, 0.1], "日本",
)  # fmt: skip
SMALL_SURVEY = """title = "Arms"
robots = ["planar-3r"]
cycles = 2
samples = 10
cases = 4
[tasks.position]
kind = "position"
[starts]
regular = 2
[loops.circle]
kind = "circle"
size = 0.1
[laws.p]
kind = "moore-penrose"
[laws.l]
kind = "lock"
joints = ["joint1"]
"""
SQL_VALUES: tuple[Any, ...] = (
    None, "", "x", "planar-3r", "fault", "complete", "<b>", "a\0b", "x" * 5000, "日本", 0, -1, 1, 2**62, 0.5, -0.5,
    1e300, float("inf"), b"", b"\xff\x00", "{}", "[]", "null", "NaN",
)  # fmt: skip
JSON_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**70, 1e300, -0.5, float("nan"), float("inf"), "", "x", "nan", "1e400", "[0, 1]",
    "0x1p+3", "9" * 5000, [], {}, [0], [[0]], {"a": 1}, [0] * 1000, "\x1b[31m", "日本",
)  # fmt: skip
ODD_NUMBERS = (0, -1, 1, 2, 3, 2**31, 2**62, 1e300, -1e-300, float("nan"), float("inf"), None)
ODD_FLOATS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-320, 0.0, -1.0, 7.0)
WHOLE = (-(2**63), 2**63 - 1, -1, 0, 5, 10**6)
ARRAY_KINDS = ("<f4", ">f8", "<c16", "<i8", "<u1", "|b1", "<U3", "|O", "<M8[s]", "<f8,<i4")
ARRAY_SHAPES = ("(10000000000000,)", "(-1,)", "()", "(0,)", "(1000000, 4, 4)", "(2, 2)", "(True,)", "1", "(9**9,)")


@cache
def log() -> tuple[hk.Robot, list[str], np.ndarray]:
    """A robot and three cycles of it, in which the third joint is a function of the tool's place."""
    robot = hk.load("ppr")
    phase = np.linspace(0, 6 * np.pi, LOG_ROWS)
    x, y = 0.3 * np.cos(phase), 0.3 * np.sin(phase)
    z = 0.5 + 0.4 * x * y
    table = np.column_stack([0.05 * np.arange(LOG_ROWS), x - np.cos(z), y - np.sin(z), z])
    return robot, ["t", *robot.joint_names], table


@cache
def bags() -> dict[str, dict[str, bytes]]:
    """Whole bags: name of the bag to names and bytes of its files."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    robot, _, table = log()
    folder = Path(tempfile.mkdtemp(prefix="fuzz-bags-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    found = {}
    modes = rosbag2.CompressionMode
    for name, plugin, mode in (
        ("db3", "SQLITE3", modes.NONE), ("db3-message", "SQLITE3", modes.MESSAGE), ("db3-file", "SQLITE3", modes.FILE),
        ("mcap", "MCAP", modes.NONE), ("mcap-zstd", "MCAP", modes.STORAGE),
    ):  # fmt: skip
        bag = rosbag2.Writer(folder / name, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
        if mode is not modes.NONE:
            bag.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
        with bag:
            _fill(bag, get_typestore(Stores.ROS2_HUMBLE), robot, table, new=True)
        found[name] = {f.name: f.read_bytes() for f in (folder / name).iterdir()}
    for name in ("plain.bag", "bz2.bag", "lz4.bag"):
        old = rosbag1.Writer(folder / name)
        if name != "plain.bag":
            old.set_compression(rosbag1.Writer.CompressionFormat[name[:3].upper()])
        with old:
            _fill(old, get_typestore(Stores.ROS1_NOETIC), robot, table, new=False)
        found[name] = {name: (folder / name).read_bytes()}
    return found


def _fill(writer: Any, store: Any, robot: hk.Robot, table: np.ndarray, *, new: bool) -> None:
    names = ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    state, header, time = (store.types[name] for name in names)
    link = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
    none = np.zeros(0)
    for k, row in enumerate(table[::3][:30]):
        at = 10**9 + 50_000_000 * k
        head = header(time(at // 10**9, at % 10**9), "") if new else header(k, time(at // 10**9, at % 10**9), "")
        message, kind = state(head, list(robot.joint_names), row[1:].copy(), none, none), state.__msgtype__
        raw = store.serialize_cdr(message, kind) if new else store.serialize_ros1(message, kind)
        writer.write(link, at, raw)


@cache
def dataset(version: str) -> dict[str, bytes]:
    """The files of a dataset of a Panda that LeRobot itself wrote: names and bytes."""
    folder = GOLDEN / f"lerobot-{version}"
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


@cache
def certificate() -> bytes:
    """A certificate of a straight line of a planar arm."""
    q0 = [0.4, 0.6, 0.5]
    task = hk.position(hk.load("planar-3r"))
    start = task.robot.pose(q0)[:3, 3]
    path = hk.polyline([start, start + [-0.01, 0.005, 0.0]])
    found = hk.certify(hk.holonomic(task, hk.linear([0.0, 0.0, 1.0])), path, q0)
    with tempfile.TemporaryDirectory() as folder:
        found.save(Path(folder) / "c.json")
        return (Path(folder) / "c.json").read_bytes()


@cache
def sheets() -> tuple[hk.Task, dict[str, np.ndarray], bytes]:
    """The task of a map, its arrays, its file."""
    task = hk.position(hk.load("planar-3r"))
    found = hk.sheets(task, hk.workspace(box=([1.0, 0.6], [0.5, 0.5])), samples=16)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "s.npz"
        hk.analysis.sheets.write_sheets(found, file)
        with np.load(file) as arrays:
            return task, dict(arrays), file.read_bytes()
