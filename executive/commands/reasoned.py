"""Contradictions that a description-logic reasoner finds in an ontology."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from executive.commands.checked import CheckResult
from executive.options.recipes import CheckOptions
from executive.runs.files import RecipeFile
from planlang.diagnostics import BadInput, Severity, has_errors
from planlang.ontology import load
from planlang.ontology.reasoning import Reasoner, missing, reason
from planlang.progress import Waiting
from planlang.words import joined

NO_TASK = "R001"
"""Code of a file without a recipe."""


def reasoned(
    file: RecipeFile, options: CheckOptions, check: Callable[[], CheckResult], waiting: Waiting
) -> CheckResult:
    """Add contradictions in the file and its imports to the result of a check. Raises BadInput.

    A file that is neither a recipe nor a map is an ontology. The reasoner also runs if the check finds errors.
    """
    checked = _checked(file, check)
    ontology = load(file.path, folders=options.folders, content=file.content)
    reasoner = Reasoner(options.reasoner.value)
    try:
        with waiting(lambda: f"{reasoner.title} searches for contradictions", options.reason_seconds):
            findings = reason(ontology, reasoner, options.reason_seconds)
    except BadInput as problem:
        diagnostics = (*checked.diagnostics, *problem.diagnostics)
        return replace(checked, ok=False, diagnostics=diagnostics, lacks_reasoner=bool(missing()))
    wrong = sum(one.severity is Severity.ERROR for one in findings.diagnostics)
    what = f"{findings.classes} classes and {findings.individuals} individuals"
    verdict = f"{wrong} contradictions in" if wrong > 1 else "a contradiction in" if wrong else "no contradiction in"
    text = joined("\n", filter(None, (checked.verdict, f"{reasoner.title}: {verdict} {what}")))
    data = {**checked.data, "reasoner": options.reasoner.value, "contradictions": wrong}
    is_ok = checked.ok and not has_errors(findings.diagnostics)
    return replace(
        checked, ok=is_ok, verdict=text, diagnostics=(*checked.diagnostics, *findings.diagnostics), data=data
    )


def _checked(file: RecipeFile, check: Callable[[], CheckResult]) -> CheckResult:
    try:
        return check()
    except BadInput as problem:
        errors = [one for one in problem.diagnostics if one.severity is Severity.ERROR]
        if [one.code for one in errors] != [NO_TASK]:
            return CheckResult(False, "recipe", "", problem.diagnostics)
        others = tuple(one for one in problem.diagnostics if one not in errors)
        return CheckResult(True, "ontology", f"{file.path}: an ontology", others)
