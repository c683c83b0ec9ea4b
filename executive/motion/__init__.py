"""Motion of the robot: kinematics, paths of the arm and of the base, timing.

General layout: ``symbolic`` is the mathematics behind ``kinematics``.
``bodies`` are convex pieces and the spheres in them, ``arm_bodies`` puts a robot's links and a room together, and
``collision`` checks configurations and base poses by them and by the ``separation`` of hulls, here and for
``executive.locations``.
``arm_path`` searches a joint space with it, ``base_path`` (on ``clearance``) drives, ``tight_path`` (on ``drivable``)
where that finds no way. ``trajectories`` go straight, and turn waypoints into motions. ``constrained_motion`` moves
arms under motion constraints: ``constraint_functions`` over an ``arm_group``, ends of phases (``constrained_ends``) and
ways to them by ``constraint_optimisation``; it is imported where it is used. Random generators are passed in;
``errors`` lists what is raised.
"""

from executive.motion.arm_path import JointSpace, plan_path
from executive.motion.base_path import plan_base_path
from executive.motion.clearance import Boxes, Grid, clearance_at, clearance_field
from executive.motion.collision import QuickCheck
from executive.motion.errors import GoalInCollision, MotionError, NoPath, StartInCollision
from executive.motion.kinematics import Chain, Gaze, InverseKinematics
from executive.motion.trajectories import cartesian_path, keeps_line, time_curve, time_path

__all__ = [
    "Boxes",
    "Chain",
    "Gaze",
    "GoalInCollision",
    "Grid",
    "InverseKinematics",
    "JointSpace",
    "MotionError",
    "NoPath",
    "QuickCheck",
    "StartInCollision",
    "cartesian_path",
    "clearance_at",
    "clearance_field",
    "keeps_line",
    "plan_base_path",
    "plan_path",
    "time_curve",
    "time_path",
]
