"""Parameters of a plan: their valid values, and their bindings by the option ``set``."""

from __future__ import annotations

import inspect
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args, get_type_hints

from executive.maps import MapObject, SemanticMap, scene_of
from executive.maps.classes import is_kind
from executive.maps.contents import is_content
from executive.maps.environments import environments_with
from executive.maps.semantic_map import namesakes
from planlang.action_classes import nearest_unstated
from planlang.designators import ActionClass, Location, Object, Person, is_called, local_name
from planlang.diagnostics import BadInput, Diagnostic, error, note, warning
from planlang.language.plans import Plan
from planlang.ontology import expand, shorten
from planlang.records import dataclass
from planlang.spelling import guess, similar
from planlang.words import Blank, Option, Text

ON_WHAT_STAYS = ("OpeningSomething", "ClosingSomething", "TurningOnPoweredDevice", "TurningOffPoweredDevice")
"""Classes of actions on furniture and devices."""
ON_WHAT_IS_TAKEN = ("HoldingAnObject", "PickingUpAnObject", "TakingSomething", "FetchingAnObject")
"""Classes of actions after which a hand holds what they act on."""
MOST_NAMES = 20
"""Maximum number of things that one message lists."""

ANY, MORE = Blank("X"), Option("environment", Blank("MAP"))

Bound = Object | Location | float
"""Value of a parameter."""


@dataclass(frozen=True, slots=True)
class PlanParameter:
    """Parameter of a plan: ``setting`` is its name in the option ``set``, ``types`` the classes of its values.

    Without a ``default`` the user has to bind it.
    """

    name: str
    setting: str
    types: tuple[type, ...]
    default: Object | None = None
    actions: tuple[str, ...] = ()
    """Known action classes of the step that acts on it; empty if none does."""

    def likely(self, semantic_map: SemanticMap, names: Sequence[str]) -> list[str]:
        """Select from ``names`` things that the step is likely to act on: graspable ones, unless it opens or switches.

        The name of a step may end in a class of things; these are selected. If nothing is likely, all are, unless a
        hand has to take it.
        """
        if not self.actions:
            return [*names]
        if things := _named_by_step(self, semantic_map):
            return [thing.name for thing in things]
        above = {cls for one in self.actions for cls in semantic_map.ontology.ancestors(one)}
        stays, taken = (any(expand(cls) in above for cls in group) for group in (ON_WHAT_STAYS, ON_WHAT_IS_TAKEN))
        graspable = {body.name for body in scene_of(semantic_map, []).bodies if body.graspable}
        likely = [name for name in names if (name in graspable) != stays]
        return likely if likely or taken else [*names]

    @property
    def takes_places(self) -> bool:
        """True if a location is a valid value."""
        return Location in self.types

    def fits(self, semantic_map: SemanticMap, thing: MapObject) -> bool:
        """Check whether a thing has the class of the default, or without a default one of the parameter's types."""
        if self.default is not None:
            cls = expand(self.default.type)
            return semantic_map.is_a(thing, cls) or _is_similar(semantic_map, thing, self.default)
        return (Person if semantic_map.is_a(thing, "Person") else Object) in self.types


def plan_parameters(plan: Plan[Any, Any]) -> dict[str, PlanParameter]:
    """Parameters of a plan that have an object as default, or no default."""
    parameters = {}
    hints = _hints(plan)
    for name, parameter in inspect.signature(plan.function).parameters.items():
        if parameter.kind in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
            continue
        annotation = hints.get(name)
        setting = next((text for text in getattr(annotation, "__metadata__", ()) if isinstance(text, str)), name)
        bare = getattr(annotation, "__origin__", annotation) if hasattr(annotation, "__metadata__") else annotation
        types = tuple(cls for cls in get_args(bare) or (bare,) if isinstance(cls, type))
        if isinstance(parameter.default, Object):
            parameters[name] = PlanParameter(name, setting, types, parameter.default)
        elif parameter.default is parameter.empty:
            parameters[name] = PlanParameter(name, setting, types, actions=_actions_on(plan, setting))
    return parameters


def _actions_on(plan: Plan[Any, Any], setting: str) -> tuple[str, ...]:
    """Known classes of the action on the thing that a setting names."""
    step, _, role = setting.rpartition(".")
    classes = (one for one in inspect.unwrap(plan.function).__globals__.values() if isinstance(one, ActionClass))
    step = step.rpartition(".")[2]
    cls = next((one for one in classes if local_name(one) == step), step)
    return nearest_unstated(cls) if role == "objectActedOn" else ()


def _hints(plan: Plan[Any, Any]) -> dict[str, Any]:
    """Type hints of a plan's parameters; empty if one of them cannot be evaluated."""
    try:
        return get_type_hints(plan.function, include_extras=True)
    except Exception:  # an annotation is any expression, which may raise anything
        return {}


def stated_bindings(plan: Plan[Any, Any], bound: Mapping[str, Bound], semantic_map: SemanticMap) -> dict[str, str]:
    """Values of the option ``set`` for the parameters that differ from the plan's defaults in this map."""
    try:
        defaults = bound_parameters(plan, {}, semantic_map, [])
    except BadInput:
        defaults = {}
    set_ = {name: value for name, value in bound.items() if value != defaults.get(name)}
    return {name: local_name(getattr(value, "iri", None) or str(value)) for name, value in set_.items()}


def bound_parameters(
    plan: Plan[Any, Any], bindings: Mapping[str, str], semantic_map: SemanticMap, diagnostics: list[Diagnostic]
) -> dict[str, Bound]:
    """Bind the plan's parameters to their defaults, or to things of the map that the user names by IRI or local name.

    A thing must have the class of the default; for an individual of the recipe, a sibling class is valid, too, with a
    warning in ``diagnostics``. A location may be given as a phrase. The default of what a step such as
    OpeningARefrigerator acts on is the only refrigerator of the map. Raises BadInput, with valid values, for an unknown
    parameter, an unknown or unsuitable thing, and a parameter that is not bound.
    """
    parameters = plan_parameters(plan)
    bound: dict[str, Bound] = {name: one.default for name, one in parameters.items() if one.default is not None}
    problems: list[Diagnostic] = []
    settings = dict(_settings(parameters, bindings, problems))
    for name, text in settings.items():
        try:
            bound[name] = _bound(parameters[name], text, semantic_map, diagnostics)
        except BadInput as problem:
            problems += problem.diagnostics
    for name in (name for name in parameters if name not in bound and name not in settings):
        if len(things := _named_by_step(parameters[name], semantic_map)) == 1:
            bound[name] = _bound(parameters[name], things[0].iri, semantic_map, diagnostics)
            message = (
                f"{parameters[name].setting} is {things[0].name}, the only one of the class in the name of the step"
            )
            diagnostics.append(
                note("X028", message, help=Text(_set(parameters[name].setting), " chooses another thing"))
            )
    missing = [one for name, one in parameters.items() if name not in bound and name not in settings]
    problems += [_missing(one, semantic_map) for one in missing]
    if problems:
        raise BadInput(problems)
    return {name: bound[name] for name in parameters}


def not_in_map(bound: Mapping[str, Bound], semantic_map: SemanticMap, made: Collection[str]) -> Iterator[Diagnostic]:
    """Yield a diagnostic for each individual that the map lacks, for which a thing of its class is used.

    It is a warning if there are several: the nearest may be the wrong one; an error in a recipe for this very map, of
    which it names other things: what is missing there is missing. Excludes parameters that the plan itself creates
    (``made``).
    """
    in_map = {thing.iri for thing in semantic_map.objects}
    things = [what for name, value in bound.items() if name not in made for what in things_of(value)]
    own = {_namespace(what.iri) for what in things if what.iri is not None and what.iri in in_map}
    for what in dict.fromkeys(one for one in things if one.iri is not None and one.iri not in in_map):
        placed = [thing for thing in semantic_map.objects if thing.pose is not None]
        named = namesakes(semantic_map.ontology, placed, what)
        alike = [one for one in placed if any(is_kind(semantic_map.ontology, cls, what.type) for cls in one.types)]
        fitting = named or alike
        if not fitting:
            continue
        message = f"{local_name(what.iri or '')} of the recipe ({what.iri}) is not in the map"
        is_for_this_map = not named and _namespace(what.iri or "") in own
        if len(fitting) == 1 and not is_for_this_map:
            reason = f"its only {what.type}" if len(alike) == 1 else f"its {what.type} of that name ({named[0].iri})"
            yield note("X029", f"{message}: using {fitting[0].name}, {reason}")
            continue
        known = _listed([thing.name for thing in fitting])
        names = [name for name, value in bound.items() if value == what]
        advice = "name one in the recipe by its IRI in the map"
        if names:
            advice = Text("choose one: ", _set(names[0], fitting[0].name))
        if is_for_this_map:
            yield error("X029", f"{message}, which has other things of the recipe; it has {known}", help=advice)
            continue
        yield warning("X029", f"{message}: using the {what.type} nearest to the robot, of {known}", help=advice)


def _namespace(iri: str) -> str:
    return iri.removesuffix(local_name(iri))


def things_of(value: Bound) -> Iterator[Object]:
    """Yield the things in a value."""
    if not isinstance(value, float):
        yield from value.things() if isinstance(value, Location) else (value,)


def _settings(
    parameters: Mapping[str, PlanParameter], bindings: Mapping[str, str], problems: list[Diagnostic]
) -> Iterator[tuple[str, str]]:
    """Yield the names of the parameters that the user sets, and their values."""
    known_settings = {setting: name for name, one in parameters.items() for setting in (one.setting, name)}
    for setting, text in bindings.items():
        if setting in known_settings:
            yield known_settings[setting], text
            continue
        known = ", ".join(one.setting for one in parameters.values()) or "none"
        alike = similar(setting, known_settings)
        guess = Text("did you mean ", _set(alike[0], text), "? ") if alike else ""
        bound = (
            "; what the recipe states of a step is bound, and changed there or in the plan" if "." in setting else ""
        )
        help = Text(guess, f"its parameters: {known}{bound}")
        problems.append(error("X004", f"the plan has no parameter {setting!r}", help=help))


def _named_by_step(parameter: PlanParameter, semantic_map: SemanticMap) -> list[MapObject]:
    """Things of the map with a class whose name is the end of the name of the parameter's step."""
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
    """Cabinet for Cabinet-PieceOfFurniture; but Object-SupportingFurniture is not called by what it supports."""
    name, _, kind = local_name(cls).partition("-")
    return name + kind if kind.startswith("Supporting") else name


def _missing(parameter: PlanParameter, semantic_map: SemanticMap) -> Diagnostic:
    """Error for a parameter that has to be set."""
    message = Text("the plan needs ", _set(parameter.setting))
    if float in parameter.types:
        number = Text("a number, such as ", _set(parameter.setting, 30), "; times are in seconds")
        return error("X014", message, help=number)
    if not {Object, Person, Location}.intersection(parameter.types):
        return error(
            "X014",
            Text(message, ", but its type is no thing of a map"),
            help="give the parameter a default in the plan",
        )
    advice = _fitting(parameter, semantic_map)
    if parameter.takes_places:
        advice = Text(advice, "; or a phrase such as ", _set(parameter.setting, "on the table"))
    return error("X014", message, help=advice)


def _bound(parameter: PlanParameter, text: str, semantic_map: SemanticMap, diagnostics: list[Diagnostic]) -> Bound:
    """Resolve the value of a setting. Raises BadInput."""
    if float in parameter.types:
        return _number(parameter, text)
    thing, default = semantic_map.find(text), parameter.default
    if thing is None or (thing.pose is None and not is_content(thing)):
        if parameter.takes_places and thing is None and " " in text.strip():
            from executive.runs.phrases import read_phrase  # the grammar of phrases is slow to import

            return read_phrase(text, semantic_map, Text(Option("set"), f" {parameter.setting}"))
        what = "is not in the map" if thing is None else "has no pose in the map"
        raise BadInput([error("X005", f"{text!r} {what}", help=_fitting(parameter, semantic_map, text))])
    classes = ", ".join(shorten(cls) for cls in thing.types)
    if default is None and parameter.fits(semantic_map, thing):
        kind = Person if semantic_map.is_a(thing, "Person") else Object
        return kind(shorten(thing.types[0]), thing.iri)
    if default is not None and semantic_map.is_a(thing, default.type):
        return replace(default, iri=thing.iri)
    if default is not None and _is_similar(semantic_map, thing, default):
        message = f"{text} is a {classes}, but the recipe asks for a {default.type}"
        diagnostics.append(warning("X006", message, help=f"the plan treats it as a {shorten(thing.types[0])}"))
        return replace(default, iri=thing.iri, type=shorten(thing.types[0]))
    message = f"{text} is a {classes}, but {parameter.setting} must be a {_type_of(parameter)}"
    raise BadInput([error("X006", message, help=_fitting(parameter, semantic_map))])


ALL = "all"
"""Stands for all things of a map."""


def unknown_things(semantic_map: SemanticMap, words: Sequence[str]) -> tuple[str, ...]:
    """Names of the things, except rooms, that words select: a thing, a class, or :data:`ALL`.

    Raises BadInput for a word that selects nothing.
    """
    rooms = [one for one in semantic_map.objects if semantic_map.is_a(one, "RoomInAConstruction")]
    things = [one for one in semantic_map.objects if one not in rooms and one.pose is not None]
    selected: dict[str, None] = {}
    for word in words:
        names = [
            one.name
            for one in things
            if word in (ALL, one.name) or is_called(one.iri, word) or semantic_map.is_a(one, word)
        ]
        if not names:
            known = [one.name for one in things]
            types = dict.fromkeys(cls for one in things for cls in one.types)
            classes = (local_name(above) for cls in types for above in semantic_map.ontology.ancestors(cls))
            alike = guess(word, (*known, *classes))
            advice = Text(alike, Option("unknown"), f" may be all, or {_listed(known)}")
            raise BadInput([error("X005", f"{word!r} is not in the map", help=advice)])
        selected.update(dict.fromkeys(names))
    return tuple(selected)


def _number(parameter: PlanParameter, text: str) -> float:
    """Parse the number that a parameter is set to. Raises BadInput."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (math.isfinite(number) and number >= 0):
        raise BadInput([error("X006", f"{parameter.setting} must be a number of at least 0, not {text!r}")])
    return number


def _type_of(parameter: PlanParameter) -> str:
    """Class of the values of a parameter, in words."""
    if parameter.default is not None:
        return parameter.default.type
    return " or ".join(cls.__name__.lower() for cls in parameter.types)


def _is_similar(semantic_map: SemanticMap, thing: MapObject, default: Object) -> bool:
    """Check whether a direct superclass of the class of the recipe's individual includes the thing."""
    if default.iri is None:
        return False
    return any(semantic_map.is_a(thing, cls) for cls in semantic_map.ontology.parents(default.type))


def _fitting(parameter: PlanParameter, semantic_map: SemanticMap, absent: str | None = None) -> str:
    """Advise valid values of a parameter: suitable things with a pose; if there are none, all things but joints.

    For a thing that the map lacks (``absent``), also similar names, and bundled environments that have it.
    """
    joint = expand("Joint-Physical")
    things = (one for one in semantic_map.objects if one.pose is not None and not semantic_map.is_a(one, joint))
    placed = {thing.name: thing for thing in things}
    right = [name for name, one in placed.items() if parameter.fits(semantic_map, one)]
    fitting = parameter.likely(semantic_map, right)
    advice = f"nothing in the map is a {_type_of(parameter)}; things with a pose: {_listed(list(placed))}"
    if fitting:
        advice = f"{parameter.setting} may be {_listed(fitting)}"
    elif right:
        advice = Text("nothing in the map is graspable; add a map with such a thing: ", MORE)
    if absent is None:
        return advice
    short = local_name(absent)
    alike = similar(short, fitting) or similar(short, placed)
    others = [one for one in placed if one not in fitting]
    if alike:
        advice = Text("did you mean ", _set(parameter.setting, alike[0]), "? ", advice)
    if fitting and others:
        advice = Text(advice, f"; the map also has {_listed(others)}")
    if environments := environments_with((absent,)):
        there = Option("environment", Blank(" or ".join(environments)))
        advice = Text(advice, f"; {absent} is in a bundled environment: ", there)
    return advice


def _set(setting: str, value: object = ANY) -> Option:
    """The option that sets a parameter."""
    return Option("set", {setting: value})


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more
