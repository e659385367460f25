"""For the API reference: writes what docstrings say briefly in the long form that the Google style knows.

`Args:` entries for several names become one for each. `Raises:` in a line, or with several errors in a row, becomes a
list; an error of which nothing is said gets the first sentence of its own docstring. Members of an Enum get their text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from griffe import Alias, Attribute, Class, Docstring, Extension, Module, Object

NAMES = re.compile(r"(?:(?<=^)|(?<=[.;,] ))((?:[A-Z]\w*Error)(?:(?:, | or )[A-Z]\w*Error)*)(?=$|[\s:.;,])")
RAISES = re.compile(r"(?:^|(?<=[.\])]\s))Raises(?: \(([^)]*)\))?:[ \n]", re.MULTILINE)
TEXTS = re.compile(r"""['"]([^'"]+)['"]""")
SEVERAL = re.compile(r"^( +)(\*{0,2}\w+(?:, \*{0,2}\w+)+):(.*)$", re.MULTILINE)


def entries(text: str, when: str, meanings: dict[str, str]) -> Iterator[tuple[str, str]]:
    """(error, in which case) of a text such as `ShapeError, NotFiniteError. PathError: it is open`."""
    words = " ".join(text.split())
    found = list(NAMES.finditer(words))
    for i, match in enumerate(found):
        after = found[i + 1] if i + 1 < len(found) else None
        said = words[match.end() : after.start() if after else None].strip(" ,;:").removesuffix(".")
        said = re.sub(r"^\((.*)\)$", r"\1", said)
        for name in re.split(r", | or ", match[1]):
            yield name, f"{when}: {said}" if when and said else said or when or meanings.get(name, "see there")


def long_form(text: str, meanings: dict[str, str]) -> str:
    """A docstring with `Raises` as a block of one error a line, and `Args` of one name a line."""
    text = SEVERAL.sub(lambda m: "\n".join(f"{m[1]}{name}:{m[3]}" for name in m[2].split(", ")), text)
    kept, listed, position = "", "", 0
    for match in RAISES.finditer(text):
        end = re.compile(r"\n\s*\n|\n(?=\S)|\Z" if text[match.end() - 1] == "\n" else r"\n\s*\n|\Z").search(
            text, match.end()
        )
        assert end  # noqa: S101  \Z is always there
        lines = list(entries(text[match.end() : end.start()], match[1] or "", meanings))
        if lines:
            kept += text[position : match.start()]
            position = end.start()
            listed += "".join(f"    {name}: {said}\n" for name, said in lines)
    kept = (kept + text[position:]).rstrip()
    return f"{kept}\n\nRaises:\n{listed}" if listed else kept


class Docstrings(Extension):
    """Rewrites every docstring of the package after it has been read."""

    def on_package(self, *, pkg: Module, **_: Any) -> None:
        """All of the package."""
        errors = [e for module in pkg["base.errors"].modules.values() for e in module.classes.values() if e.docstring]
        meanings = {e.name: e.docstring.value.split("\n")[0].rstrip(".") for e in errors if e.docstring}
        self._walk(pkg, meanings)

    def _walk(self, thing: Object, meanings: dict[str, str]) -> None:
        if isinstance(thing, Module) and ".errors" not in thing.path:  # so that the names of errors lead to their page
            for name in meanings.keys() - thing.members.keys():
                thing.set_member(name, Alias(name, f"holokin.base.errors.{name}", parent=thing))
        if thing.docstring:
            thing.docstring.value = long_form(thing.docstring.value, meanings)
        enum = isinstance(thing, Class) and any(str(base) == "Enum" for base in thing.bases)
        for member in thing.members.values():
            if member.is_alias:
                continue
            if enum and isinstance(member, Attribute) and not member.docstring:
                member.docstring = Docstring(" ".join(TEXTS.findall(str(member.value))), parent=member)
            self._walk(member, meanings)  # pyright: ignore[reportArgumentType]
