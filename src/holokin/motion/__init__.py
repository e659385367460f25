"""Uses of strategies: following paths, drift, spread."""

from .follow import follow
from .inverse import InverseKinematics, inverse
from .leaf import settle
from .repeat import Drift, Spread, drift, path_spread

__all__ = ["Drift", "InverseKinematics", "Spread", "drift", "follow", "inverse", "path_spread", "settle"]
