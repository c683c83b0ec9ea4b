"""Recipes that run with uncertain fixes, which their trace repeats with the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from executive.runs.options import Outcome, RunOptions
from executive.runs.plan_run import Run
from executive.runs.prepared import prepared
from executive.runs.traces import read_trace
from planlang.files import bundled
from tests.support.scenarios import CORPUS

NEW = RunOptions(
    recipe=CORPUS / "recipes" / "serve_drink_new@re_stack.owl",
    ontologies=[CORPUS / "ontologies"],
    robot=bundled("ontologies") / "robots" / "amigo.omn",
    environment=CORPUS / "environments" / "map_hospital_room@re_stack.owl.in",
    accept=["R042"],
)


@pytest.mark.long
@pytest.mark.skipif(not CORPUS.is_dir(), reason="the corpus of real OWL files is not beside this checkout")
def test_a_recipe_without_orders_runs_and_is_replayed_with_those_that_were_accepted(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    with Run(prepared(replace(NEW, trace=trace))) as run:
        assert run.execute().outcome is Outcome.DONE
        fixed = [one for one in run.found if one.code == "C017"]
    assert any("R042" in one.message for one in fixed)
    assert {one.span.file for one in fixed if one.span} == {str(NEW.recipe)}
    with Run(prepared(NEW)) as again:  # its steps run plans of the library below performed actions
        assert again.replay(read_trace(trace)[0]).equal
