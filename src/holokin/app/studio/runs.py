"""What a session knows of one law now, and what it tells of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...base.types import Matrix, Vector, frozen
from ...motion.ik.leaf import leaf_value
from ...strategies import HolonomicStrategy, SelfMotion
from .drag_follower import Follower, Move, follower
from .joint_history import History
from .loop_follower import Walk
from .session_laws import Law
from .sliders import Slider, across, along, level_slider, self_motion_curve, self_slider
from .states import Judgement, LawState, LawStatus

MOVED = 0.02
"""Joint motion [joint units] from which the curvature at a posture is asked for again."""


@dataclass(eq=False)
class Run:
    """One law of a session: where it stands, what moves it, and what was recorded. Only its session changes it."""

    law: Law
    q: Vector
    follow: Follower
    level: Vector
    history: History
    drifts: Matrix  # (cycles, n)
    status: LawStatus = LawStatus.FOLLOWING
    sentence: str = ""
    q0: Vector | None = None  # of the loop
    walk: Walk | None = None
    whole: bool = True  # it has made every step of the loop
    judgement: Judgement | None = None
    curves: dict[int, tuple[SelfMotion, float]] = field(default_factory=dict)  # of sliders, with the place on each
    levels: dict[int, Slider] = field(default_factory=dict)  # sliders across the leaves
    ready: bool = False  # native code was built, or tried
    state: LawState | None = None

    @property
    def due(self) -> bool:
        """Whether its judgement is missing, or of a posture that it has left."""
        known = self.judgement
        return self.law.strategy is not None and (known is None or bool(np.abs(self.q - known.q).max() > MOVED))

    def put(self, move: Move) -> None:
        """Where it stands from now on."""
        self.q, self.status, self.sentence = frozen(move.q), move.status, move.sentence
        self.curves, self.levels, self.state = {}, {}, None

    def forget(self) -> None:
        """What was recorded of the loop."""
        self.q0, self.walk, self.whole, self.state = None, None, True, None
        self.history, self.drifts = History(len(self.q)), frozen(np.zeros((0, len(self.q))))


def new_run(law: Law, q: Vector, limits: bool) -> Run:
    """A law that stands at a posture (n,), on the leaf through it. Raises: HolokinError: it is not defined there."""
    if law.strategy is not None:
        law.strategy(q)
    return Run(
        law, frozen(q), follower(law, q, limits), _level_of(law, q), History(len(q)), frozen(np.zeros((0, len(q))))
    )


def _level_of(law: Law, q: Vector) -> Vector:
    """g(q) (r,) of a holonomic law; empty for others."""
    return leaf_value(law.rule, q) if isinstance(law.rule, HolonomicStrategy) else np.zeros(0)


def state_of(run: Run) -> LawState:
    """What a page is told of it."""
    if run.state is None:
        strategy, largest = run.law.strategy, np.abs(run.drifts).max(axis=1, initial=0.0)
        rcond = np.nan if strategy is None else float(strategy.gain(run.q)[1])
        t, history = run.history.view()
        run.state = LawState(
            run.law.name, run.law.colour, run.law.holonomic, run.q, run.status, run.sentence, rcond, frozen(run.level),
            frozen(largest), run.drifts, t, history, run.judgement,
        )  # fmt: skip
    return run.state


def put_on_leaf(run: Run, q: Vector, limits: bool) -> None:
    """A law at another posture (n,) with its tool pose; a holonomic one on the leaf through it from now on.

    Raises:
        HolokinError: the law is not defined there; nothing changes then.
    """
    if run.law.holonomic:
        law = replace(run.law, level=_level_of(run.law, q))
        run.follow = follower(law, q, limits)
        run.law, run.level = law, _level_of(law, q)
    run.put(Move(q, run.status, run.sentence))


def slider_of(run: Run, direction: int, limits: bool) -> Slider:
    """The slider of a law along its self-motion; it counts from where the law stood when it was first asked for."""
    if direction not in run.curves:
        run.curves[direction] = self_motion_curve(run.law.task, run.q, limits, direction), 0.0
    return self_slider(run.law, *run.curves[direction], direction)


def slide(run: Run, direction: int, s: float, limits: bool) -> None:
    """A law to the place s of its slider. Raises: as `slider_of`, `along`, `put_on_leaf`."""
    slider_of(run, direction, limits)
    curve = run.curves[direction][0]
    put_on_leaf(run, along(curve, s), limits)
    run.curves = {direction: (curve, s)}


def level_slider_of(run: Run, row: int, limits: bool) -> Slider:
    """The slider of a row of the level of a law; angles count on through whole turns from when it was asked for."""
    if row not in run.levels:
        run.levels[row] = level_slider(run.law, run.q, limits, row)
    return run.levels[row]


def move_across(run: Run, row: int, value: float, limits: bool) -> None:
    """A law to the leaf of a value of its slider. Raises: as `level_slider`, `across`; JointLimitError."""
    slider = level_slider_of(run, row, limits)
    q = across(run.law, run.q, slider, value, row)
    if limits:
        run.law.task.robot.check_limits(q)
    put_on_leaf(run, q, limits)
    run.levels = {row: replace(slider, value=value)}
