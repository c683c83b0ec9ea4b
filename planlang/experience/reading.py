"""Read experience from a narrative of any origin; missing and contradictory statements are refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NoReturn, TypeVar

from planlang.diagnostics import BadInput, Span, error
from planlang.experience.model import (
    Activity,
    Designator,
    Experience,
    Failure,
    Occurrence,
    Resolution,
    ResolvedTo,
    Role,
    Thing,
)
from planlang.experience.narrative import DESIGNATORS, DUL, EXPERIENCE, SOMA, STATES
from planlang.experience.traces import MOST_ACTIVITIES, MOST_STEPS
from planlang.ontology.terms import RDF, RDFS, Literal, Term, Triple
from planlang.ontology.turtle import read_turtle
from planlang.runs.schema import DEEPEST

_STATES = {iri: state for state, iri in STATES.items()}
_ABOUTS = {iri: about for about, iri in DESIGNATORS.items()}
T = TypeVar("T")


def read_narrative(content: bytes | str, file: str) -> Experience:
    """Read the experience in a Turtle file. Raises BadInput with K080, or with the codes of the Turtle reader."""
    return experience_in(read_turtle(content, file, base=f"file:///{file}").triples, file)


def experience_in(triples: Iterable[Triple], file: str) -> Experience:
    """Read the experience in a graph. Raises BadInput with K080 if there is none, or if it contradicts itself."""
    return _Reader(triples, file).experience()


def episode_in(triples: Iterable[Triple], file: str) -> str:
    """Find the IRI of the episode in a graph. Raises BadInput like :func:`experience_in`."""
    reader = _Reader(triples, file)
    reader.experience()
    return reader.episode


class _Reader:
    def __init__(self, triples: Iterable[Triple], file: str) -> None:
        self._file = file
        self._about: dict[str, dict[str, list[Triple]]] = {}
        for triple in triples:
            self._about.setdefault(str(triple.subject), {}).setdefault(triple.predicate, []).append(triple)
        episodes = [one for one in self._about if SOMA.Episode in self._kinds(one)]
        if len(episodes) != 1:
            self._refuse(f"a narrative has exactly one episode (soma:Episode), this one has {len(episodes)}", None)
        self.episode = episodes[0]
        self._failures: dict[str, Failure] = {}
        self._roles: dict[str, tuple[Role, ...]] = {}

    def experience(self) -> Experience:
        top = self.episode
        nodes = self._many(top, DUL.includesAction)
        if len(nodes) > MOST_ACTIVITIES:
            self._refuse(f"more than {MOST_ACTIVITIES:,} actions", top)
        parents: dict[str, str] = {}
        for node in nodes:
            for below in self._many(node, DUL.hasConstituent):
                if parents.setdefault(below, node) != node:
                    self._refuse("an action is a constituent of two actions", below)
        numbers = {node: self._whole(node, EXPERIENCE.number) for node in nodes}
        things = {self._text(one, RDFS.label): one for one in self._many(top, DUL.includesObject)}
        names = {iri: name for name, iri in things.items()}
        activities = sorted(
            (self._activity(node, numbers, parents.get(node), names) for node in nodes), key=lambda one: one.number
        )
        self._check_tree(activities)
        return Experience(
            self._text(top, EXPERIENCE.planName),
            self._rate(top),
            self._maybe(top, EXPERIENCE.recipe),
            self._maybe_whole(top, EXPERIENCE.seed),
            self._maybe_whole(top, EXPERIENCE.schedule),
            self._maybe(top, EXPERIENCE.robot),
            self._maybe(top, EXPERIENCE.environment),
            self._text(top, EXPERIENCE.isWhole) == "true",
            tuple(activities),
            tuple(self._thing(name, things[name]) for name in sorted(things)),
        )

    def _rate(self, top: str) -> float:
        rate = self._float(top, EXPERIENCE.rate)
        if not 0 < rate <= MOST_STEPS:
            self._refuse("the rate is not a valid number of steps per second", top)
        return rate

    def _check_tree(self, activities: list[Activity]) -> None:
        seen: set[int] = set()
        for one in activities:  # a parent has to come first, which also excludes circles
            if one.number in seen or (one.parent is not None and one.parent not in seen):
                self._refuse(
                    f"number {one.number} is used twice, or is not greater than that of its parent action", None
                )
            seen.add(one.number)

    def _thing(self, name: str, node: str) -> Thing:
        kind, type_ = (self._text(node, prop) for prop in (EXPERIENCE.thingKind, EXPERIENCE.thingType))
        return Thing(name, kind, type_, self._maybe(node, EXPERIENCE.thingIri))

    def _activity(
        self, node: str, numbers: Mapping[str, int], parent: str | None, names: Mapping[str, str]
    ) -> Activity:
        interval, task = self._one(node, DUL.hasTimeInterval), self._one(node, DUL.executesTask)
        state = _STATES.get(str(self._one(node, SOMA.hasExecutionState)))
        if state is None or (parent is not None and parent not in numbers):
            self._refuse("its execution state is unknown, or its parent action is not part of the episode", node)
        designator = next((self._designator(one) for one in self._many(node, EXPERIENCE.describedBy)), None)
        participants = self._many(node, DUL.hasParticipant)
        if not names.keys() >= set(participants):
            self._refuse("a participant is not a thing of the episode", node)
        return Activity(
            numbers[node],
            None if parent is None else numbers[parent],
            self._text(node, EXPERIENCE.kind),
            self._text(node, EXPERIENCE.nodeName),
            state,
            self._maybe_whole(interval, EXPERIENCE.beginStep),
            self._maybe_whole(interval, EXPERIENCE.endStep),
            self._json(node, EXPERIENCE.parameters, {}),
            self._json(node, EXPERIENCE.result, None),
            self._failed(node),
            designator,
            self._roles_of(task),
            tuple(sorted(names[one] for one in participants)),
            tuple(self._listed(node, EXPERIENCE.hasResolution, self._resolution)),
            tuple(self._listed(node, EXPERIENCE.hasOccurrence, self._occurrence)),
        )

    def _listed(self, node: str, prop: str, read: Callable[[str], T]) -> Iterator[T]:
        """Yield linked individuals, sorted by their numbers."""
        found = sorted(self._many(node, prop), key=lambda one: self._whole(one, EXPERIENCE.number))
        yield from map(read, found)

    def _roles_of(self, task: str) -> tuple[Role, ...]:
        """Roles of a task, read once because many actions may share it."""
        if task not in self._roles:
            self._roles[task] = tuple(self._listed(task, DUL.isTaskOf, self._role))
        return self._roles[task]

    def _role(self, node: str) -> Role:
        return Role(self._text(node, EXPERIENCE.property), self._text(node, EXPERIENCE.filler))

    def _designator(self, node: str) -> Designator:
        about = next((_ABOUTS[kind] for kind in self._kinds(node) if kind in _ABOUTS), None)
        if about is None:
            self._refuse("it is not a designator", node)
        return Designator(about, self._text(node, EXPERIENCE.text))

    def _resolution(self, node: str) -> Resolution:
        base = self._json(node, EXPERIENCE.base, None)
        to = self._text(node, EXPERIENCE.resolvedAs)
        is_base = base is None or (isinstance(base, list) and all(isinstance(one, int | float) for one in base))
        if to not in list(ResolvedTo) or not is_base:
            self._refuse("the kind of the designator's solution is unknown", node)
        return Resolution(
            self._whole(node, EXPERIENCE.atStep),
            self._designator(self._one(node, EXPERIENCE.resolves)),
            ResolvedTo(to),
            self._text(node, EXPERIENCE.value),
            None if base is None else tuple(map(float, base)),
            self._json(node, EXPERIENCE.details, {}),
            self._failed(node),
        )

    def _occurrence(self, node: str) -> Occurrence:
        step, event = self._whole(node, EXPERIENCE.atStep), self._text(node, EXPERIENCE.event)
        return Occurrence(step, event, self._json(node, EXPERIENCE.details, {}), self._failed(node))

    def _failed(self, node: str) -> Failure | None:
        failures = self._many(node, EXPERIENCE.failedWith)
        if len(failures) > 1:
            self._refuse("it has two failures", node)
        return self._failure(failures[0]) if failures else None

    def _failure(self, node: str) -> Failure:
        chain = [node]
        while chain[-1] not in self._failures and (causes := self._many(chain[-1], EXPERIENCE.hasCause)):
            if len(causes) > 1 or len(chain) >= DEEPEST or causes[0] in chain:
                self._refuse("a failure has several direct causes, causes itself, or has too many causes", node)
            chain.append(causes[0])
        for one in reversed(chain):
            if one not in self._failures:
                causes = self._many(one, EXPERIENCE.hasCause)
                self._failures[one] = self._link(one, self._failures[causes[0]] if causes else None)
        return self._failures[node]

    def _link(self, node: str, cause: Failure | None) -> Failure:
        others = self._json(node, EXPERIENCE.other, [])
        if not isinstance(others, list) or not all(_are_texts(one) for one in others):
            self._refuse("the failures that came with it are not triples of texts", node)
        return Failure(
            self._text(node, EXPERIENCE.typeName),
            self._text(node, EXPERIENCE.message),
            self._maybe(node, EXPERIENCE.where),
            cause,
            tuple((relation, branch, text) for relation, branch, text in others),
        )

    # values

    def _kinds(self, node: str) -> list[str]:
        return self._many(node, RDF.type)

    def _values(self, node: str, prop: str) -> list[Term]:
        return list(dict.fromkeys(triple.object for triple in self._about.get(node, {}).get(prop, ())))

    def _many(self, node: str, prop: str) -> list[str]:
        return [value for value in self._values(node, prop) if isinstance(value, str)]

    def _one(self, node: str, prop: str) -> str:
        values = self._many(node, prop)
        if len(values) != 1:
            self._refuse(f"{prop} is stated {len(values)} times instead of once", node)
        return values[0]

    def _maybe(self, node: str, prop: str) -> str | None:
        values = [value for value in self._values(node, prop) if isinstance(value, Literal)]
        if len(values) > 1:
            self._refuse(f"{prop} is stated {len(values)} times", node)
        if not values:
            return None
        if values[0].datatype != EXPERIENCE.json:
            return values[0].value
        return str(self._loaded(values[0].value, node))

    def _text(self, node: str, prop: str) -> str:
        text = self._maybe(node, prop)
        if text is None:
            self._refuse(f"{prop} is missing", node)
        return text

    def _json(self, node: str, prop: str, default: Any) -> Any:
        text = self._maybe(node, prop)
        value = default if text is None else self._loaded(text, node)
        if isinstance(default, dict) and not isinstance(value, dict):
            self._refuse(f"{prop} is not a JSON object", node)
        return value

    def _loaded(self, text: str, node: str) -> Any:
        try:
            return json.loads(text)
        except (ValueError, RecursionError):
            self._refuse("a value is not JSON, or is too deeply nested", node)

    def _whole(self, node: str, prop: str) -> int:
        number = self._maybe_whole(node, prop)
        if number is None:
            self._refuse(f"{prop} is missing", node)
        return number

    def _maybe_whole(self, node: str, prop: str) -> int | None:
        number = self._maybe(node, prop)
        try:
            return None if number is None else int(number)
        except ValueError:
            self._refuse(f"{prop} is not a whole number", node)

    def _float(self, node: str, prop: str) -> float:
        try:
            return float(Literal(self._text(node, prop)).number())
        except (ValueError, OverflowError):
            self._refuse(f"{prop} is not a finite number", node)

    def _refuse(self, message: str, node: str | None) -> NoReturn:
        statements = next(iter(self._about.get(node or "", {}).values()), None)
        where = "" if node is None else f"{node.rsplit('#', 1)[-1]}: "
        raise BadInput([error("K080", where + message, statements[0].span if statements else Span(self._file))])


def _are_texts(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(isinstance(one, str) for one in value)
