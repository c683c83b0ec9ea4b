"""Contents in the syntax that an asker accepts."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path

from executive.serving.problems import Problem
from executive.serving.vocabulary import Vocabulary
from executive.serving.workers import Workers
from planlang.knowledge.entries import Syntax
from planlang.ontology.convert import Target, convert_content

_TARGETS = {
    Syntax.RDFXML: Target.RDFXML,
    Syntax.TURTLE: Target.TURTLE,
    Syntax.MANCHESTER: Target.MANCHESTER,
}


def converted(data: bytes, uid: str, accept: str | None, syntax: Syntax, workers: Workers) -> tuple[bytes, Syntax]:
    """Return a content in the syntax that an Accept header prefers, its own before others, and which that is.

    Raises Problem if none that is written is accepted.
    """
    for wanted in _accepted(accept):
        for target in (syntax, *Syntax):
            family = target.value.partition("/")[0]
            if wanted in ("*/*", f"{family}/*", target.value):
                if target is syntax:
                    return data, syntax
                return workers.call(written, data, uid, target), target
    names = ", ".join(one.value for one in Syntax)
    raise Problem(HTTPStatus.NOT_ACCEPTABLE, f"an ontology is written as one of {names}")


def written(data: bytes, uid: str, syntax: Syntax, _: Vocabulary) -> bytes:
    """Return a content in another syntax. Raises BadInput."""
    return convert_content(data, Path(uid), _TARGETS[syntax]).text.encode()


def _accepted(accept: str | None) -> list[str]:
    """Return the media types that a header accepts, those of the highest quality first."""
    found = []
    for part in (accept or "*/*").lower().split(","):
        kind, *parameters = (one.strip() for one in part.split(";"))
        stated = next((one[2:] for one in parameters if one.startswith("q=")), "1")
        try:
            quality = float(stated)
        except ValueError:
            quality = 0.0
        if quality > 0:
            found.append((-quality, kind))
    return [kind for _, kind in sorted(found, key=lambda one: one[0])]
