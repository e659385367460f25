"""The panel of the posture: how near to singular, what is known of each strategy, and sliders with the tool still."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...base.errors import HolokinError
from ..report.plots import BLUE, GREY, PURPLE, YELLOW, rgb
from .panel_html import block, line, plain, put, quiet, ramp, swatch, table, verdict
from .stage import Page
from .states import Cloud, LeafCusps, Phase, Snapshot, figure
from .strategies import DEGREES, Slider

# colours of a cloud: from dark to light, so that they are told apart in print, too; what is not reached has none
FAR, NEAR, UNREACHED = BLUE, YELLOW, GREY
FLAT = 1e-9  # a curvature below this is round-off
SINGULAR = 0.01  # an rcond below this is written in red
CUSP = PURPLE  # colour of the nearest cusp, and of a tool loop that does not bring the joints back
SELF, LEVEL = "self-motion", "level"  # the two sliders
# what the columns of the table are
COLUMNS = (
    "verdict: whether small loops near the start bring the joints back. rcond: how near the strategy is to singular, "
    "1 is good, 0 singular"
)


class PosturePanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Page):
        self.page = page
        gui = page.server.gui
        gray = partial(gui.add_button, color="gray")
        names = tuple(strategy.name for strategy in page.session.strategies)
        self.known = gui.add_html("")
        # Sliders.
        gui.add_divider()
        hint = "The strategy that the two sliders move"
        self.strategy = gui.add_dropdown("Sliders of", names, initial_value=names[page.lead], hint=hint)
        bounds: dict[str, Any] = {"min": 0.0, "max": 1.0, "step": 0.001, "initial_value": 0.0}
        gui.add_markdown("**Self-motion**: the joints move, the tool stands still.")
        self.self_motion = gui.add_slider("Self-motion", hint="Along the postures of this tool pose", **bounds)
        self.level_text = gui.add_markdown("")
        self.level = gui.add_slider("Level", hint="From leaf to leaf; the strategy keeps the new one", **bounds)
        # Cusps.
        gui.add_divider()
        gui.add_markdown("**How far** does the pose decide the joints? Round a cusp they may not come back.")
        hint = "On its leaf, about the tool; it takes some seconds"
        self.far = gray("Look for cusps of this strategy", hint=hint)
        self.far_text = gui.add_html("")
        # Coverage.
        gui.add_divider()
        gui.add_markdown("**Coverage** of the space around the tool by the leaf of a holonomic strategy.")
        holonomic = tuple(strategy.name for strategy in page.session.strategies if strategy.holonomic)
        self.cover = gui.add_dropdown("Strategy", holonomic or ("none",), hint="Whose leaf is looked at")
        hint = "Points about the tool, each as far from joint limits as its colour says"
        self.find = gray("Find the coverage", disabled=not holonomic, hint=hint)
        self.clear = gray("Take the cloud away", disabled=not holonomic, hint="And look no farther")
        self.cloud_text = gui.add_html("")
        self._sliders: dict[str, Slider | None] = {}
        self._cloud: Cloud | None = None
        self._cusps: LeafCusps | None = None
        self._seen: tuple[Any, ...] = ()
        self._fitted: dict[str, tuple[Any, ...]] = {}

        self.strategy.on_update(lambda _event: self.refit())
        self.far.on_click(lambda _event: page.ask(lambda: page.session.start_cusps(self.strategy.value)))
        self.find.on_click(lambda _event: page.ask(lambda: page.session.start_cloud(self.cover.value)))
        self.clear.on_click(lambda _event: page.ask(self.take_away))

        @self.self_motion.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(lambda: self._move(SELF), SELF)

        @self.level.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(lambda: self._move(LEVEL), LEVEL)

    def draw(self, snap: Snapshot) -> None:
        """Bring texts, sliders and cloud to a snapshot."""
        put(self.known, self._verdict_table(snap))
        still = snap.phase in (Phase.IDLE, Phase.DONE)
        self.self_motion.disabled = not still
        if still:
            self._fit(snap)
        # The nearest cusp as a ball, the smallest loop as a line; of a leaf that was left it is said.
        cusps = snap.cusps
        found = "" if cusps is None else block(line(self.page.worded(cusps.sentence)), quiet(_where(cusps, snap)))
        put(self.far_text, found)
        if cusps is not self._cusps:
            self._cusps = cusps
            self.page.scene.ball(None if cusps is None else cusps.place, CUSP, "cusp")
            self.page.scene.path([] if cusps is None else cusps.loop, "cusp", CUSP)
        if snap.cloud is not self._cloud:
            self._cloud = snap.cloud
            self._draw_cloud(snap.cloud)

    def take_away(self) -> None:
        """For good: what was found until it was cancelled is known, and not drawn again."""
        self._cloud = self.page.session.cancel_cloud().cloud
        self._draw_cloud(None)

    def refit(self) -> None:
        """The sliders are drawn anew, as in other units."""
        self._fitted = {}

    def _move(self, name: str) -> None:
        """The chosen strategy goes to where a slider stands."""
        slider, session = self._sliders.get(name), self.page.session
        if slider is None:
            return
        self.page.say("")
        handle = self.self_motion if name == SELF else self.level
        value = float(np.clip(handle.value / self.page.units.factor(slider.unit), slider.low, slider.high))
        if name == SELF:
            session.move_self(self.strategy.value, value)
        else:
            session.move_level(self.strategy.value, value)
            self._say_level(replace(slider, value=value))
        self._fitted[name] = self._key(session.snapshot())

    def _key(self, snap: Snapshot) -> tuple[Any, ...]:
        return self.strategy.value, snap.strategy(self.strategy.value).q.tobytes()

    def _fit(self, snap: Snapshot) -> None:
        """Bring the sliders to the posture; only when it changed, since finding how far they go takes time."""
        key, before = self._key(snap), self._seen
        self._seen = key
        if key != before:  # it moves still, and a drag must not wait
            return
        session, state, slider = self.page.session, snap.strategy(self.strategy.value), None
        for name, handle in ((SELF, self.self_motion), (LEVEL, self.level)):
            if self._fitted.get(name) == key:
                continue
            self._fitted[name] = key
            # How far it goes from here.
            try:
                slider = session.self_motion(state.name) if name == SELF else session.level_slider(state.name)
            except HolokinError as problem:
                slider = None
                if name == LEVEL:
                    text = str(problem) if state.holonomic else f"{state.name} has no leaves."
                    put(self.level_text, f"**Level**: {text}")
            if slider is not None and not slider.high > slider.low:
                slider = None
            self._sliders[name] = slider
            handle.disabled = slider is None
            if slider is None:
                continue
            # In the units of what it moves; what is shown at its ends is rounded inwards.
            scale, unit = self.page.units.factor(slider.unit), self.page.units.name(slider.unit)
            fine = 10 ** _decimals(unit)
            low, high = np.ceil(fine * scale * slider.low) / fine, np.floor(fine * scale * slider.high) / fine
            with self.page.server.atomic():
                handle.label = f"{slider.label} [{unit}]" if unit else slider.label
                handle.min, handle.max = low, high
                handle.step, handle.precision = 1 / fine, _decimals(unit)
                handle.value = float(np.clip(round(scale * slider.value, _decimals(unit)), low, high))
            if name == LEVEL:
                self._say_level(slider)

    def _say_level(self, slider: Slider) -> None:
        scale, name = self.page.units.factor(slider.unit), self.page.units.name(slider.unit)
        value, low, high = (f"{scale * x:.{_decimals(name)}f}" for x in (slider.value, slider.low, slider.high))
        span = f"{f'{value} {name}'.strip()}, from {low} ({slider.why_low}) to {high} ({slider.why_high})"
        put(self.level_text, f"**{slider.label}** of {slider.name}: {span}. The strategy keeps the new leaf.")

    def _verdict_table(self, snap: Snapshot) -> str:
        rows = [("", *(plain(text, grey=True) for text in ("strategy", "verdict about the start", "rcond")))]
        hints = [COLUMNS]
        for state, color in zip(snap.strategies, self.page.colors, strict=False):
            judgement = state.judgement
            known, hint = "is being judged", ""
            if judgement is not None:
                size = figure(judgement.curvature, 2) if judgement.curvature > FLAT else "none"
                known = verdict(judgement.holonomic)
                known += "" if np.isnan(judgement.curvature) else f", curvature {size}"
                hint = self.page.worded(judgement.sentence)
            elif np.isnan(state.rcond):
                known = "a control law is not judged"
            rcond = "" if np.isnan(state.rcond) else f"{state.rcond:.3f}"
            rcond = plain(rcond, red=bool(state.rcond < SINGULAR), right=True)
            rows.append((swatch(color), plain(state.name), plain(known), rcond))
            hints.append(hint)
        foot = "rcond: 1 is good, 0 singular. curvature: drift over the area of a small loop."
        return block(table(rows, hints), quiet(foot))

    def _draw_cloud(self, cloud: Cloud | None) -> None:
        """Each pose in a colour from FAR in the middle of the joints to NEAR at a limit, or UNREACHED."""
        if cloud is None:
            self.page.scene.cloud([], [])
            put(self.cloud_text, "")
            return
        share = np.nan_to_num(np.sqrt(np.clip(cloud.margin, 0.0, 1.0)))[:, None]
        colors = (1 - share) * np.array(rgb(NEAR)) + share * np.array(rgb(FAR))
        self.page.scene.cloud(cloud.points, np.where(cloud.reached[:, None], colors, rgb(UNREACHED)))
        reached = f"{100 * cloud.reached.mean():.0f} % are reached" if len(cloud.reached) else ""
        text = cloud.sentence or f"{cloud.strategy}: {cloud.done} of {cloud.total} poses looked at, {reached}"
        scale = ramp(FAR, NEAR, "in the middle of the joints", "at a limit")
        put(self.cloud_text, block(line(text), scale, table([(swatch(UNREACHED), plain("not reached"))])))


def _where(cusps: LeafCusps, snap: Snapshot) -> str:
    """What is said below the cusps: what is drawn of them, or that the strategy stands on another leaf by now."""
    if not any(s.name == cusps.strategy and np.array_equal(s.level, cusps.level) for s in snap.strategies):
        return "This is of a leaf that the strategy has left: look again."
    ball = "" if cusps.place is None else "The purple ball is the tool at the nearest cusp."
    return f"{ball} The purple line is the loop." if ball and len(cusps.loop) else ball


def _decimals(unit: str) -> int:
    """Decimals of a slider's numbers in a unit."""
    return 1 if unit in (DEGREES, "mm") else 3
