"""Semantic maps: read, merged, and made into the bodies of a world. Nothing here knows what a robot believes.

General layout: ``semantic_map`` reads the things of a map and ``measures`` their sizes; ``frames``, ``merging`` and
``statements`` are maps among maps; ``files`` reads what robots have measured (``occupancy_grid``, ``octree``,
``point_cloud``); ``scene`` makes bodies, with the ``articulation`` of doors and drawers, ``controls`` of devices and
``contents`` of vessels.
"""

from executive.maps.scene import default_starts, scene_of, support_of
from executive.maps.semantic_map import MapObject, SemanticMap, read_map

__all__ = ["MapObject", "SemanticMap", "default_starts", "read_map", "scene_of", "support_of"]
