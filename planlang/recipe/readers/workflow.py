"""Dialect D5: workflows of the DUL, EASE and SOMA ontologies: individuals with ``hasStep`` and related steps.

Steps are tasks: individuals of action classes. A workflow ``definesTask`` that it performs, so a step that another
workflow defines is nested; a step may also be a workflow itself. Relations are those of J. F. Allen between intervals,
under the names of DUL, EASE, SOMA and OWL-Time. A relation belongs to the workflow that has both tasks as steps, or as
phases (processes in the background, ``hasPhase``), directly or in workflows below its steps. Participants of a task
are roles (``isTaskOf``); the class of a role determines the property of the action. A role is filled with the thing
that it ``classifies`` (``isRoleOf``), else with the class that the task's class states. A binding (``hasBindingRole``)
passes the filler from the role of one task to that of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from planlang.closure import reached
from planlang.designators import local_name
from planlang.kept import kept
from planlang.ontology import BNode, Ontology, Restriction, expand, shorten
from planlang.recipe.fillers import action_class
from planlang.recipe.model import WORKFLOW, Allen, Flow, Ordering, Overlap
from planlang.recipe.statements import Filling, Statements, SubAction, facts, is_word, named_iris

BEFORE = "before"
"""Relations that only order: Allen's before and meets, and DUL's precedes."""

RELATIONS: dict[str, tuple[Allen | str, bool]] = {
    "before": (BEFORE, False),
    "after": (BEFORE, True),
    "precedes": (BEFORE, False),
    "follows": (BEFORE, True),
    "directlyprecedes": (BEFORE, False),
    "directlyfollows": (BEFORE, True),
    "meets": (BEFORE, False),
    "metby": (BEFORE, True),
    "overlaps": (Allen.OVERLAPS, False),
    "overlapson": (Allen.OVERLAPS, False),
    "overlapon": (Allen.OVERLAPS, False),
    "overlappedon": (Allen.OVERLAPS, False),
    "overlappedby": (Allen.OVERLAPS, True),
    "during": (Allen.DURING, False),
    "contains": (Allen.DURING, True),
    "starts": (Allen.STARTS, False),
    "startedby": (Allen.STARTS, True),
    "finishes": (Allen.FINISHES, False),
    "finishedby": (Allen.FINISHES, True),
    "equals": (Allen.EQUALS, False),
    "simultaneous": (Allen.EQUALS, False),
}
"""Lower-case local name without the prefix "interval" or "temporally" -> relation, and whether it is the inverse."""

ROLES: dict[str, str] = {
    "Tool": "deviceUsed",
    "Instrument": "deviceUsed",
    "Destination": "toLocation",
    "Location": "toLocation",
    "Origin": "fromLocation",
    "Source": "fromLocation",
    "CreatedObject": "outputsCreated",
    "DestroyedObject": "inputsDestroyed",
    "Product": "outputsCreated",
    **dict.fromkeys(("Recipient", "RecipientRole", "Beneficiary", "BeneficiaryRole"), "recipient"),
    "PerformerRole": "performedBy",
    "AgentRole": "performedBy",
}
"""Class of a role (local name), or of one above it -> property of the action; other roles are the object acted on."""

OUTPUT = expand("outputsCreated")

_STEPS, _STEP_OF = ("hasStep",), ("isStepOf", "stepOf")
_PHASES, _PHASE_OF = ("hasPhase",), ("isPhaseOf",)
_FILLS, _FILLED_BY = ("classifies", "isRoleOf"), ("isClassifiedBy", "hasRole")
"""In DUL isRoleOf is a subproperty of classifies."""
_DEFINES, _DEFINED_BY = ("definesTask", "isPlanFor"), ("isTaskDefinedIn", "isDefinedIn", "hasPlan")


def tasks(ontology: Ontology) -> Iterator[str]:
    """Yield the tasks of the workflows of the main document; a workflow that defines none is its own task."""
    for triple in ontology.using(*_STEPS, *_STEP_OF):
        workflow = triple.subject if is_word(triple.predicate, *_STEPS) else triple.object
        if isinstance(workflow, str) and ontology.main(workflow):
            yield task_of(ontology, workflow)


def read(ontology: Ontology, iri: str) -> Statements | None:
    """Read a workflow, or the workflow of a task; None if it has no steps."""
    if not ontology.properties_named(*_STEPS, *_STEP_OF):
        return None
    subs: list[SubAction] = []
    workflows = workflows_of(ontology, iri)
    for workflow in workflows:
        subs += [
            SubAction(task_of(ontology, step), tuple(_roles(ontology, task_of(ontology, step))), filling.span)
            for filling in _linked(ontology, workflow, _STEPS, _STEP_OF)
            for step in [str(filling.term)]
        ]
    if not subs:
        return None
    subs.sort(key=lambda sub: sub.iri or "")
    phases = {str(one.term): None for name in workflows for one in _linked(ontology, name, _PHASES, _PHASE_OF)}
    task = task_of(ontology, iri)
    orderings, overlaps = _related(ontology, task, [*(str(sub.iri) for sub in subs), *phases])
    return Statements(
        task,
        WORKFLOW,
        tuple(subs),
        orderings,
        overlaps,
        tuple(phases),
        tuple(_bindings(ontology, [str(sub.iri) for sub in subs])),
        fillings=tuple(_roles(ontology, task)),
    )


def relations(ontology: Ontology, names: list[str]) -> Iterator[tuple[str, str, str, Filling]]:
    """Yield the relations that tasks state: (task, local name of the relation, other task, the fact)."""
    for name in dict.fromkeys(names):
        for triple in ontology.triples(s=name):
            if isinstance(triple.object, str) and _relation(triple.predicate) is not None:
                filling = Filling(triple.predicate, triple.object, triple.span)
                yield name, local_name(triple.predicate), triple.object, filling


def is_interval_relation(property_name: str) -> bool:
    """True for a property that relates two intervals."""
    return _relation(property_name) is not None


def workflows_of(ontology: Ontology, iri: str) -> list[str]:
    """Workflows that perform a task, sorted; a workflow performs itself."""
    if _linked(ontology, iri, _STEPS, _STEP_OF):
        return [iri]
    candidates = [str(filling.term) for filling in _linked(ontology, iri, _DEFINED_BY, _DEFINES)]
    return sorted(workflow for workflow in candidates if _linked(ontology, workflow, _STEPS, _STEP_OF))


def task_of(ontology: Ontology, iri: str) -> str:
    """The task that a workflow defines, if it is exactly one; anything else is its own task."""
    defined = dict.fromkeys(str(filling.term) for filling in _linked(ontology, iri, _DEFINES, _DEFINED_BY))
    return next(iter(defined)) if len(defined) == 1 else iri


def _linked(ontology: Ontology, subject: str, words: tuple[str, ...], inverses: tuple[str, ...]) -> list[Filling]:
    """Individuals linked by properties, or by their inverses from the other side; each once, in document order."""
    linked = {
        filling.term: filling
        for filling in facts(ontology, subject, *words)
        if isinstance(filling.term, str) and filling.term != subject
    }
    for predicate in ontology.properties_named(*inverses):
        for triple in ontology.triples(p=predicate, o=subject):
            if isinstance(triple.subject, str) and triple.subject != subject:
                linked.setdefault(triple.subject, Filling(triple.predicate, triple.subject, triple.span))
    return list(linked.values())


def _relation(predicate: str) -> tuple[Allen | str, bool] | None:
    name = local_name(predicate).lower().removeprefix("interval").removeprefix("temporally")
    return RELATIONS.get(name)


def _related(ontology: Ontology, task: str, parts: list[str]) -> tuple[tuple[Ordering, ...], tuple[Overlap, ...]]:
    """Orderings and overlaps that relations state among the steps and phases of a task, each once."""
    orderings: dict[tuple[str, str], Ordering] = {}
    overlaps: dict[tuple[str, Allen, str], Overlap] = {}
    nesting = _nesting(ontology)
    for name, _, other, filling in relations(ontology, nesting.stating(task, parts)):
        meaning = _relation(filling.property)
        assert meaning is not None
        relation, is_inverse = meaning
        stated = (task_of(ontology, name), task_of(ontology, other))
        first, second = stated[::-1] if is_inverse else stated
        if isinstance(relation, str):
            for pair in nesting.within(task, parts, (first, second)):
                orderings.setdefault(pair, Ordering(*pair, span=filling.span))
            continue
        if relation is Allen.EQUALS:
            first, second = sorted((first, second))
        for pair in nesting.within(task, parts, (first, second), relation):
            overlaps.setdefault((pair[0], relation, pair[1]), Overlap(pair[0], relation, pair[1], filling.span))
    return (
        tuple(orderings[pair] for pair in sorted(orderings)),
        tuple(overlaps[key] for key in sorted(overlaps, key=lambda key: (key[0], key[1].value, key[2]))),
    )


class _Nesting:
    """Index of the tasks above and below each task, in all workflows of an ontology."""

    def __init__(self, ontology: Ontology) -> None:
        self._above: dict[str, dict[str, None]] = {}
        self._below: dict[str, dict[str, None]] = {}
        self._workflows: dict[str, dict[str, None]] = {}
        for triple in ontology.using(*_STEPS, *_STEP_OF, *_PHASES, *_PHASE_OF):
            ends = (str(triple.subject), str(triple.object))
            workflow, part = ends if is_word(triple.predicate, *_STEPS, *_PHASES) else ends[::-1]
            task, step = task_of(ontology, workflow), task_of(ontology, part)
            self._above.setdefault(step, {})[task] = None
            self._below.setdefault(task, {})[step] = None
            self._workflows.setdefault(task, {})[workflow] = None

    def stating(self, task: str, parts: list[str]) -> list[str]:
        """List a task, its parts and all tasks below them, with their workflows: all that may state relations of its
        parts.
        """
        tasks_below = dict.fromkeys((task, *reached(parts, lambda name: self._below.get(name, ()))))
        return [name for one in tasks_below for name in (one, *self._workflows.get(one, ()))]

    def within(
        self, task: str, parts: list[str], ends: tuple[str, str], relation: Allen | None = None
    ) -> Iterator[tuple[str, str]]:
        """Yield the pairs of parts, or a part and the task, that a relation of two tasks relates in the workflow of the
        task.

        A task before a step is before everything below the step, and everything below a step is during whatever the
        step is during. Other relations across workflows cannot be represented: their ends are yielded unchanged, as is
        a task that shares no workflow with the other one; checks report both.
        """
        above = [dict.fromkeys(reached((name,), lambda name: self._above.get(name, ()))) for name in ends]
        known = [task, *parts]  # an end is the task itself, or one of its parts, or in some of the parts
        first, second = (
            [name] if name in known else [part for part in parts if part in found]
            for name, found in zip(ends, above, strict=True)
        )
        if not first or not second:
            is_own = not {*parts}.isdisjoint(ends) or (task in ends and task not in self._above)
            if is_own and above[0].keys().isdisjoint(above[1]):
                yield ends
        elif {*ends} <= {task, *parts}:
            if relation is None or ends[0] != ends[1]:
                yield ends
        elif first == second or (relation is Allen.DURING and ends[1] == task):
            return  # it is in the workflow of a step, or true of all steps
        elif task not in ends and (relation is None or (relation is Allen.DURING and ends[1] in parts)):
            yield from (pair for pair in product(first, second) if pair[0] != pair[1])
        else:
            yield ends


@kept
def _nesting(ontology: Ontology) -> _Nesting:
    return _Nesting(ontology)


def _roles(ontology: Ontology, task: str) -> Iterator[Filling]:
    """Yield the fillers of a task's roles: classified individuals, else the classes that the task's class states."""
    kinds: dict[str, list[str]] = {}
    for fact in _linked(ontology, task, ("isTaskOf",), ("hasTask",)):
        role = str(fact.term)
        kind = action_class(ontology, role) or role
        for classified in sorted(_linked(ontology, role, _FILLS, _FILLED_BY), key=lambda one: str(one.term)):
            kinds.setdefault(kind, []).append(str(classified.term))
            yield Filling(_property(ontology, kind), classified.term, fact.span)
    cls = task if ontology.is_class(task) else action_class(ontology, task)
    for ancestor in ontology.ancestors(cls) if cls is not None else ():
        for restriction in ontology.restrictions(ancestor):
            if is_word(restriction.property, "isTaskOf") and isinstance(restriction.filler, BNode):
                yield from _role_of_class(ontology, restriction, kinds)


def _role_of_class(
    ontology: Ontology, restriction: Restriction, individuals: dict[str, list[str]]
) -> Iterator[Filling]:
    """Yield the class of a role's filler, if no individual of it is known."""
    kind = next((member for member in ontology.members(restriction.filler) if isinstance(member, str)), None)
    assert isinstance(restriction.filler, BNode)
    for inner in ontology.restrictions(restriction.filler):
        cls = inner.filler
        if kind is None or not is_word(inner.property, *_FILLS) or not isinstance(cls, str):
            continue
        if not any(ontology.is_a(individual, cls) for individual in individuals.get(kind, ())):
            yield Filling(_property(ontology, kind), cls, inner.span)


def _property(ontology: Ontology, role: str) -> str:
    names = map(local_name, ontology.ancestors(role))
    return expand(next((ROLES[name] for name in names if name in ROLES), "objectActedOn"))


def _bindings(ontology: Ontology, steps: list[str]) -> Iterator[Flow]:
    """Yield the data flow between tasks with bound roles, from the task that creates the filler."""
    tasks_of_roles: dict[str, str] = {}
    for step in steps:
        for fact in _linked(ontology, step, ("isTaskOf",), ("hasTask",)):
            tasks_of_roles.setdefault(str(fact.term), step)
    seen: set[str] = set()
    for role in tasks_of_roles:
        for link in ontology.triples(o=role):
            if is_word(link.predicate, "hasBindingRole", "hasBindingFiller") and isinstance(link.subject, (str, BNode)):
                binding = link.subject
                if str(binding) in seen:
                    continue
                seen.add(str(binding))
                bound = [name for name, _ in named_iris(facts(ontology, binding, "hasBindingRole", "hasBindingFiller"))]
                yield from _bound(ontology, sorted(bound), tasks_of_roles, str(binding))


def _bound(ontology: Ontology, roles: list[str], tasks_of_roles: dict[str, str], binding: str) -> Iterator[Flow]:
    known = [(role, tasks_of_roles[role]) for role in roles if role in tasks_of_roles]
    outputs = [(role, task) for role, task in known if _property(ontology, _kind(ontology, role)) == OUTPUT]
    for created, producer in outputs:
        for role, consumer in known:
            if consumer != producer and (role, consumer) not in outputs:
                span = next((triple.span for triple in ontology.triples(o=role) if triple.subject == binding), None)
                resource = _passed(ontology, (created, producer), (role, consumer))
                used_by = shorten(_property(ontology, _kind(ontology, role)))
                yield Flow(producer, consumer, resource, used_by, binding, span)


def _passed(ontology: Ontology, made: tuple[str, str], used: tuple[str, str]) -> str | None:
    """Filler that one role creates and the other uses: an individual that either classifies, else a class."""
    for role, _ in (made, used):
        for classified in _linked(ontology, role, _FILLS, _FILLED_BY):
            return str(classified.term)
    created, needed = (
        [
            filling.term
            for filling in _roles(ontology, task)
            if filling.property == _property(ontology, _kind(ontology, role)) and isinstance(filling.term, str)
        ]
        for role, task in (made, used)
    )
    common = [cls for cls in created if cls in needed]
    if len(common) == 1:
        return common[0]
    return created[0] if len(created) == 1 else None


def _kind(ontology: Ontology, role: str) -> str:
    return action_class(ontology, role) or role
