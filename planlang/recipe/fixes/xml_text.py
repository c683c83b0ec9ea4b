"""Fixes as edits of RDF/XML."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field
from xml.parsers import expat
from xml.sax.saxutils import escape

from planlang.designators import local_part
from planlang.diagnostics import Declaration, Span
from planlang.ontology.checks import meant_term
from planlang.ontology.moved_names import canonical
from planlang.ontology.terms import OWL, RDF, RDFS
from planlang.ontology.xml_text import place_of_declarations
from planlang.recipe.fixes import CannotEdit, Edit, Editable, Place
from planlang.records import dataclass

_START = re.compile(r"<[^\s/>\"'<]+(?:[^\"'<>]|\"[^\"<]*\"|'[^'<]*')*>")
_KINDS = {"some": "someValuesFrom", "value": "hasValue"}
_ATTRIBUTE = re.compile(r"\s([^\s=\"']+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")


@dataclass(slots=True)
class Element:
    """An element in the file, with the offsets of its start, the end of its start tag, and its end."""

    tag: str
    name: str
    """The tag with its namespace instead of the prefix."""
    attributes: Mapping[str, str]
    """The attributes, with entities expanded."""
    prefixes: Mapping[str, str]
    parent: Element | None
    start: int
    opened: int = -1
    closing: int = -1
    """Offset of the end tag; -1 for an empty-element tag."""
    end: int = -1
    children: list[Element] = field(default_factory=list)


class XmlText(Editable):
    """RDF/XML file; spans are the starts of elements. If it is malformed, only entities can be declared."""

    def __init__(self, text: str, file: str) -> None:
        super().__init__(text, file)
        self._data = text.encode("utf-8")
        self._bytes = self._characters = 0
        self._stack: list[Element] = []
        self._at: dict[tuple[int, int], Element] = {}
        self._entities: dict[str, str] = {}
        self._problem = ""
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._finish
        self._parser.EntityDeclHandler = self._declared
        try:
            self._parser.Parse(self._data, True)
        except expat.ExpatError as problem:
            self._problem = f"the file is not well-formed XML: {expat.ErrorString(problem.code)}"

    def exchanged(self, first: Span, second: Span) -> list[Edit]:
        a, b = self._value(self._property(first), "resource"), self._value(self._property(second), "resource")
        return [Edit(a[0], a[1], self.text[b[0] : b[1]]), Edit(b[0], b[1], self.text[a[0] : a[1]])]

    def renamed(self, where: Span, like: Span) -> list[Edit]:
        element = self._element(where)
        name = "resource" if RDF + "resource" in _names(element) else "about"
        start, end = self._value(element, name)
        return [Edit(start, end, self._reference(like))]

    def replaced(self, where: Span, written: str, meant: str) -> list[Edit]:
        element = self._element(where)
        is_local = written.removesuffix(local_part(written)) == meant.removesuffix(local_part(meant))
        if element.name == written:
            namespace = meant.removesuffix(local_part(meant))
            prefix = element.tag.rpartition(":")[0] + ":" if is_local else _prefix(element, namespace)
            return self._tagged(element, prefix.removeprefix(":") + local_part(meant))
        for local in ("resource", "about"):
            if RDF + local in _names(element):
                start, end = self._value(element, local)
                old = local_part(written)
                if not self.text.endswith(old, start, end):
                    continue
                if is_local:
                    return [Edit(end - len(old), end, local_part(meant))]
                return [Edit(start, end, self._in_attribute(element, meant))]
        raise CannotEdit(f"the name {local_part(written)} is not written there")

    def without(self, filler: Span) -> list[Edit]:
        restriction, parent = self._restriction_of(filler)
        if meant_term(parent.name) == RDFS.subClassOf:
            return [self._whole_lines(parent)]
        if parent.name == OWL.intersectionOf and len(parent.children) > 2:
            return [self._whole_lines(restriction)]
        raise CannotEdit("the restriction is neither a superclass nor one of several in an intersection")

    def without_individual(self, where: Span, name: str) -> list[Edit]:
        element = _outermost(self._element(where))
        same = [one for one in self._at.values() if one is not element and _names_it(one, local_part(name))]
        return [self._whole_lines(element)] if _names_it(element, local_part(name)) and not same else []

    def with_kind(self, filler: Span, kind: str) -> list[Edit]:
        element = self._element(filler)
        tag = _KINDS[kind]
        if element.name not in (OWL.someValuesFrom, OWL.hasValue):
            raise CannotEdit("expected owl:someValuesFrom or owl:hasValue there")
        return self._tagged(element, _prefix(element, OWL) + tag)

    def with_ordering(self, place: Place, before: Span, after: Span, suffix: str) -> list[Edit]:
        on_property = self._property(place.sub_action)
        head, local, tail = self._slice(self._value(on_property, "resource")).rpartition(place.word)
        namespace = on_property.attributes[_names(on_property)[RDF + "resource"]].removesuffix(place.word)
        if not local or tail:
            raise CannotEdit(f"the property is not written as {place.word}")
        restriction, parent = self._restriction_of(place.last)
        name = self._reference(place.task) + suffix
        ends = self._reference(before), self._reference(after)
        return [
            self._restriction(restriction, parent, f"{head}orderingConstraints", "hasValue", name),
            self._constraint(_outermost(restriction), name, namespace, _prefix(parent, RDF), ends),
        ]

    def with_sub_action(self, place: Place, step: Span, kind: str) -> list[Edit]:
        property_name = self._slice(self._value(self._property(place.sub_action), "resource"))
        restriction, parent = self._restriction_of(place.last)
        return [self._restriction(restriction, parent, property_name, _KINDS[kind], self._reference(step))]

    def with_declarations(self, declarations: Sequence[Declaration]) -> list[Edit]:
        offset, before, after = place_of_declarations(self.text)
        end = self.line_end()
        lines = [f"{end}    {one}" for one in declarations]
        return [Edit(offset, offset, "".join([before, *lines, f"{end}{after}{end}" if after == "]>" else after]))]

    def with_right_terms(self) -> list[Edit]:
        self._check()
        edits = []
        for element in self._at.values():
            right = meant_term(element.name)
            if right == element.name:
                continue
            local = local_part(right)
            edits += self._tagged(element, _prefix(element, right.removesuffix(local)) + local)
        return edits

    @staticmethod
    def _tagged(element: Element, tag: str) -> list[Edit]:
        """Change the tag of an element."""
        edits = [Edit(element.start + 1, element.start + 1 + len(element.tag), tag)]
        if element.closing >= 0:
            edits.append(Edit(element.closing + 2, element.closing + 2 + len(element.tag), tag))
        return edits

    def _whole_lines(self, element: Element) -> Edit:
        """Remove an element, with its lines if nothing else is on them."""
        start = element.start - len(self.indentation(element.start))
        rest = re.compile(r"[ \t]*\r?\n").match(self.text, element.end)
        is_alone = rest is not None and (start == 0 or self.text[start - 1] == "\n")
        return Edit(start, rest.end(), "") if rest and is_alone else Edit(element.start, element.end, "")

    def _restriction_of(self, filler: Span) -> tuple[Element, Element]:
        """Restriction of a filler, and the element that contains the restriction."""
        restriction = self._element(filler).parent
        parent = restriction.parent if restriction is not None else None
        if restriction is None or parent is None:
            raise CannotEdit("expected a restriction there")
        return restriction, parent

    def _restriction(self, restriction: Element, parent: Element, property_name: str, kind: str, filler: str) -> Edit:
        """Write a restriction after another one, in the same form."""
        owl, rdf = _prefix(parent, OWL), _prefix(parent, RDF)
        inner = restriction.children[0] if restriction.children else restriction
        is_superclass = meant_term(parent.name) == RDFS.subClassOf
        if not is_superclass and parent.name != OWL.intersectionOf:
            raise CannotEdit("the restriction is neither a superclass nor in an intersection")
        behind = parent if is_superclass else restriction
        first = self.indentation(behind.start)
        second = self.indentation(restriction.start)
        third = self.indentation(inner.start) or second + "    "
        lines = [
            f"{second}<{owl}Restriction>",
            f'{third}<{owl}onProperty {rdf}resource="{property_name}"/>',
            f'{third}<{owl}{kind} {rdf}resource="{filler}"/>',
            f"{second}</{owl}Restriction>",
        ]
        if is_superclass:
            lines = [f"{first}<{parent.tag}>", *lines, f"{first}</{parent.tag}>"]
        return Edit(behind.end, behind.end, self.line_end().join(["", *lines]))

    def _constraint(self, behind: Element, name: str, namespace: str, rdf: str, ends: tuple[str, str]) -> Edit:
        """Write the individual of an ordering constraint after an element."""
        declared, prefix = "", ""
        try:
            prefix = _prefix(behind.parent or behind, namespace)
        except CannotEdit:
            if re.search(r"[\"&<]", namespace):
                raise
            prefix, declared = "ordering:", f' xmlns:ordering="{namespace}"'
        indent = self.indentation(behind.start)
        step = indent or "    "
        lines = [
            "",
            "",
            f'{indent}<{prefix}PartialOrdering-Strict{declared} {rdf}about="{name}">',
            f'{indent}{step}<{prefix}occursBeforeInOrdering {rdf}resource="{ends[0]}"/>',
            f'{indent}{step}<{prefix}occursAfterInOrdering {rdf}resource="{ends[1]}"/>',
            f"{indent}</{prefix}PartialOrdering-Strict>",
        ]
        return Edit(behind.end, behind.end, self.line_end().join(lines))

    def _element(self, span: Span) -> Element:
        self.check_file(span)
        self._check()
        element = self._at.get((span.line, span.column))
        if element is None:
            raise CannotEdit("expected an element there")
        return element

    def _check(self) -> None:
        if self._problem:
            raise CannotEdit(self._problem)

    def _property(self, filler: Span) -> Element:
        """The owl:onProperty element of a filler's restriction."""
        restriction = self._element(filler).parent
        for child in restriction.children if restriction is not None else ():
            if child.name == OWL.onProperty:
                return child
        raise CannotEdit("its restriction has no owl:onProperty")

    def _reference(self, span: Span) -> str:
        """Text for rdf:resource that refers to an element."""
        element = self._element(span)
        for local, sign in (("resource", ""), ("about", ""), ("ID", "#")):
            if RDF + local in _names(element):
                return sign + self._slice(self._value(element, local))
        raise CannotEdit("the element has no name")

    def _in_attribute(self, element: Element, iri: str) -> str:
        """IRI in the form that the file uses: with its entity, else with the namespace of its prefix."""
        local = local_part(iri)
        namespace = iri.removesuffix(local)
        for name, value in self._entities.items():
            if canonical(value) == namespace:
                return f"&{name};{escape(local)}"
        declared = next((value for value in element.prefixes.values() if canonical(value) == namespace), namespace)
        return escape(declared + local, {'"': "&quot;"})

    def _value(self, element: Element, local: str) -> tuple[int, int]:
        """Start and end of the value of an RDF attribute in the text."""
        attribute = _names(element).get(RDF + local)
        for match in _ATTRIBUTE.finditer(self.text, element.start, element.opened):
            if match[1] == attribute:
                return match.span(2) if match[2] is not None else match.span(3)
        raise CannotEdit(f"the element has no rdf:{local}")

    def _slice(self, place: tuple[int, int]) -> str:
        value = self.text[place[0] : place[1]]
        if '"' in value:
            raise CannotEdit("a name contains a quotation mark")
        return value

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        parent = self._stack[-1] if self._stack else None
        prefixes = dict(parent.prefixes) if parent is not None else {}
        for key, value in attributes.items():
            if key == "xmlns" or key.startswith("xmlns:"):
                prefixes[key.partition(":")[2]] = value
        element = Element(tag, _resolved(tag, prefixes), attributes, prefixes, parent, self._offset())
        match = _START.match(self.text, max(element.start, 0))
        if match is not None and element.start >= 0 and re.match(rf"<{re.escape(tag)}[\s/>]", match[0]):
            element.opened = match.end()
            self._at[self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1] = element
        if parent is not None:
            parent.children.append(element)
        self._stack.append(element)

    def _declared(self, name: str, is_parameter: int, value: str | None, *_: object) -> None:
        self._entities.setdefault(name, value or "")

    def _finish(self, tag: str) -> None:
        element = self._stack.pop()
        if element.opened < 0:
            return
        if self.text[element.opened - 2] == "/":
            element.end = element.opened
            return
        offset = self._offset()
        if self.text.startswith(f"</{tag}", offset):
            element.closing, element.end = offset, self.text.index(">", offset) + 1

    def _offset(self) -> int:
        """Offset of expat's current character; -1 inside an entity, where positions go backwards."""
        position = self._parser.CurrentByteIndex
        if position < self._bytes:
            return -1
        self._characters += len(self._data[self._bytes : position].decode("utf-8"))
        self._bytes = position
        return self._characters


def _outermost(element: Element) -> Element:
    """Child of the root that the element is, or is inside of."""
    while element.parent is not None and element.parent.parent is not None:
        element = element.parent
    return element


def _names(element: Element) -> dict[str, str]:
    """Written names of attributes with a prefix, by their full names."""
    return {_resolved(key, element.prefixes): key for key in element.attributes if ":" in key}


def _names_it(element: Element, name: str) -> bool:
    """True if an element describes the thing with this local name."""
    names = _names(element)
    written = [element.attributes[names[key]] for key in (RDF + "about", RDF + "ID") if key in names]
    return any(one == name or one.endswith((f"#{name}", f"/{name}")) for one in written)


def _resolved(tag: str, prefixes: Mapping[str, str]) -> str:
    prefix, _, local = tag.rpartition(":")
    return canonical(prefixes.get(prefix, prefix + ":" if prefix else "") + local)


def _prefix(element: Element, namespace: str) -> str:
    """Prefix, with colon, of a namespace (at its old or current address) that is valid at an element."""
    for prefix, value in element.prefixes.items():
        if canonical(value) == canonical(namespace) and prefix:
            return prefix + ":"
    raise CannotEdit(f"no prefix is declared for {namespace}")
