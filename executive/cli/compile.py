"""``planlang compile``: a recipe becomes a plan in Python, and a drawing of the order of its steps."""

from __future__ import annotations

from typing import Any

from executive import api
from executive.cli.authoring_arguments import CompileArguments
from executive.cli.console import Answer, ExitCode, waiting
from executive.commands.compile import CONFLICT
from planlang.plan_versions import backup_path


def command(arguments: CompileArguments) -> Answer:
    """Compile a recipe; raises BadInput."""
    output, graph = arguments.output, arguments.graph
    with waiting(arguments, lambda: "compiling the recipe"):
        plan = api.compile(arguments)
    has_conflicts = any(one.code == CONFLICT for one in plan.diagnostics)
    data: dict[str, Any] = {"task": plan.task, "functions": list(plan.functions)}
    data |= {"graph": str(graph)} if graph is not None else {}
    data |= {"plan": str(output)} if output is not None else {"source": plan.source}
    text = plan.source if output is None else f"{output}: {plan.task}"
    if has_conflicts and output is not None:
        text += f", with conflicts; as it was before: {backup_path(output)}"
    return Answer(ExitCode.FAILED if has_conflicts else ExitCode.DONE, plan.diagnostics, text, data)
