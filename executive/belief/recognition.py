"""The believed state of the robot's software: which parts run, and of which classes things are recognised."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from executive.maps.semantic_map import MapObject
from planlang.ontology import Ontology, expand

VISION, EXPLORATION = "vision", "exploration"


class Recognition:
    """The state of the software parts; a part that was never started or stopped runs."""

    def __init__(self, ontology: Ontology, classes: Iterable[str] | None = None) -> None:
        """Begin with models of ``classes``, or with None of all classes."""
        self._ontology = ontology
        self._stopped: dict[str, None] = {}
        self.classes: tuple[str, ...] | None = None if classes is None else tuple(map(expand, classes))
        """IRIs."""

    def set_running(self, part: str, *, running: bool) -> None:
        """Record that a part runs from now on, or does not."""
        self._stopped.pop(part, None)
        if not running:
            self._stopped[part] = None

    def runs(self, part: str) -> bool:
        """Return whether a part runs."""
        return part not in self._stopped

    def load(self, classes: Iterable[str]) -> None:
        """Record that things of further classes (IRIs) are recognised."""
        if self.classes is not None:
            self.classes = tuple(dict.fromkeys((*self.classes, *classes)))

    def recognises(self, thing: MapObject) -> bool:
        """Return whether a thing would be recognised in a picture."""
        if not self.runs(VISION):
            return False
        return self.classes is None or self._ontology.any_is_a(thing.types, self.classes)

    def may_recognise(self, classes: Iterable[str]) -> bool:
        """Return whether there is a model of one of some classes (IRIs), or of one above or below it."""
        known, is_a = self.classes, self._ontology.is_a
        return known is None or any(is_a(one, cls) or is_a(cls, one) for one in classes for cls in known)

    def snapshot(self) -> dict[str, Any]:
        """Return the state as JSON."""
        return {"stopped": list(self._stopped), "classes": None if self.classes is None else list(self.classes)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore :meth:`snapshot`; raises KeyError or TypeError for what is none."""
        self._stopped = dict.fromkeys(map(str, state["stopped"]))
        self.classes = None if state["classes"] is None else tuple(map(str, state["classes"]))
