"""Matching of robots with the requirements of tasks, as a tree of findings with reasons.

A requirement is available, missing, or unknown if neither the self-model nor the vocabulary decides.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace

from executive.robots.closed_world import ClosedWorld, cardinality, combined
from executive.robots.requirements import (
    NEEDED,
    Availability,
    Finding,
    FindingKind,
    Requirement,
    requirements_of,
    together,
)
from executive.robots.robot import Part, Robot, SelfModel
from planlang.designators import Device, local_name
from planlang.diagnostics import Span
from planlang.ontology import Ontology, expand
from planlang.ontology.expressions import Expression
from planlang.records import dataclass

AVAILABLE, MISSING, UNKNOWN = Availability.AVAILABLE, Availability.MISSING, Availability.UNKNOWN

_SHAPE = ("srdl2-comp:ArmComponent", "srdl2-comp:GripperComponent", "srdl2-comp:ManipulationEntity",
          "srdl2-comp:Camera", "srdl2-comp:MobileBase")  # fmt: skip
"""Parts visible in a URDF: without a self-model they are missing rather than unknown."""
_BY_CAMERA = frozenset(map(expand, ("srdl2-comp:ObjectRecognitionComponent", "knowrob:ObjectRecognitionModel")))
"""Parts that come with a camera (:func:`executive.robots.robot.inherent`): without a camera they are missing."""


@dataclass(frozen=True)
class Possessions:
    """Parts and capabilities of a robot, for matching.

    ``lacks`` are capabilities (local names) that the URDF disproves, with the reason.
    """

    robot: str
    parts: tuple[Part, ...]
    claims: Mapping[str, Span | None]
    model: SelfModel | None = None
    lacks: Mapping[str, str] = field(default_factory=dict)
    recognises: tuple[str, ...] | None = None
    """Classes (IRIs) that its camera recognises; None if its robot file does not state any."""
    bound: Robot | None = None
    """The robot itself; None if it is known by its self-model alone."""


def possessions_of(robot: Robot) -> Possessions:
    """Collect what a bound robot has. The URDF outweighs claims: without a gripper in it, the robot cannot grasp."""
    lacks: dict[str, str] = {}
    if not robot.arms:
        lacks |= dict.fromkeys(("ArmMotionCapability", "ManipulationCapability"), f"{robot.name} has no arm")
    if not any(arm.gripper for arm in robot.arms):
        grasping = ("GripperMotionCapability", "GraspingCapability", "PickingUpAnObjectCapability")
        lacks |= dict.fromkeys(grasping, _without_gripper(robot))
    if robot.base.fixed:
        lacks["BaseMotionCapability"] = _fixed(robot)
    classes = robot.camera.recognises if robot.camera is not None else None
    recognises = None if classes is None else tuple(map(expand, classes))
    return Possessions(robot.name, robot.parts, robot.claims, robot.model, lacks, recognises, robot)


def _fixed(robot: Robot) -> str:
    """Word that the base does not drive, and what serves a robot that stands, or that is on something that drives."""
    file = "its robot file" if robot.file is None else robot.file.name
    return (
        f"the base of {robot.name} is fixed: if it is on something that drives, state fixed = false and the speeds in "
        f"[base] of {file}, and the size of that in [mount]; if it stands, take a recipe without driving, such as "
        "pass_a_drink, with the things and the person within its reach of where it starts"
    )


def _without_gripper(robot: Robot) -> str:
    """Word that no arm has a gripper, and what to state in the robot file if the URDF has fingers."""
    sentence = f"{robot.name} has no gripper"
    if robot.file is None or not robot.arms:
        return sentence
    table = f"[arms.{robot.arms[0].name}.gripper]"
    return (
        f"{sentence}: {robot.file.name} has no table {table}. If fingers of the URDF move, state there opened and "
        "closed (positions of their joints), fingers (their links) and max_opening (the widest object between them "
        "[m]); if the URDF has no fingers, merge that of the gripper into it (docs/first_steps/own_robot.md)"
    )


@dataclass(frozen=True, slots=True)
class Missing:
    """A requirement of a task that a robot lacks or may lack."""

    iri: str
    kind: FindingKind
    """CAPABILITY or COMPONENT; ACTION for a class of actions that nothing performs."""
    state: Availability
    """MISSING or UNKNOWN."""
    because: tuple[str, ...]
    """Classes (IRIs) from the action to the requirement, each depending on the next."""
    reason: str

    @property
    def name(self) -> str:
        """Local name of the requirement."""
        return local_name(self.iri)

    def __str__(self) -> str:
        text = f"{self.kind.value} {self.name}: {self.reason}"
        above = " > ".join(map(local_name, self.because))
        return text if self.kind is FindingKind.ACTION else f"{text} (required by {above})"


def missing_capabilities(ontology: Ontology, actions: Iterable[str], robot: Robot) -> tuple[Missing, ...]:
    """List the requirements of action classes that the robot lacks or may lack, capabilities first."""
    matcher = Matcher(ontology, possessions_of(robot))
    missing = missing_in(matcher.action(action) for action in dict.fromkeys(actions))
    return tuple(sorted(missing, key=lambda one: one.kind.value))


def missing_in(trees: Iterable[Finding]) -> tuple[Missing, ...]:
    """List the missing and unknown requirements in trees of findings, each once, except for avoidable alternatives."""
    missing: dict[tuple[FindingKind, str], Missing] = {}
    for finding, path in (pair for tree in trees for pair in lacking_in(tree)):
        if finding.kind in NEEDED:
            because = tuple(one.iri or one.text for one in (*path, finding) if one.kind is not FindingKind.ALTERNATIVES)
            what = finding.iri or finding.text
            entry = Missing(what, finding.kind, finding.state, because, finding.reason)
            missing.setdefault((finding.kind, what), entry)
    return tuple(missing.values())


def lacking_in(tree: Finding) -> Iterator[tuple[Finding, tuple[Finding, ...]]]:
    """Yield the missing and unknown findings of a tree, each with those above it.

    Findings below alternatives are skipped if another alternative is available, or, for missing ones, unknown.
    """
    for finding, path in tree.walk():
        choices = [one.state for one in path if one.kind is FindingKind.ALTERNATIVES]
        is_avoidable = finding.state is MISSING and any(one is not MISSING for one in choices)
        if finding.state is not AVAILABLE and AVAILABLE not in choices and not is_avoidable:
            yield finding, path


class Matcher:
    """Compares the requirements stated in an ontology with the possessions of one robot."""

    def __init__(self, ontology: Ontology, robot: Possessions) -> None:
        self.ontology = ontology
        self.robot = robot
        self.world = ClosedWorld([ontology, *([robot.model.ontology] if robot.model else [])])
        self._classes = [self.world.above(part.classes) for part in robot.parts]
        """Classes of each part, superclasses included."""
        self._known: dict[str, Finding] = {}
        self._open: dict[str, None] = {}

    def action(self, cls: str, text: str | None = None, span: Span | None = None) -> Finding:
        """Check the requirements of an action class, and all that these depend on."""
        below = tuple(self.requirement(one) for one in requirements_of(self.ontology, cls))
        state = together(one.state for top in below for one, _ in top.walk())
        return Finding(FindingKind.ACTION, text or local_name(cls), cls, state, "", span, below)

    def requirement(self, needed: Requirement) -> Finding:
        """Check a single requirement."""
        if needed.kind is FindingKind.CAPABILITY and needed.name is not None:
            return replace(self.capability(self._class_of(needed.name)), required=needed.span)
        if needed.kind is FindingKind.CAPABILITY:
            return self._expressed_capability(needed)
        return self.component(needed)

    def _class_of(self, name: str) -> str:
        """Map an individual of a capability to its class."""
        if self.ontology.is_class(name):
            return name
        return next(iter(self.ontology.types(name)), name)

    def _expressed_capability(self, needed: Requirement) -> Finding:
        """Check a combination of capabilities with and, or, not."""
        below: list[Finding] = []

        def decide(part: Expression) -> bool | None:
            if part.kind != "name" or not isinstance(part.term, str):
                return None
            below.append(replace(self.capability(part.term), counts=False))
            return below[-1].state.decided

        state = Availability.of(combined(needed.expression, decide))
        return Finding(FindingKind.CAPABILITY, needed.text, None, state, "", None, tuple(below), required=needed.span)

    # -- components

    def device(self, named: Device, span: Span | None = None) -> Finding | None:
        """Check whether the robot has an arm or hand that is named for a step; None if it has, or is not bound."""
        robot = self.robot.bound
        if robot is None or (reason := robot.without(named)) is None:
            return None
        return Finding(FindingKind.COMPONENT, named.name, named.iri, MISSING, reason, None, (), span)

    def component(self, needed: Requirement) -> Finding:
        """Check whether enough parts of the robot fit a requirement."""
        text, name = needed.text, needed.name
        parts = zip(self.robot.parts, self._classes, strict=True)
        answers = [self._fits(part, classes, needed) for part, classes in parts]
        kind = needed.quantifier if needed.quantifier in ("min", "max", "exactly") else "min"
        enough = cardinality(kind, needed.number, answers)
        matching = [part for part, answer in zip(self.robot.parts, answers, strict=True) if answer]
        if enough:
            return self._usable(needed, matching)
        who, state = self.robot.robot, UNKNOWN
        if enough is None or (name is not None and not self.world.is_known(name)):
            reason = "no ontology defines it"
        elif self.robot.model is None and not matching and not self._shows(name):
            reason = f"{who} has no self-model to decide"
        else:
            count = f"only {len(matching)}" if matching and kind != "max" else len(matching) or "none"
            state, reason = MISSING, f"{who} has {count}"
        return Finding(FindingKind.COMPONENT, text, name, state, reason, None, (), needed.span)

    def _usable(self, needed: Requirement, parts: Sequence[Part]) -> Finding:
        """Check what fitting parts require in turn: a recognition system may need a model of an object."""
        names = ", ".join(part.name for part in parts[:3]) + (", ..." if len(parts) > 3 else "")
        span = next((part.span for part in parts if part.span), None)
        needed_by = [self._requirements(part) for part in parts if needed.quantifier in ("some", "value")]
        below = () if () in needed_by else min(needed_by, key=_worst, default=())
        state = together(one.state for one in below)
        reason = (names or "none") if state is AVAILABLE else f"{names} {_lacking(state, below)}"
        return Finding(FindingKind.COMPONENT, needed.text, needed.name, state, reason, span, below, needed.span)

    def _requirements(self, part: Part) -> tuple[Finding, ...]:
        """Check the components that the stated classes of a part require."""
        types = self.world.types(part.iri) if part.iri is not None else ()
        needs = (needed for cls in types for needed in requirements_of(self.ontology, cls))
        required = [one for one in needs if one.kind is FindingKind.COMPONENT]
        key = f"{part.iri}"
        if not required or key in self._open:
            return ()
        self._open[key] = None
        findings = tuple(self.component(one) for one in required)
        del self._open[key]
        return findings

    def _fits(self, part: Part, classes: Collection[str], needed: Requirement) -> bool | None:
        if needed.name is not None and (part.iri == needed.name or needed.name in classes):
            return True
        if part.iri is not None:
            return self.world.satisfies(part.iri, needed.expression)
        # Of a part that the URDF implies only the classes are known, superclasses included.
        return combined(needed.expression, lambda one: str(one.term) in classes if one.kind == "name" else None)

    def _shows(self, name: str | None) -> bool:
        """Check whether a URDF shows if a robot has parts of this class."""
        if name is None or name in _BY_CAMERA:
            return name is not None
        return any(self.world.is_below(expand(one), name) for one in _SHAPE)

    # -- capabilities

    def capability(self, cls: str) -> Finding:
        """Check a capability: claimed, with its components, or unclaimed, with all its requirements fulfilled."""
        if cls not in self._known:
            if cls in self._open:  # not cached: the capability may be available in another way
                return Finding(
                    FindingKind.CAPABILITY, local_name(cls), cls, MISSING, "it depends on itself", counts=False
                )
            self._open[cls] = None
            finding = self._validated(cls)
            del self._open[cls]
            if self._open:  # not cached either: it may rest on a capability whose check is unfinished
                return finding
            self._known[cls] = finding
        return self._known[cls]

    def _validated(self, cls: str) -> Finding:
        """Check a capability together with its requirements, which are listed even if it is claimed."""
        needed = requirements_of(self.ontology, cls)
        components = [self.requirement(one) for one in needed if one.kind is FindingKind.COMPONENT]
        capabilities = [self.requirement(one) for one in needed if one.kind is FindingKind.CAPABILITY]
        below = (*components, *capabilities)
        claim = next((one for one in self.robot.claims if self.world.is_below(one, cls)), None)
        disproved = [a for a in map(local_name, self.ontology.ancestors(cls)) if a in self.robot.lacks]
        span = None
        if disproved:
            state, reason = MISSING, self.robot.lacks[disproved[0]]
        elif claim is not None:
            state, reason = self._claimed(cls, claim, components)
            span = self.robot.claims[claim]
        elif not below:
            state, reason = UNKNOWN, f"{self.robot.robot} does not claim it, and its prerequisites are unknown"
        else:
            state, reason = together(one.state for one in below), "all prerequisites are met"
            if state is not AVAILABLE:
                reason = f"{self.robot.robot} does not claim it and {_lacking(state, below)}"
        return Finding(FindingKind.CAPABILITY, local_name(cls), cls, state, reason, span, below)

    def _claimed(self, cls: str, claim: str, components: Iterable[Finding]) -> tuple[Availability, str]:
        components = tuple(components)
        claim_text = f"{self.robot.robot} claims {'it' if claim == cls else local_name(claim)}"
        state = together(one.state for one in components)
        if state is AVAILABLE:
            return AVAILABLE, claim_text
        return state, f"{claim_text}, but {_lacking(state, components)}"


def _worst(findings: Iterable[Finding]) -> int:
    """Rank findings by the worst of them: 0 available, 1 unknown, 2 missing."""
    return (AVAILABLE, UNKNOWN, MISSING).index(together(one.state for one in findings))


def _lacking(state: Availability, below: Iterable[Finding]) -> str:
    verb = "lacks" if state is MISSING else "may lack"
    return f"{verb} {', '.join(one.text for one in below if one.state is state)}"
