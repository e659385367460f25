"""Without torch and JAX holokin is whole; who asks for them is told how to install them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import holokin as hk
from holokin.base.errors import MissingExtraError


@pytest.mark.parametrize("library", ["torch", "jax"])
def test_a_library_that_is_missing_is_named_with_its_extra(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    room: Any = getattr(hk.learning, library)
    ik = hk.ik(hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2)), [0.3, 0.8, 0.5])
    with pytest.raises(MissingExtraError, match=rf"this needs {library}; .*holokin\[interop\]"):
        room.inverse(ik)


def test_no_other_extra_installs_torch_or_jax() -> None:
    """They are large: the two commands of the README work without them."""
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
    assert [line.split(" ")[0] for line in text.splitlines() if "torch" in line] == ["interop"]
    assert [line for line in text.splitlines() if "holokin[" in line and "interop" in line] == []
