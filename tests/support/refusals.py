"""Refusals and failures that tests expect: told by codes, classes, fields and names, not by their wording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import pytest

from planlang.diagnostics import BadInput, Severity

F = TypeVar("F", bound=Exception)


@contextmanager
def refusal(*codes: str, naming: str | tuple[str, ...] = ()) -> Iterator[pytest.ExceptionInfo[BadInput]]:
    """Expect BadInput whose errors have exactly these codes, and say these names, numbers or options."""
    with pytest.raises(BadInput) as caught:
        yield caught
    errors = [one for one in caught.value.diagnostics if one.severity is Severity.ERROR]
    assert {one.code for one in errors} == {*codes}, str(caught.value)
    said = "\n".join(map(str, errors))
    assert all(name in said for name in ((naming,) if isinstance(naming, str) else naming)), said


@contextmanager
def failing(kind: type[F], **details: object) -> Iterator[pytest.ExceptionInfo[F]]:
    """Expect a failure of a class whose fields have these values."""
    with pytest.raises(kind) as caught:
        yield caught
    assert {name: getattr(caught.value, name) for name in details} == details
