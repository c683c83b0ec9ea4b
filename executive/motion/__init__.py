"""Motion planning: kinematics, arm paths, base paths, timing.

``symbolic`` is the mathematics behind ``kinematics``. ``bodies`` approximates convex shapes by spheres, ``arm_bodies``
combines a robot's links with the bodies of a room, and ``collision`` checks configurations and base poses with both,
and by the ``separation`` of hulls, here and for ``executive.locations``. ``arm_path`` plans in joint space;
``base_path`` (on ``clearance``) plans for the base.
``trajectories`` moves the tip along straight lines and times waypoints. ``constrained_motion`` moves arms under motion
constraints: ``constraint_functions`` over an ``arm_group``, the ends of phases (``constrained_ends``), and paths to
them by ``constraint_optimisation``; it is imported only where it is used. Random generators are passed in; ``errors``
lists the exceptions.
"""

from executive.motion.arm_path import JointSpace, plan_path
from executive.motion.base_path import plan_base_path
from executive.motion.clearance import Boxes, Grid, clearance_at, clearance_field
from executive.motion.collision import QuickCheck
from executive.motion.errors import GoalInCollision, MotionError, NoPath, StartInCollision
from executive.motion.kinematics import Chain, Gaze
from executive.motion.trajectories import cartesian_path, keeps_line, time_curve, time_path

__all__ = [
    "Boxes",
    "Chain",
    "Gaze",
    "GoalInCollision",
    "Grid",
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
