"""What a robot is and can do: its self-model bound to a URDF, and what a task requires of it.

General layout: ``binding`` is the entrance; ``self_model`` reads SRDL, ``robot_file`` the numbers beside it,
``mechanism`` the URDF; ``naming`` and ``limbs`` bring them together into a ``robot`` with its ``parts``.
``requirements`` says what classes of actions and capabilities require, ``matching`` compares that with a robot (with
``closed_world`` for class expressions) and gives a tree of findings (``finding``); ``tasks`` does so for a whole
recipe, and ``remedies`` tells where what is missing could be had.
"""

from executive.robots.binding import bind_robot, robots
from executive.robots.finding import Availability, Finding, FindingKind
from executive.robots.matching import Missing, missing_capabilities, possessions_of
from executive.robots.requirements import Semantics, requirements
from executive.robots.robot import CARRYING, Arm, BaseDrive, Gripper, JointLimits, Robot
from executive.robots.tasks import match

__all__ = [
    "CARRYING",
    "Arm",
    "Availability",
    "BaseDrive",
    "Finding",
    "FindingKind",
    "Gripper",
    "JointLimits",
    "Missing",
    "Robot",
    "Semantics",
    "bind_robot",
    "match",
    "missing_capabilities",
    "possessions_of",
    "requirements",
    "robots",
]
