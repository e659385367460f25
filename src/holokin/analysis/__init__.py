"""Questions about strategies: curvature, involutivity."""

from .curvature import curvature
from .involutivity import Verdict, involutivity, involutivity_of
from .region import Region, around, box

__all__ = ["Region", "Verdict", "around", "box", "curvature", "involutivity", "involutivity_of"]
