"""Robot descriptions: DH tables, URDF, MJCF and xacro files, models of other libraries, the catalogue, compositions.

Uses `symbolic`. Read first: `model.py`, `tree.py`.
"""

from .chains import GIVE_SPEEDS as GIVE_SPEEDS
from .chains import Part, compose, ordered, with_base_pose, with_limits, with_tool
from .chains import check_metres as check_metres
from .chains import doubtful_unit as doubtful_unit
from .chains import nearer_or_other as nearer_or_other
from .chains import speed_limits as speed_limits
from .chains import without_speed_limit as without_speed_limit
from .formats.dh import DHRow, from_dh
from .formats.libraries import from_pinocchio, from_roboticstoolbox
from .formats.loading import assembled as assembled
from .formats.loading import beside as beside
from .formats.loading import catalogue, load, model_links, model_tips
from .formats.loading import is_model as is_model
from .formats.loading import model_root as model_root
from .formats.mjcf import from_mjcf
from .formats.urdf import from_urdf, from_yourdfpy
from .formats.writers import to_mjcf, to_urdf
from .joints import FARTHEST, Body, Coordinate, Joint, Kinematics, Tip
from .joints import foot_of as foot_of
from .joints import joints_above as joints_above
from .links import (
    DENSITY,
    SERVOS,
    Servo,
    chain_length,
    coordinates,
    obstacle,
    reach,
    servo,
    weighed,
    with_capsules,
    with_shape,
)
from .links import knows_masses as knows_masses
from .links import link_jacobian as link_jacobian
from .links import mass_matrix_expression as mass_matrix_expression
from .links import potential_expression as potential_expression
from .model import Robot
from .model import hessian_expression as hessian_expression
from .model import start_posture as start_posture
from .shapes.convex_pieces import convex_pieces
from .shapes.link_shapes import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, Shape, Unread
from .shapes.visuals import Surface, Visual

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
    "convex_pieces",
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
