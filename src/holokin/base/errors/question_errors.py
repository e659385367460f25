"""Errors of questions about strategies that have no answer."""

from __future__ import annotations

from collections.abc import Iterable

from .holokin_error import HolokinError, brief, posture_text


class NotHolonomicError(HolokinError):
    """A strategy without leaves, where leaves are needed; `.witness` is a posture that shows it.

    It shows it by a `gap` [joint units] between two paths of the tool to one pose, or by `curvature` [1/rad], the
    relative one of `involutivity`; the other is None.
    """

    def __init__(
        self, name: str, witness: Iterable[float], gap: float | None = None, *, curvature: float | None = None
    ) -> None:
        self.witness, self.gap, self.curvature = tuple(float(v) for v in witness), gap, curvature
        at = posture_text(self.witness)
        fact = f"at q = {at} it has a curvature of {curvature or 0:.3g} per rad of joint motion"
        if gap is not None:
            fact = f"from q = {at} two paths of the tool to one pose end {gap:.3g} (joint units) apart"
        super().__init__(
            f"{name!r} is not holonomic: {fact}; hk.radial(strategy, start) is a holonomic strategy near it"
        )


class AmbiguousTruthError(HolokinError):
    """A result was used as if it were True or False; `what` is its kind, `ask` what to ask it instead.

    Python takes objects for True, and so `if verdict:` would be a yes where the answer is no.
    """

    def __init__(self, what: str, ask: str) -> None:
        self.what, self.ask = what, ask
        super().__init__(f"{what} is neither True nor False, for that would say nothing of what was found; ask {ask}")


class RoundOffError(HolokinError):
    """A question that numbers cannot answer at a posture, because round-off hides the answer."""

    def __init__(self, name: str, q: Iterable[float], noise: float) -> None:
        self.q, self.noise = tuple(float(v) for v in q), noise
        super().__init__(
            f"{name!r} cannot be judged at q = {posture_text(self.q)}: round-off makes {noise:.1e} of a bracket "
            "there, and a real one could hide in it; choose a posture farther from singularities"
        )


class EmptyRegionError(HolokinError):
    """No posture of a region could be judged."""

    def __init__(self, samples: int, first: Exception) -> None:
        self.first = first
        super().__init__(
            f"all {samples} sampled postures of the region are singular or nearly so, and nothing can be judged; "
            f"move or enlarge the region. The first said: {first}"
        )


class FunctionError(HolokinError):
    """A strategy's Python function raised at a posture; `.problem` is what it raised."""

    def __init__(self, name: str, q: Iterable[float], problem: Exception) -> None:
        self.q, self.problem = tuple(float(v) for v in q), problem
        said = f"{type(problem).__name__}: {brief(problem)}"
        super().__init__(
            f"the function of {name!r} raised {said} at q = {posture_text(self.q)}; "
            "correct it, or keep away from this posture"
        )
