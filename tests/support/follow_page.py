"""Follows a page of the documentation in another environment: ``python -m tests.support.follow_page PAGE BIN FOLDER``.

BIN is where that environment has its programs. Files of the page are written into the folder, commands run there one by
one, as a reader types them, and have to print what the page shows.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from tests.support.pages import FIRST_RUN_ONLY, Command, agrees, blocks, commands, shape

INSTALLING = ("python3 -m venv", "source", "pip")
"""How commands begin that make the environment, which is there."""


def main(page: Path, programs: Path, folder: Path) -> None:
    """Run the page; the first command that goes another way ends the program with what it prints."""
    environment = {**os.environ, "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.title:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        for command in commands(block) if block.language == "console" else ():
            if command.text.startswith("cd "):
                folder /= command.text.split()[1]
            elif not command.text.startswith(INSTALLING) and (other := _followed(command, folder, environment)):
                sys.exit(f"{page}:{command.line}: {other}")


def _followed(command: Command, folder: Path, environment: dict[str, str]) -> str | None:
    """Run a command; return what it prints if that is not what the page shows."""
    begun = time.perf_counter()
    ran = subprocess.run(
        ["bash", "-c", command.text],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    sys.stdout.write(f"{time.perf_counter() - begun:6.1f} s  {command.text}\n")
    lines = ran.stdout.splitlines(keepends=True)
    printed = "".join(line for line in lines if not line.startswith(FIRST_RUN_ONLY))
    is_shown = ran.returncode == 0 and agrees(shape(command.shown), shape(printed))
    return None if is_shown else f"exit code {ran.returncode}, this prints\n{printed}"


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
