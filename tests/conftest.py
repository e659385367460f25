"""What the tests share: robots, start postures, and the URDFs of the example-robot-data package."""

from __future__ import annotations

from importlib.metadata import files
from pathlib import Path

import numpy as np
import pytest

import holokin as hk

PANDA_START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
IRB_START = np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0])
IIWA_START = np.array([0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0])
PPR_START = np.array([0.9022932188134525, -0.3035067811865475, np.pi / 4])
PPR_CENTER = np.array([1.2070, 0.4036, 0.0])
PPR_RADIUS = 0.4024


def urdf_files() -> list[Path]:
    """Every URDF of the installed example-robot-data package."""
    listed = files("example-robot-data") or []
    return sorted({Path(str(f.locate())).resolve() for f in listed if f.name.endswith(".urdf")})


def urdf(name: str) -> Path:
    """One URDF of that package by file name."""
    return next(path for path in urdf_files() if path.name == name)


@pytest.fixture(scope="session")
def ppr() -> hk.Robot:
    return hk.load("ppr")


@pytest.fixture(scope="session")
def irb140() -> hk.Robot:
    return hk.load("irb140")


@pytest.fixture(scope="session")
def panda() -> hk.Robot:
    return hk.load("panda")


@pytest.fixture(scope="session")
def iiwa14() -> hk.Robot:
    return hk.load("iiwa14")


@pytest.fixture(scope="session")
def planar_3r() -> hk.Robot:
    return hk.load("planar-3r")
