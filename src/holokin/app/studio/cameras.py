"""`Cameras`: each browser sees all of the robot in the part of its window that no panel covers."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.types import ArrayLike, Matrix, Vector
from .page_scene import FOV, Scene

FILLED = 0.88
"""Share of the picture's width and height that what is shown takes at most."""

UNMOVED = 1e-3
"""How far a camera may be from where it was put, over its distance to the robot, if nobody moved it: browsers round."""

RESHAPED = 0.01
"""Change of the picture's width over its height from which the robot is fitted in again."""

BOTTOM_SHEET = """<style>@media (max-width: 36em) {
#root .mantine-Paper-root[style*="position: fixed"], .mantine-Paper-root div[style="width: 20em;"]
{ width: 100% !important; max-height: 58% !important; }
body:not(:has([style*="display: none"] .holokin-head))
#root div[style*="background-color"]:has(> div > div > div > canvas) { height: 42% !important; }
}</style>"""
"""On a window as narrow as a telephone's viser lays its panel over the scene, at the bottom: there the scene ends above
it, as long as the panel is open. Where viser's page is built in another way, this does nothing."""


def fitted(points: ArrayLike, away: Vector, aspect: float) -> tuple[Vector, Vector]:
    """(place of the camera, point it looks at) (3,) [m]: the nearest place from which points (k, 3) fit in.

    A point at x to the right, y above and z towards the camera is in the picture of a camera at c where
    |x - c_x| <= T (c_z - z); so for each axis c_z >= (max(x + T z) + max(T z - x)) / (2 T).

    Args:
        away: unit vector (3,) from the points towards the camera; not upright.
        aspect: width over height of the picture.
    """
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(away, right), away])
    seen = np.asarray(points, dtype=float).reshape(-1, 3) @ axes.T
    slopes = FILLED * np.tan(FOV / 2) * np.array([aspect, 1.0])
    ends = [((x + t * seen[:, 2]).max(), (t * seen[:, 2] - x).max()) for x, t in zip(seen.T, slopes, strict=False)]
    far = max((high + low) / (2 * t) for (high, low), t in zip(ends, slopes, strict=True))
    across = [(high - low) / 2 for high, low in ends]
    middle = (seen[:, 2].max() + seen[:, 2].min()) / 2
    return np.array([*across, far]) @ axes, np.array([*across, middle]) @ axes


class Cameras:
    """The cameras of all browsers on a scene; a camera that somebody moved stays where it is until it is reset.

    Args:
        points: (k, 3) [m], what shall be seen besides the robot.
    """

    def __init__(self, scene: Scene, points: Matrix) -> None:
        self._away, shown = scene.outlook(points)
        self._points = shown
        self._first = fitted(shown, self._away, 1.0)
        self._given: dict[int, tuple[float, Vector]] = {}
        scene.look_from(*self._first)

    def fit(self, client: Any, anew: bool = False) -> None:
        """Put the camera of a browser where its window shows all; `anew`: wherever it is.

        Browsers tell where they look from whenever they were moved, reset, or their window got another size.
        """
        camera = client.camera
        if not camera.image_width or not camera.image_height:
            return
        aspect, place = camera.image_width / camera.image_height, np.asarray(camera.position)
        before = self._given.get(client.client_id)
        as_put = before is not None and self._near(place, before[1])
        if as_put and before is not None and abs(aspect / before[0] - 1) < RESHAPED:
            return
        if not (anew or as_put or self._near(place, self._first[0])):
            return
        put, at = fitted(self._points, self._away, aspect)
        self._given[client.client_id] = aspect, put
        with client.atomic():
            camera.position, camera.look_at = put, at

    def forget(self, client: Any) -> None:
        """A browser went away."""
        self._given.pop(client.client_id, None)

    def _near(self, place: Vector, put: Vector) -> bool:
        return bool(np.linalg.norm(place - put) < UNMOVED * np.linalg.norm(put - self._first[1]))
