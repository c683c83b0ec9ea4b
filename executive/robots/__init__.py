"""Robots: a self-model bound to a URDF, and what a task requires of it.

General layout: ``binding`` is the entrance; ``robot`` reads SRDL, ``robot_file`` the numbers beside it and
``mechanism`` the URDF, ``limbs`` brings them together. ``requirements`` reads what classes of actions and
capabilities require, ``matching`` compares that with a robot, ``tasks`` does so for a whole recipe: import ``match``
from there, the rest needs no recipes. ``arms`` is the robot as planning asks it. ``draft`` makes a robot file from a
URDF: ``anatomy`` finds arms and hands in its tree, ``hand_shape`` measures hands, ``srdf`` reads what stands beside it.
"""

from executive.robots.binding import bind_draft, bind_robot, robots
from executive.robots.matching import Missing, missing_capabilities, possessions_of
from executive.robots.requirements import Availability, FindingKind, Semantics, requirements
from executive.robots.robot import CARRYING, Arm, Gripper, Robot, trusting_map

__all__ = [
    "CARRYING",
    "Arm",
    "Availability",
    "FindingKind",
    "Gripper",
    "Missing",
    "Robot",
    "Semantics",
    "bind_draft",
    "bind_robot",
    "missing_capabilities",
    "possessions_of",
    "requirements",
    "robots",
    "trusting_map",
]
