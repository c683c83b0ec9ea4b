"""``planlang report``: a run is repeated for its page, or shown as far as its trace goes, with what is missing."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang import sleep
from planlang.files import Bundled
from planlang.testing import run_plan
from tests.executive.report.conftest import Reported


def called(*words: object) -> dict[str, Any]:
    """Return what the command prints as JSON."""
    ended = CliRunner().invoke(app, [*map(str, words), "--json"], prog_name="planlang")
    assert ended.exit_code in (0, 2), ended.output
    return dict(json.loads(ended.stdout))


def model_in(page: Path) -> dict[str, Any]:
    found = re.search(r'id="model">(.*?)</script>', page.read_text(encoding="utf-8"))
    assert found is not None
    return dict(json.loads(found[1]))


@pytest.mark.long
def test_a_repeated_run_has_the_page_of_the_run_itself(reported: Reported, tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    assert called("report", reported.trace, "-o", page)["repeated"] is True
    first, again = model_in(reported.page), model_in(page)
    assert again["facts"].pop("world") == "repeated"
    assert first == again


def test_a_run_that_was_cut_off_is_shown_up_to_there(reported: Reported, tmp_path: Path) -> None:
    lines = reported.trace.read_text(encoding="utf-8").splitlines(keepends=True)
    trace = tmp_path / "cut.jsonl"
    trace.write_text("".join(lines[:100]) + lines[100][:20], encoding="utf-8")
    answer = called("report", trace)
    assert answer["repeated"] is True
    model = model_in(tmp_path / "cut.html")
    assert model["outcome"]["status"] == "running"
    assert model["end"] == pytest.approx(json.loads(lines[99])["step"] / 30, abs=1e-3)
    keys, every = (sum(one["keys"] for one in part["scene"]["entities"]) for part in (model, model_in(reported.page)))
    assert keys < every / 2, "the world goes no further than the trace"


@pytest.mark.long
def test_a_resumed_run_has_the_page_of_one_that_was_never_cut_off(reported: Reported, tmp_path: Path) -> None:
    trace, page = tmp_path / "run.jsonl", tmp_path / "run.html"
    lines = reported.trace.read_text(encoding="utf-8").splitlines(keepends=True)
    trace.write_text("".join(lines[:100]), encoding="utf-8")
    called("run", "--resume", trace, "--report", page)
    assert model_in(page) == model_in(reported.page)


def test_another_map_is_not_shown_and_the_page_says_why(reported: Reported, tmp_path: Path) -> None:
    room = tmp_path / "room.omn"
    room.write_text(Bundled.ENVIRONMENT.find("hospital_room").read_text() + "\n# changed\n")
    answer = called("report", reported.trace, "-o", tmp_path / "run.html", "--environment", room)
    assert answer["repeated"] is False
    model = model_in(tmp_path / "run.html")
    assert model["missing"] == answer["missing"]
    assert "the map" in model["missing"][0]
    assert "scene" not in model
    assert [one["name"] for one in model["sources"]] == ["serve_a_drink.py", "serve_a_drink.omn"]
    assert model["graph"]["title"] == "ServeADrink"


def test_a_page_that_shows_more_is_kept_unless_forced(reported: Reported, tmp_path: Path) -> None:
    trace, page = tmp_path / "run.jsonl", tmp_path / "run.html"
    header, rest = reported.trace.read_text(encoding="utf-8").split("\n", 1)
    trace.write_text(header.replace('"plan_sha256": "', '"plan_sha256": "0') + "\n" + rest, encoding="utf-8")
    page.write_bytes(before := reported.page.read_bytes())
    refused = called("report", trace)
    assert [one["code"] for one in refused["diagnostics"]] == ["C005"]
    assert "shows map, scene, serve_a_drink.py" in refused["diagnostics"][0]["message"]
    assert "The plan is not shown" in refused["diagnostics"][0]["message"]
    assert page.read_bytes() == before
    assert called("report", trace, "--force")["repeated"] is False
    assert "scene" not in model_in(page)
    assert called("report", trace)["repeated"] is False, "a page that shows as much is replaced"


def test_a_scripted_run_has_no_world(tmp_path: Path) -> None:
    async def wait() -> None:
        await sleep(2)

    trace = tmp_path / "run.jsonl"
    trace.write_text(run_plan(wait).trace.text(), encoding="utf-8")
    answer = called("report", trace)
    assert "scripted" in answer["missing"][0]
    assert model_in(tmp_path / "run.html")["nodes"][0]["name"] == "wait"


def test_a_file_that_is_no_trace_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "run.jsonl").write_text("{}\n")
    answer = called("report", tmp_path / "run.jsonl")
    assert [one["code"] for one in answer["diagnostics"]] == ["X020"]
    assert not (tmp_path / "run.html").exists()


@pytest.mark.long
def test_a_failing_world_of_a_sweep_leaves_a_page(tmp_path: Path) -> None:
    room = tmp_path / "tower.omn"
    text = Bundled.ENVIRONMENT.find("hospital_room").read_text()
    room.write_text(text.replace("knowrob:m23 0.9,", "knowrob:m23 2.3,"))
    words = ("sweep", "serve_a_drink", "--robot", "amigo", "--environment", room, "--worlds", 1, "--processes", 1)
    ended = CliRunner().invoke(app, [*map(str, words), "--reports", str(tmp_path / "pages")], prog_name="planlang")
    assert ended.exit_code == 1
    model = model_in(tmp_path / "pages" / "world-1.html")
    assert (model["outcome"]["status"], model["facts"]["seed"]) == ("failed", "1")
