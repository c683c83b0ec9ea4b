"""The page for uploading, checking and changing entries."""

from __future__ import annotations

from dataclasses import replace
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Query, Response

from executive.serving.entries import own
from executive.serving.forms import Filled, Form
from executive.serving.page import PageRoute, author_of, page, status_of
from executive.serving.problems import REFUSALS, Problem, refusal
from executive.serving.serving import Served, Serving, now
from executive.serving.sources import MOST_SHOWN, is_own, lines_with, text_of
from executive.serving.uploads import Upload, read_upload
from planlang.diagnostics import Diagnostic, has_errors
from planlang.knowledge.entries import Entry, Kind
from planlang.records import dataclass

router = APIRouter(route_class=PageRoute, include_in_schema=False)


@dataclass(frozen=True, slots=True)
class Draft:
    """Content of the upload form: a new entry, or a revision of the entry ``uid``, which had ``etag`` at that time."""

    kind: Kind = Kind.RECIPE
    name: str = ""
    about: str = ""
    data: bytes = b""
    uid: str = ""
    etag: str = ""

    @property
    def text(self) -> str:
        """The content as editable text; empty if a browser would send it back changed."""
        text = text_of(self.data) or ""
        is_same = text.encode(errors="replace") == self.data.replace(b"\r\n", b"\n")
        return text if is_same else ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of an upload: the entry or the reason of a refusal, and the diagnostics of the checks."""

    entry: Entry | None = None
    reason: str = ""
    diagnostics: tuple[Diagnostic, ...] = ()


@router.get("/upload")
def begin(served: Served, kind: Kind = Kind.RECIPE, uid: Annotated[str, Query(max_length=300)] = "") -> Response:
    """Show an empty form, or that for the next revision of an entry."""
    draft = Draft(kind)
    if uid:
        entry = served.store.entry(uid)
        draft = Draft(entry.kind, uid.partition(".")[2], "", served.store.content(uid), uid, entry.etag)
    return _page(draft, None)


@router.post("/upload")
def upload(form: Filled, served: Served) -> Response:
    """Check an upload, store it unless the form asks for a check only, and show diagnostics at their lines."""
    draft = _draft(form)
    try:
        author = author_of(form, served)
        if draft.uid:
            entry = served.store.entry(draft.uid)
            own(entry, author)
            draft = replace(draft, kind=entry.kind, name=draft.uid.partition(".")[2], about=entry.about)
        arguments = (draft.kind, draft.name, draft.data, draft.about or None)
        checked = served.staff.checking.call(read_upload, *arguments)
        if form.text("only") == "check":
            return _page(draft, Outcome(diagnostics=checked.diagnostics))
        stored = _store(served, draft, checked, author)
    except REFUSALS as problem:
        _, reason, diagnostics = refusal(problem)
        return _page(draft, Outcome(None, reason, diagnostics), status_of(problem))
    return _page(draft, Outcome(stored, diagnostics=checked.diagnostics))


def _draft(form: Form) -> Draft:
    try:
        kind = Kind(form.text("kind") or Kind.RECIPE)
    except ValueError:
        raise Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "unknown kind of entry") from None
    pasted = form.fields.get("text", "").replace("\r\n", "\n").encode(errors="replace")
    data = form.files.get("file") or pasted
    return Draft(kind, form.text("name")[:100], form.text("about")[:1000], data, form.text("uid"), form.text("etag"))


def _store(served: Serving, draft: Draft, checked: Upload, author: str) -> Entry:
    with served.writing:
        if draft.uid:
            return served.store.change(draft.uid, checked.content, author, draft.etag, now())
        return served.store.create(checked.content, author, now())


def _page(draft: Draft, outcome: Outcome | None, status: HTTPStatus = HTTPStatus.OK) -> Response:
    text = text_of(draft.data) if outcome else None
    by_severity = () if outcome is None else sorted(outcome.diagnostics, key=lambda one: not has_errors([one]))
    shown = by_severity[:MOST_SHOWN]
    return page(
        "upload",
        status,
        draft=draft,
        outcome=outcome,
        errors=[one for one in shown if has_errors([one]) and is_own(one)],
        elsewhere=[one for one in shown if text is None or not is_own(one)],
        lines=() if text is None else lines_with(text, shown),
        left_out=len(by_severity) - len(shown),
    )
