"""The page of the knowledge base shows what commands print: all of them in their order, in one folder, at one server.

``python -m tests.executive.serving.test_knowledge_page`` writes the outputs anew.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import pytest

from tests.repository.test_documentation import BLOCK, CHECKOUT, agrees, fitted, output, prepare, shape
from tests.support.servers import running_server

PAGE = CHECKOUT / "docs" / "guides" / "knowledge.md"
SHOWN_URL = "https://knowledge.example.org"
"""The server's address in outputs on the page."""
WITHOUT_END = "serve "
"""How commands begin that only a signal ends."""


def outputs(folder: Path, corpus: Path) -> list[tuple[str, str, str]]:
    """Return each command of the page, what the page shows, and what it prints."""
    found = []
    (folder / "broken.omn").symlink_to(CHECKOUT / "tests" / "diagnostics" / "R012_cycle.omn")
    with running_server(folder / "kb.sqlite") as server, pytest.MonkeyPatch.context() as patch:
        patch.setenv("PLANLANG_SERVER", server.url)
        patch.setenv("PLANLANG_KEY", server.key("ada"))
        (folder / "ben.key").write_text(server.key("ben"))
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        for command, shown in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
            if not command.startswith(WITHOUT_END):
                assert prepare(command, folder, corpus), command
                found.append((command, shown, output(command, folder).replace(server.url, SHOWN_URL)))
    return found


@pytest.mark.long
def test_the_commands_on_the_page_print_what_it_shows(tmp_path: Path, corpus: Path) -> None:
    for command, shown, real in outputs(tmp_path, corpus):
        assert agrees(shape(shown), shape(real)), f"planlang {command} prints:\n{real}"


def test_the_programs_on_the_page_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    programs = re.findall(r"```python\n(.+?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert programs
    with running_server(tmp_path / "kb.sqlite") as server:
        for program in programs:
            exec(compile(program.replace(SHOWN_URL, server.url), str(PAGE), "exec"), {})


def rewrite() -> None:
    """Write the outputs into the page."""
    with tempfile.TemporaryDirectory() as folder:
        found = iter(outputs(Path(folder), CHECKOUT.parent / "shared" / "corpus"))

    def renewed(block: re.Match[str]) -> str:
        if block[1].startswith(WITHOUT_END):
            return block[0]
        command, shown, real = next(found)
        return block[0] if agrees(shown, real) else f"```console\n$ planlang {command}\n{fitted(shown, real)}```"

    PAGE.write_text(BLOCK.sub(renewed, PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    rewrite()
