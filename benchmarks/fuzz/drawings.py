"""SVG drawings: broken bytes, odd numbers, commands, units and transforms, uses of uses, very deep XML."""

from __future__ import annotations

import random
from pathlib import Path

import holokin as hk
from benchmarks.fuzz.jobs import broken

_NUMBERS = ("0", "-1", "nan", "inf", "1e9", "1e200", "1e400", "1e-300", "", "a", "9" * 400, "50%", "3mm", "1 2", "-0")
_PATHS = (
    "M 10 10 L 60 10 L 60 40 Z", "m5,5 h 20 v 10 h -20 z", "M 10 80 C 40 10, 65 10, 95 80 S 150 150, 180 80",
    "M10 80 Q 52 10 95 80 T 180 80", "M 30 80 A 45 45 0 0 0 75 125 L 75 80 Z", "M 10 10 A 30 50 0 0 1 16 21",
    "M0 0 L0 0", "M 1 1", "L 1 1", "Z", "", "M 0 0 A 0 0 0 0 0 1 1", "M 0 0 A 5 5 0 1 1 0 0", "M 0 0 C 0 0 0 0 0 0",
)  # fmt: skip
_TRANSFORMS = (
    "rotate(30)", "scale(2 -1)", "scale(0)", "matrix(1 0 0 1 5 5)", "matrix(1 1 1 1 0 0)", "skewX(89.99)", "skewX(90)",
    "translate(nan)", "rotate(inf)", "scale(1e200)", "scale(1e-200)", "turn(3)", "matrix(1 2)", "rotate(30",
)  # fmt: skip


def _drawing(chance: random.Random) -> str:
    def number(good: str) -> str:
        return chance.choice(_NUMBERS) if chance.random() < 0.12 else good

    def turned() -> str:
        return f' transform="{chance.choice(_TRANSFORMS)}"' if chance.random() < 0.25 else ""

    def element() -> str:
        match chance.randrange(10):
            case 0:
                sides = f'width="{number("20")}" height="{number("9")}" rx="2"'
                return f'<rect x="{number("5")}" y="{number("5")}" {sides}{turned()}/>'
            case 1:
                return f'<circle cx="{number("30")}" cy="{number("30")}" r="{number("12")}"{turned()}/>'
            case 2:
                return f'<ellipse cx="{number("30")}" cy="30" rx="{number("12")}" ry="{number("7")}"{turned()}/>'
            case 3:
                return f'<polygon points="0,0 {number("20")},0 20,{number("20")}"{turned()}/>'
            case 4:
                return f"<g{turned()}>{''.join(element() for _ in range(2))}</g>"
            case 5:
                return f'<defs><circle id="c" r="5"/></defs><use href="#{chance.choice("cxg")}" x="{number("9")}"/>'
            case 6:
                return f'<g id="g" display="{chance.choice(("none", "inline"))}"><use href="#g"/></g>'
            case 7:
                style = chance.choice(("", "a:b;", ";"))
                return f'<line x1="0" y1="{number("1")}" x2="{number("30")}" y2="3" style="{style}"/>'
            case _:
                d = "".join(number(c) if c == "1" else c for c in chance.choice(_PATHS))
                return f'<path d="{d}"{turned()}/>'

    size = "".join(
        f' {key}="{number(value)}"'
        for key, value in (("width", "100mm"), ("height", "80mm"), ("viewBox", "0 0 100 80"))
        if chance.random() < 0.9
    )  # fmt: skip
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg"{size}>{"".join(element() for _ in range(chance.randint(1, 4)))}</svg>'
    )


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, read as outlines."""
    chance = random.Random(seed)
    text = _drawing(chance).encode()
    if chance.random() < 0.4:
        text = broken(text, chance)
    elif chance.random() < 0.1:
        text = text.replace(b"<svg", b"<svg><g>" + b"<g>" * chance.choice((10, 300, 3000)), 1)
    file = folder / "drawing.svg"
    file.write_bytes(text)
    for path in hk.path.read_svg(file, pixel=chance.choice((None, None, 1e-3))):
        if not 0 < path.length < float("inf"):
            raise ValueError("a path without a length")
