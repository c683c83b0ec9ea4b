"""Experience as a narrative in RDF, in terms of DUL and SOMA, and of planlang where these have none.

An activity is a ``dul:Action`` that executes a ``dul:Task`` in a ``dul:TimeInterval``; nested activities are its
constituents. The episode includes them all, so that a knowledge base can be queried for it. Individuals are named in
the narrative's own namespace, things by the IRIs of their designators.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from planlang.designators import local_part
from planlang.diagnostics import Span
from planlang.experience.model import (
    About,
    Activity,
    Designator,
    Experience,
    Failure,
    Occurrence,
    Resolution,
    ResolvedTo,
    Role,
    State,
    Thing,
)
from planlang.ontology.nested_writers import turtle
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, VOCABULARIES, XSD, Literal, Namespace, Term, Triple, expand
from planlang.outputs import MARK

DUL = Namespace(
    "http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#",
    """Action Agent InformationObject Role Task TimeInterval classifies definesTask executesTask hasConstituent
    hasParticipant hasTimeInterval includesAction includesAgent includesObject includesTime isExecutedIn isTaskOf""",
)
SOMA = Namespace(
    "http://www.ease-crc.org/ont/SOMA.owl#",
    """Episode ExecutionState_Active ExecutionState_Cancelled ExecutionState_Failed ExecutionState_Succeeded hasFilePath
    hasExecutionState hasIntervalBegin hasIntervalEnd includesRecord isPerformedBy""",
)
EXPERIENCE = Namespace(
    "http://planlang.org/kb/experience.owl#",
    """ActionDesignator GoalDesignator LocationDesignator ObjectDesignator Occurrence Resolution atStep base beginStep
    details describedBy endStep environment event failedWith filler hasCause hasOccurrence hasResolution
    includesFailure includesRecoveredFailure isWhole json kind message nodeName number other
    parameters planName property rate recoveredFrom recipe resolvedAs resolvedTo resolves result robot schedule seed
    text thingIri thingKind thingType typeName value where began""",
)
PREFIXES = {"dul": str(DUL), "soma": str(SOMA), "experience": str(EXPERIENCE)}

STATES = {
    State.SUCCEEDED: SOMA.ExecutionState_Succeeded,
    State.FAILED: SOMA.ExecutionState_Failed,
    State.EVAPORATED: SOMA.ExecutionState_Cancelled,
    State.RUNNING: SOMA.ExecutionState_Active,
}
DESIGNATORS = {
    About.ACTION: EXPERIENCE.ActionDesignator,
    About.LOCATION: EXPERIENCE.LocationDesignator,
    About.GOAL: EXPERIENCE.GoalDesignator,
    About.OBJECT: EXPERIENCE.ObjectDesignator,
}

IMPORTED = "http://planlang.org/kb/experience.owl"
_HERE = Span("narrative")
_IRI = re.compile(r"https?://[^\x00-\x20<>\"{}|^`\\\x7f-\U0010ffff]+")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,79}")
_DECLARED = (DUL.Action, DUL.Agent, DUL.InformationObject, DUL.TimeInterval)


def narrative(experience: Experience, base: str, began: datetime | None = None, *, records: Sequence[str] = ()) -> str:
    """Write a narrative in Turtle. ``base`` is its IRI, without ``#``.

    Times are seconds since 1970 if the run ``began`` at a known time (with its zone), otherwise since its beginning.
    ``records`` are names of accompanying files with more data, such as poses. Equal experiences give equal texts.
    """
    writer = _Writer(experience, base, 0.0 if began is None else began.timestamp())
    writer.write(began)
    for file in records:
        writer.record(file)
    prefixes = {**PREFIXES, "knowrob": KNOWROB, "rdfs": RDFS, "owl": OWL, "xsd": XSD, "": f"{base}#"}
    return f"# {MARK}\n{turtle(writer.triples, prefixes, base)}"


class _Writer:
    def __init__(self, experience: Experience, base: str, began: float) -> None:
        self.triples: list[Triple] = []
        self._experience, self._base, self._began = experience, base, began
        plan = re.sub(r"[^A-Za-z0-9_-]", "_", local_part(experience.iri or experience.plan))[:80]
        self._episode = f"{base}#{plan if _NAME.fullmatch(plan) else 'plan'}_episode"
        self._named: dict[object, str] = {}
        """Key of an individual that several activities share -> its IRI."""
        self._counts: dict[str, int] = {}
        self._spaces = {0: _space_of(experience.iri)}
        """Number of an activity -> namespace of the enclosing recipe, in which the classes of its steps may be."""

    def write(self, began: datetime | None) -> None:
        run, episode = self._experience, self._episode
        self._say(self._base, RDF.type, OWL.Ontology)
        self._say(self._base, OWL.imports, IMPORTED)
        for declared in _DECLARED:
            self._say(declared, RDF.type, OWL.Class)
        self._say(episode, RDF.type, SOMA.Episode)
        outcome = run.activities[0].state if run.activities else State.RUNNING
        self._text(episode, RDFS.label, f"{run.plan}: {outcome.value}")
        self._text(episode, EXPERIENCE.planName, run.plan)
        self._text(episode, EXPERIENCE.recipe, run.iri)
        self._text(episode, EXPERIENCE.robot, run.robot)
        self._text(episode, EXPERIENCE.environment, run.environment)
        self._text(episode, EXPERIENCE.began, None if began is None else began.isoformat())
        self._number(episode, EXPERIENCE.rate, run.rate)
        self._number(episode, EXPERIENCE.seed, run.seed)
        self._number(episode, EXPERIENCE.schedule, run.schedule)
        self._say(episode, EXPERIENCE.isWhole, Literal(str(run.is_whole).lower(), XSD.boolean))
        for thing in run.things:
            self._thing(thing)
        for activity in run.activities:
            self._activity(activity)
        for survivor, failure in run.recovered():
            for link in failure.chain():
                self._say(self._activity_iri(survivor.number), EXPERIENCE.recoveredFrom, self._failure(link))
                self._say(episode, EXPERIENCE.includesRecoveredFailure, self._failure(link))

    def record(self, file: str) -> None:
        """State that a file contains further data of the whole run."""
        for root in (one for one in self._experience.activities if one.parent is None):
            node = self._new("record")
            self._say(self._activity_iri(root.number), SOMA.includesRecord, node)
            self._say(node, RDF.type, DUL.InformationObject)
            self._text(node, SOMA.hasFilePath, file)

    def _thing(self, thing: Thing) -> None:
        node = self._named[thing.name] = self._thing_iri(thing)
        self._say(self._episode, DUL.includesObject, node)
        self._text(node, RDFS.label, thing.name)
        self._text(node, EXPERIENCE.thingKind, thing.kind)
        self._text(node, EXPERIENCE.thingType, thing.type)
        self._text(node, EXPERIENCE.thingIri, thing.iri)
        self._kind(node, thing.type)

    def _thing_iri(self, thing: Thing) -> str:
        reserved = (self._base, *PREFIXES.values(), RDF, RDFS, OWL, XSD, *VOCABULARIES.values())
        if thing.iri is not None and _IRI.fullmatch(thing.iri) and not thing.iri.startswith(reserved):
            return thing.iri
        return self._new("thing")

    def _activity_iri(self, number: int) -> str:
        return f"{self._base}#action{number}"

    def _activity(self, one: Activity) -> None:
        node = self._activity_iri(one.number)
        recipe = one.parameters.get("iri") if one.kind == "plan" else None
        self._spaces[one.number] = _space_of(recipe) if isinstance(recipe, str) else self._spaces[one.parent or 0]
        self._say(self._episode, DUL.includesAction, node)
        self._say(node, RDF.type, DUL.Action)
        self._number(node, EXPERIENCE.number, one.number)
        self._text(node, EXPERIENCE.kind, one.kind)
        self._text(node, EXPERIENCE.nodeName, one.name)
        self._say(node, SOMA.hasExecutionState, STATES[one.state])
        if one.parent is not None:
            self._say(self._activity_iri(one.parent), DUL.hasConstituent, node)
        self._interval(one, node)
        self._json(node, EXPERIENCE.parameters, one.parameters or None)
        self._json(node, EXPERIENCE.result, one.result)
        self._classes(one, node)
        self._task(one, node)
        for thing in one.participants:
            self._say(node, DUL.hasParticipant, self._named[thing])
        if one.failure is not None:
            self._say(node, EXPERIENCE.failedWith, self._failure(one.failure))
        for number, resolution in enumerate(one.resolutions, 1):
            self._resolution(node, number, resolution)
        for number, occurrence in enumerate(one.occurrences, 1):
            self._occurrence(node, number, occurrence)

    def _interval(self, one: Activity, node: str) -> None:
        interval = f"{self._base}#interval{one.number}"
        self._say(node, DUL.hasTimeInterval, interval)
        self._say(interval, RDF.type, DUL.TimeInterval)
        if one.parent is None:
            self._say(self._episode, DUL.includesTime, interval)
        for step, seconds, exact in (
            (one.begin, SOMA.hasIntervalBegin, EXPERIENCE.beginStep),
            (one.end, SOMA.hasIntervalEnd, EXPERIENCE.endStep),
        ):
            self._number(interval, exact, step)
            self._number(interval, seconds, None if step is None else self._began + step / self._experience.rate)

    def _classes(self, one: Activity, node: str) -> None:
        """State the classes of an activity: those of the action that it performs, and of the recipe that it follows."""
        if one.designator is not None and one.designator.about is About.ACTION:
            above = one.parameters.get("classes")
            own = one.designator.text.partition("(")[0]
            space = self._spaces[one.number]
            self._kind(node, space + own if isinstance(above, list) and space else own)
            for name in above if isinstance(above, list) else ():
                self._kind(node, str(name))
        if one.kind == "plan" and isinstance(one.parameters.get("iri"), str):
            self._kind(node, one.parameters["iri"])
        robot = self._experience.robot
        if robot is not None and (one.parent is None or one.kind == "perform"):
            self._say(node, SOMA.isPerformedBy, self._shared("robot", robot, self._robot))

    def _robot(self, node: str) -> None:
        self._say(node, RDF.type, DUL.Agent)
        self._text(node, RDFS.label, self._experience.robot)
        self._say(self._episode, DUL.includesAgent, node)

    def _kind(self, node: str, name: str) -> None:
        if _NAME.fullmatch(name) or _IRI.fullmatch(name):
            self._say(node, RDF.type, expand(name))

    # tasks, roles and designators, which several activities may share

    def _task(self, one: Activity, node: str) -> None:
        subject = one.designator or one.parameters.get("iri") or one.name
        key = (one.kind, subject if isinstance(subject, str | Designator) else one.name, one.roles)

        def describe(task: str) -> None:
            self._say(task, RDF.type, DUL.Task)
            self._text(task, RDFS.label, subject.text if isinstance(subject, Designator) else str(subject))
            for number, role in enumerate(one.roles, 1):
                self._role(task, number, role)

        task = self._shared("task", key, describe)
        self._say(node, DUL.executesTask, task)
        self._say(task, DUL.isExecutedIn, node)
        for role in one.roles:
            for thing in self._fillers(role) if _NAME.fullmatch(role.property) else ():
                self._say(node, KNOWROB + role.property, thing)
        if one.designator is not None:
            described = self._designator(one.designator)
            self._say(node, EXPERIENCE.describedBy, described)
            if one.designator.about is About.ACTION:
                self._say(described, DUL.definesTask, task)

    def _role(self, task: str, number: int, role: Role) -> None:
        node = self._new("role")
        self._say(task, DUL.isTaskOf, node)
        self._say(node, RDF.type, DUL.Role)
        self._number(node, EXPERIENCE.number, number)
        self._text(node, EXPERIENCE.property, role.property)
        self._text(node, EXPERIENCE.filler, role.filler)
        for thing in self._fillers(role):
            self._say(node, DUL.classifies, thing)

    def _fillers(self, role: Role) -> list[str]:
        """Things (IRIs) that fill a role; several are written ``(cup1, plate1)``."""
        names = role.filler[1:-1].split(", ") if role.filler.startswith("(") else [role.filler]
        return [self._named[name] for name in dict.fromkeys(names) if name in self._named]

    def _designator(self, one: Designator) -> str:
        def state(node: str) -> None:
            self._say(node, RDF.type, DESIGNATORS[one.about])
            self._text(node, EXPERIENCE.text, one.text)

        return self._shared("designator", one, state)

    def _resolution(self, activity: str, number: int, one: Resolution) -> None:
        node = self._new("resolution")
        self._say(activity, EXPERIENCE.hasResolution, node)
        self._say(node, RDF.type, EXPERIENCE.Resolution)
        self._number(node, EXPERIENCE.number, number)
        self._number(node, EXPERIENCE.atStep, one.step)
        self._say(node, EXPERIENCE.resolves, self._designator(one.designator))
        self._text(node, EXPERIENCE.resolvedAs, one.to.value)
        self._text(node, EXPERIENCE.value, one.value)
        self._json(node, EXPERIENCE.base, None if one.base is None else list(one.base))
        self._json(node, EXPERIENCE.details, one.details or None)
        if one.to is ResolvedTo.THING:
            self._say(node, EXPERIENCE.resolvedTo, self._thing_of_the_map(one))
        elif one.to is ResolvedTo.PLAN and _IRI.fullmatch(one.value):
            self._say(node, EXPERIENCE.resolvedTo, one.value)
        if one.failure is not None:
            self._say(node, EXPERIENCE.failedWith, self._failure(one.failure))

    def _thing_of_the_map(self, one: Resolution) -> str:
        """Individual that a thing's designator was bound to: a thing named by a designator, or a new individual."""
        if one.value in self._named:
            return self._named[one.value]
        node = self._shared("bound", one.value, lambda new: self._text(new, RDFS.label, one.value))
        for thing in self._experience.things:
            if thing.name == one.designator.text:
                self._kind(node, thing.type)
        return node

    def _occurrence(self, activity: str, number: int, one: Occurrence) -> None:
        node = self._new("occurrence")
        self._say(activity, EXPERIENCE.hasOccurrence, node)
        self._say(node, RDF.type, EXPERIENCE.Occurrence)
        self._number(node, EXPERIENCE.number, number)
        self._number(node, EXPERIENCE.atStep, one.step)
        self._text(node, EXPERIENCE.event, one.event)
        self._json(node, EXPERIENCE.details, one.details or None)
        if one.failure is not None:
            self._say(node, EXPERIENCE.failedWith, self._failure(one.failure))

    def _failure(self, one: Failure) -> str:
        def state(node: str) -> None:
            self._kind(node, one.type if _NAME.fullmatch(one.type) else "FailureOfAPlan")
            self._say(node, RDF.type, expand("FailureOfAPlan"))
            self._text(node, EXPERIENCE.typeName, one.type)
            self._text(node, EXPERIENCE.message, one.message)
            self._text(node, EXPERIENCE.where, one.where)
            self._json(node, EXPERIENCE.other, [list(other) for other in one.others] or None)
            self._say(self._episode, EXPERIENCE.includesFailure, node)
            if one.cause is not None:
                self._say(node, EXPERIENCE.hasCause, self._failure(one.cause))

        return self._shared("failure", one, state)

    # statements

    def _shared(self, word: str, key: object, state: Any) -> str:
        """Individual for a key; ``state`` adds its statements when it is first used."""
        iri = self._named.get((word, key))
        if iri is None:
            iri = self._named[word, key] = self._new(word)
            state(iri)
        return iri

    def _new(self, word: str) -> str:
        self._counts[word] = self._counts.get(word, 0) + 1
        return f"{self._base}#{word}{self._counts[word]}"

    def _say(self, subject: str, predicate: str, value: Term) -> None:
        self.triples.append(Triple(subject, predicate, value, _HERE))

    def _text(self, subject: str, predicate: str, text: str | None) -> None:
        if text is not None:
            self._say(subject, predicate, text_literal(text))

    def _json(self, subject: str, predicate: str, value: Any) -> None:
        if value is not None:
            self._say(subject, predicate, Literal(json.dumps(value, separators=(",", ":"))))

    def _number(self, subject: str, predicate: str, number: float | None) -> None:
        if number is not None:
            kind = XSD.integer if isinstance(number, int) else XSD.double
            self._say(subject, predicate, Literal(repr(number), kind))


def _space_of(iri: str | None) -> str:
    return "" if iri is None else iri.removesuffix(local_part(iri))


def text_literal(text: str) -> Literal:
    """Literal for a text; characters that RDF does not allow (lone surrogates, NUL) are written as JSON."""
    try:
        text.encode()
        is_plain = "\0" not in text
    except UnicodeEncodeError:
        is_plain = False
    return Literal(text) if is_plain else Literal(json.dumps(text), EXPERIENCE.json)
