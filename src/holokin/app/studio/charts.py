"""Live plots of a page: drift after each cycle, a joint of all laws over time, and the joints between their limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.types import Vector
from ..report.palette import INK, PALE
from ..report.plots import thin
from .panel_texts import block, marks, plain, put, quiet, short_names, table
from .shown_units import joint_factors, joint_unit, largest
from .stage import Stage
from .states import Snapshot

MOST = 12
"""Laws in a plot at most: more lines nobody tells apart."""

KEPT = 400
"""Points of a line at most."""

_EMPTY = np.array([0.0, 1.0])

SOFT = 0.1
"""Drift [rad or m] to which its plot goes at least."""


class Charts:
    """A column of plots at the left of the page."""

    def __init__(self, page: Stage):
        self.page = page
        self.panel = page.server.gui.add_panel()
        self.panel.dock_left()
        self.panel.set_width(330)
        self.joint = 0
        self._drawn: tuple[Any, ...] = ()
        names = page.session.robot.joint_names
        self._names = short_names(names)
        with self.panel.add_tab("What the joints do"):
            gui = page.server.gui
            self.title = gui.add_markdown(self._title())
            self.drift = self._plot("cycle", dots=True)
            self.pick = gui.add_dropdown(
                self._picked(),
                names,
                initial_value=names[self._restless()],
                hint="The joint of the plot below, with a line for each law",
            )
            self.history = self._plot("time [s]", dots=False)
            gui.add_markdown("**Joints** between their limits, a mark for each law")
            self.bars = gui.add_html("")

        @self.pick.on_update
        def _(_event: Any) -> None:
            self._drawn = ()

    def draw(self, snap: Snapshot) -> None:
        """Bring plots to a snapshot; those without news are left alone."""
        laws = snap.laws[:MOST]
        news = (snap.number, self.pick.value)
        if news == self._drawn:
            return
        self._drawn = news
        cycles = max((len(law.drift) for law in laws), default=0)
        units, robot = self.page.units, self.page.session.robot
        drifts = [largest(units, robot, law.drift_joints) for law in laws]
        if cycles:
            rows = thin(cycles + 1, KEPT)
            lines = [np.concatenate([[0.0], drift, np.full(cycles - len(drift), np.nan)]) for drift in drifts]
            self.drift.data = (rows.astype(float), *(line[rows] for line in lines))
        else:
            self.drift.data = (_EMPTY, *[np.zeros(2) for _ in laws])
        joint = robot.joint_names.index(self.pick.value)
        scale = joint_factors(units, robot)[joint]
        longest = max((law.t for law in laws), key=len, default=np.zeros(0))
        if len(longest) > 1:
            t = longest[thin(len(longest), KEPT)]
            self.history.data = (t, *[scale * _at(t, law.t, law.history, joint) for law in laws])
        else:
            self.history.data = (_EMPTY, *[np.full(2, scale * law.q[joint]) for law in laws])
        self.bars.content = self._bars(snap)

    def forget(self) -> None:
        """All is drawn anew, as in other units."""
        self._drawn = ()
        put(self.title, self._title())
        self.drift.scales = self._scales(soft=True)
        self.pick.label = self._picked()

    def _title(self) -> str:
        unit = joint_unit(self.page.units, self.page.session.robot)
        return f"**Drift**: how far the worst joint is from where it began, after each cycle [{unit}]"

    def _picked(self) -> str:
        """The label of the joint that is plotted, with its unit."""
        return f"Joint [{joint_unit(self.page.units, self.page.session.robot)}]"

    def _scales(self, soft: bool) -> dict[str, Any]:
        least = SOFT * joint_factors(self.page.units, self.page.session.robot).max()
        grows = {"min": {"pad": 0.05, "soft": 0.0, "mode": 1}, "max": {"pad": 0.05, "soft": least, "mode": 1}}
        return {"x": {"time": False}, **({"y": {"range": grows}} if soft else {})}

    def _plot(self, across: str, dots: bool) -> Any:
        from viser import uplot

        laws = self.page.session.laws[:MOST]
        series = [uplot.Series(label=across)]
        for law, color in zip(laws, self.page.colors, strict=False):
            dash = () if law.holonomic else (6.0, 4.0)
            series.append(uplot.Series(label=law.name, stroke=color, width=2, dash=dash, points={"show": dots}))
        axis = {"stroke": INK, "grid": {"stroke": PALE}, "size": 34}
        return self.page.server.gui.add_uplot(
            (_EMPTY, *[np.zeros(2) for _ in laws]), tuple(series), height=180, legend={"show": False},
            scales=self._scales(dots), padding=(14, 16, 0, 0),
            axes=({**axis, "label": across, "labelSize": 18}, {**axis, "size": 52}),
        )  # fmt: skip

    def _restless(self) -> int:
        """The joint that the self-motion moves most."""
        return int(np.argmax(np.linalg.norm(self.page.session.task.null_space(self.page.session.home), axis=1)))

    def _bars(self, snap: Snapshot) -> str:
        robot, rows, hints = self.page.session.robot, [], []
        for index, c in enumerate(robot.coordinates):
            bounded = bool(np.isfinite([c.lower, c.upper]).all())
            low, high = (c.lower, c.upper) if bounded else (-np.pi, np.pi)
            values = [_share(law.q[index], low, high) for law in snap.laws[:MOST]]
            scale, unit = self.page.units.factor(c.unit), self.page.units.name(c.unit)
            number = plain(f"{scale * snap.laws[self.page.lead].q[index]:.{3 if scale == 1 else 1}f}", right=True)
            rows.append((plain(self._names[index]), marks(values, self.page.colors, bounded), number))
            hints.append(
                f"{c.name}: {scale * low:.4g} to {scale * high:.4g} {unit}" if bounded else f"{c.name}: without limits"
            )
        return block(
            table(rows, hints),
            quiet(f"Number: of the solid robot [{joint_unit(self.page.units, robot)}]. Dark ends: limits."),
        )


def _share(value: float, low: float, high: float) -> float:
    """Where a value is between two others, 0 to 1."""
    return float(np.clip((value - low) / (high - low), 0.0, 1.0)) if high > low else 0.5


def _at(t: Vector, known: Vector, history: Any, joint: int) -> Vector:
    """A joint at instants t, where it is known; else NaN."""
    if len(known) < 2:
        return np.full(len(t), np.nan)
    return np.interp(t, known, history[:, joint], left=np.nan, right=np.nan)
