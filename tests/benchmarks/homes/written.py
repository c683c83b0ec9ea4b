"""Homes and tasks as files: a semantic map and a recipe in Manchester syntax, as a user writes them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tests.benchmarks.homes.furnishing import Home, Thing

MAP = "http://homes.example/home.owl"
RECIPE = "http://homes.example/task.owl"
KNOWROB = """Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
"""


@dataclass(frozen=True)
class Step:
    """A step of a recipe: a class of actions and what it states, as (property, filler).

    A filler is the name of a thing of the home, a place (:func:`place`), or a number.
    """

    cls: str
    facts: tuple[tuple[str, str], ...]


def place(relation: str, thing: str) -> str:
    """Return the filler that is a place with a relation to a thing, such as ``on-Physical`` a table."""
    return f"{relation} {thing}"


def map_text(home: Home) -> str:
    """Return the map of a home."""
    lines = [
        f"Prefix: : <{MAP}#>",
        KNOWROB,
        f"Ontology: <{MAP}>",
        "    Import: <http://knowrob.org/kb/knowrob.owl>",
        "",
    ]
    lines += [f"Class: {name}\n    SubClassOf: {above}\n" for name, above in home.classes.items()]
    lines += ["Individual: home", "    Types: knowrob:SemanticEnvironmentMap", ""]
    for thing in home.things.values():
        lines += _individual(thing, home)
    return "\n".join(lines) + "\n"


def _individual(thing: Thing, home: Home) -> list[str]:
    facts = ["knowrob:describedInMap home", *thing.facts]
    if thing.size is not None:
        extents = zip(("depthOfObject", "widthOfObject", "heightOfObject"), thing.size, strict=True)
        facts += [f"knowrob:{name} {value:.4f}" for name, value in extents]
    facts += [f"knowrob:properPhysicalParts {part}" for part in thing.parts]
    if thing.pose is not None:
        facts.append(f"knowrob:pose pose_{thing.name}")
    lines = [f"Individual: {thing.name}", f"    Types: {_class(thing.cls, home)}", f"    Facts: {', '.join(facts)}", ""]
    if thing.pose is not None:
        at = " ".join(f"{value:.4f}" for value in thing.pose.position)
        turn = " ".join(f"{value:.7f}" for value in thing.pose.orientation)
        lines += [
            f"Individual: pose_{thing.name}",
            "    Types: knowrob:RotationMatrix3D",
            f'    Facts: knowrob:translation "{at}", knowrob:quaternion "{turn}"',
            "",
        ]
    return lines


def _class(name: str, home: Home) -> str:
    return f":{name}" if name in home.classes else f"knowrob:{name}"


def recipe_text(steps: Sequence[Step], home: Home) -> str:
    """Return a recipe of steps, one after the other."""
    names = [f"Step{number}" for number in range(1, len(steps) + 1)]
    lines = [
        f"Prefix: : <{RECIPE}#>",
        KNOWROB + f"Prefix: home: <{MAP}#>",
        f"Ontology: <{RECIPE}>",
        "    Import: <http://knowrob.org/kb/knowrob.owl>",
        "",
    ]
    lines += [
        f"Individual: home:{name}\n    Types: {_foreign(home.things[name].cls, home)}\n" for name in _used(steps, home)
    ]
    places: dict[str, str] = {}
    for step in steps:
        for _, filler in step.facts:
            if " " in filler and filler not in places:
                relation, thing = filler.split()
                places[filler] = f"place{len(places) + 1}"
                lines += [
                    f"Individual: {places[filler]}",
                    "    Types: knowrob:Point3D",
                    f"    Facts: knowrob:{relation} home:{thing}",
                    "",
                ]
    lines += ["Class: TheTask", "    SubClassOf:", "        knowrob:PurposefulAction,"]
    parts = [f"        knowrob:subAction some {name}" for name in names]
    parts += [f"        knowrob:orderingConstraints value {one}Before{two}" for one, two in itertools.pairwise(names)]
    lines += [",\n".join(parts), ""]
    for one, two in itertools.pairwise(names):
        lines += [
            f"Individual: {one}Before{two}",
            "    Types: knowrob:PartialOrdering-Strict",
            f"    Facts: knowrob:occursBeforeInOrdering {one}, knowrob:occursAfterInOrdering {two}",
            "",
        ]
    for name, step in zip(names, steps, strict=True):
        stated = [f"        knowrob:{step.cls}"]
        stated += [f"        knowrob:{prop} value {_filler(filler, home, places)}" for prop, filler in step.facts]
        lines += [f"Class: {name}", "    SubClassOf:", ",\n".join(stated), ""]
    return "\n".join(lines) + "\n"


def while_seen_text(cls: str, at: str, to: str, home: Home) -> str:
    """Return a recipe: while something of a class is seen from before furniture, bring one to another place."""
    tables = "\n".join(
        f"Individual: home:{one}\n    Types: {_foreign(home.things[one].cls, home)}\n" for one in (at, to)
    )
    states = [("Drive", "Look", "COMPLETED_OK"), ("Look", "Bring", "CONDITION_TRUE"),
              ("Bring", "Drive", "COMPLETED_OK"), ("Look", "Rest", "CONDITION_FALSE")]  # fmt: skip
    stated = ",\n".join(f"        knowrob:stateTransition value t{number}" for number, _ in enumerate(states))
    changes = "\n".join(
        f"Individual: t{number}\n    Types: knowrob:IntrinsicStateChangeEvent\n"
        f"    Facts: knowrob:fromState {one}, knowrob:toState {two}, knowrob:causedBy knowrob:{why}\n"
        for number, (one, two, why) in enumerate(states)
    )
    return f"""Prefix: : <{RECIPE}#>
{KNOWROB}Prefix: home: <{MAP}#>

Ontology: <{RECIPE}>
    Import: <http://knowrob.org/kb/knowrob.owl>

{tables}
Individual: before
    Types: knowrob:Point3D
    Facts: knowrob:near home:{at}, knowrob:visibleFrom home:{at}

Class: TheTask
    SubClassOf: knowrob:PurposefulAction,
        knowrob:subAction some Drive, knowrob:subAction some Look,
        knowrob:subAction some Bring, knowrob:subAction some Rest,
        knowrob:taskStartState value Drive, knowrob:taskEndState value Rest,
{stated}

{changes}
Class: Drive
    SubClassOf: knowrob:Translation-LocationChange, knowrob:toLocation value before

Class: Look
    SubClassOf: knowrob:CheckingWhetherConditionObtains,
        knowrob:conditionEvaluated some (knowrob:VisualPerception and (knowrob:detectedObject some knowrob:{cls}))

Class: Bring
    SubClassOf: knowrob:TransportingAnObject,
        knowrob:objectActedOn some knowrob:{cls}, knowrob:toLocation value home:{to}

Class: Rest
    SubClassOf: knowrob:WaitForPredefinedTimeInterval, knowrob:duration value 1.0
"""


def _used(steps: Iterable[Step], home: Home) -> list[str]:
    words = (word for step in steps for _, filler in step.facts for word in filler.split())
    return list(dict.fromkeys(word for word in words if word in home.things))


def _foreign(cls: str, home: Home) -> str:
    return f"home:{cls}" if cls in home.classes else f"knowrob:{cls}"


def _filler(filler: str, home: Home, places: dict[str, str]) -> str:
    if filler in places:
        return places[filler]
    return f"home:{filler}" if filler in home.things else filler
