"""Settings of a run: what follows from their declarations."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest

from executive.cli.arguments import RunArguments
from executive.options.declaring import as_json, declared, made, stated
from executive.options.headers import given_or, header_entries, in_header, settings_from_header
from executive.options.running import RunSettings
from executive.runs.options import RunOptions

SET = RunSettings(trust_map=True, unknown=["cup1", "all"], models=[Path("models")], modules=[Path("mine.py")])


def test_every_setting_is_an_option_of_the_command_and_of_the_library() -> None:
    names = {*declared(RunSettings)}
    assert names == {one.name for one in fields(RunSettings)}
    assert names < {*declared(RunArguments)}
    assert names < {one.name for one in fields(RunOptions)}


def test_the_header_states_what_is_set_and_nothing_else() -> None:
    assert header_entries(RunSettings()) == {}
    found = header_entries(SET, models=[], modules={"mine.py": "sha256"})
    assert found == {"given": [], "modules": {"mine.py": "sha256"}, "trusts_map": True, "unknown": ["cup1", "all"]}


def test_a_factor_of_nothing_is_stated_and_taken_over_as_it_differs_from_none() -> None:
    header = header_entries(RunSettings(camera_noise=0.0))
    assert header == {"camera_noise": 0.0}
    assert settings_from_header(header) == {"camera_noise": 0.0}
    assert (given_or(0.0, 1.0), given_or(None, 1.0), given_or(False, True)) == (0.0, 1.0, True)


def test_a_resumed_run_takes_over_what_can_be_read_from_a_header_alone() -> None:
    assert settings_from_header(header_entries(SET)) == {"trust_map": True, "unknown": ["cup1", "all"]}


@pytest.mark.parametrize("header", [{"unknown": "cup1"}, {"unknown": None}, {"trusts_map": 1}, {"trusts_map": "yes"}])
def test_a_damaged_setting_is_not_taken_over(header: dict[str, object]) -> None:
    assert settings_from_header(header) == {}


def test_options_are_made_again_from_json() -> None:
    options = RunSettings(
        recipe="wait", set={"bottle": "bottle2"}, start=(1.0, 0.0, 0.5), models=[Path("models")], seed=0
    )
    assert made(RunSettings, json.loads(json.dumps(as_json(options, RunSettings)))) == options


def test_a_run_without_observers_has_the_same_world() -> None:
    options = RunOptions(seed=3, trust_map=True, trace=Path("run.jsonl"), watch=True, progress=print)
    assert options.unseen() == RunOptions(seed=3, trust_map=True)
    assert dict(stated(options, RunSettings)) == {"seed": 3, "trust_map": True}


def test_no_two_settings_stand_under_one_key_of_the_header() -> None:
    keys = [one.key for one in in_header().values()]
    assert len(set(keys)) == len(keys)
