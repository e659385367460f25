"""The controls of the page: what they say and show, and what each of them changes. No browser."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import holokin as hk

pytest.importorskip("viser", reason="the extra `studio` is not installed")


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the virtual machine, which shows the same and needs no compiler."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")


@pytest.fixture
def studio() -> Iterator[Any]:
    """A studio with the smallest job."""
    made = hk.studio("ppr-cycle", port=0, browser=False, wait=False, tell=str)
    yield made
    made.close()


def test_every_control_of_the_page_says_what_it_does_where_the_mouse_rests_on_it(studio: Any) -> None:
    controls = studio.server.gui._gui_input_handle_from_uuid.values()
    assert len(controls) > 30 and [control.label for control in controls if not control.hint] == []
    assert [control.label for control in controls if control.hint.lower() == control.label.lower()] == []
