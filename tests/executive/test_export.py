"""Experience of a real run, exported by the command: read back, pushed to a knowledge base, and found there."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from shutil import copy
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.serving.uploads import read_upload, unpacked
from executive.serving.vocabulary import read_vocabulary
from planlang import Recovery, action, an_object, perform, with_failure_handling
from planlang.designators import local_name
from planlang.experience import experience_of, narrative, read_narrative
from planlang.experience.model import ResolvedTo
from planlang.experience.poses import read_poses
from planlang.failures import GraspMissed
from planlang.files import bundled
from planlang.knowledge.entries import Kind
from planlang.knowledge.index import Index
from planlang.knowledge.names import Names
from planlang.knowledge.questions import read_question
from planlang.ontology import load
from planlang.runs.recorded_run import read_records
from planlang.testing import Script, run_plan
from tests.executive.conftest import Served


def planlang(*words: object) -> dict[str, Any]:
    reply = CliRunner().invoke(app, [*map(str, words), "--json"], prog_name="planlang")
    found: dict[str, Any] = json.loads(reply.stdout)
    return found


@pytest.fixture(scope="module")
def run(served: Served, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for what is exported, with trace and log of poses of a run in which a first grasp is in collision."""
    folder = tmp_path_factory.mktemp("run")
    for name in ("run.jsonl", "poses.jsonl"):
        copy(served.folder / name, folder)
    return folder


@pytest.mark.long
def test_a_real_run_is_exported_with_its_failures_resolutions_and_poses(run: Path) -> None:
    found = planlang("export", run / "run.jsonl", "--to", "neem", "-o", run / "neem", "--began", "2026-11-23T14:00:00Z")
    assert set(found["recovered"]) == set(found["failed"]) == {"ManipulationGoalInCollision"}
    records = [json.loads(line) for line in (run / "run.jsonl").read_text().splitlines()]
    told = read_narrative((run / "neem" / "narrative.ttl").read_bytes(), "narrative.ttl")
    assert told == experience_of(records)
    resolved = [one for activity in told.activities for one in activity.resolutions]
    bases = [list(one.base or ()) for one in resolved if one.to is ResolvedTo.BASE_POSE]
    assert bases == [one["base"] for one in records if one["event"] == "solution"]
    modules = [one.value for one in resolved if one.to is ResolvedTo.MODULE]
    assert modules == [one["module"] for one in records if one["event"] == "request"]
    bound = {(one.designator.text, one.value) for one in resolved if one.to is ResolvedTo.THING}
    assert bound == {("bottle1", "bottle1"), ("patient1", "patient1")}
    _, poses = read_poses((run / "neem" / "poses.jsonl").read_text().splitlines(keepends=True))
    assert {one.child for one in poses} >= {"base", "bottle1"}
    assert [one.step for one in poses] == sorted(one.step for one in poses)
    assert (run / "neem" / "poses.jsonl").read_text().count("2026-11-23T14:00:") > len(poses) / 2


@pytest.mark.long
def test_what_a_crash_left_of_a_real_trace_comes_back_at_every_tenth_record(run: Path) -> None:
    records, _ = read_records(run / "run.jsonl")
    for end in range(1, len(records), 10):
        told = experience_of(records[:end])
        assert not told.is_whole
        assert read_narrative(narrative(told, "http://example.org/run"), "narrative.ttl") == told


def test_a_last_line_that_was_torn_is_left_out_and_told(run: Path, tmp_path: Path) -> None:
    torn = tmp_path / "run.jsonl"
    torn.write_bytes((run / "run.jsonl").read_bytes()[:-9])
    found = planlang("export", torn, "--to", "neem", "-o", tmp_path / "neem")
    assert [one["code"] for one in found["diagnostics"]] == ["X026"]
    assert not found["is_whole"]


def test_the_log_of_poses_follows_the_bottle_and_belongs_to_its_run_only(run: Path) -> None:
    words = ("export", run / "run.jsonl", "--to", "neem", "-o", run / "logged", "--poses")
    found = planlang(*words, run / "poses.jsonl")
    _, poses = read_poses((run / "logged" / "poses.jsonl").read_text().splitlines(keepends=True))
    assert found["poses"] == len(poses)
    heights = [one.position[2] for one in poses if one.child == "bottle1" and one.by == "log"]
    assert len(heights) > 100, "ten a second while the robot carries it"
    assert max(heights) > heights[0]
    lines = (run / "poses.jsonl").read_text().splitlines(keepends=True)
    other = run / "other.jsonl"
    for text, said in (
        (lines[0].replace('"seed": 3', '"seed": 4') + lines[1], "another run: seed"),
        (lines[0] + lines[1].replace('"step": 0', '"step": 9007199254740992'), "impossible time"),
        ("{}\n[]\n", "line 2"),
    ):
        other.write_text(text)
        refused = planlang(*words, other)
        assert [one["code"] for one in refused["diagnostics"]] == ["K081"]
        assert said in refused["diagnostics"][0]["message"]


def test_the_same_trace_gives_the_same_bytes(run: Path) -> None:
    for folder in ("one", "two"):
        planlang("export", run / "run.jsonl", "--to", "neem", "-o", run / folder)
    for name in ("narrative.ttl", "poses.jsonl"):
        assert (run / "one" / name).read_bytes() == (run / "two" / name).read_bytes()


def test_a_file_that_is_no_trace_a_time_without_zone_and_a_strange_file_in_the_folder_are_refused(
    run: Path, tmp_path: Path
) -> None:
    trace, folder = tmp_path / "run.jsonl", tmp_path / "neem"
    trace.write_text('{"step": 0, "event": "header", "schema": 5}\n')
    words = ("export", trace, "--to", "neem", "-o", folder)
    assert [one["code"] for one in planlang(*words)["diagnostics"]] == ["X020"]
    assert not folder.exists()
    usage = CliRunner().invoke(app, [*map(str, words), "--began", "2026-11-23T14:00:00"], prog_name="planlang")
    assert usage.exit_code == 2
    assert "zone" in usage.stderr
    trace.write_bytes((run / "run.jsonl").read_bytes())
    folder.mkdir()
    (folder / "narrative.ttl").write_text("mine")
    assert [one["code"] for one in planlang(*words)["diagnostics"]] == ["C005"]
    assert (folder / "narrative.ttl").read_text() == "mine"


QUESTIONS = (
    "Episode and includesRecoveredFailure some ManipulationGoalInCollision",
    "Episode and includesRecoveredFailure some ManipulationFailure",
    "Episode and includesFailure some (ManipulationFailure and hasCause some LocationUnresolvable)",
    "Episode and includesAction some (GraspingSomething and objectActedOn some DrinkingBottle)",
    "Episode and includesAction some (Reaching and hasExecutionState value ExecutionState_Failed)",
    "includesAction some (hasResolution some (resolves some LocationDesignator))",
)


@pytest.mark.long
def test_a_run_that_was_pushed_is_found_by_what_was_recovered_in_it(run: Path, tmp_path: Path) -> None:
    pytest.importorskip("fastapi", reason="the server is in the extra serve")
    from fastapi.testclient import TestClient

    from executive.serving.app import application
    from planlang.knowledge.sqlite_store import SqliteStore

    planlang("export", run / "run.jsonl", "--to", "neem", "-o", run / "pushed")
    store = SqliteStore(tmp_path / "kb.sqlite")
    key = store.new_key("ada", "2026-01-01T00:00:00Z")
    app = application(store)
    client = TestClient(app, headers={"Authorization": f"Bearer {key}"})
    content = (run / "pushed" / "narrative.ttl").read_bytes()
    made = client.post("/v1/experiences", params={"name": "run3"}, content=content)
    assert (made.status_code, made.json()["diagnostics"]) == (201, []), made.text
    assert made.json()["entry"]["uid"] == "serveadrink_episode.run3"
    for question, expected in (
        *((one, ["serveadrink_episode.run3"]) for one in QUESTIONS),
        ("Episode and includesRecoveredFailure some GraspMissed", []),
    ):
        found = client.get("/v1/search", params={"expression": question})
        assert [one["uid"] for one in found.json().get("entries", found.text)] == expected, question
    other = content.replace(b"a soma:Episode", b"a owl:Thing")
    refused = client.post("/v1/experiences", params={"name": "two"}, content=other)
    assert refused.status_code == 422
    assert refused.json()["diagnostics"][0]["code"] == "K080"
    app.state.serving.close()
    store.close()


def grasp_missed(attempts: int) -> str:
    """The narrative of a run in which the first grasp is missed, and grasping is tried so often."""

    async def grasp() -> None:
        body = partial(perform, action("GraspingSomething", object_acted_on=an_object("Cup")))
        await with_failure_handling(body, Recovery(GraspMissed, retries=attempts - 1))

    script = Script().on("GraspingSomething", fails=GraspMissed, times=1)
    run = run_plan(grasp, script=script)
    assert (run.failure is None) == (attempts > 1)
    return narrative(experience_of(run.events), f"http://example.org/{attempts}")


def test_a_failure_that_ended_the_run_was_not_recovered() -> None:
    vocabulary = read_vocabulary()
    index = Index(vocabulary.axioms)
    for attempts in (1, 2):
        upload = read_upload(Kind.EXPERIENCE, f"run{attempts}", grasp_missed(attempts).encode(), None, vocabulary)
        assert upload.diagnostics == ()
        kept, _ = unpacked(upload.content.description, vocabulary)
        assert kept is not None
        index.add(f"run{attempts}", kept.description())
    for question, found in (
        ("Episode and includesFailure some GraspMissed", ("run1", "run2")),
        ("Episode and includesRecoveredFailure some GraspMissed", ("run2",)),
        ("Episode and includesRecoveredFailure some GripperFailure", ("run2",)),
        ("includesAction some (recoveredFrom some GraspMissed)", ("run2",)),
    ):
        assert index.answers(read_question(question, Names(vocabulary.names))) == found


def test_each_word_for_experience_has_one_meaning_for_a_server() -> None:
    names = read_vocabulary().names
    words = load(bundled("ontologies") / "experience.omn", builtin=False).alone()
    stated = {term for term in words.store.terms if isinstance(term, str) and words.main(term)}
    used = {local_name(term) for term in stated if words.defined(term) or words.is_property(term)}
    assert used >= {"Episode", "GraspMissed", "includesRecoveredFailure", "hasConstituent", "Resolution"}
    assert {word: names[word] for word in used if len(names[word]) != 1} == {}
