"""Proofs by computation: a theorem about a leaf along a path, or over a box of tool poses, and its certificate.

Uses `motion` and intervals of `symbolic`. Read first: `certify_leaf.py`, `tube.py`.
"""

from .cell_search import Extent
from .certificate import Certificate, JointRates, joint_rates
from .certify_leaf import certify
from .proven_region import UniqueRegion, region_of, unique_region
from .signed_box import SignedBox
from .whole_arm import WholeArm

__all__ = [
    "Certificate",
    "Extent",
    "JointRates",
    "SignedBox",
    "UniqueRegion",
    "WholeArm",
    "certify",
    "joint_rates",
    "region_of",
    "unique_region",
]
