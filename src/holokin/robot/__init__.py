"""Robot descriptions: DH tables, URDF files, the catalogue."""

from .catalog import catalogue, load
from .dh import DHRow, from_dh
from .export import to_mjcf, to_urdf
from .inertia import mass_matrix_expression, potential_expression
from .model import FARTHEST, Body, Coordinate, Joint, Kinematics, Robot, Tip
from .second_order import hessian_expression
from .units import check_metres, doubtful_unit, start_posture
from .urdf import from_urdf, urdf_links, urdf_root, urdf_tips

__all__ = [
    "FARTHEST",
    "Body",
    "Coordinate",
    "DHRow",
    "Joint",
    "Kinematics",
    "Robot",
    "Tip",
    "catalogue",
    "check_metres",
    "doubtful_unit",
    "from_dh",
    "from_urdf",
    "hessian_expression",
    "load",
    "mass_matrix_expression",
    "potential_expression",
    "start_posture",
    "to_mjcf",
    "to_urdf",
    "urdf_links",
    "urdf_root",
    "urdf_tips",
]
