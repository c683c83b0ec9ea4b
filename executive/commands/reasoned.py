"""``planlang check --reason``: contradictions that a description-logic reasoner finds in an ontology."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from executive.commands.answers import Answer, ExitCode
from executive.commands.arguments import CheckArguments
from planlang.diagnostics import BadInput, Severity, has_errors
from planlang.ontology import load
from planlang.ontology.reasoning import Reasoner, missing, reason
from planlang.progress import Waiting

NO_TASK = "R001"
"""Code of a file without a recipe."""


def reasoned(path: Path, arguments: CheckArguments, check: Callable[[], Answer], waiting: Waiting) -> Answer:
    """Add contradictions in the file and its imports to the answer of a check. Raises BadInput.

    A file that is neither a recipe nor a map is an ontology. The reasoner also runs if the check finds errors.
    """
    answer = _checked(path, check)
    ontology = load(path, folders=arguments.folders)
    reasoner = Reasoner(arguments.reasoner.value)
    code = answer.exit_code
    try:
        with waiting(lambda: f"{reasoner.title} searches for contradictions", arguments.reason_seconds):
            findings = reason(ontology, reasoner, arguments.reason_seconds)
    except BadInput as problem:
        code = ExitCode.MISSING_CAPABILITY if missing() else ExitCode.BAD_INPUT
        return replace(answer, exit_code=code, diagnostics=(*answer.diagnostics, *problem.diagnostics))
    wrong = sum(one.severity is Severity.ERROR for one in findings.diagnostics)
    what = f"{findings.classes} classes and {findings.individuals} individuals"
    verdict = f"{wrong} contradictions in" if wrong > 1 else "a contradiction in" if wrong else "no contradiction in"
    text = "\n".join(filter(None, (answer.text, f"{reasoner.title}: {verdict} {what}")))
    data = {**answer.data, "reasoner": arguments.reasoner.value, "contradictions": wrong}
    code = ExitCode.BAD_INPUT if has_errors(findings.diagnostics) else code
    return Answer(code, (*answer.diagnostics, *findings.diagnostics), text, data)


def _checked(path: Path, check: Callable[[], Answer]) -> Answer:
    try:
        return check()
    except BadInput as problem:
        errors = [one for one in problem.diagnostics if one.severity is Severity.ERROR]
        if [one.code for one in errors] != [NO_TASK]:
            return Answer(ExitCode.BAD_INPUT, problem.diagnostics, data={"kind": "recipe"})
        others = tuple(one for one in problem.diagnostics if one not in errors)
        return Answer(diagnostics=others, text=f"{path}: an ontology", data={"kind": "ontology"})
