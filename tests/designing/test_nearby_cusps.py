"""Cusps near a workspace: found where one is, and a law without them is taken, other things equal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import campaign
from holokin.designing import compare_laws
from holokin.designing.advice import ranked
from holokin.designing.nearby_cusps import NEAR, NearbyCusps, cusps_near, said_of
from holokin.errors import HolokinError

PANDA = np.array([0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8])


def strategy(constraint: hk.Constraint) -> hk.strategies.HolonomicStrategy:
    return hk.holonomic(hk.pose(hk.load("panda")), constraint)


def test_a_workspace_about_a_cusp_is_near_it_and_one_about_the_start_is_as_far_as_the_cusp() -> None:
    law = strategy(hk.lock(2))
    found = hk.cusps(law, PANDA, starts=300)
    for pose, near in ((found.poses[0], True), (law.task.pose(PANDA), False)):
        space = hk.workspace(box=(pose[:3, 3], [0.05] * 3), rotation=pose[:3, :3], tilt=0.2, spin=0.2)
        said = cusps_near(law, PANDA, space)
        assert said is not None and said.near is near
        away = np.linalg.norm(found.poses[:, :3, 3] - pose[:3, 3], axis=1)
        assert said.away <= away.min() + np.pi * 0.1 * np.sqrt(2)
        assert ("no proof" in said.sentence) is not near
    assert said.away > found.tool_away.min() - 0.15 > NEAR
    for bad in (np.eye(4), [[1, 2, 3]], [np.eye(4).T + np.eye(4)[3]]):
        with pytest.raises(HolokinError):
            found.tool_away_from(bad)


def test_where_none_is_found_or_none_is_looked_for_it_is_said() -> None:
    law = strategy(hk.lock(6))
    space = hk.workspace(box=(law.task.pose(PANDA)[:3, 3], [0.05] * 3))
    said = cusps_near(law, PANDA, space)
    assert said is not None and said.away == np.inf and "no cusp was found" in said.sentence
    assert cusps_near(hk.radial(hk.moore_penrose(law.task), PANDA), PANDA, space) is None
    assert "were not looked for" in said_of("radial", "radial", {"radial": None}, 0.0)[0]


@pytest.mark.parametrize("near", [{0}, campaign("near", {0, 1}), campaign("near", {0, 1, 2})])
def test_of_laws_that_serve_alike_one_without_a_cusp_nearby_is_taken(
    near: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Laws by their place in the ranking: those in `near` have a cusp; where all have, the first stays."""
    seen: list[Any] = []

    def given(law: Any, q0: Any, _space: Any) -> NearbyCusps:
        seen.append(law)
        return NearbyCusps(hk.cusps(strategy(hk.lock(6)), PANDA, starts=1), 0.0 if len(seen) - 1 in near else 0.4)

    monkeypatch.setattr(compare_laws, "cusps_near", given)
    monkeypatch.setattr(compare_laws, "MORE_SPEED", 2.0)
    bars = [{"a": 1.0, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0} for _ in range(3)]
    space = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
    advice = hk.advise(hk.from_dh(bars, name="planar"), space)
    order = [law.name for law in ranked(advice.laws)]
    assert len(seen) == min(len(near) + 1, compare_laws.MOST)
    assert advice.best.strategy is seen[0 if len(near) == compare_laws.MOST else len(near)]
    assert advice.best.name == order[0 if len(near) == compare_laws.MOST else len(near)]
    said = " ".join(advice.reasons)
    if len(near) == compare_laws.MOST:
        assert f"so has {order[1]}, {order[2]}" in said
    else:
        assert f"{order[0]}, which needs" in said and "0.4 m from the workspace" not in said.split("which needs")[0]
    assert advice.summary()["reasons"] == list(advice.reasons)
