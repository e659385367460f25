"""A xacro file is data: its expressions run nothing, and files made to fill time or memory are refused."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, write_job
from holokin.base.errors import RobotFileError
from holokin.robot.formats import xacro_expander

pytest.importorskip("xacrodoc")

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
ARM = """<link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
  <origin xyz="0 0 {z}"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""
SHELL = "().__class__.__base__.__subclasses__()"
RUN = f"[c for c in {SHELL} if c.__name__ == '_wrap_close'][0].__init__.__globals__['system']('touch MARK')"
LAMBDA = f"(lambda: {RUN})()"
"""What Python does of it: touch MARK. The names lie in a code object of their own, which xacro does not look at."""


def robot(inside: str = "", z: str = "0.1") -> str:
    return f'<robot name="r" {NAMESPACE}>{inside}{ARM.format(z=z)}</robot>'


VALUES = {
    "lambda": LAMBDA,
    "comprehension": f"[{RUN} for i in [0]]",
    "generator": f"list({RUN} for i in [0])",
    "dunder": SHELL,
    "dunder of a function": "xacro.load_yaml.__globals__['os'].system('touch MARK')",
    "dunder of a namespace": "math.__dict__",
    "dunder name": "__builtins__",
    "dunder in a format": r"'\x7b0.__class__\x7d'.format(1)",  # a brace would end the expression
    "part in a format": r"'\x7b0.real\x7d'.format(1)",
    "index in a format": r"'\x7b0[x]\x7d'.format(dict(x=1))",
    "part in the width of a format": r"'\x7b0:\x7b1.real\x7d\x7d'.format(1, 2)",
    "format_map": r"'\x7bx\x7d'.format_map(dict(x=1))",
    "mro": "str.mro()",
    "frame": "(i for i in [0]).gi_frame",
    "frame of a list": "[g.gi_frame.f_back.f_globals for g in [(i for i in [0])]]",
    "code of a function": "xacro.arg.func_code",
    "vars": "python.vars(str)",
    "type": "python.type('X', (), dict())",
    "type without a dot": "type(1)",
    "walrus": "(x := 1)",
    "import": "__import__('os')",
    "open": "open('MARK', 'w')",
    "eval": "eval('1')",
    "getattr": "getattr(str, 'mro')",
    "method of a namespace": "python.update(x=1)",
    "parent of a namespace": "math.root",
    "method of a class": "str.split('a b')",
    "functions of functions": "list(map(str.upper, ['a']))",
    "yield": "(yield 1)",
}
"""Expressions that must be refused, by what they try."""

PLACES = {
    "attribute": robot(z="${X}"),
    "text": robot("<gazebo>${X}</gazebo>"),
    "property": robot('<xacro:property name="p" value="${X}"/>', z="${p}"),
    "property at once": robot('<xacro:property name="p" value="${X}" lazy_eval="false"/>'),
    "global property": robot('<xacro:property name="p" value="${X}" scope="global"/>'),
    "name of a property": robot('<xacro:property name="${X}" value="1"/>'),
    "condition": robot('<xacro:if value="${X}"><link name="c"/></xacro:if>'),
    "unless": robot('<xacro:unless value="${X}"><link name="c"/></xacro:unless>'),
    "argument": robot('<xacro:arg name="p" default="${X}"/>'),
    "default of a macro": robot('<xacro:macro name="m" params="p:=${X}"><link name="${p}"/></xacro:macro><xacro:m/>'),
    "parameter": robot('<xacro:macro name="m" params="p"><link name="${p}"/></xacro:macro><xacro:m p="${X}"/>'),
    "block": robot(
        '<xacro:macro name="m" params="*p"><xacro:insert_block name="p"/></xacro:macro><xacro:m><l n="${X}"/></xacro:m>'
    ),
    "call": robot('<xacro:call macro="${X}"/>'),
    "element": robot('<xacro:element xacro:name="${X}"/>'),
    "attribute's name": robot('<xacro:attribute name="${X}" value="1"/>'),
    "file name": robot('<xacro:include filename="${X}"/>'),
    "comment": robot("<!-- xacro:eval-comments --><!-- ${X} -->"),
    "substitution": robot(z="$(eval lambda: 1)"),
    "included": robot('<xacro:include filename="inner.xacro"/>'),
    "yaml": robot(z="${xacro.load_yaml('inner.yaml')}"),
}
"""Places where xacro evaluates an expression X."""

UNDUNDERED = robot(
    """<xacro:property name="O" value="${python.vars(python.type)['__subclasses__'](str.mro()[1])}"/>
    <xacro:property name="W" value="${O[list(map(str, O)).index(&quot;&lt;class 'os._wrap_close'&gt;&quot;)]}"/>
    <xacro:property name="I" value="${python.vars(W)['__init__']}"/>
    <xacro:property name="D" value="${python.vars(python.type(I))['__globals__']}"/>
    <xacro:property name="G" value="${python.vars(python.type(D))['__get__'](D, I)}"/>""",
    z="${G['system']('touch MARK')}",
)
"""Names no dunder: they are texts. Python does of it: touch MARK."""

SUBSTITUTED = robot("""<link name="$(eval ${'open\\x28\\'MARK\\',\\'w\\'\\x29'})"/>""")
"""$(eval ...) has all of Python's functions, where a bracket is written so. Python does of it: open("MARK", "w")."""


def expanded(folder: Path, texts: list[str]) -> list[dict[str, str]]:
    """What a process of its own answers of each text: as `hk.load` asks, but of many files at once."""
    program = "import json, runpy, sys; from pathlib import Path; expand = runpy.run_path(sys.argv[1])['answer']; "
    program += "print(json.dumps([expand(Path(p), {}) for p in sys.argv[2:]]))"
    paths = [folder / f"robot{i}.xacro" for i in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text.replace("MARK", str(folder / "mark")))
    done = subprocess.run(
        [sys.executable, "-P", "-c", program, xacro_expander.__file__, *map(str, paths)],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)


def marked(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.suffix not in (".xacro", ".yaml"))


def test_no_known_way_out_of_an_expression_runs(tmp_path: Path) -> None:
    files = {name: robot(z=f"${{{text}}}") for name, text in VALUES.items()}
    files |= {"texts that are dunders": UNDUNDERED, "brackets in a substitution": SUBSTITUTED}
    answers = dict(zip(files, expanded(tmp_path, list(files.values())), strict=True))
    assert [name for name, answer in answers.items() if "fault" not in answer] == []
    assert marked(tmp_path) == []


def test_an_expression_is_refused_wherever_it_stands(tmp_path: Path) -> None:
    (tmp_path / "inner.xacro").write_text(
        f'<robot {NAMESPACE}><link name="${{{LAMBDA}}}"/></robot>'.replace("MARK", str(tmp_path / "mark"))
    )
    (tmp_path / "inner.yaml").write_text(f'a: !degrees "{LAMBDA}"'.replace("MARK", str(tmp_path / "mark")))
    answers = expanded(tmp_path, [text.replace("${X}", f"${{{LAMBDA}}}") for text in PLACES.values()])
    for place, answer in zip(PLACES, answers, strict=True):
        assert answer.get("fault") == "it holds a lambda", (place, answer)
        assert answer["expression"].startswith(("(lambda:", "lambda:")), place
    assert {Path(answer["file"]).name for answer in answers[-2:]} == {"inner.xacro", "inner.yaml"}
    assert marked(tmp_path) == []


def test_a_file_that_runs_python_is_refused_wherever_it_is_named(holokin: Command, tmp_path: Path) -> None:
    path = tmp_path / "arm.xacro"
    path.write_text(robot(z=f"${{{LAMBDA}}}").replace("MARK", str(tmp_path / "mark")))
    with pytest.raises(RobotFileError, match=r"arm.xacro is not evaluated: it holds a lambda\)"):
        hk.load(path)
    assert_refused(holokin("robots", path), "it holds a lambda", "write it with numbers")
    job = write_job(tmp_path, robot='[robot]\nname = "arm.xacro"\n')
    outcome = holokin("run", job, "--out", tmp_path / "out")
    assert outcome.code == 2
    assert "it holds a lambda" in outcome.err
    assert not (tmp_path / "mark").exists()


BOMBS = {
    "long number": (robot(z="${9**9**9}"), "a whole number|too long a number"),
    "long text": (robot(z="${'a' * 10**12}"), "a text of"),
    "long range": (robot(z="${sum(range(10**15))}".replace("sum", "python.sum")), "range of more than"),
    "wide format": (robot(z="${'%99999999999d' % 1}"), "a text of 1e"),
    "macro in itself": (robot('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>'), "contains itself"),
    "file in itself": (robot('<xacro:include filename="robot5.xacro"/>'), "contains itself"),
    "deep expression": (robot(z=f"${{{'-' * 5000}1}}"), "nested too deep"),
    "precise format": (robot(z="${'%.*f' % (10**9, 1.5)}"), "a text of 1e"),
    "many zeros": (robot(z="${'1'.zfill(10**9)}"), "a text of 1e"),
    "long replacement": (robot(z="${('1' * 10**6).replace('1', '2' * 10**6)}"), "a text of 1e"),
    "joined texts": (robot(z="${','.join(['1' * 10**6] * 10**6)}"), "a text of 1e"),
}


def test_a_file_made_to_fill_memory_is_refused(tmp_path: Path) -> None:
    answers = expanded(tmp_path, [text for text, _ in BOMBS.values()])
    for (name, (_, words)), answer in zip(BOMBS.items(), answers, strict=True):
        assert re.search(words, answer.get("fault", "")), (name, answer)


@pytest.mark.campaign
def test_a_file_made_to_take_for_ever_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nested = "".join(
        f'<xacro:macro name="m{i + 1}">{f"<xacro:m{i}/>" * 10}</xacro:macro>' for i in range(12)
    )  # 10^12 elements
    (tmp_path / "laughs.xacro").write_text(robot(f'<xacro:macro name="m0"><a/></xacro:macro>{nested}<xacro:m12/>'))
    monkeypatch.setattr("holokin.robot.formats.xacro._WAIT", 1.5)
    with pytest.raises(RobotFileError, match=r"takes longer than 1\.5 s"):
        hk.load(tmp_path / "laughs.xacro")


def test_no_module_beside_the_file_is_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("xacro", "yaml", "xacrodoc", "json"):
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w')")
    (tmp_path / "z.yaml").write_text("z: 0.25")
    (tmp_path / "arm.xacro").write_text(robot(z="${xacro.load_yaml('z.yaml').z}"))
    monkeypatch.chdir(tmp_path)
    assert hk.load("arm.xacro").pose([0.0])[2, 3] == pytest.approx(0.25)
    assert not (tmp_path / "mark").exists()


LAWS = {
    "2 * (1 + 3) / 4 - 7 // 2 % 2 ** 2": -1.0,
    "radians(180) == pi and not 1 > 2": True,
    "math.sin(0) or 'x'": "x",
    "1 < 2 < 3 != 4": True,
    "'left' if side == 'l' else 'right'": "left",
    "props.joint.lower": -1.5,
    "props['joint']['limits'][1:]": [2, 3],
    "props.joint.limits[-1] + len(props.joint.limits)": 6,
    "'a' in props": False,
    "props.get('a', 3)": 3,
    "list(props.keys())": ["joint"],
    "'0 1 2'.split(' ')[2]": "2",
    "'%s_%.2f' % (side, 0.5)": "l_0.50",
    r"'\x7b\x7d_\x7bb:.1f\x7d'.format(side, b=0.25)": "l_0.2",
    "f'v' + str(1)": "v1",
    "[*[1], 2] + list(map(float, '3 4'.split()))": [1, 2, 3.0, 4.0],
    "dict(a=1, **dict(b=2))": {"a": 1, "b": 2},
    "python.sorted([3, 1])": [1, 3],
    "max(1, 2, key=python.abs) + abs_of": 3,
    "name.startswith('panda') or name.upper() == 'ARM'": True,
    "-1 if is_on else +1": -1,
    "xacro.tokenize('1,2')": ["1", "2"],
    "props.get('a') is None and side is not None": True,
}


@pytest.mark.parametrize("text", LAWS)
def test_expressions_of_robot_descriptions_have_the_values_of_python(text: str) -> None:
    import xacro

    inside = xacro_expander.xacro_interpreter(xacro)
    names = xacro.Table(xacro._global_symbols)
    for name, value in {
        "side": "l", "props": xacro.YamlDictWrapper(joint={"lower": -1.5, "limits": [1, 2, 3]}),
        "name": "arm", "is_on": True, "abs_of": 1,
    }.items():  # fmt: skip
        names[name] = value
    found = inside.evaluate(text, names)
    assert found == LAWS[text]
    assert found == eval(text, {"__builtins__": {}}, names)  # the referee


@pytest.mark.parametrize("seed", range(30))
def test_a_wide_format_is_refused_and_the_same_one_of_a_sensible_width_has_the_value_of_python(seed: int) -> None:
    """Widths and precisions, in digits or given beside the text, of every way to format, among digits that are none."""
    import xacro

    inside = xacro_expander.xacro_interpreter(xacro)
    names, rng = xacro.Table(xacro._global_symbols), np.random.default_rng(seed)
    flag, value, name = rng.choice(["", "-", "0", "+"]), rng.choice(["7", "-2.5"]), f"serial{rng.integers(10**9)}"
    form = str(rng.choice([
        "'{name} %{flag}{w}.3f' % {value}", "'%% {name} %{flag}*.3f' % ({w}, {value})", "'%.{w}f {name}' % {value}",
        "'%.*f' % ({w}, {value})", "'{{0:{w}.3f}} {name}'.format({value})", "'{{:{{}}}}'.format({value}, {w})",
        "f'{{{value}:{w}.3f}} {name}'", "f'{{{value}:.{{{w}}}f}}'", "'{name}'.zfill({w})",
    ]))  # fmt: skip
    wide, sensible = (form.format(name=name, flag=flag, value=value, w=w) for w in (rng.integers(10**7, 10**12), 12))
    with pytest.raises(xacro_expander.Refused, match="a text of"):
        inside.evaluate(wide, names)
    assert inside.evaluate(sensible, names) == eval(sensible)
