"""xacro files: broken bytes, odd expressions, macros, conditions, arguments, files in files. Each is a process."""

from __future__ import annotations

import random
from pathlib import Path

import holokin as hk
from benchmarks.fuzz.jobs import broken

SOUND = """<?xml version="1.0"?><robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
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

_EXPRESSIONS = (
    "", "1/0", "L", "L.x", "props.nothing", "props.up[5]", "9**9**9", "lambda: 1", "[i for i in [1]]", "().__class__",
    "'a' * 10**9", "xacro.load_yaml('more.xacro')", "xacro.load_yaml('/etc/passwd')", "python.vars(1)", "f'{L}'",
    "xacro.fatal('x')", "xacro.warning('x')", "None", "True", "{}", "(1,", "'", "1 +", "nan", "-" * 3000 + "1",
    "list(range(10))", "'%s' % L", "'%d' % 'a'", "max()", "min(1, 'a')", "sin('a')", "float('x')",
    "日本", "1 if", "x y",
)  # fmt: skip
_PARTS = (
    "${2 * L}", "${-pi}", "$(arg length)", "xacro:if", "xacro:macro", "more.xacro", "props.yaml",
    "value=", "name=", "0.5",
    "${L ** 2}", "*block", "z:=0.1", "params=", "<xacro:insert_block name=\"block\"/>",
    "base", "upper", "</xacro:macro>",
)  # fmt: skip
_OTHERS = (
    "$(find nowhere)", "$(env NOTHING)", "$(eval 1 + 1)", "$(eval lambda: 1)", "$(cwd)", "$(", "${",
    "$${x}", "xacro:call",
    "xacro:unless", "arm.xacro", "**block", "z:=${z}", "z:=^|1", "xacro:x", "", "\0", "$(arg nothing)", "xacro:element",
)  # fmt: skip


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, read as a robot."""
    chance = random.Random(seed)
    texts = {"arm.xacro": SOUND, "more.xacro": MORE, "props.yaml": YAML}
    for _ in range(chance.choice((1, 1, 2, 3))):
        put = chance.choice(_OTHERS) if chance.random() < 0.5 else f"${{{chance.choice(_EXPRESSIONS)}}}"
        texts["arm.xacro"] = texts["arm.xacro"].replace(chance.choice(_PARTS), put, chance.choice((1, -1)))
    spoilt = chance.choice(list(texts)) if chance.random() < 0.3 else ""
    for name, text in texts.items():
        (folder / name).write_bytes(broken(text.encode(), chance) if name == spoilt else text.encode())
    hk.load(folder / "arm.xacro", args=chance.choice((None, {"length": 0.7}, {"length": "a b"}, {"no": True})))
