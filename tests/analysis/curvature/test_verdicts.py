"""What a verdict establishes: no law is accused by round-off, none acquitted beyond the postures that were judged."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import IRB_START, PANDA_START, PPR_START, campaign, sampled
from drift_free import drift_free
from holokin.analysis.curvature import Evidence
from holokin.analysis.curvature.curvature_of_planes import curvature_function
from holokin.analysis.curvature.involutive import is_shown, measured, noise
from holokin.base.errors import ArgumentError, NotHolonomicError, RoundOffError, SingularityError

R3_START = np.array([0.3, 0.9, 0.7])


def whole_range(robot: hk.Robot) -> hk.analysis.curvature.Region:
    return hk.analysis.curvature.box(np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi))


def anywhere(robot: hk.Robot, count: int) -> np.ndarray:
    region = whole_range(robot)
    return np.random.default_rng(1).uniform(region.lower, region.upper, (count, robot.n))


def spoilt(strategy: hk.Strategy, rows) -> hk.Strategy:
    """The strategy with something added to the rows that hold its planes."""
    e = strategy.expressions
    base = ca.Function("base", [e.q], [e.planes])
    return hk.strategies.pfaffian(strategy.task, lambda q: base(q) + ca.horzcat(*rows(q)), name="spoilt")


# --- round-off is measured ---


@pytest.mark.campaign
@sampled(1, "start", [[0.3, 0.8, 0.5], [0.5, 0.5, 0.5]])
def test_a_twin_is_holonomic_over_the_whole_joint_range(planar_3r: hk.Robot, start: list[float]) -> None:
    """It goes through singularities on the way back to its centre; these amplify round-off without bound."""
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), start)
    region = whole_range(planar_3r)
    for seed in range(8):
        assert hk.involutivity(twin, region, samples=512, seed=seed).holonomic
    assert hk.involutivity(twin, region, samples=4096).holonomic


@sampled(1, "size", [1e-3, 1e-6, 1e-8])
def test_a_weak_defect_is_found_amid_that_round_off(planar_3r: hk.Robot, size: float) -> None:
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START)
    law = spoilt(twin, lambda q: (0, 0, size * ca.sin(q[0])))
    for seed in range(3):
        verdict = hk.involutivity(law, whole_range(planar_3r), seed=seed)
        assert not verdict.holonomic
    near = hk.involutivity(law, hk.around(R3_START, 0.1))
    assert 0.01 * size < near.relative < 10 * size


def test_measured_round_off_covers_the_error_against_the_closed_form_T7(planar_3r: hk.Robot) -> None:
    """[G_1, G_2] = -(n . curl n)/|n|^4 n of the planar 3R, from arms nearly stretched to arms well bent."""
    rng = np.random.default_rng(0)
    bend = 10 ** -rng.uniform(0, 5, (200, 1)) * rng.uniform(0.3, 1.0, (200, 2))
    Q = np.hstack([rng.uniform(-1, 1, (200, 1)), bend])
    s2, s3, s23 = np.sin(Q[:, 1]), np.sin(Q[:, 2]), np.sin(Q[:, 1] + Q[:, 2])
    c2, c3, c23 = np.cos(Q[:, 1]), np.cos(Q[:, 2]), np.cos(Q[:, 1] + Q[:, 2])
    n = np.stack([s3, -(s23 + s3), s2 + s23], axis=1)
    curl = s3 * c2 + 2 * s3 * c23 - s23 * c3
    exact = -(curl / (n**2).sum(axis=1) ** 2)[:, None] * n
    function = curvature_function(hk.moore_penrose(hk.position(planar_3r)))

    def field(points: np.ndarray) -> np.ndarray:
        return function.batch(points)[0].reshape(len(points), 3, 1)

    mean, scatter = measured(field, Q)
    error = np.linalg.norm(field(Q)[:, :, 0] - exact, axis=1)
    assert (error <= noise(scatter)[:, 0]).mean() > 0.98
    assert np.median(scatter[:, 0] / np.linalg.norm(exact, axis=1)) < 1e-3
    assert is_shown(np.linalg.norm(mean, axis=1), scatter).all()


def test_postures_where_round_off_hides_the_curvature_are_left_out_and_counted(iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.stationary(hk.strategies.constraints.centring_cost()))
    stretched = np.array([0.1, 0.6, 0.2, 0.0, 0.1, 0.6, 0.1])
    region = hk.analysis.curvature.box(stretched - 1e-9, stretched + [1e-9, 1e-9, 1e-9, 0.02, 1e-9, 1e-9, 1e-9])
    verdict = hk.involutivity(strategy, region, samples=256)
    assert verdict.holonomic
    assert verdict.undecided > 0 and verdict.samples > 0
    assert verdict.samples + verdict.singular + verdict.undecided == 256
    assert f"{verdict.undecided} whose curvature round-off hides left out" in verdict.details


@pytest.mark.parametrize("scale", [1e-5, 1e5])
def test_the_scale_of_a_constraint_does_not_change_its_verdict(iiwa14: hk.Robot, scale: float) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.linear([0, 0, scale, 0, 0, 0, 0]))
    verdict = hk.involutivity(strategy, hk.around([0.1, 0.6, 0.2, -1.4, 0.3, 1.1, 0.2], 0.1))
    assert verdict.holonomic and verdict.samples == 64


def test_the_scale_of_a_distributions_fields_does_not_change_its_verdict() -> None:
    for scale in (1e-9, 1.0, 1e9):
        flat = hk.analysis.curvature.involutivity_of(lambda q, s=scale: [[s, 0], [0, 1], [s * ca.cos(q[0]), 0]], 3)
        contact = hk.analysis.curvature.involutivity_of(lambda q, s=scale: [[s, 0], [0, 1], [s * q[1], 0]], 3)
        assert flat.holonomic and flat.samples == 64
        assert not contact.holonomic
        assert contact.relative == pytest.approx(
            hk.analysis.curvature.involutivity_of(lambda q: [[1, 0], [0, 1], [q[1], 0]], 3).relative
        )


# --- filtration ---


some = pytest.mark.parametrize("share", [0.25, campaign("share", 1.0)])


@some
def test_filtration_never_calls_a_holonomic_law_nonholonomic(
    panda: hk.Robot, planar_3r: hk.Robot, iiwa14: hk.Robot, share: float
) -> None:
    laws = [
        (hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4")), 30),
        (hk.holonomic(hk.pose(iiwa14), hk.stationary(hk.strategies.constraints.centring_cost())), 10),
        (hk.holonomic(hk.position(planar_3r), hk.stationary(hk.strategies.constraints.manipulability_cost())), 30),
        (hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START), 80),
    ]
    for strategy, most in laws:
        looked, count = 0, round(share * most)
        for q in anywhere(strategy.task.robot, count):
            try:
                strategy(q)
            except SingularityError:  # a radial twin ends where its transport does
                continue
            assert (
                hk.analysis.curvature.filtration(strategy, q).integrability
                is hk.analysis.curvature.Integrability.HOLONOMIC
            )
            looked += 1
        assert looked > count / 3


@some
def test_filtration_never_calls_a_nonholonomic_law_holonomic(
    panda: hk.Robot, planar_3r: hk.Robot, irb140: hk.Robot, share: float
) -> None:
    """The weak one is the paper's coupling with a geometric Jacobian: curvature is the gain squared, 1e-4 (E3)."""
    weak = hk.strategies.coupled_twist(hk.position(irb140), 1e-2)
    laws = [(hk.moore_penrose(hk.pose(panda)), 15), (hk.moore_penrose(hk.position(planar_3r)), 60), (weak, 60)]
    for strategy, most in laws:
        for q in anywhere(strategy.task.robot, round(share * most)):
            assert (
                hk.analysis.curvature.filtration(strategy, q).integrability
                is hk.analysis.curvature.Integrability.COMPLETELY
            )


def test_filtration_is_not_deceived_by_a_posture_where_small_loops_do_not_drift(planar_3r: hk.Robot) -> None:
    pseudo_inverse = hk.moore_penrose(hk.position(planar_3r))
    for q, _ in drift_free(pseudo_inverse, R3_START):
        assert (
            hk.analysis.curvature.filtration(pseudo_inverse, q).integrability
            is hk.analysis.curvature.Integrability.COMPLETELY
        )


def test_filtration_says_when_round_off_hides_the_answer(iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle())
    with pytest.raises(RoundOffError, match="farther from singularities") as caught:
        hk.analysis.curvature.filtration(strategy, [0.1, 0.6, 0.2, 5e-6, 0.1, 0.6, 0.1])
    assert caught.value.noise > 1e-6


# --- what lies between the samples ---


@pytest.mark.campaign
def test_a_narrow_bump_of_curvature_is_missed_by_64_postures_and_found_by_thorough(panda: hk.Robot) -> None:
    """A lock of joint 3 that gives way to joint 1 in a place 0.02 wide; there a 2 cm circle drifts."""
    task, width = hk.pose(panda), 0.02
    place = PANDA_START + np.array([0.07, -0.11, 0.13, 0.05, -0.12, 0.09, -0.06])

    def rows(q: ca.SX) -> list[list]:
        return [[ca.exp(-ca.sumsqr(q - place) / width**2), 0, 1, 0, 0, 0, 0]]

    law = hk.strategies.pfaffian(task, rows, name="bump")
    region = hk.around(PANDA_START, 0.2)
    few = hk.involutivity(law, region)
    assert few.holonomic and few.samples == 64
    assert few.evidence is Evidence.SAMPLED and few.others == ("exp",)
    assert "nothing is known of the postures between" in few.details and "exp" in few.details
    found = hk.involutivity(law, region, thorough=True)
    assert not found.holonomic
    assert np.linalg.norm(found.witness - place) < 2 * width
    assert (np.abs(found.witness - PANDA_START) <= 0.2 + 1e-12).all()
    point = panda.pose(place)[:3, 3]
    assert hk.drift(law, hk.circle(point, point - [0.02, 0, 0]), place, samples=200).largest[0] > 1e-3


@pytest.mark.campaign
def test_thorough_leaves_a_holonomic_law_holonomic(panda: hk.Robot, planar_3r: hk.Robot) -> None:
    height = hk.holonomic(hk.pose(panda), hk.strategies.constraints.height("panda_joint4"))
    assert hk.involutivity(height, hk.around(PANDA_START, 0.3), thorough=5000).samples >= 5000
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START)
    assert hk.involutivity(twin, whole_range(planar_3r), thorough=4000).holonomic
    for count in (0, -1, 2.5):
        with pytest.raises(ArgumentError, match="thorough"):
            hk.involutivity(height, hk.around(PANDA_START, 0.3), thorough=count)  # type: ignore[arg-type]


def test_a_verdict_says_on_which_grounds_it_reaches_beyond_its_postures(ppr: hk.Robot) -> None:
    task, region = hk.position(ppr), hk.around(PPR_START, 0.2)

    def judged(entry) -> hk.analysis.curvature.Verdict:
        return hk.involutivity(hk.strategies.pfaffian(task, lambda q: [[0, 0, entry(q[2])]]), region)

    assert hk.involutivity(hk.holonomic(task, hk.lock(2)), region).evidence is Evidence.CONSTRAINT
    for plain in (lambda z: 2 + ca.sin(z) ** 3, lambda z: (2 + ca.cos(z)) / (3 + ca.sin(z))):
        assert judged(plain).evidence is Evidence.TRIGONOMETRIC
    named = {
        "exp": ca.exp,
        "sqrt": lambda z: ca.sqrt(2 + ca.cos(z)),
        "atan2": lambda z: 2 + ca.atan2(z, 2),
        "tanh": lambda z: 2 + ca.tanh(z),
        "if_else": lambda z: ca.if_else(z > 0.7, 1, 2),
        "fabs": lambda z: 1 + ca.fabs(z),
        "pow": lambda z: (2 + z) ** z,
        "fmax": lambda z: ca.fmax(z, 0.7),
    }
    for name, entry in named.items():
        verdict = judged(entry)
        assert verdict.holonomic and verdict.evidence is Evidence.SAMPLED
        assert verdict.others == (name,)
    bare = hk.analysis.curvature.involutivity_of(lambda q: [[1, 0], [0, ca.exp(q[1])], [0, 0]], 3)
    assert bare.others == ("exp",) and "exp" in bare.details


def test_a_holonomic_law_may_end_elsewhere_after_a_round_of_a_place_where_it_is_not_defined(ppr: hk.Robot) -> None:
    """dq3 = d(atan2(y, x)) / 2 has no curvature; a round of the origin turns q3 by pi, one beside it does not."""
    task = hk.position(ppr)

    def rows(q: ca.SX) -> list[list]:
        x, y = q[0] + ca.cos(q[2]), q[1] + ca.sin(q[2])
        a, b = -y / (2 * (x**2 + y**2)), x / (2 * (x**2 + y**2))
        return [[-a, -b, 1 + a * ca.sin(q[2]) - b * ca.cos(q[2])]]

    law = hk.strategies.pfaffian(task, rows, name="half turn")
    verdict = hk.involutivity(law, hk.around(PPR_START, 0.5))
    assert verdict.holonomic
    point = ppr.pose(PPR_START)[:3, 3]
    around_it = hk.drift(law, hk.circle(point, [0, 0, 0]), PPR_START, samples=400, limits=False)
    assert abs(around_it.since_start[0][2]) == pytest.approx(np.pi, abs=1e-6)
    beside = hk.drift(law, hk.circle(point, point + [0.4, 0, 0]), PPR_START, samples=400, limits=False)
    assert beside.largest[0] < 1e-8
    assert "small closed paths" in verdict.sentence and "long closed path" in verdict.details


# --- leaves ---


@pytest.mark.parametrize("size", [1e-3, 1e-6, 1e-8])
def test_what_has_curvature_has_no_leaf_function_however_weak(ppr: hk.Robot, size: float) -> None:
    """The two paths back end 1e-2 * size apart, which is too little to be seen there."""
    law = hk.strategies.pfaffian(hk.position(ppr), lambda q: [[size * q[1], 0, 1]])
    assert not hk.involutivity(law, hk.around(PPR_START, 0.1)).holonomic
    with pytest.raises(NotHolonomicError, match="not holonomic"):
        hk.analysis.curvature.leaf_function(law, PPR_START)
    with pytest.raises(NotHolonomicError, match="not holonomic"):
        hk.analysis.curvature.general_form(law, PPR_START)


def test_a_small_radius_does_not_make_leaves(irb140: hk.Robot) -> None:
    law = hk.strategies.coupled_twist(hk.position(irb140), 0.1)
    with pytest.raises(NotHolonomicError, match="it has a curvature of") as caught:
        hk.analysis.curvature.leaf_function(law, IRB_START, radius=1e-4)
    assert caught.value.gap is None and caught.value.curvature > 1e-9


def test_the_general_form_is_refused_where_curvature_lies_on_the_way_to_the_reference(ppr: hk.Robot) -> None:
    """Flat near the reference, curved where the posture is."""
    place = PPR_START + np.array([0.6, 0.5, 0.1])
    law = hk.strategies.pfaffian(hk.position(ppr), lambda q: [[ca.exp(-ca.sumsqr(q - place) / 0.05**2), 0, 1]])
    hk.analysis.curvature.leaf_function(law, PPR_START)
    with pytest.raises(NotHolonomicError, match="it has a curvature of"):
        hk.analysis.curvature.general_form(law, place + np.array([0.0, 0.02, 0.0]), PPR_START)
    form = hk.analysis.curvature.general_form(law, PPR_START + 0.05, PPR_START)
    assert form.residuals()["(10)"] < 1e-9
