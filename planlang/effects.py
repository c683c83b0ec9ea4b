"""Effects of action classes and of heat, as ontologies declare them (see object_change.omn)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from planlang.diagnostics import BadInput, Span, error
from planlang.kept import kept
from planlang.ontology import Literal, Ontology, Term, expand
from planlang.records import dataclass
from planlang.units import IncompatibleUnits, stated_number, unit_of_property

Classes = tuple[str, ...]
"""IRIs of classes."""


@dataclass(frozen=True, slots=True)
class Effects:
    """Effects of an action; classes and states are IRIs, ``flow_rate`` is in ml/s, ``amount`` in ml."""

    destroyed: Classes = ()
    """Classes of input objects that the action destroys."""
    created: Classes = ()
    """Classes of objects that the action creates, one of each."""
    turned: Classes = ()
    """Classes of input objects that the action turns over."""
    states: Classes = ()
    """States that the device is put in, most specific first."""
    flow_rate: float | None = None
    amount: float | None = None
    vessels: Classes = ()
    """Classes of vessels that hold the outputs, unless the action names another or its inputs are in one."""

    completes: Classes = ()
    """Classes of enclosing actions that this one completes: the effects of the innermost are applied as well."""

    def __bool__(self) -> bool:
        """Check whether the action changes anything."""
        return self != Effects()

    @property
    def lasts(self) -> bool:
        """True if repeating the action changes something again; a device that is on stays on."""
        return bool(self.destroyed or self.created or self.turned or self.flow_rate)


@dataclass(frozen=True, slots=True)
class HeatEffect:
    """A thing of class ``inputs`` becomes ``output`` after a side was over a running device for ``duration`` [s]."""

    inputs: Classes
    output: str
    devices: Classes
    duration: float


_NOTHING = Effects()


def effects_of(
    ontology: Ontology, action_class: str, ancestors: Iterable[str] | None = None, also: Iterable[Ontology] = ()
) -> Effects:
    """Collect the effects declared for a class of actions and its superclasses, by an ontology and by others ``also``.

    ``ancestors`` lists the class and its superclasses, nearest first, for classes that the ontology does not define.
    Of the created classes only the most specific count. A rate, an amount or a state of a nearer class overrides that
    of a farther one. Raises BadInput for an invalid number.
    """
    tables = [*map(_declared, (ontology, *also))]
    levels = ontology.ancestors(action_class) if ancestors is None else ancestors
    found = [effects for cls in levels for table in tables for effects in table.get(cls, ())]
    if not found:
        return _NOTHING
    return Effects(
        destroyed=_each(one.destroyed for one in found),
        created=narrowest((ontology, *also), _each(one.created for one in found)),
        turned=_each(one.turned for one in found),
        states=_each(one.states for one in found),
        flow_rate=next((one.flow_rate for one in found if one.flow_rate is not None), None),
        amount=next((one.amount for one in found if one.amount is not None), None),
        vessels=_each(one.vessels for one in found),
        completes=_each(one.completes for one in found),
    )


def heat_effects(ontology: Ontology) -> tuple[HeatEffect, ...]:
    """Return the effects of heat, in the order of the files; raises BadInput for an invalid number."""
    found = []
    for individual in ontology.individuals(expand("HeatChange")):
        inputs, devices = (ontology.iris(individual, name) for name in ("inputsDestroyed", "deviceUsed"))
        duration = number_of_individual(ontology, individual, "duration")
        outputs = ontology.iris(individual, "outputsCreated")
        if duration is not None:
            found += [HeatEffect(inputs, output, devices, duration) for output in outputs]
    return tuple(found)


def narrowest(ontologies: Sequence[Ontology], classes: Iterable[str]) -> Classes:
    """Drop classes that have a subclass among the others, according to some ontology."""
    every = tuple(dict.fromkeys(classes))
    pairs = [(one, cls) for one in every for cls in every if one != cls]
    wider = {cls for one, cls in pairs if any(ontology.is_a(one, cls) for ontology in ontologies)}
    return tuple(cls for cls in every if cls not in wider)


def number_of_class(ontology: Ontology, classes: Iterable[str], name: str) -> float | None:
    """Look up a numeric property in the first of the classes that has it, itself or by inheritance.

    Raises BadInput unless it is a finite number >= 0.
    """
    for cls in classes:
        for restriction in ontology.inherited_restrictions(cls, expand(name)):
            return _checked(restriction.filler, name, restriction.span)
    return None


def number_of_individual(ontology: Ontology, individual: str, name: str) -> float | None:
    """Look up a numeric property of an individual, like :func:`number_of_class`; the last statement counts."""
    found = tuple(ontology.triples(individual, expand(name)))
    return _checked(found[-1].object, name, found[-1].span) if found else None


@kept
def _declared(ontology: Ontology) -> dict[str, list[Effects]]:
    """Return the declared effects by class of actions; an ontology is read once."""
    table: dict[str, list[Effects]] = {}
    for individual in ontology.individuals(expand("ObjectChange")):
        effects = Effects(
            ontology.iris(individual, "inputsDestroyed"),
            ontology.iris(individual, "outputsCreated"),
            ontology.iris(individual, "turnedOver"),
            ontology.iris(individual, "toState"),
            number_of_individual(ontology, individual, "flowRate"),
            number_of_individual(ontology, individual, "amount"),
            ontology.iris(individual, "deviceUsed"),
            ontology.iris(individual, "completes"),
        )
        for action in ontology.iris(individual, "byAction"):
            table.setdefault(action, []).append(effects)
    return table


def _each(several: Iterable[Classes]) -> Classes:
    return tuple(dict.fromkeys(cls for classes in several for cls in classes))


def _checked(term: Term, name: str, span: Span | None) -> float:
    try:
        number = float(stated_number(term, unit_of_property(name))) if isinstance(term, Literal) else -1.0
    except IncompatibleUnits as wrong:
        raise BadInput([error("M030", f"{name}: {wrong}", span)]) from None
    except ValueError:
        number = -1.0
    if not (math.isfinite(number) and number >= 0):
        text = term.value if isinstance(term, Literal) else str(term)
        raise BadInput([error("M002", f"{name} is {text!r}, not a finite number >= 0", span)])
    return number
