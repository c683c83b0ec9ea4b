"""Bodies of the true world as relations ask about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from executive.maps import SemanticMap
from executive.maps.scene_bodies import SceneBodies
from planlang.geometry import Pose
from sim import Body, ComfortZone
from sim.joints import Articulation
from sim.truth import Truth


class TrueBodies(SceneBodies):
    """Bodies of a true world, by name."""

    def __init__(self, truth: Truth, semantic_map: SemanticMap) -> None:
        """``semantic_map`` says what the bodies are, not where."""
        self._truth, self._map = truth, semantic_map

    @property
    def map(self) -> SemanticMap:
        """The map whose ontology says what the bodies are."""
        return self._map

    @property
    def joints(self) -> Mapping[str, Articulation]:
        """Leaf -> its joint."""
        return {joint.leaf: joint for joint in self._truth.scene.joints}

    def names(self) -> Sequence[str]:
        """List all bodies that exist."""
        return self._truth.names()

    def body(self, name: str) -> Body:
        """Look up the description of a body."""
        return self._truth.scene.body(name)

    def pose(self, name: str) -> Pose:
        """Look up the map pose of a body."""
        return self._truth.pose(name)

    def zone(self, name: str) -> ComfortZone:
        """Look up the zone in which a person takes objects."""
        return self._truth.person(name)

    def support(self, name: str) -> str | None:
        """Find the body on which another stands."""
        return self._truth.support(name)

    def is_held(self, name: str) -> bool:
        """Check whether a hand of the robot holds a body."""
        return name in self._truth.attached()
