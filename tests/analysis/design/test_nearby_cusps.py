"""Cusps near a workspace: found where one is, and a law without them is taken, other things equal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import campaign
from holokin.analysis.design import advice_case, nearby_cusps
from holokin.analysis.design.nearby_cusps import NEAR, NearbyCusps, cusps_near
from holokin.analysis.design.trials import ranked
from holokin.app.studio.states import leaf_cusps

PANDA = np.array([0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8])
BARS = [{"a": 1.0, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0} for _ in range(3)]
FLAT = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))


def strategy(constraint: hk.Constraint) -> hk.strategies.HolonomicStrategy:
    return hk.holonomic(hk.pose(hk.load("panda")), constraint)


@pytest.mark.parametrize(
    ("near", "starts"), [(True, 100), *(campaign(("near", "starts"), (near, 300)) for near in (True, False))]
)
def test_a_workspace_about_a_cusp_is_near_it_and_one_about_the_start_is_as_far_as_the_cusp(
    near: bool, starts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    law = strategy(hk.lock(2))
    found = hk.cusps(law, PANDA, starts=starts)
    if starts < nearby_cusps.STARTS:  # the search is the same, and not made again
        monkeypatch.setattr(nearby_cusps, "STARTS", starts)
        monkeypatch.setattr(nearby_cusps, "cusps", lambda one, _q0, starts: {(law, starts): found}[one, starts])
    pose = found.poses[0] if near else law.task.pose(PANDA)
    space = hk.workspace(box=(pose[:3, 3], [0.05] * 3), rotation=pose[:3, :3], tilt=0.2, spin=0.2)
    said = cusps_near(law, PANDA, space)
    assert said.near is near and said.clear is not near
    away = np.linalg.norm(found.poses[:, :3, 3] - pose[:3, 3], axis=1)
    assert said.away <= away.min() + np.pi * 0.1 * np.sqrt(2)
    assert ("no proof" in said.sentence) is not near
    assert near or said.away > found.tool_away.min() - 0.15 > NEAR
    assert said.found is not None
    least = said.found.witness
    assert (
        least is not None
        and f"is {least.length:.2g} m long" in said.loop
        and f"a joint is {least.apart:.2g} " in said.loop
    )


def test_where_none_is_found_or_none_is_looked_for_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nearby_cusps, "STARTS", 60)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    law = strategy(hk.linear([0, 0, 0, 1, 0, 0, 1]))
    space = hk.workspace(box=(law.task.pose(PANDA)[:3, 3], [0.05] * 3))
    proven = cusps_near(strategy(hk.lock(6)), PANDA, space)
    assert proven.clear and proven.sentence.startswith("its leaf has no cusp: proven on the whole arm")
    said = cusps_near(law, PANDA, space)
    assert said.clear and said.away == np.inf and "no cusp was found" in said.sentence and not said.loop
    flat, q0 = hk.position(hk.from_dh(BARS, name="planar")), np.array([-0.6, 1.0, 0.8])
    radial = cusps_near(hk.radial(hk.moore_penrose(flat), q0), q0, FLAT)
    assert radial.found is None and not radial.clear and not radial.near
    assert "were not looked for: its formulas are too long" in radial.sentence
    line = hk.holonomic(hk.position(flat.robot, rows=[0]), hk.lock(1, 2))
    said = cusps_near(line, q0, FLAT)
    assert said.clear and said.sentence.startswith("its leaf has no cusp") and "search" not in said.sentence
    assert leaf_cusps("lock", line, q0).sentence.startswith("lock: its leaf has no cusp")
    beyond = cusps_near(law, PANDA + [0, 0, 0, 2.0, 0, 0, 0], space)
    assert beyond.found is None and "panda_joint4" in beyond.reason


@pytest.mark.campaign
@pytest.mark.parametrize("near", [{0}, {0, 1}, {0, 1, 2}])
def test_of_laws_that_serve_alike_one_without_a_cusp_nearby_is_taken(
    near: set[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Laws by their place in the ranking: those in `near` have a cusp; where all have, the first stays."""
    seen: list[Any] = []

    def given(law: Any, q0: Any, _space: Any) -> NearbyCusps:
        seen.append(law)
        return NearbyCusps(hk.cusps(strategy(hk.lock(6)), PANDA, starts=1), 0.0 if len(seen) - 1 in near else 0.4)

    monkeypatch.setattr(advice_case, "cusps_near", given)
    monkeypatch.setattr(advice_case, "MORE_SPEED", 2.0)
    bars = [{"a": 1.0, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0} for _ in range(3)]
    space = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
    advice = hk.advise(hk.position(hk.from_dh(bars, name="planar")), space)
    order = [law.name for law in ranked(advice.strategies)]
    assert len(seen) == min(len(near) + 1, advice_case.MOST)
    assert advice.best.strategy is seen[0 if len(near) == advice_case.MOST else len(near)]
    assert advice.best.name == order[0 if len(near) == advice_case.MOST else len(near)]
    assert any(text.startswith("It is not proven on the whole arm: ") for text in advice.reasons)
    assert advice.to_dict()["reasons"] == list(advice.reasons)


@pytest.mark.campaign
def test_a_design_says_what_was_found_of_its_cusps_and_why_none_were_looked_for() -> None:
    """Referee of the cusps: the least singular value of [J; J_g], g by differences, at the postures that are told."""
    box = hk.workspace(box=([0.5, 0.05, 0.35], [0.05, 0.05, 0.05]))
    task, ready = hk.pose(hk.load("panda")), [0.0, -0.7854, 0.0, -2.3562, 0.0, 1.5708, 0.7854]
    made = hk.design(task, box, ready, base=hk.lock(2), degree=1, samples=8)
    assert made.cusps.found is not None and len(made.cusps.found) > 0
    for q in made.cusps.found.q[:10]:
        slope = [(made.strategy.g(q + e) - made.strategy.g(q - e)) / 2e-6 for e in 1e-6 * np.eye(7)]
        E = np.vstack([task.jacobian(q), np.array(slope).T])
        assert np.linalg.svd(E, compute_uv=False)[-1] < 1e-7
        assert np.abs(made.strategy.g(q) - made.strategy.g(made.q0)).max() < 1e-9
    assert str(made).splitlines()[-2].lower().startswith(made.cusps.sentence.lower())
    flat = hk.position(hk.from_dh(BARS, name="planar"))
    beyond = hk.design(flat, FLAT, [-1.0, 2.9, -1.5], base=hk.lock(2), degree=0, samples=8, limits=False)
    assert beyond.cusps.found is None and "were not looked for: joint" in str(beyond)
