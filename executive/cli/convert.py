"""``planlang convert``: an ontology in another syntax."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from executive.cli.arguments import Arguments, Force, refuse, taking
from executive.cli.console import Answer, answer
from planlang.outputs import check_outputs, write_text
from planlang.resources import Bundled


class Syntax(Enum):
    """The syntaxes that are written, here again as their writers take long to import."""

    MANCHESTER = "manchester"
    TURTLE = "turtle"
    NTRIPLES = "ntriples"
    RDFXML = "rdfxml"


@dataclass(frozen=True, kw_only=True)
class ConvertArguments(Arguments):
    """Arguments of ``planlang convert``."""

    file: Annotated[str, typer.Argument(metavar="FILE", help="An ontology's file, in any syntax that is read.")]
    to: Annotated[Syntax, typer.Option("--to", help="The syntax to write.", show_default=False)]
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the text here, not to stdout.")
    ] = None
    force: Force = False


@taking(ConvertArguments)
def convert_command(arguments: ConvertArguments) -> None:
    """Write an ontology, such as a recipe, in another syntax, and list what is lost."""
    answer("convert", lambda: _converted(arguments), as_json=arguments.json)


def _converted(arguments: ConvertArguments) -> Answer:
    from planlang.ontology.writing import Target, convert

    path, output = Bundled.RECIPE.find(arguments.file), arguments.output
    refuse(check_outputs({"--output": output}, {"the file": path}, force=arguments.force))
    converted = convert(path, Target(arguments.to.value))
    if output is not None:
        write_text(output, converted.text)
    data: dict[str, Any] = {"output": str(output)} if output is not None else {"source": converted.text}
    text = converted.text if output is None else f"{output}: {len(converted.triples)} statements"
    return Answer(diagnostics=converted.diagnostics, text=text, data=data)
