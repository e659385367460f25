"""The drift of a tracker is measured at every start, and refused circles are counted."""

from __future__ import annotations

import sys
import types

import numpy as np
import pytest
from benchmarks import trackers


class Tracker:
    """It drifts by 0.25 rad in joint 1 a circle where it is told to, and holds beyond a reach."""

    def __init__(self, q: np.ndarray, drifts: bool) -> None:
        self.q, self.drifts = q, drifts

    def update(self, pose: np.ndarray) -> types.SimpleNamespace:
        held = self.q[1] > 0.5
        step = np.eye(len(self.q))[0] * 0.25 / trackers.SAMPLES * self.drifts
        self.q = self.q + step
        return types.SimpleNamespace(
            q=self.q,
            status=types.SimpleNamespace(name="HELD" if held else "OK"),
            reason="unreachable" if held else None,
        )


def test_the_drift_of_a_tracker_is_measured_at_every_start_and_refused_circles_are_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def from_prebuilt(name: str) -> types.SimpleNamespace:
        return types.SimpleNamespace(
            joint_limits=[(-1.0, 1.0), None, (-1.0, 2.0)], solver_name="a", fk=lambda q: np.eye(4),
            tracker=lambda q: Tracker(q, name == "iiwa14"),
        )  # fmt: skip

    ssik = types.SimpleNamespace(Manipulator=types.SimpleNamespace(from_prebuilt=from_prebuilt))
    monkeypatch.setitem(sys.modules, "ssik", ssik)
    found = trackers.tracked("iiwa14", 12)
    assert len(found.drift) + found.held["unreachable"] == 12
    assert 0 < found.held["unreachable"] < 12
    assert found.drift == pytest.approx(0.25)
    monkeypatch.setattr(trackers, "version", lambda name: "0.0")
    rows = {cells[1].strip(): cells for line in trackers.tracker_page(True) if len(cells := line.split("|")) > 8}
    assert (rows["iiwa14"][5].strip(), rows["iiwa14"][8].strip()) == ("0", "2.5e-01")
    assert rows["Panda"][3].strip() == rows["Panda"][5].strip()


def test_without_ssik_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ssik", None)
    assert "Left out: ssik" in "\n".join(trackers.tracker_page(True))
