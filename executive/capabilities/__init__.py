"""What a robot is and can do: its self-model bound to a URDF, and what a task requires of it.

General layout: ``binding`` is the entrance; ``self_model`` reads SRDL, ``robot_file`` the numbers beside it,
``mechanism`` the URDF; ``naming`` and ``limbs`` bring them together into a ``robot``. ``requirements`` compares tasks
with robots (``components``: the classes of a robot's parts).
"""

from executive.capabilities.binding import bind_robot, robots
from executive.capabilities.requirements import Missing, missing_capabilities, requirements
from executive.capabilities.robot import Arm, BaseDrive, Gripper, JointLimits, Robot

__all__ = [
    "Arm",
    "BaseDrive",
    "Gripper",
    "JointLimits",
    "Missing",
    "Robot",
    "bind_robot",
    "missing_capabilities",
    "requirements",
    "robots",
]
