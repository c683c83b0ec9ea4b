"""Matching of robots with the requirements of tasks, with the reasons, as a tree.

Three answers: available, missing, and unknown, when neither the self-model nor the vocabulary says enough.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace

from executive.robots.closed_world import ClosedWorld, compared, conjunction, disjunction, negation
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
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import Ontology, expand
from planlang.ontology.expressions import Expression
from planlang.records import dataclass

AVAILABLE, MISSING, UNKNOWN = Availability.AVAILABLE, Availability.MISSING, Availability.UNKNOWN

_SHAPE = ("srdl2-comp:ArmComponent", "srdl2-comp:GripperComponent", "srdl2-comp:ManipulationEntity",
          "srdl2-comp:Camera", "srdl2-comp:MobileBase")  # fmt: skip
"""Parts that the shape of a robot shows, so that without self-model they are missing rather than unknown."""
_BY_CAMERA = frozenset(map(expand, ("srdl2-comp:ObjectRecognitionComponent", "knowrob:ObjectRecognitionModel")))
"""Parts that come with a camera (:func:`executive.robots.robot.inherent`), and so are missing without one."""


@dataclass(frozen=True)
class Possessions:
    """Parts and capabilities of a robot, for matching.

    ``lacks`` are capabilities (local names) that binding to a URDF has disproved, with the reason.
    """

    robot: str
    parts: tuple[Part, ...]
    claims: Mapping[str, Span | None]
    model: SelfModel | None = None
    lacks: Mapping[str, str] = field(default_factory=dict)
    recognises: tuple[str, ...] | None = None
    """Classes (IRIs) that its camera recognises; None: its robot file does not say."""


def possessions_of(robot: Robot) -> Possessions:
    """Return what a bound robot has. What binding found outweighs claims: no gripper in the URDF, no gripping."""
    lacks: dict[str, str] = {}
    if not robot.arms:
        lacks |= dict.fromkeys(("ArmMotionCapability", "ManipulationCapability"), f"{robot.name} has no arm")
    if not any(arm.gripper for arm in robot.arms):
        grasping = ("GripperMotionCapability", "GraspingCapability", "PickingUpAnObjectCapability")
        lacks |= dict.fromkeys(grasping, f"{robot.name} has no gripper")
    if robot.base.fixed:
        lacks["BaseMotionCapability"] = f"the base of {robot.name} is fixed"
    known = robot.camera.recognises if robot.camera is not None else None
    recognises = None if known is None else tuple(map(expand, known))
    return Possessions(robot.name, robot.parts, robot.claims, robot.model, lacks, recognises)


@dataclass(frozen=True, slots=True)
class Missing:
    """Something that a task requires and a robot does not have, or may not have."""

    iri: str
    kind: FindingKind
    """CAPABILITY or COMPONENT; ACTION for a class of actions that nothing performs."""
    state: Availability
    """MISSING, or UNKNOWN when neither the self-model nor the vocabulary says enough."""
    because: tuple[str, ...]
    """Classes from the action to the requirement, each depending on the next (IRIs)."""
    reason: str

    @property
    def name(self) -> str:
        """Local name of what is missing."""
        return local_name(self.iri)

    def __str__(self) -> str:
        told = f"{self.kind.value} {self.name}: {self.reason}"
        above = " > ".join(map(local_name, self.because))
        return told if self.kind is FindingKind.ACTION else f"{told} (required by {above})"


def missing_capabilities(ontology: Ontology, actions: Iterable[str], robot: Robot) -> tuple[Missing, ...]:
    """Return what action classes require and the robot lacks or may lack, capabilities first."""
    matcher = Matcher(ontology, possessions_of(robot))
    found = missing_in(matcher.action(action) for action in dict.fromkeys(actions))
    return tuple(sorted(found, key=lambda one: one.kind.value))


def missing_in(trees: Iterable[Finding]) -> tuple[Missing, ...]:
    """Return what findings lack or may lack, each once, without what only one of several alternatives needs."""
    found: dict[tuple[FindingKind, str], Missing] = {}
    for finding, path in (pair for tree in trees for pair in lacking_in(tree)):
        if finding.kind in NEEDED:
            because = tuple(one.iri or one.text for one in (*path, finding) if one.kind is not FindingKind.ALTERNATIVES)
            what = finding.iri or finding.text
            found.setdefault((finding.kind, what), Missing(what, finding.kind, finding.state, because, finding.reason))
    return tuple(found.values())


def lacking_in(tree: Finding) -> Iterator[tuple[Finding, tuple[Finding, ...]]]:
    """Yield the findings that are not available, each with those above; none that only one of several choices needs."""
    for finding, path in tree.walk():
        choices = [one.state for one in path if one.kind is FindingKind.ALTERNATIVES]
        is_excused = finding.state is MISSING and any(one is not MISSING for one in choices)
        if finding.state is not AVAILABLE and AVAILABLE not in choices and not is_excused:
            yield finding, path


class Matcher:
    """Compares requirements, as one ontology states them, with the possessions of one robot."""

    def __init__(self, ontology: Ontology, robot: Possessions) -> None:
        self.ontology = ontology
        self.robot = robot
        self.world = ClosedWorld([ontology, *([robot.model.ontology] if robot.model else [])])
        self._classes = [self.world.above(part.classes) for part in robot.parts]
        """The classes of each part, with those above them."""
        self._known: dict[str, Finding] = {}
        self._open: dict[str, None] = {}

    def action(self, cls: str, text: str | None = None, span: Span | None = None) -> Finding:
        """Return what an action class requires itself, with all that this takes, and whether all of it is there."""
        below = tuple(self.requirement(one) for one in requirements_of(self.ontology, cls))
        state = together(one.state for top in below for one, _ in top.walk())
        return Finding(FindingKind.ACTION, text or local_name(cls), cls, state, "", span, below)

    def requirement(self, needed: Requirement) -> Finding:
        """Return whether one requirement is met."""
        if needed.kind is FindingKind.CAPABILITY and needed.name is not None:
            return replace(self.capability(self._class_of(needed.name)), required=needed.span)
        if needed.kind is FindingKind.CAPABILITY:
            return self._expressed_capability(needed)
        return self.component(needed)

    def _class_of(self, name: str) -> str:
        """Return the class of a capability given by an individual of it."""
        if self.ontology.is_class(name):
            return name
        return next(iter(self.ontology.types(name)), name)

    def _expressed_capability(self, needed: Requirement) -> Finding:
        """Return the finding about a combination of capabilities with and, or, not."""
        below: list[Finding] = []

        def judged(expression: Expression) -> Availability:
            if expression.kind == "name" and isinstance(expression.term, str):
                below.append(replace(self.capability(expression.term), counts=False))
                return below[-1].state
            states = [judged(part) for part in expression.parts]
            match expression.kind:
                case "and":
                    return together(states)
                case "or":
                    return together(states, any_of=True)
                case "not":
                    return {AVAILABLE: MISSING, MISSING: AVAILABLE}.get(states[0], UNKNOWN)
            return UNKNOWN

        state = judged(needed.expression)
        return Finding(FindingKind.CAPABILITY, needed.text, None, state, "", None, tuple(below), required=needed.span)

    # -- components

    def component(self, needed: Requirement) -> Finding:
        """Return whether parts of the robot are what is required, and as many."""
        text, name = needed.text, needed.name
        parts = zip(self.robot.parts, self._classes, strict=True)
        answers = [self._fits(part, classes, needed) for part, classes in parts]
        kind = needed.quantifier if needed.quantifier in ("min", "max", "exactly") else "min"
        enough = compared(kind, needed.number, answers)
        found = [part for part, answer in zip(self.robot.parts, answers, strict=True) if answer]
        if enough:
            return self._usable(needed, found)
        who = self.robot.robot
        if enough is None or (name is not None and not self.world.is_known(name)):
            return Finding(FindingKind.COMPONENT, text, name, UNKNOWN, "no ontology defines it", None, (), needed.span)
        if self.robot.model is None and not found and not self._shows(name):
            reason = f"{who} has no self-model that would tell"
            return Finding(FindingKind.COMPONENT, text, name, UNKNOWN, reason, None, (), needed.span)
        reason = f"{who} has {f'only {len(found)}' if found and kind != 'max' else len(found) or 'none'}"
        return Finding(FindingKind.COMPONENT, text, name, MISSING, reason, None, (), needed.span)

    def _usable(self, needed: Requirement, found: Sequence[Part]) -> Finding:
        """Return the finding about parts that are there: some may require others, as a recognition system its model."""
        named = ", ".join(part.name for part in found[:3]) + (", ..." if len(found) > 3 else "")
        span = next((part.span for part in found if part.span), None)
        takes = [self._requirements(part) for part in found if needed.quantifier in ("some", "value")]
        below = () if () in takes else min(takes, key=_worst, default=())
        state = together(one.state for one in below)
        reason = (named or "none") if state is AVAILABLE else f"{named} {_lacking(state, below)}"
        return Finding(FindingKind.COMPONENT, needed.text, needed.name, state, reason, span, below, needed.span)

    def _requirements(self, part: Part) -> tuple[Finding, ...]:
        """Return the findings about the components that a part requires, by the classes that it is stated to be of."""
        types = self.world.types(part.iri) if part.iri is not None else ()
        stated = (needed for cls in types for needed in requirements_of(self.ontology, cls))
        required = [one for one in stated if one.kind is FindingKind.COMPONENT]
        key = f"{part.iri}"
        if not required or key in self._open:
            return ()
        self._open[key] = None
        found = tuple(self.component(one) for one in required)
        del self._open[key]
        return found

    def _fits(self, part: Part, classes: Collection[str], needed: Requirement) -> bool | None:
        if needed.name is not None and (part.iri == needed.name or needed.name in classes):
            return True
        if part.iri is None:
            return self._by_classes(classes, needed.expression)
        return self.world.satisfies(part.iri, needed.expression)

    def _by_classes(self, classes: Collection[str], expression: Expression) -> bool | None:
        """Return whether a part of which only classes are known, with those above, satisfies an expression."""
        answers = [self._by_classes(classes, one) for one in expression.parts]
        match expression.kind:
            case "name":
                return str(expression.term) in classes
            case "and":
                return conjunction(answers)
            case "or":
                return disjunction(answers)
            case "not":
                return negation(answers[0])
        return None

    def _shows(self, name: str | None) -> bool:
        """Return whether the shape of a robot shows if it has such a part."""
        if name is None or name in _BY_CAMERA:
            return name is not None
        return any(self.world.is_below(expand(one), name) for one in _SHAPE)

    # -- capabilities

    def capability(self, cls: str) -> Finding:
        """Return whether the robot has a capability: claims it and has the components, or has all that it takes."""
        if cls not in self._known:
            if cls in self._open:  # not remembered: it may be there by another way
                return Finding(
                    FindingKind.CAPABILITY, local_name(cls), cls, MISSING, "it depends on itself", counts=False
                )
            self._open[cls] = None
            finding = self._validated(cls)
            del self._open[cls]
            if self._open:  # what it found may stand on something that is still open
                return finding
            self._known[cls] = finding
        return self._known[cls]

    def _validated(self, cls: str) -> Finding:
        """Return the finding about a capability with all that it takes, which a claimed one takes all the same."""
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
            state, reason = UNKNOWN, f"{self.robot.robot} does not claim it, and nothing is known of what it takes"
        else:
            state, reason = together(one.state for one in below), "all that it takes is there"
            if state is not AVAILABLE:
                reason = f"{self.robot.robot} does not claim it and {_lacking(state, below)}"
        return Finding(FindingKind.CAPABILITY, local_name(cls), cls, state, reason, span, below)

    def _claimed(self, cls: str, claim: str, components: Iterable[Finding]) -> tuple[Availability, str]:
        components = tuple(components)
        stated = f"{self.robot.robot} claims {'it' if claim == cls else local_name(claim)}"
        state = together(one.state for one in components)
        if state is AVAILABLE:
            return AVAILABLE, stated
        return state, f"{stated}, but {_lacking(state, components)}"


def _worst(findings: Iterable[Finding]) -> int:
    """Return 0 if all that findings are about is there, 2 if something is missing, else 1."""
    return (AVAILABLE, UNKNOWN, MISSING).index(together(one.state for one in findings))


def _lacking(state: Availability, below: Iterable[Finding]) -> str:
    verb = "lacks" if state is MISSING else "may lack"
    return f"{verb} {', '.join(one.text for one in below if one.state is state)}"
