"""Parameters of a plan: what they take, and what the user binds them to by ``--set``."""

from __future__ import annotations

import inspect
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args, get_type_hints

from executive.maps import MapObject, SemanticMap, scene_of
from executive.maps.class_names import is_kind
from executive.maps.contents import is_content
from executive.maps.environments import environments_with
from planlang.action_classes import nearest_unstated
from planlang.designators import ActionClass, Location, Object, Person, local_name
from planlang.diagnostics import BadInput, Diagnostic, error, note, warning
from planlang.language.plans import Plan
from planlang.ontology import expand, shorten
from planlang.records import dataclass
from planlang.spelling import guess, similar

ON_WHAT_STAYS = ("OpeningSomething", "ClosingSomething", "TurningOnPoweredDevice", "TurningOffPoweredDevice")
"""Classes of actions on furniture and devices."""
ON_WHAT_IS_TAKEN = ("HoldingAnObject", "PickingUpAnObject", "TakingSomething", "FetchingAnObject")
"""Classes of actions after which a hand has what they act on."""
MOST_NAMES = 20
"""Things of a map that one message lists."""

Bound = Object | Location | float
"""A value that a parameter may be bound to."""


@dataclass(frozen=True, slots=True)
class PlanParameter:
    """A parameter of a plan: ``setting`` is what ``--set`` calls it, ``types`` are the classes of what it takes.

    ``default`` is None where the user has to bind it.
    """

    name: str
    setting: str
    types: tuple[type, ...]
    default: Object | None = None
    actions: tuple[str, ...] = ()
    """Classes of actions of the step that acts on it, as far as the vocabulary knows them; empty if none does."""

    def likely(self, semantic_map: SemanticMap, names: Sequence[str]) -> list[str]:
        """Return on which of the things that fit the step may act: what can be grasped, unless it opens or switches.

        Where the name of the step says on what it acts, it is that. If nothing is likely, all are, unless a hand is to
        take it.
        """
        if not self.actions:
            return [*names]
        if meant := _named_by_step(self, semantic_map):
            return [thing.name for thing in meant]
        above = {cls for one in self.actions for cls in semantic_map.ontology.ancestors(one)}
        stays, taken = (any(expand(cls) in above for cls in those) for those in (ON_WHAT_STAYS, ON_WHAT_IS_TAKEN))
        handled = {body.name for body in scene_of(semantic_map, []).bodies if body.graspable}
        likely = [name for name in names if (name in handled) != stays]
        return likely if likely or taken else [*names]

    @property
    def takes_places(self) -> bool:
        """True if a location may be given."""
        return Location in self.types

    def fits(self, semantic_map: SemanticMap, thing: MapObject) -> bool:
        """Return True if a thing of a map is of the class of the default, or without one of the parameter's types."""
        if self.default is not None:
            cls = expand(self.default.type)
            return semantic_map.is_a(thing, cls) or _is_alike(semantic_map, thing, self.default)
        return (Person if semantic_map.is_a(thing, "Person") else Object) in self.types


def plan_parameters(plan: Plan[Any, Any]) -> dict[str, PlanParameter]:
    """Return the plan's parameters that have an object as default, or none at all."""
    found = {}
    hints = _hints(plan)
    for name, parameter in inspect.signature(plan.function).parameters.items():
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        annotation = hints.get(name)
        setting = next((text for text in getattr(annotation, "__metadata__", ()) if isinstance(text, str)), name)
        bare = getattr(annotation, "__origin__", annotation) if hasattr(annotation, "__metadata__") else annotation
        types = tuple(cls for cls in get_args(bare) or (bare,) if isinstance(cls, type))
        if isinstance(parameter.default, Object):
            found[name] = PlanParameter(name, setting, types, parameter.default)
        elif parameter.default is parameter.empty:
            found[name] = PlanParameter(name, setting, types, actions=_acting(plan, setting))
    return found


def _acting(plan: Plan[Any, Any], setting: str) -> tuple[str, ...]:
    """Return the classes, as far as the vocabulary knows them, of the action on what a setting names."""
    step, _, role = setting.rpartition(".")
    stated = (one for one in inspect.unwrap(plan.function).__globals__.values() if isinstance(one, ActionClass))
    step = step.rpartition(".")[2]
    cls = next((one for one in stated if local_name(one) == step), step)
    return nearest_unstated(cls) if role == "objectActedOn" else ()


def _hints(plan: Plan[Any, Any]) -> dict[str, Any]:
    """Return the types of a plan's parameters; nothing for an author's that cannot be evaluated."""
    try:
        return get_type_hints(plan.function, include_extras=True)
    except Exception:  # an annotation is any expression, which may raise anything
        return {}


def stated_bindings(plan: Plan[Any, Any], bound: Mapping[str, Bound], semantic_map: SemanticMap) -> dict[str, str]:
    """Return the parameters of ``bound`` that differ from the plan's defaults in this map, as texts to be set."""
    try:
        defaults = bound_parameters(plan, {}, semantic_map, [])
    except BadInput:
        defaults = {}
    set_ = {name: value for name, value in bound.items() if value != defaults.get(name)}
    return {name: local_name(getattr(value, "iri", None) or str(value)) for name, value in set_.items()}


def bound_parameters(
    plan: Plan[Any, Any], bindings: Mapping[str, str], semantic_map: SemanticMap, found: list[Diagnostic]
) -> dict[str, Bound]:
    """Return the plan's parameters: their defaults, or things of the map that the user named, by IRI or local name.

    A thing has to be of the class of the default. Where the recipe names an individual, a thing of a class beside that
    of the individual, below the same one, will do, too, with a warning among ``found``. A location may be told by a
    phrase as well. Raises BadInput, telling what would be valid, for a parameter or a thing that does not exist or does
    not fit, and for a parameter without default that is not bound; what OpeningARefrigerator acts on is the only
    refrigerator of the map.
    """
    parameters = plan_parameters(plan)
    bound: dict[str, Bound] = {name: one.default for name, one in parameters.items() if one.default is not None}
    problems: list[Diagnostic] = []
    wanted = dict(_named(parameters, bindings, problems))
    for name, text in wanted.items():
        try:
            bound[name] = _bound(parameters[name], text, semantic_map, found)
        except BadInput as problem:
            problems += problem.diagnostics
    for name in (name for name in parameters if name not in bound and name not in wanted):
        if len(things := _named_by_step(parameters[name], semantic_map)) == 1:
            bound[name] = _bound(parameters[name], things[0].iri, semantic_map, found)
            message = f"{parameters[name].setting} is {things[0].name}, the only one of the class that the step names"
            found.append(note("X028", message, help=f"--set {parameters[name].setting}=X names another thing"))
    missing = [one for name, one in parameters.items() if name not in bound and name not in wanted]
    problems += [_missing(one, semantic_map) for one in missing]
    if problems:
        raise BadInput(problems)
    return {name: bound[name] for name in parameters}


def not_in_map(bound: Mapping[str, Bound], semantic_map: SemanticMap, made: Collection[str]) -> Iterator[Diagnostic]:
    """Yield a diagnostic for each individual that the map lacks, where things of its class are meant instead.

    It is a warning where there are several: the nearest need not be the right one. Parameters that are ``made`` by the
    plan itself are left out.
    """
    there = {thing.iri for thing in semantic_map.objects}
    things = [what for name, value in bound.items() if name not in made for what in things_of(value)]
    for what in dict.fromkeys(one for one in things if one.iri is not None and one.iri not in there):
        fitting = [
            thing
            for thing in semantic_map.objects
            if thing.pose is not None and any(is_kind(semantic_map.ontology, cls, what.type) for cls in thing.types)
        ]
        if not fitting:
            continue
        message = f"{local_name(what.iri or '')} of the recipe ({what.iri}) is not in the map"
        if len(fitting) == 1:
            yield note("X029", f"{message}: {fitting[0].name} is meant, its only {what.type}")
            continue
        known = _listed([thing.name for thing in fitting])
        names = [name for name, value in bound.items() if value == what]
        advice = (
            f"--set {names[0]}={fitting[0].name} says which"
            if names
            else "the recipe may name it by its IRI in the map"
        )
        yield warning("X029", f"{message}: the nearest {what.type} to the robot is meant, of {known}", help=advice)


def things_of(value: Bound) -> Iterator[Object]:
    """Yield the things that a value is, or is about."""
    if not isinstance(value, float):
        yield from value.things() if isinstance(value, Location) else (value,)


def _named(
    parameters: Mapping[str, PlanParameter], bindings: Mapping[str, str], problems: list[Diagnostic]
) -> Iterator[tuple[str, str]]:
    """Yield the names of the parameters that the user means, and what they are set to."""
    settings = {setting: name for name, one in parameters.items() for setting in (one.setting, name)}
    for wanted, text in bindings.items():
        if wanted in settings:
            yield settings[wanted], text
            continue
        known = ", ".join(one.setting for one in parameters.values()) or "none"
        alike = similar(wanted, settings)
        guess = f"did you mean --set {alike[0]}={text}? " if alike else ""
        problems.append(error("X004", f"the plan has no parameter {wanted!r}", help=f"{guess}its parameters: {known}"))


def _named_by_step(parameter: PlanParameter, semantic_map: SemanticMap) -> list[MapObject]:
    """Return the things of the map of a class with whose name the name of a parameter's step ends."""
    step = parameter.setting.split(".")[-2:][0]
    ontology = semantic_map.ontology
    return [
        thing
        for thing in semantic_map.objects
        if thing.pose is not None
        and parameter.fits(semantic_map, thing)
        and any(step.endswith(_noun(cls)) for own in thing.types for cls in ontology.ancestors(own))
    ]


def _noun(cls: str) -> str:
    """Return "Cabinet" of Cabinet-PieceOfFurniture; what Object-SupportingFurniture supports is no name of it."""
    name, _, kind = local_name(cls).partition("-")
    return name + kind if kind.startswith("Supporting") else name


def _missing(parameter: PlanParameter, semantic_map: SemanticMap) -> Diagnostic:
    """Return an error for a parameter that has to be set."""
    message = f"the plan does not run without --set {parameter.setting}=X"
    if float in parameter.types:
        return error("X014", message, help=f"a number, such as --set {parameter.setting}=30; times are in seconds")
    if not {Object, Person, Location}.intersection(parameter.types):
        return error("X014", f"{message}, which takes no thing of the map", help="give it a default in the plan")
    advice = _fitting(parameter, semantic_map)
    if parameter.takes_places:
        advice += f'; or a phrase such as --set {parameter.setting}="on the table"'
    return error("X014", message, help=advice)


def _bound(parameter: PlanParameter, text: str, semantic_map: SemanticMap, found: list[Diagnostic]) -> Bound:
    """Return the thing or location that a parameter is set to; raises BadInput."""
    if float in parameter.types:
        return _number(parameter, text)
    thing, default = semantic_map.find(text), parameter.default
    if thing is None or (thing.pose is None and not is_content(thing)):
        if parameter.takes_places and thing is None and " " in text.strip():
            from executive.runs.phrases import read_phrase  # the grammar of phrases takes long to import

            return read_phrase(text, semantic_map, f"--set {parameter.setting}")
        what = "is not in the map" if thing is None else "has no place in the map"
        raise BadInput([error("X005", f"{text!r} {what}", help=_fitting(parameter, semantic_map, text))])
    classes = ", ".join(shorten(cls) for cls in thing.types)
    if default is None and parameter.fits(semantic_map, thing):
        kind = Person if semantic_map.is_a(thing, "Person") else Object
        return kind(shorten(thing.types[0]), thing.iri)
    if default is not None and semantic_map.is_a(thing, default.type):
        return replace(default, iri=thing.iri)
    if default is not None and _is_alike(semantic_map, thing, default):
        message = f"{text} is a {classes}, where the recipe speaks of a {default.type}"
        found.append(warning("X006", message, help="the plan treats it as what it is"))
        return replace(default, iri=thing.iri, type=shorten(thing.types[0]))
    message = f"{text} is a {classes}, but {parameter.setting} must be a {_wanted(parameter)}"
    raise BadInput([error("X006", message, help=_fitting(parameter, semantic_map))])


ALL = "all"
"""The word that stands for all things of a map."""


def unknown_things(semantic_map: SemanticMap, words: Sequence[str]) -> tuple[str, ...]:
    """Return the names of things, without rooms, that words mean: a thing, a class, or :data:`ALL`.

    Raises BadInput for a word that means nothing in the map.
    """
    rooms = [one for one in semantic_map.objects if semantic_map.is_a(one, "RoomInAConstruction")]
    things = [one for one in semantic_map.objects if one not in rooms and one.pose is not None]
    found: dict[str, None] = {}
    for word in words:
        meant = [one.name for one in things if word in (ALL, one.name, one.iri) or semantic_map.is_a(one, word)]
        if not meant:
            names = [one.name for one in things]
            types = dict.fromkeys(cls for one in things for cls in one.types)
            classes = (local_name(above) for cls in types for above in semantic_map.ontology.ancestors(cls))
            advice = f"{guess(word, (*names, *classes))}--unknown may be all, or {_listed(names)}"
            raise BadInput([error("X005", f"{word!r} is not in the map", help=advice)])
        found.update(dict.fromkeys(meant))
    return tuple(found)


def _number(parameter: PlanParameter, text: str) -> float:
    """Return the number that a parameter is set to; raises BadInput."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number >= 0):
        raise BadInput([error("X006", f"{text!r} is no number from 0 on, as {parameter.setting} must be")])
    return number


def _wanted(parameter: PlanParameter) -> str:
    """Return the class of what a parameter takes."""
    if parameter.default is not None:
        return parameter.default.type
    return " or ".join(cls.__name__.lower() for cls in parameter.types)


def _is_alike(semantic_map: SemanticMap, thing: MapObject, default: Object) -> bool:
    """Return True if a class directly above that of the recipe's individual is also above that of the thing."""
    if default.iri is None:
        return False
    return any(semantic_map.is_a(thing, cls) for cls in semantic_map.ontology.parents(default.type))


def _fitting(parameter: PlanParameter, semantic_map: SemanticMap, absent: str | None = None) -> str:
    """Return to what a parameter may be bound: the things with a place that fit; if there are none, all but joints.

    ``absent``, a thing that the map lacks: also what may have been meant by it, and where there is such a thing.
    """
    joint = expand("Joint-Physical")
    things = (one for one in semantic_map.objects if one.pose is not None and not semantic_map.is_a(one, joint))
    placed = {thing.name: thing for thing in things}
    right = [name for name, one in placed.items() if parameter.fits(semantic_map, one)]
    fitting = parameter.likely(semantic_map, right)
    said = f"nothing in the map is a {_wanted(parameter)}; things with a place: {_listed(list(placed))}"
    if fitting:
        said = f"{parameter.setting} may be {_listed(fitting)}"
    elif right:
        said = "the map has nothing that a hand could take; add one that has: --environment MAP"
    if absent is None:
        return said
    short = local_name(absent)
    alike = similar(short, fitting) or similar(short, placed)
    others = [one for one in placed if one not in fitting]
    if alike:
        said = f"did you mean --set {parameter.setting}={alike[0]}? {said}"
    if fitting and others:
        said += f"; the map also has {_listed(others)}"
    if there := environments_with((absent,)):
        said += f"; {absent} is in a bundled environment: --environment {' or '.join(there)}"
    return said


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more
