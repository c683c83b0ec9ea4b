"""Rigid poses, convex shapes, and readers for URDF and mesh files.

``matrices.py`` has poses and matrix products, ``shapes.py`` boxes, outlines and solids.
Nothing here depends on a robot, a world or a plan.

Frames: ``map`` is right-handed with z up and the floor at z = 0. Lengths in metres, angles in radians, quaternions as
(x, y, z, w).
"""

from planlang.geometry.matrices import IDENTITY, Array, Pose

__all__ = ["IDENTITY", "Array", "Pose"]
