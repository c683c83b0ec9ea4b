"""Runs the blocks of a page from top to bottom, in a folder of its own, and compares what it shows.

What is where: files of a page (blocks with a title) are written into the folder, ``docs/``, ``recipes/`` and the like
are those of the checkout, and published files (``name@version``, ``corpus/``) are those beside it, where there are any.
"""

from __future__ import annotations

import linecache
import os
import re
import shlex
import subprocess
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import chdir, nullcontext, redirect_stdout
from dataclasses import dataclass, field
from importlib.util import find_spec
from io import StringIO
from itertools import pairwise
from pathlib import Path
from textwrap import dedent
from types import MappingProxyType
from unittest.mock import patch

from click.testing import CliRunner

from executive.cli.app import app
from executive.runs.options import RunOptions, RunResult
from planlang.ontology.reasoning import missing as reasoner_missing
from tests.support.extras import HAS_PR2, WITHOUT_PR2
from tests.support.pages import (
    CHECKOUT,
    ENDS_WITH_STATUS,
    FIRST_RUN_ONLY,
    Block,
    Command,
    agrees,
    blocks,
    commands,
    fitted,
    is_excerpt,
    shape,
)
from tests.support.scenarios import CORPUS, Judged, judged_run, run_by

NEEDS: tuple[tuple[str, Callable[[], bool], str], ...] = (
    (r"\w@\w|\bcorpus/", CORPUS.is_dir, "published files are not beside this checkout"),
    (r"--robot pr2\b", lambda: HAS_PR2, WITHOUT_PR2),
    (r"--reason\b|owlready", lambda: reasoner_missing() is None, "a reasoner needs Java and the extra reason"),
    (r"--parquet\b", lambda: find_spec("pyarrow") is not None, "Parquet needs the extra parquet"),
    (r"--record\b", lambda: find_spec("rerun") is not None, "recordings need the extra record"),
)
"""What some commands and programs need: a pattern of these, whether it is there, and what to say if not."""
SHELL = ("cat", "cp", "head", "sed", "ls", "diff")
"""Commands that a shell runs in the page's folder."""
UNTRIED = ("pip", "python3", "source", "git", "curl", "rerun", "make", "while")
"""Commands of which only the syntax is checked, and the target of make: they install, download, or take minutes."""
CLOCK = re.compile(r"(?<= in )\d+\.\d+s|\d{4}-\d\d-\d\dT[\d:]+Z")
"""Times of the clock on the wall in outputs: they alone are no reason to write an output anew."""
WITHOUT_END = ("serve",)
"""Subcommands that only a signal ends."""


@dataclass
class Found:
    """What came of running a page: what was compared, by kind, what is wrong, what was skipped, and new outputs."""

    kinds: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    outputs: dict[int, tuple[str, str]] = field(default_factory=dict)
    """The line where an output begins, to what is shown and what is printed."""


class PageRun:
    """A page and the folder where it runs.

    ``dry``: nothing is executed; commands are parsed, programs compiled. ``exempt``: how blocks begin that are compared
    with nothing. ``aliases`` map what the page shows to what stands for it here, as an address.
    """

    def __init__(
        self,
        text: str,
        folder: Path,
        *,
        dry: bool = False,
        exempt: tuple[str, ...] = (),
        aliases: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._blocks = blocks(text)
        self._folder, self._dry, self._exempt, self._aliases = folder, dry, exempt, aliases
        self._names: dict[str, object] = {"__name__": "page"}
        self._texts: list[str] = []
        self._done: set[int] = set()
        self.found = Found()

    def run(self) -> Found:
        """Run all blocks in their order."""
        strategies = patch.dict("planlang.recoveries._registered")  # those that a page registers end with it
        calm = patch("executive.cli.progress.SHORT", 1e9)  # how far a long command is depends on the machine
        with chdir(self._folder), patch.object(sys, "path", [str(self._folder), *sys.path]), strategies, calm:
            for block, following in pairwise([*self._blocks, None]):
                try:
                    if block.line not in self._done:
                        self._block(block, following)
                except ValueError as error:
                    self._wrong(block.line, str(error))
        return self.found

    def _block(self, block: Block, following: Block | None) -> None:
        if block.title:
            self._write(block)
        elif block.language in ("console", "sh"):
            for command in commands(block):
                self._command(command, scenario_only=block.language == "sh")
        elif block.language == "python":
            self._python(block, following if following and following.language == "text" else None)
        elif block.text.startswith(self._exempt):
            self.found.kinds["compared with nothing, for a reason"] += 1
        elif is_excerpt(block.text, self._texts):
            self.found.kinds["excerpts found"] += 1
        else:
            self._wrong(block.line, "this is neither an output nor in any bundled file, or file of this page")

    def _write(self, block: Block) -> None:
        self.found.kinds["files written"] += 1
        self._texts.append(block.text)
        path = Path(block.title)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.text, encoding="utf-8")

    # Programs

    def _python(self, block: Block, output: Block | None) -> None:
        """Run a program, and compare what it prints with the block of text behind it."""
        name, text = f"<block at line {block.line}>", self._here(block.text)
        code = compile(text, name, "exec")
        self._texts.append(block.text)
        if output:
            self._done.add(output.line)
        if self._dry or self._lacks(block.text):
            return
        linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
        printed = StringIO()
        before = set(self._names)
        try:
            with redirect_stdout(printed):
                exec(code, self._names)
                for test in [one for one in self._names if one.startswith("test_") and one not in before]:
                    self._names[test]()  # type: ignore[operator]
        except Exception:
            self._wrong(block.line, traceback.format_exc())
        self.found.kinds["programs run"] += 1
        if output:
            self.found.kinds["outputs of programs compared"] += 1
            self._compare(output.line, output.text, printed.getvalue())
        elif printed.getvalue():
            self._wrong(block.line, f"a block of text behind this shows what it prints:\n{printed.getvalue()}")

    # Commands

    def _command(self, command: Command, scenario_only: bool) -> None:
        words = shlex.split(command.words, comments=True)
        name = words[0].removeprefix(".venv/bin/")
        if name == "cd" and len(words) == 2:
            self._enter(words[1])
        elif name in UNTRIED or self._is_measurement(words):
            self._untried(command, name, words)
        elif name == "planlang" and (scenario_only or words[1] in WITHOUT_END):
            self.found.kinds["commands of scenarios, or without end"] += 1
            parse(words[1:])
            if scenario_only and run_by(words[1:]) is None:
                self._wrong(command.line, "a command without output has to be that of a scenario")
        elif name not in ("planlang", "python", *SHELL):
            self._wrong(command.line, f"{name} is no command that pages use")
        elif self._dry or self._lacks(command.text):
            if name == "planlang":
                parse(words[1:])
            self.found.kinds["commands parsed"] += 1
        else:
            self._prepare(command.words)
            status, printed = self._planlang(command, words[1:]) if name == "planlang" else self._shell(command, name)
            self._ended(command, status, printed)

    def _enter(self, folder: str) -> None:
        """Go on in a folder that an earlier command has made."""
        if not self._dry:
            os.chdir(folder)

    def _ended(self, command: Command, status: int, printed: str) -> None:
        self.found.kinds["commands run, outputs compared"] += 1
        lines = printed.splitlines(keepends=True)
        printed = "".join(line for line in lines if not line.startswith(FIRST_RUN_ONLY))
        for shown, here in self._aliases.items():
            printed = printed.replace(here, shown)
        if command.text.endswith(ENDS_WITH_STATUS):
            printed += f"{status}\n"
        elif status:
            self._wrong(command.line, f"{command.text} ends with exit code {status}:\n{printed}")
        printed = printed.replace(f"{self._folder}/", "")
        self._texts.append(printed)
        self._compare(command.output_line, command.shown, printed)

    def _planlang(self, command: Command, words: list[str]) -> tuple[int, str]:
        """Run the command in this process; a run that is a scenario's is asked for the goal, too."""
        scenario, ended = run_by(words), list[Judged]()

        def judged(options: RunOptions) -> RunResult:
            assert scenario is not None
            ended.append(judged_run(scenario, options))
            return ended[0].result

        with patch("executive.api.run", judged) if scenario else nullcontext():
            result = CliRunner().invoke(app, words, prog_name="planlang")
        if scenario is not None and [one.reached for one in ended] != [True]:
            self._wrong(command.line, f"the goal of {scenario.name} is not reached: {[one.unmet for one in ended]}")
        return result.exit_code, result.output

    def _shell(self, command: Command, name: str) -> tuple[int, str]:
        text = command.words.removeprefix(".venv/bin/")
        if name == "python":
            text = shlex.quote(sys.executable) + text.removeprefix("python")
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # for a python within the command
        settings = {"PATH": path, "PYTEST_ADDOPTS": "-p no:cacheprovider", "PYTHONDONTWRITEBYTECODE": "1"}
        ran = subprocess.run(
            ["bash", "-c", text],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            env={**os.environ, **settings},
        )
        return ran.returncode, ran.stdout

    def _is_measurement(self, words: list[str]) -> bool:
        """Whether this is a program that measures, which takes minutes and has other figures on each machine."""
        return "tests/benchmarks/" in " ".join(words[:3]).replace(".", "/")

    def _untried(self, command: Command, name: str, words: list[str]) -> None:
        self.found.kinds["commands checked, not run"] += 1
        subprocess.run(["bash", "-n", "-c", command.words], check=True)
        if name == "make":
            targets = re.findall(r"(?m)^([a-z -]+):", (CHECKOUT / "Makefile").read_text(encoding="utf-8"))
            if words[1] not in " ".join(targets).split():
                self._wrong(command.line, f"the Makefile has no target {words[1]}")
        elif name in ("python", "-m"):
            module = next(one for one in words[1:] if one != "-m")
            path = CHECKOUT / (module if module.endswith(".py") else module.replace(".", "/"))
            if not (path.exists() or path.with_suffix(".py").exists()):
                self._wrong(command.line, f"there is no {module}")

    def _prepare(self, text: str) -> None:
        """Link what a command reads into the folder: folders of the checkout, published files."""
        folders = {name: CHECKOUT / name for name in ("docs", "recipes", "ontologies", "tests")}
        for name, there in {**folders, "corpus": CORPUS}.items():
            if f"{name}/" in text and not (self._folder / name).exists():
                (self._folder / name).symlink_to(there)
        for name in re.findall(r"(?<![\w/])[\w.-]+@[\w.-]+", text):
            here = self._folder / name
            if not here.exists() and (found := next(CORPUS.rglob(name), None)):
                here.symlink_to(found)

    # What all blocks need

    def _lacks(self, text: str) -> bool:
        reasons = [reason for pattern, is_there, reason in NEEDS if re.search(pattern, text) and not is_there()]
        self.found.skipped += reasons
        return bool(reasons)

    def _here(self, text: str) -> str:
        for shown, here in self._aliases.items():
            text = text.replace(shown, here)
        return text

    def _compare(self, line: int, shown: str, printed: str) -> None:
        self.found.outputs[line] = (shown, printed)
        if not agrees(shape(shown), shape(dedent(printed))):
            self._wrong(line, f"this prints\n{printed}")

    def _wrong(self, line: int, text: str) -> None:
        self.found.wrong.append(f"line {line}: {text}")


def parse(words: list[str]) -> None:
    """Raise ValueError where ``planlang`` has no such subcommand or options."""
    context = app.make_context("planlang", [], resilient_parsing=True)
    try:
        _, command, rest = app.resolve_command(context, list(words))
        while hasattr(command, "commands"):
            _, command, rest = command.resolve_command(command.make_context("", [], resilient_parsing=True), rest)
        command.make_parser(command.make_context("", [], resilient_parsing=True)).parse_args(list(rest))
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        raise ValueError(f"planlang {' '.join(words)}: {error.format_message()}") from None


def renewed(text: str, found: Found) -> str:
    """A page with the outputs that were printed, where they differ from what it shows."""
    lines = text.splitlines(keepends=True)
    for line, (shown, printed) in sorted(found.outputs.items(), reverse=True):
        if not agrees(CLOCK.sub("#", shown), CLOCK.sub("#", printed)):
            before = lines[line - 2]
            indent = before[: len(before) - len(before.lstrip())]
            new = [f"{indent}{one}" for one in fitted(shown, printed).splitlines(keepends=True)]
            lines[line - 1 : line - 1 + shown.count("\n")] = new
    return "".join(lines)
