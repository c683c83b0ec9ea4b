"""Belief: what the robot knows of the things of a map, and what planning asks of that.

General layout: ``belief`` is what the robot knows, ``planning_scene`` is what planning asks (``believed_bodies``:
shapes, ``scene_collisions``: room and contacts). ``map_updating`` and ``map_writing`` write maps of what is believed.
"""

from executive.belief.belief import Belief
from executive.belief.knowledge import Grip

__all__ = ["Belief", "Grip"]
