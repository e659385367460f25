"""`HolokinError`, the parent of all errors, and the texts that their messages are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from typing import Any

LONGEST_PART = 400
"""Characters that a fact, a value or a cure may have in a message: more, nobody reads in one sentence."""

LONGEST = 1_600
"""Characters of a whole message: a fact, a cure and some names; files and keys are at its beginning."""

MOST_NAMES = 40
"""Names that a message lists of those that are known: those of any job, robot or table of this library."""

SYNONYMS = {
    "pseudo-inverse": "moore-penrose",
    "pseudoinverse": "moore-penrose",
    "pinv": "moore-penrose",
    "leaf": "level",
    "way": "direction",
    "tell": "progress",
    "clear_of": "obstacles",
    "ignore": "allowed",
}
"""Names that people use, and keys that had another name before -> those that are known."""

FORMS = {
    "robot.pose(q)": "fk fkine forward forward_kinematics end_effector end_effector_pose tool_pose get_pose",
    "robot.jacobian(q)": "jac jacob jacob0 jacobe geometric_jacobian get_jacobian",
    "ik = hk.ik(strategy, q0), and then q = ik(pose)": "ik inverse ikine solve_ik inverse_kinematics solve",
    "hk.follow(strategy, path, q0)": "run execute track trace plan play",
    "hk.load(name)": "load_robot load_urdf from_file robots",
}
"""What is to be written -> names by which people look for it, on nouns and in the package."""

LONGEST_NAME = 200
"""Characters up to which a name is compared with the known ones; the comparison takes the product of the lengths."""


def brief(value: object, most: int = LONGEST_PART) -> str:
    """A text on one line without control characters, with its middle left out where it is longer than `most`."""
    text = value if isinstance(value, str) else _written(value, str)
    if len(text) > most:
        left_out = f" ... ({len(text) - most} characters left out) ... "
        text = text[: most - most // 3] + left_out + text[len(text) - most // 3 :]
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def shown(value: object, most: int = LONGEST_PART) -> str:
    """`repr` of a value, cut; only its type where it has none, as a whole number of 5,000 digits or a deep list."""
    return brief(_written(value, repr), most)


def _written(value: object, write: Callable[[Any], str]) -> str:
    try:
        return write(value)
    except (RecursionError, ValueError):
        return f"a value of type {type(value).__name__} that is too long to show"


def posture_text(q: Iterable[float], names: Sequence[str] = ()) -> str:
    """A posture as [0.1, -2], or with its joints' names, elbow 0.1, wrist -2; round-off below 1e-12 is 0."""
    values = [f"{0.0 if abs(float(v)) < 1e-12 else float(v):.6g}" for v in q]
    if names:
        return brief(", ".join(f"{n} {v}" for n, v in zip(names, values, strict=True)), 4 * LONGEST_PART)
    return brief(f"[{', '.join(values)}]", 2 * LONGEST_PART)


def _near(word: str, known: Sequence[str]) -> list[str]:
    """The known name most like a word, whatever the case; none if none is like it."""
    if len(word) > LONGEST_NAME:
        return []
    matches = get_close_matches(word.lower(), [k.lower() for k in known], n=1, cutoff=0.5)
    return [k for k in known if k.lower() in matches]


def closest(word: object, known: Sequence[str]) -> str:
    """The known name nearest to a word, as a question, and all that are known."""
    word = brief(word, LONGEST_NAME + 1)
    meant = SYNONYMS.get(word.lower())
    close = [k for k in known if k.partition(".")[0] == word or k == meant] or _near(word, known)
    hint = f"did you mean {shown(close[0], LONGEST_NAME)}? " if close else ""
    names = ", ".join(brief(name, 60) for name in known[:MOST_NAMES]) or "none"
    return f"{hint}known: {names}{f' and {len(known) - MOST_NAMES} more' if len(known) > MOST_NAMES else ''}"


class HolokinError(Exception):
    """The parent of every error that holokin raises on purpose. Its message is one line of 1,600 characters at most."""

    def __init__(self, message: object = "") -> None:
        super().__init__(brief(message, LONGEST))

    def __reduce__(self) -> Any:
        """Pickled as message and facts: the children are made from other arguments than their message."""
        return _unpickled, (type(self), self.args), vars(self)


class FileError(HolokinError):
    """A file that cannot be used as it is: which one, what is wrong with it, and what to do. Abstract."""

    def __init__(self, path: object, fact: str, cure: str) -> None:
        self.path, self.fact, self.cure = path, fact, cure
        super().__init__(f"{brief(path)}: {brief(fact)}; {brief(cure, LONGEST)}")


def _unpickled(kind: type[HolokinError], arguments: tuple[Any, ...]) -> HolokinError:
    return kind.__new__(kind, *arguments)
