"""Which link of a URDF a self-model means: by urdfName, else by local name, with or without the robot's prefix."""

from __future__ import annotations

from executive.robots.mechanism import Mechanism
from executive.robots.self_model import SelfModel
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note


class Naming:
    """Finds links; what had to be guessed is noted once."""

    def __init__(self, model: SelfModel, mechanism: Mechanism, found: list[Diagnostic]) -> None:
        self.model, self.mechanism, self.found = model, mechanism, found
        self._noted: set[str] = set()
        self._prefixes = self._find_prefixes()

    def _find_prefixes(self) -> tuple[str, ...]:
        """What local names have in front of the URDF's names, longest first."""
        prefixes: dict[str, None] = {}
        for iri, name in (*self.model.links.items(), *self.model.joints.items()):
            local = local_name(iri)
            if local.endswith(name) and local != name:
                prefixes[local.removesuffix(name)] = None
        for cls in (self.model.name, *map(local_name, self.model.types)):
            prefixes[f"{cls}_"] = None
        return tuple(sorted(prefixes, key=lambda prefix: (-len(prefix), prefix)))

    def link(self, iri: str, span: Span | None = None) -> str | None:
        """Name in the URDF of the link that an IRI means; a joint means its child link. None if there is none."""
        links, joints = self.mechanism.links, self.mechanism.joints
        name = self.model.links.get(iri)
        if name in links:
            return name
        joint = self.model.joints.get(iri)
        if joint in joints:
            child = joints[joint].child
            self._note(
                iri, f"{local_name(iri)} is a joint where a link is expected; its child link {child} is meant", span
            )
            return child
        local = local_name(iri)
        shorter = [local.removeprefix(prefix) for prefix in self._prefixes if local.startswith(prefix)]
        for candidate in (local, *shorter):
            if candidate in links:
                self._note(
                    iri, f"{local} is matched by name to the link {candidate} of {self.mechanism.path.name}", span
                )
                return candidate
            if candidate in joints:
                child = joints[candidate].child
                self._note(iri, f"{local} is a joint where a link is expected; its child link {child} is meant", span)
                return child
        return None

    def _note(self, iri: str, message: str, span: Span | None) -> None:
        if iri not in self._noted:
            self._noted.add(iri)
            self.found.append(note("B003", message, span))

    def unknown(self) -> tuple[str, ...]:
        """Names of links and joints that the URDF does not have, in the order of the self-model."""
        known = {*self.mechanism.links, *self.mechanism.joints}
        return tuple(name for name in (*self.model.links.values(), *self.model.joints.values()) if name not in known)
