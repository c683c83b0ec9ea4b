"""Generate Python source from the plan tree: header, imports, constants, places, plan functions."""

from __future__ import annotations

import re
import textwrap

from planlang.compiler.bodies import BodyWriter
from planlang.compiler.layout import INDENT, WIDTH, Expression, Text, assignment, call, sequence, signature, statement
from planlang.compiler.names import Symbols, is_iri, quoted
from planlang.compiler.tree import Function, PlanTree
from planlang.designators import local_name
from planlang.outputs import PlanHeader, digest
from planlang.recipe.model import Kind, Place, RecipeSet, Thing
from planlang.relations import RELATIONS

TYPES = {Kind.OBJECT: "Object", Kind.PERSON: "Person", Kind.DEVICE: "Device"}
MAKERS = {Kind.OBJECT: "an_object", Kind.PERSON: "a_person", Kind.DEVICE: "a_device"}


def emit(
    tree: PlanTree, recipes: RecipeSet, version: str, options: tuple[str, ...] = ()
) -> tuple[str, tuple[str, ...]]:
    """Return the source of a plan module and the names of its plan functions; formatted, deterministic.

    Functions stand before their callers, constants and places in the order in which the plan first uses them.
    ``options`` are those of the compiler that shaped the tree.
    """
    symbols = Symbols(tree, recipes)
    for function in tree.functions:
        for thing in function.parameters:
            symbols.thing(thing)
    functions = [_function(symbols, function) for function in tree.functions]
    places = _places(symbols)
    constants = [line for thing in symbols.things() for line in _thing(symbols, thing)]
    constants += [line for place in symbols.places() if place.is_posture for line in _posture(symbols, place)]
    parts = ["", *_imports(symbols), "", *_namespaces(symbols)]
    if constants:
        parts += ["", *constants]
    for block in [*places, *functions]:
        parts += ["", "", *block]
    below = "\n".join(parts) + "\n"
    source = "\n".join([*_header(recipes, version, options, digest(f'""""""\n{below}')), below])
    return source, tuple(symbols.functions[function.iri] for function in tree.functions)


def humanised(name: str) -> str:
    """Return a name as a sentence: ``ServeADrink`` becomes ``Serve a drink``."""
    words = re.sub(r"[_\-]+", " ", re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)).split()
    text = " ".join(word if word.isupper() and len(word) > 1 else word.lower() for word in words)
    return text[:1].upper() + text[1:]


def _header(recipes: RecipeSet, version: str, options: tuple[str, ...], below: str) -> list[str]:
    source, main = recipes.source, recipes.main
    origin = PlanHeader(version, source.file, source.sha256, main.name, options, below)
    return _docstring([_sentence(main.label or humanised(main.name)), "", *origin.paragraphs()], depth=0)


def _imports(symbols: Symbols) -> list[str]:
    lines: list[str] = []
    imports = symbols.imports()
    standard = [entry for entry in imports if not entry[0].startswith("planlang")]
    ours = [entry for entry in imports if entry[0].startswith("planlang")]
    for group in (standard, ours):
        if lines and group:
            lines.append("")
        for module, names in group:
            line = f"from {module} import {', '.join(names)}"
            if len(line) <= WIDTH:
                lines.append(line)
            else:
                lines += [f"from {module} import (", *(f"{INDENT}{name}," for name in names), ")"]
    return lines


def _namespaces(symbols: Symbols) -> list[str]:
    return [
        line for name, start in symbols.namespaces() for line in assignment([Text(name)], Text(quoted(start)), depth=0)
    ]


def _thing(symbols: Symbols, thing: Thing) -> list[str]:
    arguments: list[Expression | str] = [quoted(thing.type) if not is_iri(thing.type) else symbols.iri(thing.type)]
    if thing.iri is not None:
        arguments.append(symbols.iri(thing.iri))
    return assignment([Text(symbols.constant(thing))], call(symbols.use(MAKERS[thing.kind]), *arguments), depth=0)


def _posture(symbols: Symbols, place: Place) -> list[str]:
    return assignment([Text(symbols.place(place))], call(symbols.use("a_posture"), quoted(place.name)), depth=0)


def _places(symbols: Symbols) -> list[list[str]]:
    """Place functions by first use; writing one may bring in others that it refers to."""
    written: dict[str, list[str]] = {}
    while missing := [place for place in symbols.places() if not place.is_posture and place.iri not in written]:
        for place in missing:
            written[place.iri] = _place(symbols, place)
    return list(written.values())


def _place(symbols: Symbols, place: Place) -> list[str]:
    relations: dict[str, list[Expression]] = {}
    phrases: list[str] = []
    for relation, reference in place.relations:
        expression, words = _reference(symbols, reference)
        relations.setdefault(relation, []).append(expression)
        form = RELATIONS[relation].prose or f"{RELATIONS[relation].forms[0]} {{}}"
        phrases.append(form.format(words))
    keywords: dict[str, Expression | str] = {
        relation: references[0] if len(references) == 1 else sequence(references)
        for relation, references in relations.items()
    }
    device = symbols.devices.get(place.iri)
    if device is not None:
        keywords["using"] = symbols.thing(device)
    phrase = " and ".join(phrases)
    text = f"{place.label.rstrip('. ')}: {phrase}" if place.label else phrase
    parameters = [f"{symbols.thing(thing)}: {symbols.use(TYPES[thing.kind])}" for thing in _parameters(place)]
    return [
        *signature(f"def {symbols.place(place)}", parameters, symbols.use("Location"), depth=0),
        *_docstring([_sentence(text)], depth=1),
        *statement(call(symbols.use("a_location"), quoted(place.name), **keywords), depth=1, before="return "),
    ]


def _reference(symbols: Symbols, reference: Thing | Place) -> tuple[Expression, str]:
    """Return what a place refers to, as an expression and in words."""
    name = symbols.thing(reference) if isinstance(reference, Thing) else symbols.place(reference)
    words = f"the {name.lower().replace('_', ' ')}"
    if isinstance(reference, Thing) or reference.is_posture:
        return Text(name), words
    return call(name, *[symbols.thing(thing) for thing in _parameters(reference)]), words


def _parameters(place: Place) -> list[Thing]:
    return [thing for thing in dict.fromkeys(place.things()) if thing.kind is not Kind.DEVICE]


def _function(symbols: Symbols, function: Function) -> list[str]:
    name = symbols.functions[function.iri]
    parameters = [
        f"{symbols.thing(thing)}: {symbols.use(TYPES[thing.kind])} = {symbols.constant(thing)}"
        for thing in function.parameters
    ]
    title = _sentence(function.label or humanised(local_name(function.iri)))
    body = BodyWriter(symbols, name, function.body).lines()
    first = next((line.lstrip() for line in body if not line.lstrip().startswith("#")), "")
    if first.startswith("async def "):
        body.insert(0, "")
    return [
        *statement(call("@" + symbols.use("plan"), symbols.iri(function.iri)), depth=0),
        *signature(f"async def {name}", ["*", *parameters] if parameters else [], "None", depth=0),
        *_docstring([title], depth=1),
        *body,
    ]


def _docstring(paragraphs: list[str], *, depth: int) -> list[str]:
    """Return a docstring; characters that would end it or form an escape are escaped."""
    indent = INDENT * depth
    lines: list[str] = []
    for paragraph in paragraphs:
        text = " ".join(paragraph.split()).replace("\\", "/").replace('"', "'")
        lines += textwrap.wrap(text, WIDTH - len(indent) - 6, break_long_words=False, break_on_hyphens=False) or [""]
    if len(lines) == 1:
        return [f'{indent}"""{lines[0]}"""']
    return [f'{indent}"""{lines[0]}', *((indent + line).rstrip() for line in lines[1:]), f'{indent}"""']


def _sentence(text: str) -> str:
    text = " ".join(text.split())
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
