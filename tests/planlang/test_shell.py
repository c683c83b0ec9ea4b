"""Command lines in messages mean the same when they are copied into a shell."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput
from planlang.outputs import write_plan
from planlang.shell import joined
from planlang.words import COMMAND_LINE, said

WORDS = (
    "plan.py", "my plans/plan.py", 'a "plan".py', "it's.py", "$HOME.py", "`id`.py", "wow!.py", "a\nb.py", "a\tb\\.py",
    "#1.py", "~.py", "*.py", "a;b.py", "", "Küche.py", "\x1b[31m.py", "\u202e.py", "*", "a=b c",
)  # fmt: skip


@pytest.mark.parametrize("shell", ["bash"])
def test_a_shell_reads_quoted_words_as_they_were(shell: str) -> None:
    line = joined(["printf", "%s\\0", *WORDS])
    assert line.isprintable()
    done = subprocess.run([shell, "-c", line], check=True, capture_output=True, env={"LC_ALL": "C.UTF-8"})
    assert tuple(done.stdout.decode().split("\0")[:-1]) == WORDS


def test_a_path_is_never_read_as_an_option() -> None:
    assert joined([Path("-f"), Path("--help me"), "--set"]) == "./-f './--help me' --set"


def test_advice_quotes_the_names_of_files(tmp_path: Path) -> None:
    plan = tmp_path / "my plan.py"
    source = compile_recipe(Path("recipes/push_the_cup.omn")).source
    assert source is not None
    plan.write_text(source + "\nEDITED = True\n", encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        write_plan(plan, source + "\n", force=False)
    assert f"planlang check '{plan}'" in said(caught.value.diagnostics[0].help or "", COMMAND_LINE)
