"""The panel of the posture: how near to singular, what is known of each law, and sliders that keep the tool still."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import HolokinError
from ..output.palette import BAD, GREY, INK, rgb
from .states import Cloud, LawState, Phase, Snapshot

if TYPE_CHECKING:
    from .page import Page

TICKS = 1000
"""Places of a slider."""


class PosturePanel:
    """Its controls; built inside a tab."""

    def __init__(self, page: Page):
        self.page = page
        gui = page.server.gui
        names = tuple(law.name for law in page.session.laws)
        self.known = gui.add_html("")
        gui.add_divider()
        self.law = gui.add_dropdown("Sliders of", names, initial_value=names[page.lead])
        gui.add_markdown("**Self-motion**: the joints move, the tool stands still.")
        self.self_motion = gui.add_slider("Self-motion", min=0.0, max=1.0, step=1 / TICKS, initial_value=0.5)
        self.level_text = gui.add_markdown("")
        self.level = gui.add_slider("Level", min=0.0, max=1.0, step=1 / TICKS, initial_value=0.5)
        gui.add_divider()
        gui.add_markdown("**Coverage** of the space around the tool by the leaf of a holonomic law.")
        holonomic = tuple(law.name for law in page.session.laws if law.holonomic)
        self.cover = gui.add_dropdown("Law", holonomic or ("none",))
        self.find = gui.add_button("Find the coverage", color="gray", disabled=not holonomic)
        self.clear = gui.add_button("Take the cloud away", color="gray", disabled=not holonomic)
        self.cloud_text = gui.add_html("")
        self._ranges: dict[str, Any] = {}
        self._quiet = False
        self._cloud: Cloud | None = None
        self._fitted: tuple[Any, ...] = ()
        self._connect()

    def draw(self, snap: Snapshot) -> None:
        """Bring texts, sliders and cloud to a snapshot."""
        from .panels import put

        put(self.known, self._known(snap))
        still = snap.phase in (Phase.IDLE, Phase.DONE)
        self.self_motion.disabled = not still
        if still:
            self._fit(snap)
        if snap.cloud is not self._cloud:
            self._cloud = snap.cloud
            self._draw_cloud(snap.cloud)

    def _connect(self) -> None:
        page = self.page

        @self.law.on_update
        def _(_event: Any) -> None:
            self._fitted = ()

        @self.self_motion.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(self._slide, "self-motion")

        @self.level.on_update
        def _(event: Any) -> None:
            if event.client is not None:
                page.ask(self._lift, "level")

        @self.find.on_click
        def _(_event: Any) -> None:
            page.ask(lambda: page.session.start_cloud(self.cover.value))

        @self.clear.on_click
        def _(_event: Any) -> None:
            page.ask(lambda: (page.session.cancel_cloud(), page.scene.cloud([], [])))

    def _slide(self) -> None:
        known = self._ranges.get("self-motion")
        if known is not None:
            self.page.say("")
            self.page.session.move_self(self.law.value, known.low + self.self_motion.value * (known.high - known.low))
            self._fitted = self._key(self.page.session.snapshot())

    def _lift(self) -> None:
        known = self._ranges.get("level")
        if known is not None:
            value = known.low + self.level.value * (known.high - known.low)
            rest = self.page.session.snapshot().law(self.law.value).level[1:]
            scale = np.pi / 180 if known.unit == "deg" else 1.0
            self.page.say("")
            self.page.session.set_level(self.law.value, [scale * value, *rest])
            self._fitted = self._key(self.page.session.snapshot())

    def _key(self, snap: Snapshot) -> tuple[Any, ...]:
        return self.law.value, snap.law(self.law.value).q.tobytes()

    def _fit(self, snap: Snapshot) -> None:
        """Bring the sliders to the posture; to find how far they go costs some milliseconds, so only when it changed."""
        key = self._key(snap)
        if key == self._fitted:
            return
        self._fitted = key
        law = snap.law(self.law.value)
        self._ranges = {}
        for name, handle in (("self-motion", self.self_motion), ("level", self.level)):
            try:
                found = self.page.session.self_motion(law.name) if name == "self-motion" else self._level(law)
            except HolokinError as problem:
                found = None
                self.level_text.content = str(problem) if name == "level" else self.level_text.content
            handle.disabled = found is None or not found.high > found.low
            if found is not None and found.high > found.low:
                self._ranges[name] = found
                handle.value = float(np.clip((found.value - found.low) / (found.high - found.low), 0.0, 1.0))
        known = self._ranges.get("level")
        if known is not None:
            what = "Elbow angle" if known.unit == "deg" else "Level g(q)"
            unit = f" {known.unit}" if known.unit else ""
            self.level_text.content = f"**{what}**: {known.value:.4g}{unit}, from {known.low:.4g} to {known.high:.4g}. The law keeps the new leaf."

    def _level(self, law: LawState) -> Any:
        if not law.holonomic:
            self.level_text.content = f"**Level**: {law.name} has no leaves."
            return None
        return self.page.session.level_slider(law.name)

    def _known(self, snap: Snapshot) -> str:
        rows = []
        for law, color in zip(snap.laws, self.page.colors, strict=False):
            judged = law.judgement
            verdict = "is being judged" if judged is None else "holonomic" if judged.holonomic else "not holonomic"
            bend = "" if judged is None else f", curvature {judged.curvature:.2g}"
            near = BAD if law.rcond < 0.01 else INK
            rows.append(
                f'<tr title="{escape(judged.sentence if judged is not None else "")}"><td><div style="width:12px;height:12px;'
                f'border-radius:3px;background:{color}"></div></td><td>{escape(law.name)}</td>'
                f'<td>{verdict}{bend}</td><td style="text-align:right;color:{near}">{law.rcond:.3f}</td></tr>'
            )
        head = f'<tr style="color:{GREY}"><td></td><td>law</td><td>verdict about the start</td><td style="text-align:right">rcond</td></tr>'
        foot = f'<div style="color:{GREY};font-size:12px;padding:0 10px">rcond: 1 is good, 0 singular. curvature: drift over the area of a small loop.</div>'
        return (
            f'<table style="width:100%;font-size:12.5px;color:{INK};padding:0 8px">{head}{"".join(rows)}</table>{foot}'
        )

    def _draw_cloud(self, cloud: Cloud | None) -> None:
        if cloud is None:
            self.page.scene.cloud([], [])
            self.cloud_text.content = ""
            return
        self.page.scene.cloud(cloud.points, margin_colors(cloud))
        share = f"{100 * cloud.reached.mean():.0f} % are reached" if len(cloud.reached) else ""
        text = cloud.sentence or f"{cloud.law}: {cloud.done} of {cloud.total} poses looked at, {share}"
        key = "blue: far from joint limits; orange: near one; red: not reached"
        self.cloud_text.content = f'<div style="font-size:12.5px;color:{INK};padding:0 10px">{escape(text)}<div style="color:{GREY}">{key}</div></div>'


def margin_colors(cloud: Cloud) -> Any:
    """A colour (k, 3) for each pose: from orange at a joint limit to blue in the middle; red where it is not reached."""
    share = np.nan_to_num(np.sqrt(np.clip(cloud.margin, 0.0, 1.0)))[:, None]
    colors = (1 - share) * np.array(rgb("#E69F00")) + share * np.array(rgb("#0072B2"))
    return np.where(cloud.reached[:, None], colors, np.array(rgb("#D55E00"))).astype(np.uint8)
