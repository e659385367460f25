"""Enclosures hold every value: random expressions over random boxes, against samples of the boxes."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from holokin.symbolic import Enclosure, Function

OPERATIONS = {
    "product": lambda x, y: x * y, "quotient": lambda x, y: x / (y + 3), "sin": lambda x, y: ca.sin(x * y),
    "cos": lambda x, y: ca.cos(x - y) ** 2, "tan": lambda x, y: ca.tan(x / 3), "exp": lambda x, y: ca.exp(x) - y,
    "log": lambda x, y: ca.log(x + 3) * y, "sqrt": lambda x, y: ca.sqrt(y + 3), "atan": lambda x, y: ca.atan(5 * x),
    "asin": lambda x, y: ca.asin(x / 4), "tanh": lambda x, y: ca.tanh(3 * x) * y, "cosh": lambda x, y: ca.cosh(x),
    "erf": lambda x, y: ca.erf(x), "cube": lambda x, y: x**3, "power": lambda x, y: (y + 3) ** 2.5,
    "inverse power": lambda x, y: (x + 3) ** -2,
    "base": lambda x, y: ca.power(2, y),
    "both": lambda x, y: ca.power(x + 3, y),
    "atan2": lambda x, y: ca.atan2(x, y), "fmax": lambda x, y: ca.fmax(x, y), "fabs": lambda x, y: ca.fabs(x) * y,
    "if": lambda x, y: ca.if_else(x > y, x, -y),
    "floor": lambda x, y: ca.floor(2 * x), "sign": lambda x, y: ca.sign(x - y),
    "hypot": lambda x, y: ca.hypot(x, y), "pole": lambda x, y: ca.erf(1 / x) + ca.sign(1 / y),
}  # fmt: skip


@pytest.mark.parametrize("name", list(OPERATIONS))
def test_an_enclosure_holds_every_value_of_its_box(name: str) -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    value = OPERATIONS[name](x, y)
    made, function = Enclosure("pair", {"x": x, "y": y}, value), Function("value", {"x": x, "y": y}, {"z": value})
    rng, bounded = np.random.default_rng(0), 0
    for _ in range(60):
        mid, rad = rng.uniform(-2, 2, 2), 10.0 ** rng.uniform(-4, 0.3, 2) * rng.integers(0, 2, 2)
        points = mid + rad * np.clip(rng.uniform(-1.2, 1.2, (200, 2)), -1, 1)
        samples = function.batch(points[:, :1], points[:, 1:])
        center, radius = made.function(mid, rad)
        if np.isfinite(radius):
            bounded += 1
            assert np.abs(samples - center).max() <= radius + 1e-12 * (1 + abs(center))
    assert bounded > 10


def test_an_enclosure_shrinks_to_the_value_with_its_box() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    made = Enclosure("pair", {"x": x, "y": y}, ca.sin(x * y) / (2 + ca.cos(x)) + ca.atan2(y, x))
    sizes = [made.function([0.7, 0.4], [r, r])[1] for r in (1e-2, 1e-4, 1e-6, 0.0)]
    assert sizes[1] < 0.011 * sizes[0]
    assert sizes[2] < 0.011 * sizes[1]
    assert sizes[3] == 0.0


def test_equal_expressions_share_their_enclosure_and_others_do_not() -> None:
    """An arm's takes half a second: a law that is made again has it at once."""

    def made(factor: float) -> Function:
        x = ca.SX.sym("x")
        return Enclosure("value", {"x": x}, factor * ca.sin(x)).function

    assert made(2.0) is made(2.0) and made(3.0) is not made(2.0)
    assert made(3.0)([0.7], [0.1])[0] == pytest.approx(3 * np.sin(0.7))
