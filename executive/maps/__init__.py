"""Semantic maps: reading and merging them, and building the bodies of a world. No robot's belief is involved here.

General layout: ``semantic_map`` reads the objects of a map and ``measures`` their sizes; ``frames``, ``merging`` and
``statements`` merge and write maps; ``occupied_space`` reads sensor data (``occupancy_grid``, ``octree``,
``point_cloud``);
``scene`` builds the bodies, with the ``articulation`` of doors and drawers, the controls of devices, and the
``contents`` of vessels; ``supports`` says what stands on what.
"""

from executive.maps.classes import MapObject
from executive.maps.scene import default_starts, scene_of
from executive.maps.semantic_map import SemanticMap, read_map
from executive.maps.supports import support_of

__all__ = ["MapObject", "SemanticMap", "default_starts", "read_map", "scene_of", "support_of"]
