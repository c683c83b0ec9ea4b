"""Robots: self-models bound to URDFs, and matching with the requirements of tasks.

General layout: ``binding`` is the entry point; ``robot`` reads SRDL, ``robot_file`` the TOML file and ``mechanism`` the
URDF, ``limbs`` combines them. ``requirements`` reads what classes of actions and capabilities require, ``matching``
compares that with a robot, ``tasks`` does so for a whole recipe: import ``match`` from there, as the rest does not
depend on recipes. ``arms`` is the robot as planning sees it and as plans command it. ``draft`` makes a robot file from
a URDF and an SRDF: ``anatomy`` finds arms, hands, torsos and legs in the kinematic tree, ``hand_shape`` measures hands,
``srdf`` reads what an SRDF adds.
"""

from executive.robots.binding import bind_draft, bind_robot, robots
from executive.robots.matching import Missing, missing_capabilities, possessions_of
from executive.robots.requirements import Availability, FindingKind, requirements
from executive.robots.robot import CARRYING, Arm, Gripper, Robot, with_options

__all__ = [
    "CARRYING",
    "Arm",
    "Availability",
    "FindingKind",
    "Gripper",
    "Missing",
    "Robot",
    "bind_draft",
    "bind_robot",
    "missing_capabilities",
    "possessions_of",
    "requirements",
    "robots",
    "with_options",
]
