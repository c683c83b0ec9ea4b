"""``planlang convert``: an ontology in another syntax."""

from __future__ import annotations

from executive.cli.authoring_arguments import ConvertArguments
from executive.cli.console import Answer, text_answer
from executive.options.declaring import check_written
from executive.runs.files import refuse
from planlang.diagnostics import error, settled
from planlang.files import Bundled
from planlang.ontology import Literal
from planlang.ontology.convert import convert
from planlang.units import chosen_units, in_chosen_unit, unit_of


def command(arguments: ConvertArguments) -> Answer:
    """Convert a file; raises BadInput."""
    path, output = Bundled.RECIPE.find(arguments.file), arguments.output
    refuse(check_written(arguments, ConvertArguments, {"the file": path}))
    units = chosen_units(arguments.units or ())
    converted = convert(path, arguments.to, lambda literal: in_chosen_unit(literal, units))
    left_out = settled(converted.unread, ignore_unread=arguments.ignore_unread)
    written = {unit_of(one.object) for one in converted.triples if isinstance(one.object, Literal)}
    refuse(
        [
            error("C019", f"--units {name}: no number in {path} has a unit that can be converted to it")
            for name in units.values()
            if name not in written
        ]
    )
    told, diagnostics = f"{len(converted.triples)} statements", (*converted.diagnostics, *left_out)
    return text_answer(converted.text, output, told, diagnostics)
