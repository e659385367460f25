"""The map from the paper to the code: docs/paper.md is made from tags in src/ by `python tests/paper_map.py`.

A tag is a comment that begins with what it marks, `# (13)`, `# (31), (32)`, `# Theorem III.3`, words behind a colon
if need be, at the end of the line that is it or on a line of its own above. As a pytest plugin (`-p paper_map`) it
records which tagged functions and files each test runs, into the JSON file that PAPER_MAP_CALLS names.
"""

from __future__ import annotations

import ast
import importlib.machinery
import io
import json
import os
import re
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType
from typing import Any

ROOT = Path(__file__).parents[1]
THEOREMS = "strategies/test_theorems.py"
PAGE = ROOT / "docs" / "paper.md"
BEGIN, END = "<!-- made by tests/paper_map.py -->", "<!-- end -->"
ITEM = r"(?:\(\d{1,2}\)|Lemma III\.1|Theorem III\.[23]|Proposition 1|Table I|Further research)"
TAG = re.compile(rf"#\s*({ITEM}(?:, {ITEM})*)(?::.*)?$")

EQUATIONS = {
    "(1)": ("x = f(q)", ["strategies/test_paper.py::test_the_robot_ppr_has_the_papers_jacobian_18"]),
    "(2)": ("x' = J q', J = df/dq", ["strategies/test_paper.py::test_the_robot_ppr_has_the_papers_jacobian_18"]),
    "(3)": ("q' = G x'", ["strategies/test_paper.py::test_joint_rates_are_G_times_the_tools_rates_3"]),
    "(4)": (
        "involutive: [G_i, G_j] in range G; the code has the part outside it",
        [
            "strategies/test_paper.py::test_curvature_of_the_pseudo_inverse_of_ppr_is_a_quarter_of_N",
            "strategies/test_theorems.py::test_a_weighted_strategy_is_involutive_exactly_when_W_JT_is",
        ],
    ),
    "(5)": ("Lie bracket", ["strategies/test_paper.py::test_our_lie_bracket_agrees_with_sympy"]),
    "(6)": (
        "weighted pseudo-inverse",
        ["strategies/test_paper.py::test_seven_by_our_weighted_pseudo_inverse_gives_22_and_23"],
    ),
    "(7)": (
        "G = H H^T J^T (J H H^T J^T)^-1; computed as N_G (J N_G)^-1 (theory 1.3)",
        [
            "strategies/test_paper.py::test_our_strategy_keeps_the_digits_that_seven_loses",
            "strategies/test_paper.py::test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold",
        ],
    ),
    "(8)": (
        "H H^T J^T = N_G N_G^T J^T",
        ["strategies/test_paper.py::test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold"],
    ),
    "(9)": (
        "Range N_G and Null J meet in 0, so J N_G is nonsingular",
        [
            "strategies/test_paper.py::test_our_strategy_keeps_the_digits_that_seven_loses",
            "strategies/test_paper.py::test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold",
        ],
    ),
    **{
        number: (says, ["strategies/test_paper.py::test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold"])
        for number, says in {
            "(10)": "J_G q' = 0, J_G = dg/dq",
            "(11)": "extended Jacobian J_A = [J; J_G]",
            "(12)": "Null J and Null J_G meet in 0; the code has the angle between them",
            "(13)": "J_A H is block diagonal",
            "(14)": "J_A G = [1; 0]",
        }.items()
    },
    **{
        number: (
            says,
            [
                "strategies/test_theorems.py::test_a_representation_changes_the_geometric_jacobian_by_a_square_matrix_15_to_17"
            ],
        )
        for number, says in {
            "(15)": "J_w = T_phi J; the code has the inverse of T",
            "(16)": "a step of a proof: J^T = J_w^T T_phi^-T",
            "(17)": "J_w = T_psi J with another representation",
        }.items()
    },
    "(18)": ("J of the PPR arm", ["strategies/test_paper.py::test_the_robot_ppr_has_the_papers_jacobian_18"]),
    "(19)": ("N of the PPR arm", ["strategies/test_paper.py::test_the_null_space_of_ppr_is_the_papers_19"]),
    "(20)": (
        "N_G found by inspection",
        ["strategies/test_paper.py::test_the_packaged_job_holds_20_with_its_22_and_23_with_its_24"],
    ),
    "(21)": ("det H = 1", ["strategies/test_paper.py::test_H_of_20_has_determinant_one_everywhere_21"]),
    "(22)": ("G of (20)", ["strategies/test_paper.py::test_the_packaged_job_holds_20_with_its_22_and_23_with_its_24"]),
    "(23)": (
        "the cyclic strategy of [DO97]",
        ["strategies/test_paper.py::test_the_packaged_job_holds_20_with_its_22_and_23_with_its_24"],
    ),
    "(24)": (
        "its extended Jacobian",
        ["strategies/test_paper.py::test_the_packaged_job_holds_20_with_its_22_and_23_with_its_24"],
    ),
    "(25)": (
        "its N_G, a basis of ker J_G",
        ["strategies/test_paper.py::test_our_extended_jacobian_is_24_its_determinant_minus_one_and_its_kernel_25"],
    ),
    "(26)": (
        "J = [J_p; J_o]",
        ["strategies/test_paper.py::test_an_orientation_stands_below_the_position_and_its_rows_are_derivatives_26"],
    ),
    **{
        number: (says, ["strategies/tasks/test_frames.py::test_the_packaged_irb140_job_is_27_with_28_and_29"])
        for number, says in {
            "(27)": "G of the IRB 140, N_G = null(J_o + J_p)",
            "(28)": "J_p q' + J_o q' = 0",
            "(29)": "J_A = [1 0; 1 1] J; the code has its lower rows J_o + Lambda J_p",
        }.items()
    },
    "(30)": (
        "J N = 0",
        [
            "strategies/test_paper.py::test_the_null_space_of_ppr_is_the_papers_19",
            "strategies/test_theorems.py::test_the_bracket_of_a_kernel_needs_the_rows_derivative_only_33_to_35",
        ],
    ),
    **{
        number: (
            says,
            ["strategies/test_theorems.py::test_the_bracket_of_a_kernel_needs_the_rows_derivative_only_33_to_35"],
        )
        for number, says in {
            "(31)": "a step of a proof: its derivative; the code has it for any rows A, along G_j and summed over u",
            "(32)": "a step of a proof: the same, i and j exchanged",
            "(33)": "a step of a proof: (31) times N_uj less (32) times N_ui",
            "(34)": "a step of a proof: summed over u (errata E1)",
            "(35)": "A [G_i, G_j] by derivatives of A alone, 0 for an exact J",
        }.items()
    },
    "(36)": ("J [N_i, N_j] = 0", ["strategies/test_theorems.py::test_a_null_space_basis_is_involutive_lemma_III_1_36"]),
    "Table I": ("IRB 140", ["robot/test_robot.py::test_the_irb140_is_table_I"]),
}

THEOREMS = {
    "Lemma III.1": (
        "a null-space basis of an exact J is involutive",
        [
            "strategies/test_theorems.py::test_a_null_space_basis_is_involutive_lemma_III_1_36",
            "analysis/curvature/test_verdicts.py::test_a_verdict_says_on_which_grounds_it_reaches_beyond_its_postures",
        ],
    ),
    "Theorem III.2": (
        "G is holonomic exactly when it has an H = [N_G N] with N_G involutive",
        [
            "strategies/test_paper.py::test_the_paper_strategies_are_holonomic_and_the_pseudo_inverse_is_not",
            "strategies/test_paper.py::test_a_holonomic_strategy_has_a_nonsingular_H_and_10_to_14_hold",
        ],
    ),
    "Theorem III.3": (
        "one H, any representation of orientation",
        ["strategies/test_theorems.py::test_the_planes_do_not_depend_on_the_representation_of_orientation_III_3"],
    ),
    "Further research": (
        "section VI: all N_G (theory 1.6)",
        ["strategies/test_laws.py::test_the_papers_two_strategies_are_members_of_the_family"],
    ),
    "Proposition 1": (
        "of [RM93], used in the proofs: G_W is involutive exactly when W J^T is",
        ["strategies/test_theorems.py::test_a_weighted_strategy_is_involutive_exactly_when_W_JT_is"],
    ),
}


@dataclass(frozen=True)
class Tag:
    """Where an item stands: file, name of the function ("" in a table), and the line at which its code begins."""

    item: str
    file: str
    name: str
    first: int
    text: str

    @property
    def place(self) -> str:
        """As docs/paper.md has it."""
        return f"`{self.file}::{self.name}`" if self.name else f"`{self.file}`"

    @property
    def key(self) -> str:
        """As the record of calls has it."""
        return f"{self.file}:{self.first}" if self.name else self.file


def comments(file: Path) -> Iterator[tuple[int, str]]:
    """(line of the code it speaks of, text) of each comment."""
    lines = file.read_text("utf-8").splitlines()
    if file.suffix == ".py":
        tokens = tokenize.generate_tokens(io.StringIO("\n".join(lines) + "\n").readline)
        found = [(t.start[0], t.string) for t in tokens if t.type == tokenize.COMMENT]
    else:
        found = [(k, line.strip()) for k, line in enumerate(lines, 1) if line.lstrip().startswith("#")]
    for k, text in found:
        while k < len(lines) and (not lines[k - 1].strip() or lines[k - 1].lstrip().startswith("#")):
            k += 1
        yield k, text


def function_at(tree: ast.Module, line: int) -> tuple[str, int]:
    """(dotted name, first line) of the innermost function around a line; a handler of a kind goes by its function's."""
    names, first = [], 0
    node: ast.AST = tree
    while True:
        inner = [
            child
            for child in ast.walk(node)
            if child is not node
            and isinstance(child, ast.FunctionDef | ast.ClassDef)
            and min([child.lineno, *(d.lineno for d in child.decorator_list)]) <= line <= (child.end_lineno or 0)
        ]
        if not inner:
            return (".".join(names), first) if isinstance(node, ast.FunctionDef) else ("", 0)
        node = min(inner, key=lambda child: child.lineno)
        first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
        handlers = [
            d.value for d in map(_called, node.decorator_list) if isinstance(d, ast.Attribute) and d.attr == "register"
        ]
        names.append(ast.unparse(handlers[0]) if handlers and node.name == "_" else node.name)


def _called(decorator: ast.expr) -> ast.expr:
    return decorator.func if isinstance(decorator, ast.Call) else decorator


@cache
def tags() -> tuple[Tag, ...]:
    """Every tag in src/, in the order of files and lines."""
    found = []
    for file in sorted(f for f in (ROOT / "src").rglob("*") if f.suffix in (".py", ".toml")):
        text = file.read_text("utf-8")
        if not any(map(TAG.search, text.splitlines())):
            continue  # to read its tokens takes longer
        tree = ast.parse(text) if file.suffix == ".py" else None
        for line, said in comments(file):
            if match := TAG.match(said):
                name, first = function_at(tree, line) if tree else ("", 0)
                assert name or tree is None, f"{file}:{line}: the tag {said!r} stands in no function"
                place = file.relative_to(ROOT).as_posix()
                found += [Tag(item, place, name, first, said) for item in re.findall(ITEM, match[1])]
    return tuple(found)


def tables() -> str:
    """The part of docs/paper.md between the markers."""
    out = []
    for title, rows in (("Equations", EQUATIONS), ("Theorems", THEOREMS)):
        out += [f"## {title}", "", "| Paper | What it says | Code | Test |", "|---|---|---|---|"]
        for item, (says, tests) in rows.items():
            code = ", ".join(dict.fromkeys(t.place for t in tags() if t.item == item)) or "in the test"
            out.append(f"| {item} | {says} | {code} | {', '.join(f'`tests/{test}`' for test in tests)} |")
        out.append("")
    return "\n".join(out)


def page() -> str:
    """docs/paper.md with its tables made again."""
    text = PAGE.read_text("utf-8")
    head, rest = text.split(BEGIN)
    return f"{head}{BEGIN}\n\n{tables()}\n{END}{rest.split(END)[1]}"


# --- the plugin ---

_CALLS: dict[str, list[str]] = {}
_SEEN: list[set[str]] = []


class _Marking(importlib.machinery.SourceFileLoader):
    """Reads a tagged file such that each of its tagged functions begins with a note that it is called.

    A trace function would be told of every call of every library.
    """

    def get_code(self, fullname: str) -> CodeType:
        """Not from bytecode, which is without the notes."""
        return self.source_to_code(self.get_data(self.path), self.path)

    def source_to_code(self, data: Any, path: Any, *, _optimize: int = -1) -> CodeType:
        """Compile it with the notes."""
        place = Path(path).relative_to(ROOT).as_posix()
        keys = {tag.first: tag.key for tag in tags() if tag.file == place and tag.name}
        tree = ast.parse(data, path)
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
                if first in keys:
                    docstring = ast.get_docstring(node, clean=False) is not None
                    note = ast.parse(f"__import__('paper_map').called({keys[first]!r})").body
                    node.body[docstring:docstring] = note
        return compile(ast.fix_missing_locations(tree), path, "exec", dont_inherit=True)


class _Finder(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> Any:
        """As ever, but a tagged file is read by `_Marking`."""
        if not fullname.startswith("holokin"):
            return None
        spec = super().find_spec(fullname, path, target)
        if spec is not None and spec.origin in {str(ROOT / tag.file) for tag in tags() if tag.name}:
            spec.loader = _Marking(fullname, spec.origin)
        return spec


def called(key: str) -> None:
    """Note that a tagged function is called, by the test that runs."""
    if _SEEN:
        _SEEN[-1].add(key)


def pytest_configure() -> None:
    """Look at the files that are opened: tables of robots and jobs are tagged, too."""
    files = {str(ROOT / tag.file): tag.key for tag in tags() if not tag.name}

    def look(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and _SEEN and (key := files.get(str(arguments[0]))):
            _SEEN[-1].add(key)

    sys.addaudithook(look)


def pytest_runtest_call(item) -> None:
    """Run one test and see which of the tagged functions it calls."""
    test, run = f"{item.path.parent.name}/{item.path.name}::{item.originalname}", item.runtest

    def watched() -> None:
        sys.modules["holokin.robot.formats.loading"]._in_use.clear()  # a robot in use is not read again
        _SEEN.append(set())
        try:
            run()
        finally:
            _CALLS[test] = sorted({*_CALLS.get(test, []), *_SEEN.pop()})

    item.runtest = watched


def pytest_sessionfinish() -> None:
    """Leave the record."""
    Path(os.environ["PAPER_MAP_CALLS"]).write_text(json.dumps(_CALLS), "utf-8")


if "PAPER_MAP_CALLS" in os.environ:
    assert "holokin" not in sys.modules
    sys.meta_path.insert(0, _Finder)

if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
