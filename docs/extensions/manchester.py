"""Colours for OWL in Manchester syntax (https://www.w3.org/TR/owl2-manchester-syntax/)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from pygments.lexer import RegexLexer, words
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text

if TYPE_CHECKING:
    from sphinx.application import Sphinx

FRAMES = ("Prefix", "Ontology", "Import", "Class", "ObjectProperty", "DataProperty", "AnnotationProperty", "Individual")
FRAMES += ("Datatype", "EquivalentClasses", "DisjointClasses", "SameIndividual", "DifferentIndividuals")
SECTIONS = ("Annotations", "SubClassOf", "EquivalentTo", "DisjointWith", "DisjointUnionOf", "HasKey", "Types", "Facts")
SECTIONS += ("SameAs", "DifferentFrom", "Domain", "Range", "Characteristics", "SubPropertyOf", "InverseOf")
SECTIONS += ("SubPropertyChain",)
OPERATORS = ("and", "or", "not", "some", "only", "value", "min", "max", "exactly", "that", "inverse", "Self", "o")


class ManchesterLexer(RegexLexer):
    """Frames, sections, operators, names, literals and comments."""

    name = "Manchester"
    aliases: ClassVar[list[str]] = ["manchester", "owl"]
    filenames: ClassVar[list[str]] = ["*.omn"]
    tokens: ClassVar[dict[str, list[Any]]] = {
        "root": [
            (r"\s+", Text),
            (r"\.\.\.", Comment),  # documentation leaves something out
            (r"#.*", Comment.Single),
            (r"<[^<>\s]*>", Name.Namespace),
            (r'"(\\.|[^"\\])*"', String),
            (r"@[A-Za-z-]+", String.Affix),
            (r"\^\^", Operator),
            (words(FRAMES, suffix=":"), Keyword.Declaration),
            (words(SECTIONS, suffix=":"), Keyword),
            (words(OPERATORS, prefix=r"\b", suffix=r"(?![\w:-])"), Operator.Word),
            (r"[+-]?\d+(\.\d+)?([eE][+-]?\d+)?(?![\w-])", Number),
            (r"(true|false)\b", Keyword.Constant),
            (r"[A-Za-z_][\w.-]*:(?=\s|$)", Name.Namespace),
            (r"(?:[A-Za-z_][\w.-]*)?:?[A-Za-z0-9_][\w.-]*", Name),
            (r"[{}()\[\],:]", Punctuation),
            (r"[<>]=?", Operator),
        ]
    }


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    for alias in ManchesterLexer.aliases:
        app.add_lexer(alias, ManchesterLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
