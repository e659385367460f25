"""Robot descriptions: DH tables, URDF files, the catalogue."""

from .catalog import catalogue, load
from .dh import DHRow, from_dh
from .model import Coordinate, Joint, Kinematics, Robot, Tip
from .urdf import from_urdf, urdf_tips

__all__ = [
    "Coordinate",
    "DHRow",
    "Joint",
    "Kinematics",
    "Robot",
    "Tip",
    "catalogue",
    "from_dh",
    "from_urdf",
    "load",
    "urdf_tips",
]
