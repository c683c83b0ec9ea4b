"""Belief: the robot's knowledge of the objects of a map, and the planning scene built from it.

General layout: ``belief`` holds the knowledge and changes it, ``planning_scene`` answers queries of planning
(``believed_bodies``: shapes, ``scene_collisions``: free floor and contacts). ``map_updating`` writes the user's map
with the robot's changes, ``map_writing`` a new map of the belief.
"""

from executive.belief.belief import Belief

__all__ = ["Belief"]
