"""What is known of the world: semantic maps, the scene they make, and what the robot believes of it.

General layout: ``semantic_map`` reads things (``transforms``, ``sizes`` and ``numbers`` below it), ``scene`` turns them
into bodies (``support`` says what stands on what, ``start`` where the robot begins), ``belief`` is what plans look at.
"""

from executive.belief.belief import Belief, Grip
from executive.belief.scene import default_starts, scene_of, support_of
from executive.belief.semantic_map import MapObject, SemanticMap, read_map

__all__ = ["Belief", "Grip", "MapObject", "SemanticMap", "default_starts", "read_map", "scene_of", "support_of"]
