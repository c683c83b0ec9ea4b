"""Commands against servers that say anything: they end with an exit code and a diagnostic, and write where they may."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable
from contextlib import chdir
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest
from click.testing import CliRunner, Result
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.cli.app import app
from planlang.files import Bundled
from planlang.knowledge.client import Client

RECIPE = Bundled.RECIPE.find("serve_a_drink")
SHA256 = hashlib.sha256(RECIPE.read_bytes()).hexdigest()
FILE = {"name": "plan.py", "media_type": "text/x-python", "sha256": hashlib.sha256(b"").hexdigest(), "size": 0}
RECORD: dict[str, Any] = {
    "uid": "servingtea.ward",
    "kind": "recipes",
    "about": "http://example.org/tea.owl#ServingTea",
    "label": "serve tea",
    "author": "eve",
    "syntax": "text/owl-manchester",
    "created": "2026-01-01T00:00:00Z",
    "revision": {"number": 1, "sha256": SHA256, "author": "eve", "made": "2026-01-01T00:00:00Z"},
    "attachments": [FILE],
    "rating": 3,
    "ratings": 1,
}
NEWS = {"number": 1, "change": "rated", "uid": "servingtea.ward", "kind": "recipes", "author": "eve", "made": "now"}
COMMANDS = (
    ("search", "ServingTea", "--limit", "3"),
    ("search", "--robot", "amigo"),
    ("pull", "servingtea.ward"),
    ("pull", "servingtea.ward", "--revision", "2"),
    ("push", str(RECIPE), "--kind", "recipe", "--name", "ward", "--attach", str(RECIPE)),
    ("push", str(RECIPE), "--kind", "recipe", "--name", "ward", "--update"),
    ("rate", "servingtea.ward", "0"),
    ("watch", "servingtea.ward", "--once", "--after", "0"),
)

SIMPLE = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.sampled_from(["../x", "\x1b[2J"])
)
ANYTHING = st.recursive(
    SIMPLE, lambda one: st.lists(one, max_size=2) | st.dictionaries(st.text(max_size=3), one, max_size=2), max_leaves=4
)


def mutated(sound: dict[str, Any]) -> st.SearchStrategy[dict[str, Any]]:
    """Return objects like a sound one, in which up to two values are anything."""
    changes = st.dictionaries(st.sampled_from(sorted(sound)), ANYTHING, max_size=2)
    return changes.map(lambda one: {**sound, **one})


@st.composite
def bodies(draw: st.DrawFn) -> Any:
    """Draw an answer that has everything that any answer has."""
    entry = draw(mutated(RECORD))
    wrong = draw(mutated({"severity": "error", "code": "R001", "message": "no", "file": "f", "line": 1, "column": 1}))
    return {
        **entry,
        "entry": entry,
        "entries": draw(
            st.lists(mutated({**RECORD, "can": "no", "missing": [{"name": "arm"}]}), max_size=2) | ANYTHING
        ),
        "revisions": draw(st.just([RECORD["revision"]]) | ANYTHING),
        "diagnostics": draw(st.just([wrong]) | ANYTHING),
        "subscriptions": draw(st.just(["servingtea.ward"]) | ANYTHING),
        "news": draw(st.just([]) | st.just([NEWS]) | ANYTHING),
        "next": draw(st.none() | st.sampled_from(["", "z", 0, 7])),
        "detail": draw(SIMPLE),
    }


WRITTEN = {".planlang-pulled.json", "plan.py", *(f"servingtea.ward{suffix}" for suffix in (".omn", ".owl", ".ttl"))}
"""Names of what pulling that entry may write."""
STATUSES = st.sampled_from([200, 200, 200, 201, 204, 302, 304, 400, 401, 403, 404, 409, 412, 413, 422, 429, 500, 503])


def answer(status: int, body: bytes) -> httpx.Response:
    """Return an answer whose body is not read yet."""
    return httpx.Response(status, stream=httpx.ByteStream(body))


def command(serve: Callable[[httpx.Request], httpx.Response], *words: str) -> Result:
    """Run a command whose server is a function."""
    with pytest.MonkeyPatch.context() as patch:
        transport = httpx.MockTransport(serve)
        patch.setattr("planlang.knowledge.refusals.Client", partial(Client, transport=transport, sleep=lambda _: None))
        patch.setenv("PLANLANG_SERVER", "http://knowledge.test")
        patch.setenv("PLANLANG_KEY", "key")
        patch.setenv("XDG_CACHE_HOME", "/dev/null/nowhere")
        return CliRunner().invoke(app, list(words), prog_name="planlang")


@pytest.mark.long
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(COMMANDS), st.lists(st.tuples(STATUSES, bodies()), min_size=1, max_size=3))
def test_whatever_a_server_says_a_command_ends_in_order(
    words: tuple[str, ...], answers: list[tuple[int, dict[str, Any]]]
) -> None:
    number = 0

    def serve(request: httpx.Request) -> httpx.Response:
        nonlocal number
        number += 1
        if number > 40:  # those that never end are another matter
            return answer(404, b"")
        status, body = answers[number % len(answers)]
        if request.url.path.endswith("/content") and request.method == "GET":
            return answer(status, RECIPE.read_bytes())
        return answer(status, json.dumps(body).encode())

    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        ended = command(serve, *words)
        assert ended.exit_code in (0, 1, 2), ended.output
        assert "\x1b" not in ended.output
        assert [one.name for one in Path(folder).iterdir() if one.name not in WRITTEN] == []


def test_a_key_that_others_can_read_on_its_way_is_warned_of() -> None:
    rated = command(lambda _: answer(200, json.dumps(RECORD).encode()), "rate", "servingtea.ward", "3")
    assert rated.exit_code == 0
    assert "warning K043 your key went to http://knowledge.test unencrypted" in rated.stderr
