"""Believed state of the robot's software: which components run, and which classes of objects are recognised."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, replace

from executive.maps.classes import MapObject
from planlang.ontology import Ontology
from planlang.records import dataclass

VISION, EXPLORATION = "vision", "exploration"


@dataclass(frozen=True, slots=True)
class Recognition:
    """State of the software components; a component runs until it is stopped."""

    ontology: Ontology = field(repr=False)
    classes: tuple[str, ...] | None = None
    """IRIs of the recognised classes; None for all."""
    stopped: tuple[str, ...] = ()
    """Components that were stopped, in that order."""

    def running(self, part: str) -> Recognition:
        """Make the state in which a component runs."""
        return replace(self, stopped=tuple(one for one in self.stopped if one != part))

    def without(self, part: str) -> Recognition:
        """Make the state in which a component is stopped."""
        return replace(self, stopped=(*self.running(part).stopped, part))

    def runs(self, part: str) -> bool:
        """Check whether a component runs."""
        return part not in self.stopped

    def with_models(self, classes: Iterable[str]) -> Recognition:
        """Make the state in which models of further classes (IRIs) have been loaded."""
        return self if self.classes is None else replace(self, classes=tuple(dict.fromkeys((*self.classes, *classes))))

    def recognises(self, thing: MapObject) -> bool:
        """Check whether an object would be recognised in an image."""
        if not self.runs(VISION):
            return False
        return self.classes is None or self.ontology.any_is_a(thing.types, self.classes)

    def may_recognise(self, classes: Iterable[str]) -> bool:
        """Check whether there is a model of one of some classes (IRIs), or of a superclass or subclass."""
        loaded, is_a = self.classes, self.ontology.is_a
        return loaded is None or any(is_a(one, cls) or is_a(cls, one) for one in classes for cls in loaded)
