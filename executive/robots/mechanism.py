"""The tree of links and joints of a URDF, and which of them a self-model means."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from executive.robots.self_model import SelfModel
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note
from planlang.geometry import Array
from planlang.geometry.matrices import product
from planlang.geometry.urdf import Joint, displacement, read_urdf


class Mechanism:
    """Joints by name, and who hangs from whom; raises BadInput for a bad file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        urdf = read_urdf(path)
        self.root = urdf.root
        self.joints: dict[str, Joint] = {joint.name: joint for joint in urdf.joints}
        self.above: dict[str, Joint] = {joint.child: joint for joint in self.joints.values()}
        """Link -> the joint it hangs from."""
        self.links: dict[str, None] = {self.root: None}
        for joint in self.joints.values():
            self.links.update({joint.parent: None, joint.child: None})

    def moves(self, name: str) -> bool:
        """Return True if a joint of that name exists and moves, by itself or after another one."""
        joint = self.joints.get(name)
        return joint is not None and joint.moves

    def actuated(self, name: str) -> bool:
        """Return True if a joint of that name exists and moves by itself."""
        return self.moves(name) and self.joints[name].mimic is None

    def chain(self, link: str) -> tuple[Joint, ...]:
        """Return the joints from the root to a link."""
        found: list[Joint] = []
        while link in self.above and len(found) <= len(self.joints):
            found.append(self.above[link])
            link = found[-1].parent
        return tuple(reversed(found))

    def movers(self, link: str) -> tuple[str, ...]:
        """Names of the actuated joints from the root to a link."""
        return tuple(joint.name for joint in self.chain(link) if self.actuated(joint.name))

    def ancestors(self, link: str) -> tuple[str, ...]:
        """Return the link and its ancestors, up to the root."""
        return (link, *(joint.parent for joint in reversed(self.chain(link))))

    def common_ancestor(self, links: Iterable[str]) -> str:
        """Return the deepest link that all links hang from or are."""
        paths = [self.ancestors(link) for link in links]
        return next(link for link in paths[0] if all(link in path for path in paths))

    def rigid_with(self, link: str) -> tuple[str, ...]:
        """Return the link and all others that never move relative to it, in the order of the file."""
        top = link
        while top in self.above and self.above[top].kind == "fixed":
            top = self.above[top].parent
        group = [top]
        for member in group:
            group += [j.child for j in self.joints.values() if j.parent == member and j.kind == "fixed"]
        return tuple(name for name in self.links if name in group)

    def fingers(self, hand: str) -> tuple[Joint, ...]:
        """Actuated joints, or those that mimic one, that hang from what is rigid with a link."""
        group = self.rigid_with(hand)
        return tuple(j for j in self.joints.values() if j.parent in group and j.kind != "fixed")

    def frame(self, link: str, position: float = 0.0, *, of: str = "") -> Array:
        """Pose (4, 4) of a link in the root frame with the joint ``of`` at a position and all others at zero."""
        matrix = np.eye(4)
        for joint in self.chain(link):
            matrix = product(matrix, joint.origin)
            if joint.name == of:
                matrix = product(matrix, displacement(joint, position))
        return matrix


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
