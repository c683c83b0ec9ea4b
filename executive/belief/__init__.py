"""Belief: semantic maps, the scene they make, and what the robot believes of it.

General layout: ``semantic_map`` reads things, ``scene`` turns them into bodies,
``belief`` is what the robot knows of them, ``planning_scene`` is what planning asks (``believed_bodies``: shapes,
``scene_collisions``: room and contacts).
"""

from executive.belief.belief import Belief
from executive.belief.knowledge import Grip
from executive.belief.scene import default_starts, scene_of, support_of
from executive.belief.semantic_map import MapObject, SemanticMap, read_map

__all__ = ["Belief", "Grip", "MapObject", "SemanticMap", "default_starts", "read_map", "scene_of", "support_of"]
