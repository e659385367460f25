"""The panel of the posture: how near to singular, what is known of each strategy, and sliders that keep the tool still."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...base.errors import HolokinError
from ..report.plots import BLUE, GREY, PURPLE, YELLOW, rgb
from .stage import Stage, block, line, plain, put, quiet, ramp, swatch, table
from .states import Cloud, LeafCusps, Phase, Snapshot, StrategyState
from .strategies import DEGREES, Slider

# colours of a cloud: from dark to light, so that they are told apart in print, too; what is not reached has none
FAR, NEAR, UNREACHED = BLUE, YELLOW, GREY
SINGULAR = 0.01  # an rcond below this is written in red
CUSP = PURPLE  # colour of the nearest cusp, and of a tool loop that does not bring the joints back
BALL, LINE = "The purple ball is the tool at the nearest cusp.", "The purple line is the loop."
LEFT = "This is of a leaf that the strategy has left: look again."  # what is said below the cusps
SELF, LEVEL = "self-motion", "level"  # the two sliders


_FIND = "Points about the tool, each as far from joint limits as its colour says"

COLUMNS = (
    "verdict: whether small loops near the start bring the joints back. rcond: how near the strategy is to singular, "
    "1 is good, 0 singular"
)
"""What the columns of the table are."""


class PosturePanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Stage):
        self.page = page
        gui = page.server.gui
        names = tuple(strategy.name for strategy in page.session.strategies)
        self.known = gui.add_html("")
        gui.add_divider()
        self.strategy = gui.add_dropdown(
            "Sliders of", names, initial_value=names[page.lead], hint="The strategy that the two sliders move"
        )
        gui.add_markdown("**Self-motion**: the joints move, the tool stands still.")
        self.self_motion = gui.add_slider(
            "Self-motion", min=0.0, max=1.0, step=0.001, initial_value=0.0, hint="Along the postures of this tool pose"
        )
        self.level_text = gui.add_markdown("")
        self.level = gui.add_slider(
            "Level",
            min=0.0,
            max=1.0,
            step=0.001,
            initial_value=0.0,
            hint="From leaf to leaf; the strategy keeps the new one",
        )
        gui.add_divider()
        gui.add_markdown("**How far** does the pose decide the joints? Round a cusp they may not come back.")
        self.far = gui.add_button(
            "Look for cusps of this strategy", color="gray", hint="On its leaf, about the tool; it takes some seconds"
        )
        self.far_text = gui.add_html("")
        gui.add_divider()
        gui.add_markdown("**Coverage** of the space around the tool by the leaf of a holonomic strategy.")
        holonomic = tuple(strategy.name for strategy in page.session.strategies if strategy.holonomic)
        self.cover = gui.add_dropdown("NamedStrategy", holonomic or ("none",), hint="Whose leaf is looked at")
        self.find = gui.add_button("Find the coverage", color="gray", disabled=not holonomic, hint=_FIND)
        self.clear = gui.add_button(
            "Take the cloud away", color="gray", disabled=not holonomic, hint="And look no farther"
        )
        self.cloud_text = gui.add_html("")
        self._ranges: dict[str, Slider | None] = {}
        self._cloud: Cloud | None = None
        self._cusps: LeafCusps | None = None
        self._seen: tuple[Any, ...] = ()
        self._fitted: dict[str, tuple[Any, ...]] = {}
        self._connect()

    def draw(self, snap: Snapshot) -> None:
        """Bring texts, sliders and cloud to a snapshot."""
        put(self.known, self._verdict_table(snap))
        still = snap.phase in (Phase.IDLE, Phase.DONE)
        self.self_motion.disabled = not still
        if still:
            self._fit(snap)
        # The nearest cusp as a ball, the smallest loop as a line; of a leaf that was left it is said.
        cusps = snap.cusps
        put(self.far_text, "" if cusps is None else block(line(cusps.sentence), quiet(_where(cusps, snap))))
        if cusps is not self._cusps:
            self._cusps = cusps
            self.page.scene.ball(None if cusps is None else cusps.place, CUSP, "cusp")
            self.page.scene.path([] if cusps is None else cusps.loop, "cusp", CUSP)
        if snap.cloud is not self._cloud:
            self._cloud = snap.cloud
            self._draw_cloud(snap.cloud)

    def _connect(self) -> None:
        page = self.page

        @self.strategy.on_update
        def _(_event: Any) -> None:
            self._fitted = {}

        @self.self_motion.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(self._slide, SELF)

        @self.level.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(self._lift, LEVEL)

        self.far.on_click(lambda _event: page.ask(lambda: page.session.start_cusps(self.strategy.value)))
        self.find.on_click(lambda _event: page.ask(lambda: page.session.start_cloud(self.cover.value)))
        self.clear.on_click(lambda _event: page.ask(self.take_away))

    def take_away(self) -> None:
        """For good: what was found until it was cancelled is known, and not drawn again."""
        self._cloud = self.page.session.cancel_cloud().cloud
        self._draw_cloud(None)

    def refit(self) -> None:
        """The sliders are drawn anew, as in other units."""
        self._fitted = {}

    def _slide(self) -> None:
        known = self._ranges.get(SELF)
        if known is not None:
            self.page.say("")
            place = float(np.clip(self.self_motion.value / self._unit(known)[0], known.low, known.high))
            self.page.session.move_self(self.strategy.value, place)
            self._fitted[SELF] = self._key(self.page.session.snapshot())

    def _lift(self) -> None:
        known = self._ranges.get(LEVEL)
        if known is not None:
            value = float(np.clip(self.level.value / self._unit(known)[0], known.low, known.high))
            self.page.say("")
            self.page.session.move_level(self.strategy.value, value)
            self._fitted[LEVEL] = self._key(self.page.session.snapshot())
            self._say_level(replace(known, value=value))

    def _key(self, snap: Snapshot) -> tuple[Any, ...]:
        return self.strategy.value, snap.strategy(self.strategy.value).q.tobytes()

    def _fit(self, snap: Snapshot) -> None:
        """Bring the sliders to the posture; only when it changed, since finding how far they go takes time."""
        key, before = self._key(snap), self._seen
        self._seen = key
        if key != before:  # it moves still, and a drag must not wait
            return
        for name, handle in ((SELF, self.self_motion), (LEVEL, self.level)):
            if self._fitted.get(name) == key:
                continue
            self._fitted[name] = key
            try:
                slider = self._range(name, snap.strategy(self.strategy.value))
            except HolokinError as problem:
                slider = None
                if name == LEVEL:
                    put(self.level_text, f"**Level**: {problem}")
            if slider is not None and not slider.high > slider.low:
                slider = None
            self._ranges[name] = slider
            handle.disabled = slider is None
            if slider is not None:
                # A slider in the units of what it moves.
                with self.page.server.atomic():
                    scale, unit = self._unit(slider)
                    handle.label = f"{_what(slider)} [{unit}]" if unit else _what(slider)
                    fine = 10 if unit in (DEGREES, "mm") else 1000  # what is shown at its ends is rounded inwards
                    low, high = np.ceil(fine * scale * slider.low) / fine, np.floor(fine * scale * slider.high) / fine
                    handle.min, handle.max = low, high
                    handle.step, handle.precision = 1 / fine, 1 if fine == 10 else 3
                    handle.value = float(np.clip(scale * slider.value, low, high))
                if name == LEVEL:
                    self._say_level(slider)

    def _unit(self, known: Slider) -> tuple[float, str]:
        """(factor, name) with which the numbers of a slider are shown."""
        return self.page.units.factor(known.unit), self.page.units.name(known.unit)

    def _range(self, name: str, strategy: StrategyState) -> Slider | None:
        if name == SELF:
            return self.page.session.self_motion(strategy.name)
        if strategy.holonomic:
            return self.page.session.level_slider(strategy.name)
        put(self.level_text, f"**Level**: {strategy.name} has no leaves.")
        return None

    def _say_level(self, known: Slider) -> None:
        scale, name = self._unit(known)
        unit = f" {name}" if name else ""
        low, high = scale * known.low, scale * known.high
        span = f"{scale * known.value:.4g}{unit}, from {low:.4g} ({known.why_low}) to {high:.4g} ({known.why_high})"
        put(self.level_text, f"**{_what(known)}** of {known.name}: {span}. The strategy keeps the new leaf.")

    def _verdict_table(self, snap: Snapshot) -> str:
        rows = [("", *(plain(text, grey=True) for text in ("strategy", "verdict about the start", "rcond")))]
        for strategy, color in zip(snap.strategies, self.page.colors, strict=False):
            judged = strategy.judgement
            verdict = "is being judged" if judged is None else "holonomic" if judged.holonomic else "not holonomic"
            bend = "" if judged is None else f", curvature {judged.curvature:.2g}"
            near = plain(f"{strategy.rcond:.3f}", red=bool(strategy.rcond < SINGULAR), right=True)
            rows.append((swatch(color), plain(strategy.name), plain(f"{verdict}{bend}"), near))
        hints = [
            COLUMNS,
            *("" if strategy.judgement is None else strategy.judgement.sentence for strategy in snap.strategies),
        ]
        foot = "rcond: 1 is good, 0 singular. curvature: drift over the area of a small loop."
        return block(table(rows, hints), quiet(foot))

    def _draw_cloud(self, cloud: Cloud | None) -> None:
        if cloud is None:
            self.page.scene.cloud([], [])
            put(self.cloud_text, "")
            return
        self.page.scene.cloud(cloud.points, _margin_colors(cloud))
        share = f"{100 * cloud.reached.mean():.0f} % are reached" if len(cloud.reached) else ""
        text = cloud.sentence or f"{cloud.strategy}: {cloud.done} of {cloud.total} poses looked at, {share}"
        scale = ramp(FAR, NEAR, "in the middle of the joints", "at a limit")
        put(self.cloud_text, block(line(text), scale, table([(swatch(UNREACHED), plain("not reached"))])))


def _where(cusps: LeafCusps, snap: Snapshot) -> str:
    """What is said below the cusps: what is drawn of them, or that the strategy stands on another leaf by now."""
    if not any(
        strategy.name == cusps.strategy and np.array_equal(strategy.level, cusps.level) for strategy in snap.strategies
    ):
        return LEFT
    return "" if cusps.place is None else BALL if not len(cusps.loop) else f"{BALL} {LINE}"


def _what(known: Slider) -> str:
    """What a slider moves, in a word or two."""
    return (
        "Self-motion" if known.label.startswith("self-motion") else "Elbow angle" if known.unit == DEGREES else "Level"
    )


def _margin_colors(cloud: Cloud) -> Any:
    """A colour (k, 3) for each pose: from FAR in the middle of the joints to NEAR at a limit, or UNREACHED."""
    share = np.nan_to_num(np.sqrt(np.clip(cloud.margin, 0.0, 1.0)))[:, None]
    colors = (1 - share) * np.array(rgb(NEAR)) + share * np.array(rgb(FAR))
    return np.where(cloud.reached[:, None], colors, np.array(rgb(UNREACHED))).astype(np.uint8)
