"""What actions require and whether a robot has it, in closed world over the robot's self-model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from executive.capabilities.robot import Robot
from planlang.designators import local_name
from planlang.ontology import Ontology, expand

CAPABILITY, COMPONENT = "srdl2-cap:dependsOnCapability", "srdl2-comp:dependsOnComponent"


@dataclass(frozen=True, slots=True)
class Missing:
    """Something that a task requires and a robot does not have."""

    iri: str
    kind: str
    """"capability" or "component"."""
    state: str
    """"missing", or "unknown" for a capability about which the self-model and the vocabulary say nothing."""
    because: tuple[str, ...]
    """Classes from the action to the requirement, each depending on the next (IRIs)."""
    reason: str

    @property
    def name(self) -> str:
        """Local name of what is missing."""
        return local_name(self.iri)

    def __str__(self) -> str:
        return f"{self.kind} {self.name}: {self.reason} (required by {' > '.join(map(local_name, self.because))})"


def requirements(ontology: Ontology, actions: Iterable[str]) -> tuple[Mapping[str, tuple[str, ...]], ...]:
    """Capabilities and components that action classes require: each IRI -> the classes that lead to it.

    Requirements are inherited from superclasses, read through intersections and equivalent classes, and closed: a
    capability's own requirements belong to them.
    """
    capabilities: dict[str, tuple[str, ...]] = {}
    components: dict[str, tuple[str, ...]] = {}
    queue: list[tuple[str, tuple[str, ...]]] = [(action, (action,)) for action in dict.fromkeys(actions)]
    for cls, path in queue:
        for component in _required(ontology, cls, COMPONENT):
            components.setdefault(component, path)
        for capability in _required(ontology, cls, CAPABILITY):
            if capability not in capabilities:
                capabilities[capability] = path
                queue.append((capability, (*path, capability)))
    return capabilities, components


def _required(ontology: Ontology, cls: str, prop: str) -> tuple[str, ...]:
    fillers = (r.filler for r in ontology.inherited_restrictions(cls, prop) if r.kind in ("some", "value"))
    return tuple(dict.fromkeys(filler for filler in fillers if isinstance(filler, str)))


def missing_capabilities(ontology: Ontology, actions: Iterable[str], robot: Robot) -> tuple[Missing, ...]:
    """What the action classes (a task with all its steps) require and the robot lacks, capabilities first.

    A component is there if a part of the robot is of its class. A capability is there if the self-model claims it and
    its components are there, or if everything that it depends on is there. What binding found outweighs claims: without
    a gripper in the URDF there is no gripping, without an arm no reaching.
    """
    capabilities, components = requirements(ontology, actions)
    judge = _Judge(ontology, robot)
    found = []
    for capability, path in capabilities.items():
        state, reason = judge.capability(capability)
        if state != "available":
            found.append(Missing(capability, "capability", state, (*path, capability), reason))
    for component, path in components.items():
        if not judge.component(component):
            reason = f"{robot.name} has no {local_name(component)}"
            found.append(Missing(component, "component", "missing", (*path, component), reason))
    return tuple(found)


class _Judge:
    """Decides about one robot; capabilities that depend on themselves count as not available by that way."""

    def __init__(self, ontology: Ontology, robot: Robot) -> None:
        self.ontology, self.robot = ontology, robot
        self.open: set[str] = set()
        self.physical: dict[str, str] = {}
        if not robot.arms:
            lack = f"{robot.name} has no arm"
            self.physical = dict.fromkeys(("ArmMotionCapability", "ManipulationCapability"), lack)
        if not any(arm.gripper for arm in robot.arms):
            lack = f"{robot.name} has no gripper"
            grasping = ("GripperMotionCapability", "GraspingCapability", "PickingUpAnObjectCapability")
            self.physical.update(dict.fromkeys(grasping, lack))

    def component(self, cls: str) -> bool:
        """Whether a part of the robot is of this class."""
        return expand(cls) in self.robot.components

    def capability(self, cls: str) -> tuple[str, str]:
        """ "available", "missing" or "unknown", and why."""
        for ancestor in self.ontology.ancestors(cls):
            if local_name(ancestor) in self.physical:
                return "missing", self.physical[local_name(ancestor)]
        components = _required(self.ontology, cls, COMPONENT)
        absent = [component for component in components if not self.component(component)]
        if absent:
            return "missing", f"{self.robot.name} has no {', '.join(map(local_name, absent))}"
        claimed = self.robot.capabilities & set(self._below(cls))
        if claimed:
            return "available", f"claimed by {self.robot.name}"
        needed = _required(self.ontology, cls, CAPABILITY)
        if not components and not needed:
            return "unknown", f"{self.robot.name} does not claim it, and nothing is known of what it takes"
        if cls in self.open:
            return "missing", "it depends on itself"
        self.open.add(cls)
        lacking = [local_name(one) for one in needed if self.capability(one)[0] != "available"]
        self.open.discard(cls)
        if lacking:
            return "missing", f"{self.robot.name} does not claim it and lacks {', '.join(lacking)}"
        return "available", "everything that it takes is there"

    def _below(self, cls: str) -> tuple[str, ...]:
        """The capability, more special ones, and those that are the same by another name."""
        return self.ontology.subclasses(cls)
