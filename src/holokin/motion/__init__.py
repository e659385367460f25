"""Uses of strategies: following paths, drift, spread."""

from .follow import follow
from .repeat import Drift, Spread, drift, path_spread

__all__ = ["Drift", "Spread", "drift", "follow", "path_spread"]
