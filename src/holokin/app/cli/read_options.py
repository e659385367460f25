"""Options that say how a log or dataset counts joints."""

from __future__ import annotations

from typing import Annotated, Any

import typer

Degrees = Annotated[bool | None, typer.Option("--degrees/--radians", help="Unit of revolute joints.")]
Columns = Annotated[
    str | None,
    typer.Option(
        help='Names of joints in it: "a, b, ..." in the order of the robot, "joint=a, ...", or "actual_q_%d".'
    ),
]
CountsTurns = Annotated[
    bool, typer.Option("--counts-turns", help="Joint values count whole turns: none is taken to be modulo a turn.")
]
Signs = Annotated[str | None, typer.Option(help='Joints that it counts the other way round: "joint_2=-1, ...".')]
Offsets = Annotated[
    str | None, typer.Option(help='Its values in rad or m where joints are at 0: "joint_2=-1.57, joint_3=90deg".')
]
Scales = Annotated[str | None, typer.Option(help='Rad or m of a unit of its own: "joint_1=0.00153398, ...".')]


def counts_of_words(signs: str | None, offsets: str | None, scales: str | None) -> dict[str, Any]:
    """Arguments signs, offsets and scales of the words of these options. Raises: ArgumentError."""
    found = {"--signs": signs, "--offsets": offsets, "--scales": scales}
    return {name[2:]: None if text is None else _pairs(name, text) for name, text in found.items()}


def _pairs(option: str, text: str) -> dict[str, float]:
    from math import pi

    from ...base.errors import ArgumentError

    pairs = {}
    for part in text.split(","):
        joint, _, value = (word.strip() for word in part.partition("="))
        turned = option != "--signs" and value.endswith("deg")
        try:
            pairs[joint] = float(value.removesuffix("deg") if turned else value) * (pi / 180 if turned else 1.0)
        except ValueError:
            raise ArgumentError(option, text, 'give pairs like "joint_2=-1, joint_3=-1"') from None
    return pairs
