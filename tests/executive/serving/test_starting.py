"""Messages to an operator of ``planlang serve`` when it cannot start."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.cli_runs import invoke

for package in ("fastapi", "uvicorn", "jinja2", "python_multipart"):
    pytest.importorskip(package, reason="the server is in the extra serve")


@pytest.mark.long
def test_a_port_that_is_taken_is_told_with_another_one_to_take(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        refused = invoke("serve", "--store", tmp_path / "kb.sqlite", "--port", port)
    assert refused.exit_code == 2
    assert refused.stderr.splitlines()[:2] == [
        f"error K005 cannot listen at 127.0.0.1, port {port}: Address already in use",
        "    help: choose another --port; 0 takes any free one",
    ]


def test_an_address_of_the_web_is_no_file_and_the_scheme_for_an_endpoint_is_told() -> None:
    refused = invoke("serve", "--store", "https://example.org/sparql", "--new-key", "ada")
    assert refused.exit_code == 2
    assert "write sparql+https://example.org/sparql for a SPARQL endpoint" in refused.stderr


@pytest.mark.parametrize("contents", ["somewhere", "nothing://x", "file:///none/such"])
def test_contents_that_cannot_be_kept_somewhere_are_refused(contents: str) -> None:
    pytest.importorskip("obstore", reason="object storage is in the extra serve")
    refused = invoke("serve", "--store", "sparql+http://127.0.0.1:9/", "--contents", contents, "--new-key", "ada")
    assert refused.exit_code == 2
    assert f"error K020 cannot store contents at {contents}: " in refused.stderr


@pytest.mark.long
def test_an_endpoint_that_does_not_answer_is_no_error_of_planlang(tmp_path: Path) -> None:
    pytest.importorskip("obstore", reason="object storage is in the extra serve")
    store = ("--store", "sparql+http://127.0.0.1:9/", "--contents", tmp_path.as_uri())
    for wanted in (("--new-key", "ada"), ("--port", 0)):
        refused = invoke("serve", *store, *wanted)
        assert refused.exit_code == 1
        assert refused.stderr.startswith("error K044 the SPARQL endpoint does not respond: "), refused.output


def test_a_key_that_leaked_is_dropped_and_another_takes_its_place(tmp_path: Path) -> None:
    store = ("serve", "--store", tmp_path / "kb.sqlite")
    leaked = invoke(*store, "--new-key", "ada").stdout.strip()
    told, key = invoke(*store, "--drop-keys", "ada", "--new-key", "ada").stdout.splitlines()
    assert told == "ada: 1 key dropped"
    opened = SqliteStore(tmp_path / "kb.sqlite")
    assert [opened.author_of(one) for one in (leaked, key)] == [None, "ada"]
    opened.close()
    assert invoke(*store, "--drop-keys", "eve").stdout == "eve: 0 keys dropped\n"
