"""Misspelt roles of actions in a plan, which its source shows."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from executive.cli.inputs import PlanFile
from planlang.diagnostics import Diagnostic, Span, error
from planlang.roles import meant_role


def misspelt_roles(plan: PlanFile) -> Iterator[Diagnostic]:
    """Yield an error for each role of an action that is nearly one of the usual ones, and no other one."""
    for node in ast.walk(ast.parse(plan.source)):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", None) or getattr(node.func, "id", None)
        for keyword in node.keywords if name == "action" else ():
            meant = meant_role(keyword.arg) if keyword.arg is not None else None
            if meant is not None:
                span = Span(str(plan.path), keyword.lineno, keyword.col_offset + 1)
                yield error("C024", f"actions have no role {keyword.arg}", span, f"did you mean {meant}?")
