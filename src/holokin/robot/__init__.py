"""Robot descriptions: DH tables, URDF, MJCF and xacro files, models of other libraries, the catalogue, compositions."""

from .capsules import chain_length, obstacle, with_capsules, with_shape
from .catalog import beside, catalogue, load
from .composing import Part, compose, ordered, with_base_pose, with_tool
from .dh import DHRow, from_dh
from .drives import SERVOS, Servo, servo
from .export import to_mjcf, to_urdf
from .extent import reach
from .free_coordinates import coordinates
from .geometry import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape, Unread
from .inertia import mass_matrix_expression, potential_expression
from .limits import with_limits
from .link_frames import link_jacobian
from .links import DENSITY, knows_masses, weighed
from .mjcf import from_mjcf
from .model import FARTHEST, Body, Coordinate, Joint, Kinematics, Robot, Tip
from .pinocchio_model import from_pinocchio
from .reading import is_model, model_links, model_root, model_tips
from .robot_table import assembled
from .second_order import hessian_expression
from .toolbox import from_roboticstoolbox
from .units import check_metres, doubtful_unit, start_posture
from .urdf import from_urdf, from_yourdfpy
from .visuals import Surface, Visual

__all__ = [
    "DENSITY",
    "FARTHEST",
    "SERVOS",
    "Body",
    "Box",
    "Capsule",
    "Coordinate",
    "Cylinder",
    "DHRow",
    "Ellipsoid",
    "Hull",
    "Joint",
    "Kinematics",
    "LinkShape",
    "Mesh",
    "Part",
    "Robot",
    "Servo",
    "Shape",
    "Surface",
    "Tip",
    "Unread",
    "Visual",
    "assembled",
    "beside",
    "catalogue",
    "chain_length",
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
    "knows_masses",
    "link_jacobian",
    "load",
    "mass_matrix_expression",
    "model_links",
    "model_root",
    "model_tips",
    "obstacle",
    "ordered",
    "potential_expression",
    "reach",
    "servo",
    "start_posture",
    "to_mjcf",
    "to_urdf",
    "weighed",
    "with_base_pose",
    "with_capsules",
    "with_limits",
    "with_shape",
    "with_tool",
]
