"""``planlang convert``: an ontology in another syntax."""

from __future__ import annotations

from typing import Any

from executive.cli.arguments import ConvertArguments
from executive.cli.console import Answer
from executive.cli.inputs import refuse
from planlang.files import Bundled
from planlang.ontology.convert import Target, convert
from planlang.outputs import check_outputs, write_text


def command(arguments: ConvertArguments) -> Answer:
    """Convert a file; raises BadInput."""
    path, output = Bundled.RECIPE.find(arguments.file), arguments.output
    refuse(check_outputs({"--output": output}, {"the file": path}, force=arguments.force))
    converted = convert(path, Target(arguments.to.value))
    if output is not None:
        write_text(output, converted.text)
    data: dict[str, Any] = {"output": str(output)} if output is not None else {"source": converted.text}
    text = converted.text if output is None else f"{output}: {len(converted.triples)} statements"
    return Answer(diagnostics=converted.diagnostics, text=text, data=data)
