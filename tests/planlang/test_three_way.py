"""A three-way merge keeps what either side changed, and marks what both changed differently."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang.plan_versions import Merged, has_conflicts, merged
from tests.support.examples import examples

LINES = st.lists(st.sampled_from("abcdef"), max_size=12).map(lambda lines: "".join(f"{line}\n" for line in lines))


def merge(base: str, ours: str, theirs: str) -> Merged:
    return merged(base, ours, theirs, our_name="ours", their_name="theirs")


@settings(max_examples=examples(500), deadline=None)
@given(LINES, LINES)
def test_what_one_side_alone_changed_counts(base: str, changed: str) -> None:
    assert merge(base, changed, base) == Merged(changed)
    assert merge(base, base, changed) == Merged(changed)
    assert merge(base, changed, changed) == Merged(changed)


@settings(max_examples=examples(500), deadline=None)
@given(LINES, LINES, LINES)
def test_no_line_that_a_side_added_is_lost(base: str, ours: str, theirs: str) -> None:
    found = merge(base, ours, theirs)
    for side in (ours, theirs):
        for line in set(side.split()) - set(base.split()):
            assert found.text.split().count(line) >= side.split().count(line)
    assert has_conflicts(found.text) == bool(found.conflicts)


def test_changes_in_different_places_are_merged() -> None:
    base = "".join(f"{number}\n" for number in range(9))
    assert merge(base, base.replace("1", "one"), base.replace("7", "seven")) == Merged(
        base.replace("1", "one").replace("7", "seven")
    )


def test_a_conflict_has_both_versions_and_its_line() -> None:
    found = merge("a\nb\nc\n", "a\nmine\nc\n", "a\nnew\nc")
    assert found == Merged("a\n<<<<<<< ours\nmine\nc\n=======\nnew\nc\n>>>>>>> theirs\n", (2,))
    assert has_conflicts(found.text)
    assert not has_conflicts("a = 1\n=======\n")


@pytest.mark.skipif(shutil.which("git") is None, reason="git is the oracle")
def test_git_merges_the_same_way(tmp_path: Path) -> None:
    base = "".join(f"line {number}\n" for number in range(20))
    ours = base.replace("line 3\n", "edited\n").replace("line 12\n", "")
    theirs = base.replace("line 8\n", "line 8\nmore\n").replace("line 12\n", "changed\n")
    for name, text in (("base", base), ("ours", ours), ("theirs", theirs)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    command = ["git", "merge-file", "-p", "-L", "ours", "-L", "base", "-L", "theirs", "ours", "base", "theirs"]
    answer = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = merge(base, ours, theirs)
    assert (found.text, len(found.conflicts)) == (answer.stdout, answer.returncode)
