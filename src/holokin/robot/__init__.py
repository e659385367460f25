"""Robot descriptions: DH tables, URDF, MJCF and xacro files, models of other libraries, the catalogue, compositions."""

from .catalog import beside, catalogue, load
from .composing import Part, compose, ordered, with_base_pose, with_tool
from .dh import DHRow, from_dh
from .export import to_mjcf, to_urdf
from .extent import reach
from .free_coordinates import coordinates
from .inertia import mass_matrix_expression, potential_expression
from .mjcf import from_mjcf
from .model import FARTHEST, Body, Coordinate, Joint, Kinematics, Robot, Tip
from .pinocchio_model import from_pinocchio
from .reading import is_model, model_links, model_root, model_tips
from .robot_table import assembled
from .second_order import hessian_expression
from .toolbox import from_roboticstoolbox
from .units import check_metres, doubtful_unit, start_posture
from .urdf import from_urdf, from_yourdfpy

__all__ = [
    "FARTHEST",
    "Body",
    "Coordinate",
    "DHRow",
    "Joint",
    "Kinematics",
    "Part",
    "Robot",
    "Tip",
    "assembled",
    "beside",
    "catalogue",
    "check_metres",
    "compose",
    "coordinates",
    "doubtful_unit",
    "from_dh",
    "from_mjcf",
    "from_pinocchio",
    "from_roboticstoolbox",
    "from_urdf",
    "from_yourdfpy",
    "hessian_expression",
    "is_model",
    "load",
    "mass_matrix_expression",
    "model_links",
    "model_root",
    "model_tips",
    "ordered",
    "potential_expression",
    "reach",
    "start_posture",
    "to_mjcf",
    "to_urdf",
    "with_base_pose",
    "with_tool",
]
