"""Names in exported C: whatever a joint, a strategy or a job is called, the strictest build takes the code."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import ArgumentError
from holokin.export import check
from holokin.export.c.c_folder import WARNINGS
from holokin.symbolic.native import compiler

NASTY = [
    "??/", "*??/", "ends with ??/", "\\", "*\\", "*/ #error", "/*/", "// x \\", "a\nb", "\u202e } ; \u2066", "\u200f",
    "\x07\x1b[31m", "\u2028", "\ud800", "$name ${NAME}", "100 %s %n", "Gelenk \u00e4", "\u5173\u8282", "a|b",
]  # fmt: skip


@pytest.mark.campaign
@pytest.mark.skipif(compiler() is None, reason="needs a C compiler")
def test_no_name_of_a_users_breaks_the_strictest_build(tmp_path: Path) -> None:
    rows = [{"a": 0.4, "joint": f"{text}{k}" if k % 2 else f"{k}{text}"} for k, text in enumerate(NASTY)]
    robot = hk.from_dh(rows[:6], name=" ".join(NASTY[6:12]))
    strategy = hk.moore_penrose(hk.position(robot), name="".join(NASTY))
    for k, title in enumerate(("??/", "\\", strategy.name)):
        law = hk.moore_penrose(strategy.task, name=title)
        found = hk.export.export_c(law, tmp_path / str(k), q0=0.1 + 0.2 * np.arange(robot.n), name="law",
                            vectors_count=1, origin=title, limits=False)  # fmt: skip
        for file in found.files:
            text = (found.folder / file).read_text("utf-8")
            assert not re.search(r"[\u202a-\u202e\u2066-\u2069\u200e\u200f\x00-\x08\x0b-\x1f\x7f]", text), file
            assert "??/" not in text, file
        if k != 1:
            continue
        assert "-Wall" in WARNINGS and "-Werror" in WARNINGS
        check(found)
    check(found)


@pytest.mark.parametrize("name", ["features", "stdint", "newlib", "reent", "corecrt", "endian", "volatile"])
def test_a_header_that_would_hide_one_of_the_c_library_is_refused(ppr: hk.Robot, tmp_path: Path, name: str) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    with pytest.raises(ArgumentError, match="no word or header of C"):
        hk.export.export_c(strategy, tmp_path, q0=[0.9, -0.3, 0.8], name=name)
    assert list(tmp_path.iterdir()) == []
