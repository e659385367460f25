"""Robot descriptions: DH tables, URDF, MJCF and xacro files, models of other libraries, the catalogue, compositions.

Uses `symbolic`. Read first: `model.py`, `tree.py`, `catalog.py`.
"""

from .capsules import chain_length, obstacle, with_capsules, with_shape
from .composition import Part, compose, ordered, with_base_pose, with_tool
from .drives import SERVOS, Servo, servo
from .extent import reach
from .formats.catalog import beside as beside
from .formats.catalog import catalogue, load
from .formats.dh import DHRow, from_dh
from .formats.mjcf import from_mjcf
from .formats.model_texts import to_mjcf, to_urdf
from .formats.models_by_name import is_model as is_model
from .formats.models_by_name import model_links, model_tips
from .formats.models_by_name import model_root as model_root
from .formats.pinocchio_model import from_pinocchio
from .formats.robot_table import assembled as assembled
from .formats.toolbox import from_roboticstoolbox
from .formats.urdf import from_urdf, from_yourdfpy
from .free_coordinates import coordinates
from .inertia import mass_matrix_expression as mass_matrix_expression
from .inertia import potential_expression as potential_expression
from .joints import FARTHEST, Body, Coordinate, Joint, Kinematics, Tip
from .joints import foot_of as foot_of
from .joints import joints_above as joints_above
from .limits import GIVE_SPEEDS as GIVE_SPEEDS
from .limits import speed_limits as speed_limits
from .limits import with_limits
from .limits import without_speed_limit as without_speed_limit
from .link_frames import link_jacobian as link_jacobian
from .links import DENSITY, weighed
from .links import knows_masses as knows_masses
from .model import Robot
from .second_order import hessian_expression as hessian_expression
from .shapes.link_shapes import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape, Unread
from .shapes.visuals import Surface, Visual
from .units import check_metres as check_metres
from .units import doubtful_unit as doubtful_unit
from .units import start_posture as start_posture

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
    "catalogue",
    "chain_length",
    "compose",
    "coordinates",
    "from_dh",
    "from_mjcf",
    "from_pinocchio",
    "from_roboticstoolbox",
    "from_urdf",
    "from_yourdfpy",
    "load",
    "model_links",
    "model_tips",
    "obstacle",
    "ordered",
    "reach",
    "servo",
    "to_mjcf",
    "to_urdf",
    "weighed",
    "with_base_pose",
    "with_capsules",
    "with_limits",
    "with_shape",
    "with_tool",
]
