"""``planlang serve`` as a process: keys, what is there after it ended, and requests that are under way then."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from click.testing import CliRunner, Result

from executive.cli import serve
from executive.cli.app import app
from planlang.files import Bundled
from tests.support.examples import some

RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()


def invoke(store: Path, *arguments: str) -> Result:
    """Run the command in this process."""
    return CliRunner().invoke(app, ["serve", "--store", str(store), *arguments], prog_name="planlang")


@contextmanager
def served(store: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Serve a store in a process of its own; yields its address."""
    command = [sys.executable, "-m", "executive", "serve", "--store", str(store), "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        told = process.stderr.readline()
        assert told.startswith(f"{store} is served at http://127.0.0.1:")
        try:
            yield told.split()[-1], process
        finally:
            process.kill()


@pytest.mark.long
@pytest.mark.parametrize("ending", some([signal.SIGTERM, signal.SIGINT, signal.SIGHUP]))
def test_a_server_that_is_ended_answers_what_was_asked_and_its_successor_knows_it(
    tmp_path: Path, ending: signal.Signals
) -> None:
    store = tmp_path / "kb.sqlite"
    key = {"Authorization": f"Bearer {invoke(store, '--new-key', 'ada').stdout.strip()}"}
    with served(store) as (url, process):
        assert httpx.post(f"{url}/v1/recipes?name=ward", content=RECIPE, headers=key).status_code == 201
        answers = []

        def ask() -> None:
            with httpx.Client(base_url=url, timeout=30) as client:
                client.get("/v1/health")  # the connection is there before the end begins
                threading.Timer(0.05, process.send_signal, (ending,)).start()
                answers.append(client.post("/v1/recipes?name=west", content=RECIPE, headers=key).status_code)

        asking = threading.Thread(target=ask)
        asking.start()
        asking.join()
        assert process.wait(90) == 0
        assert answers == [201]
    with served(store) as (url, _):
        entries = httpx.get(f"{url}/v1/recipes").json()["entries"]
        assert [one["uid"] for one in entries] == ["serveadrink.ward", "serveadrink.west"]


def test_each_key_is_another_one_and_stays_valid(tmp_path: Path) -> None:
    keys = [invoke(tmp_path / "kb.sqlite", "--new-key", "ada").stdout.strip() for _ in range(2)]
    assert len({*keys}) == 2
    assert all(len(key) >= 43 for key in keys)


@pytest.mark.parametrize("author", ["", "  ", "x" * 101, "a\nb"])
def test_an_author_has_a_name(tmp_path: Path, author: str) -> None:
    refused = invoke(tmp_path / "kb.sqlite", "--new-key", author)
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "error K006" in refused.stderr


def test_without_its_packages_the_command_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "find_spec", lambda name: None)
    refused = invoke(tmp_path / "kb.sqlite")
    assert refused.exit_code == 2
    assert "error K004" in refused.stderr
    assert "pip install 'fastapi>=0.115' " in refused.stderr
    assert not list(tmp_path.iterdir())
