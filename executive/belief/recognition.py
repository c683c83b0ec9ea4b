"""Believed state of the robot's software: which components run, and which classes of objects are recognised."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from executive.maps.semantic_map import MapObject
from planlang.ontology import Ontology, expand

VISION, EXPLORATION = "vision", "exploration"


class Recognition:
    """State of the software components; a component runs until it is stopped."""

    def __init__(self, ontology: Ontology, classes: Iterable[str] | None = None) -> None:
        """Begin with recognition models of ``classes``; None means models of all classes."""
        self._ontology = ontology
        self._stopped: dict[str, None] = {}
        self.classes: tuple[str, ...] | None = None if classes is None else tuple(map(expand, classes))
        """IRIs of the recognised classes; None for all."""

    def set_running(self, part: str, *, running: bool) -> None:
        """Record that a component has been started or stopped."""
        self._stopped.pop(part, None)
        if not running:
            self._stopped[part] = None

    def runs(self, part: str) -> bool:
        """Check whether a component runs."""
        return part not in self._stopped

    def load(self, classes: Iterable[str]) -> None:
        """Record that models of further classes (IRIs) have been loaded."""
        if self.classes is not None:
            self.classes = tuple(dict.fromkeys((*self.classes, *classes)))

    def recognises(self, thing: MapObject) -> bool:
        """Check whether an object would be recognised in an image."""
        if not self.runs(VISION):
            return False
        return self.classes is None or self._ontology.any_is_a(thing.types, self.classes)

    def may_recognise(self, classes: Iterable[str]) -> bool:
        """Check whether there is a model of one of some classes (IRIs), or of a superclass or subclass."""
        loaded, is_a = self.classes, self._ontology.is_a
        return loaded is None or any(is_a(one, cls) or is_a(cls, one) for one in classes for cls in loaded)

    def snapshot(self) -> dict[str, Any]:
        """Convert the state to JSON."""
        return {"stopped": list(self._stopped), "classes": None if self.classes is None else list(self.classes)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the state of :meth:`snapshot`. Raises KeyError or TypeError if it is malformed."""
        self._stopped = dict.fromkeys(map(str, state["stopped"]))
        self.classes = None if state["classes"] is None else tuple(map(str, state["classes"]))
