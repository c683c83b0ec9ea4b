"""Checks of requirements: capabilities and components that nothing defines, or that no robot can have."""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error, warning
from planlang.ontology import BNode, Ontology, Restriction, expand
from planlang.recipe.checks import CheckedFile, check
from planlang.recipe.checks.misspellings import guess
from planlang.recipe.model import Recipe, Step
from planlang.recipe.statements import is_word

_WORDS = ("dependsOnCapability", "dependsOnComponent", "hasCapabilityDependency")
_UPPER = {"dependsOnCapability": "Capability", "hasCapabilityDependency": "Capability"}
_ENDINGS = ("Capability", "Component")
_NO_COMPONENTS = ("Capability", "Action", "Event")
_LIKE = 0.7
"""Least similarity (difflib) of names, without their common endings, for one to be suggested for the other."""
_LAST_PART = re.compile(r"(?<=.)[A-Z][a-z]+$")
_DISJOINT = "http://www.w3.org/2002/07/owl#disjointWith"


@check("R046")
def requirements(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report what tasks and their steps depend on, directly or not, if it is undefined, impossible or circular."""
    ontology, recipes = checked.ontology, checked.recipes
    classes: dict[str, None] = {}
    for recipe in recipes.recipes.values():
        owners: tuple[Recipe | Step, ...] = (recipe, *recipe.steps)
        for owner in owners:
            classes |= dict.fromkeys(ontology.ancestors(owner.action_class))
    seen: dict[str, None] = dict(classes)
    waiting = list(seen)
    for cls in waiting:
        for restriction in _requirements(ontology, cls):
            yield from _judged(ontology, cls, restriction)
            needed = restriction.filler
            if isinstance(needed, str):
                for ancestor in ontology.ancestors(needed):
                    if ancestor not in seen:
                        seen[ancestor] = None
                        waiting.append(ancestor)
    yield from _circles(ontology, list(seen))


def _requirements(ontology: Ontology, cls: str) -> list[Restriction]:
    return [one for one in ontology.restrictions(cls) if is_word(one.property, *_WORDS)]


def _judged(ontology: Ontology, cls: str, restriction: Restriction) -> Iterator[Diagnostic]:
    needed, word = restriction.filler, local_name(restriction.property)
    if not isinstance(needed, (str, BNode)) or restriction.kind in ("max", "only"):
        return
    if isinstance(needed, str) and not ontology.defined(needed):
        meant = guess(needed, _alternatives(ontology, word, _ending(needed)), least=_LIKE, telling=_telling)
        advice = f"did you mean {meant}?" if meant else "import the file that defines it, or correct the name"
        message = f"`{local_name(cls)}` depends on `{local_name(needed)}`, which is not defined"
        yield warning("R046", message, restriction.span, advice, meant)
        return
    both = _excluded(ontology, needed)
    if both is not None:
        names = " and ".join(f"`{local_name(name)}`" for name in both)
        message = f"`{local_name(cls)}` depends on something that is both {names}, which exclude each other"
        yield error("R046", message, restriction.span, "depend on each of them, or on one")


def _alternatives(ontology: Ontology, word: str, ending: str) -> list[str]:
    """Return the classes that may be meant: those with the same ending, if it is one of the uninformative endings."""
    upper = _UPPER.get(word)
    if upper:
        names = ontology.subclasses(expand(upper))[1:]
    else:
        others = {name for top in _NO_COMPONENTS for name in ontology.subclasses(expand(top))}
        names = tuple(name for name in ontology.class_names() if name not in others)
    return [name for name in names if not ending or _ending(name) == ending]


def _ending(name: str) -> str:
    """Return the kind of thing with which a name ends, also if misspelt; empty for other names."""
    last = _LAST_PART.search(local_name(name))
    return next(iter(get_close_matches(last[0], _ENDINGS, n=1, cutoff=0.8)), "") if last else ""


def _telling(name: str) -> str:
    """Return the local name without its ending, which the names of all capabilities share."""
    short = local_name(name)
    return _LAST_PART.sub("", short) if _ending(name) else short


def _excluded(ontology: Ontology, needed: str | BNode) -> tuple[str, str] | None:
    """Two classes above what is needed that are stated to be disjoint."""
    named = [one for one in ontology.members(needed) if isinstance(one, str)]
    above = dict.fromkeys(ancestor for name in named for ancestor in ontology.ancestors(name))
    for cls in above:
        for triple in ontology.triples(s=cls, p=_DISJOINT):
            if isinstance(triple.object, str) and triple.object in above and triple.object != cls:
                return cls, triple.object
    return None


def _circles(ontology: Ontology, classes: list[str]) -> Iterator[Diagnostic]:
    """Capabilities that depend on themselves: available only where a robot states them."""
    below = {
        cls: {one.filler: one for one in _requirements(ontology, cls) if isinstance(one.filler, str)} for cls in classes
    }
    for cls in classes:
        path, seen = [cls], {cls}
        waiting = [(other, [cls, other]) for other in below[cls]]
        while waiting:
            name, path = waiting.pop(0)
            if name == cls:
                circle = " > ".join(f"`{local_name(one)}`" for one in path)
                if cls == min(path):
                    message = f"`{local_name(cls)}` depends on itself: {circle}"
                    yield warning("R046", message, below[cls][path[1]].span, "remove one of these dependencies")
                break
            if name not in seen:
                seen.add(name)
                waiting += [(other, [*path, other]) for other in below.get(name, {})]
