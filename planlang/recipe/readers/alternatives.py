"""Alternatives: a sub-action that is a union of action classes; the plan performs the first one that succeeds.

The union stands in the restriction itself (``subAction some (A or B)``), or defines the class of the sub-action
(``EquivalentTo: A or B``, or ``SubClassOf: A or B``). Nested unions are flattened. Statements about the union apply to
each member.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from planlang.designators import local_name, local_part
from planlang.diagnostics import Span
from planlang.kept import kept
from planlang.ontology import BNode, Ontology, Term, shorten
from planlang.ontology.terms import OWL, RDFS
from planlang.recipe.fillers import action_class, fillings
from planlang.recipe.model import Ordering
from planlang.recipe.statements import Filling, Statements, States, SubAction, fillings_of, is_word

MOST_NAMED = 3
"""Maximum number of members in the name of a union; longer names have the first member and the number of the others."""


def read_union(ontology: Ontology, expression: BNode, task: str, span: Span, times: int) -> SubAction | None:
    """Read an anonymous union, or an intersection with one, as a sub-action; None for anything else.

    Its name joins the names of its members: ``AOrB``.
    """
    if not _union_within(ontology, expression):
        return None
    members = tuple(_members(ontology, expression, span))
    names = [local_name(one.iri) if one.iri is not None else "Other" for one in members]
    if len(names) > MOST_NAMED:
        names = [names[0], f"{len(names) - 1}Others"]
    name = "Or".join(names)
    start = task[: len(task) - len(local_part(task))]
    while ontology.defined(start + name):
        name += "Step"
    return _sub_action(task, SubAction(start + name, (), span, times), members)


def with_alternatives(ontology: Ontology, statements: Statements) -> Statements:
    """Add the alternatives of sub-actions whose class is a union.

    Statements about a member that is not itself a sub-action apply to the step that it is an alternative of.
    """
    subs = tuple(_expanded(ontology, statements.iri, sub) for sub in statements.sub_actions)
    if not any(sub.alternatives for sub in subs):
        return statements
    named = {sub.iri for sub in subs}
    steps: dict[str, str] = {}
    for sub in subs:
        for _, member in sub.alternatives:
            if member.iri is not None and member.iri not in named and sub.iri is not None:
                steps.setdefault(member.iri, sub.iri)
    return _renamed(replace(statements, sub_actions=subs), steps)


def _expanded(ontology: Ontology, task: str, sub: SubAction) -> SubAction:
    """A sub-action, with its members if its class is a union."""
    if sub.alternatives or sub.iri is None:
        return sub
    cls = sub.iri if ontology.is_class(sub.iri) else action_class(ontology, sub.iri)
    if cls is None or cls not in _unions(ontology):
        return sub
    of_union = tuple(filling for level in fillings(ontology, sub.iri, sub.fillings) for filling in level)
    members = tuple(_members(ontology, _unions(ontology)[cls], sub.span, outer=of_union, above=frozenset({cls})))
    return _sub_action(task, sub, members)


def _sub_action(task: str, sub: SubAction, members: tuple[SubAction, ...]) -> SubAction:
    name = local_name(sub.iri or "")
    named = ((f"{task}.{name}.{number}", member) for number, member in enumerate(members, 1))
    return replace(sub, fillings=(), alternatives=tuple(named))


def _members(
    ontology: Ontology,
    term: Term,
    span: Span,
    local: tuple[Filling, ...] = (),
    outer: tuple[Filling, ...] = (),
    above: frozenset[Term] = frozenset(),
) -> Iterator[SubAction]:
    """Yield the alternatives of an expression; the expression itself if it is not a union.

    ``local`` are fillings where it is mentioned, which override those of a class; ``outer`` are overridden by them.
    ``above`` are the unions that contain it.
    """
    name = term if isinstance(term, str) else None
    union: BNode | str | None = None
    if isinstance(term, BNode):
        name = next((member for member in ontology.members(term) if isinstance(member, str)), None)
        local = (*fillings_of(ontology.restrictions(term)), *local)
        union = None if name is not None else _union_within(ontology, term)
    elif name is not None:
        union = _unions(ontology).get(name)
    if union is None:
        stated = {one.property for level in fillings(ontology, name, local) for one in level} if name else set()
        more = tuple(one for one in outer if one.property not in stated)
        yield SubAction(name, (*local, *more), mention(ontology, name, span))
        return
    if name is not None:
        outer = (*(one for level in fillings(ontology, name) for one in level), *outer)
    for member in ontology.alternatives(union):
        if member not in above:
            yield from _members(ontology, member, span, local, outer, above | {term})


def mention(ontology: Ontology, name: str | None, span: Span) -> Span:
    """First mention of a class in a list after the start of a restriction; that start if there is none."""
    if name is None:
        return span
    mentions = [triple.span for triple in ontology.triples(o=name) if triple.predicate.endswith("#first")]
    return min((span_of_mention for span_of_mention in mentions if span_of_mention >= span), default=span)


def _union_within(ontology: Ontology, term: BNode) -> BNode | None:
    """The union that an expression is, or the only union in an intersection without a named class."""
    members = ontology.members(term)
    unions = [one for one in members if isinstance(one, BNode) and ontology.alternatives(one)]
    is_named = any(isinstance(one, str) for one in members)
    return unions[0] if len(unions) == 1 and not is_named else None


def is_union(ontology: Ontology, expression: BNode) -> bool:
    """True for a union of named classes, or of intersections with one: alternatives of a step."""
    union = _union_within(ontology, expression)
    members = ontology.alternatives(union) if union is not None else ()
    return bool(members) and all(any(isinstance(one, str) for one in ontology.members(each)) for each in members)


@kept
def _unions(ontology: Ontology) -> Mapping[str, BNode | str]:
    """Map each class outside the bundled vocabulary without sub-actions of its own to the union that defines it."""
    store, union_of = ontology.store, dict[str, BNode | str]()
    nodes = {store.subjects[row] for row in store.by(OWL.unionOf)}
    for row in store.by(RDFS.subClassOf, OWL.equivalentClass) if nodes else ():
        name, value = store.name(store.subjects[row]), store.objects[row]
        if name is None or not (value in nodes or value in store.intersections):
            continue
        union = next((one for one in ontology.members(store.term(value)) if store.find(one) in nodes), None)
        if isinstance(union, BNode) and _may_define(ontology, name):
            union_of.setdefault(name, union)
    for name in filter(None, map(store.name, nodes)):
        if _may_define(ontology, name):
            union_of.setdefault(name, name)
    return union_of


def _may_define(ontology: Ontology, name: str) -> bool:
    is_own = shorten(name) == name or ontology.main(name)
    return is_own and not any(is_word(one.property, "subAction", "subEvents") for one in ontology.restrictions(name))


def _renamed(statements: Statements, steps: Mapping[str, str]) -> Statements:
    """Replace members by their steps in all statements; orders among members of one step stay as they are."""

    def step(name: str) -> str:
        return steps.get(name, name)

    def order(one: Ordering) -> Ordering:
        before, after = step(one.before), step(one.after)
        return one if before == after else one._replace(before=before, after=after)

    states = statements.states
    if states is not None:
        transitions = tuple(
            replace(one, source=step(one.source), target=step(one.target)) for one in states.transitions
        )
        states = States(tuple(map(step, states.starts)), tuple(map(step, states.ends)), transitions)
    return replace(
        statements,
        orderings=tuple(map(order, statements.orderings)),
        overlaps=tuple(replace(one, first=step(one.first), second=step(one.second)) for one in statements.overlaps),
        flows=tuple(
            replace(
                one,
                producer=step(one.producer),
                consumer=step(one.consumer),
                consumes=None if one.consumer in steps else one.consumes,
            )
            for one in statements.flows
        ),
        states=states,
    )
