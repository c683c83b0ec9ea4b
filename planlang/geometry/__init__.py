"""Rigid poses and convex shapes, and the readers of the files that hold them: URDF and meshes.

``matrices.py`` multiplies and places, ``shapes.py`` says what takes room.
Nothing here knows a robot, a world or a plan.

Frames: ``map`` is right-handed with z up and the floor at z = 0. Lengths in metres, angles in radians, quaternions as
(x, y, z, w).
"""

from planlang.geometry.matrices import Array, Pose

__all__ = ["Array", "Pose"]
