"""The commands that ask a server, with a real one: search, pull, push, rate and watch, and what was pulled."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import Result

from planlang.files import Bundled
from planlang.knowledge.client import Client
from planlang.knowledge.connection import kept_answers
from tests.support.cli_runs import invoke
from tests.support.servers import RunningServer, running_server

RECIPE = Bundled.RECIPE.find("serve_a_drink")
BOTTLE = Path(__file__).resolve().parents[3] / "docs" / "examples" / "bottle_model.omn"
DIAGNOSTICS = Path(__file__).resolve().parents[2] / "diagnostics"
BARE_ROBOT = """Prefix: : <http://example.org/bare.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/bare.owl>
Individual: bare
    Types: knowrob:Robot
"""
PLAN = """from pathlib import Path

from planlang import plan

Path("was_here").touch()


@plan
async def hello():
    pass
"""


def codes(result: Result) -> list[str]:
    return re.findall(r"(?:^|: )(?:error|warning) ([A-Z]\d{3}) ", result.stderr, flags=re.MULTILINE)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningServer]:
    """A server with one recipe of Ada's, to which a plan belongs, and one of Ben's."""
    folder = tmp_path_factory.mktemp("server")
    (folder / "hello.py").write_text(PLAN)
    with running_server(folder / "kb.sqlite") as running:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PLANLANG_SERVER", running.url)
            for author, more in (("ada", ["--attach", folder / "hello.py"]), ("ben", [])):
                patch.setenv("PLANLANG_KEY", running.key(author))
                pushed = invoke("push", RECIPE, "--kind", "recipe", "--name", author, *more)
                assert pushed.exit_code == 0, pushed.output
        yield running


@pytest.fixture(autouse=True)
def at_work(server: RunningServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in a folder and with a cache of one's own, as Ada."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PLANLANG_SERVER", server.url)
    monkeypatch.setenv("PLANLANG_KEY", server.key("ada"))


@pytest.mark.parametrize("command", ["search", "pull", "push", "rate", "delete", "watch"])
def test_help_ends_with_an_example(command: str) -> None:
    assert f"Example: planlang {command}" in invoke(command, "--help").stdout


def test_search_finds_by_expression_and_tells_what_a_robot_can_use() -> None:
    found = invoke("search", "ServingFoodOrDrink and subAction some Reaching", "--robot", "amigo", "--kind", "recipe")
    assert found.exit_code == 0, found.output
    assert found.stdout.splitlines()[0].startswith("yes      serveadrink.ada  recipe       serve a drink (by ada,")
    assert found.stdout.splitlines()[-1] == "2 entries"
    data = json.loads(invoke("search", "--label", "drink", "--limit", "1", "--json").stdout)
    assert [one["uid"] for one in data["entries"]] == ["serveadrink.ada"]
    assert "the first 1 entry" in invoke("search", "--limit", "1").stdout


def test_what_a_robot_lacks_is_told_below_each_answer() -> None:
    Path("bare.omn").write_text(BARE_ROBOT)
    found = invoke("search", "ServingFoodOrDrink", "--robot", "bare.omn", "--limit", "1")
    first, *lacks = found.stdout.splitlines()
    assert first.startswith("no       serveadrink.ada"), found.output
    assert "         ManipulationEntity: bare has none" in lacks, found.output
    unknown = invoke("search", "--robot", "panda")
    assert (unknown.exit_code, codes(unknown)) == (2, ["K037"]), "it has no self-model"
    assert "self_model = FILE" in unknown.stderr


def test_a_wrong_question_is_refused_with_its_place() -> None:
    found = invoke("search", "ServingFoodOrDrnk")
    assert (found.exit_code, codes(found)) == (2, ["K002"])
    assert "question:1:1:" in found.stderr
    assert "did you mean ServingFoodOrDrink" in found.stderr


def test_what_is_pulled_is_what_was_pushed() -> None:
    pulled = invoke("pull", "serveadrink.ben", "-o", "a/b")
    assert pulled.stdout.startswith("a/b/serveadrink.ben.omn\n"), pulled.output
    assert Path("a/b/serveadrink.ben.omn").read_bytes() == RECIPE.read_bytes()
    checked = invoke("check", "a/b/serveadrink.ben.omn")
    assert checked.exit_code == 0, checked.output


def test_an_improved_recognition_model_is_pulled_by_who_pulled_the_entry_before(server: RunningServer) -> None:
    model = Path("bottle.model")
    model.write_bytes(b"first")
    pushed = invoke("push", BOTTLE, "--kind", "object", "--name", "seen")
    assert pushed.exit_code == 0, pushed.output
    assert invoke("pull", "bottlemodel.seen", "-o", "mine").exit_code == 0
    update = ("push", BOTTLE, "--kind", "object", "--name", "bottlemodel.seen", "--update", "--attach", model)
    for data in (b"first", b"improved"):
        model.write_bytes(data)
        assert "attached bottle.model" in invoke(*update).stdout
        pulled = invoke("pull", "bottlemodel.seen", "-o", "mine")
        assert (pulled.exit_code, Path("mine/bottle.model").read_bytes()) == (0, data), pulled.output
    with Client(server.url, cache=kept_answers()) as reader, Client(server.url, server.key("eve")) as eve:
        assert reader.entry("bottlemodel.seen").ratings == 0
        eve.rate(reader.entry("bottlemodel.seen"), 9)
        assert reader.entry("bottlemodel.seen").ratings == 1
    with Client(server.url, server.key("ada")) as ada:
        ada.delete(ada.entry("bottlemodel.seen"))


def test_refusals_tell_what_else_there_is() -> None:
    unkept = invoke("pull", "serveadrink.ben", "--revision", "99")
    assert unkept.exit_code == 2
    assert "revision 99 of serveadrink.ben is not stored; stored are 1" in unkept.stderr
    Path("mine.omn").write_text(RECIPE.read_text() + "# mine\n")
    theirs = invoke("push", "mine.omn", "--kind", "recipe", "--name", "serveadrink.ben", "--update")
    assert (theirs.exit_code, codes(theirs)) == (2, ["K036"])
    assert "serveadrink.ben is not yours" in theirs.stderr
    assert "without --update you push an entry of your own" in theirs.stderr


def test_a_pulled_recipe_needs_no_trust_and_a_pulled_plan_never_runs_without() -> None:
    pulled = invoke("pull", "serveadrink.ada")
    assert codes(pulled) == ["K038"]
    assert invoke("match", "serveadrink.ada.omn", "--robot", "amigo").exit_code == 0
    Path("link.py").symlink_to("hello.py")
    as_plan = ("run", "hello.py", "--robot", "amigo", "--environment", "hospital_room")
    as_module = ("match", "serve_a_drink", "--modules", "hello.py")
    for words in (as_plan, ("run", "link.py", *as_plan[2:]), as_module):
        refused = invoke(*words)
        assert (refused.exit_code, codes(refused)) == (2, ["K038"]), refused.output
        assert "serveadrink.ada by ada" in refused.stderr
        assert not Path("was_here").exists()
    trusted = invoke(*as_plan, "--trust")
    assert trusted.exit_code == 0, trusted.output
    assert Path("was_here").exists()


def test_a_pulled_plan_is_known_by_its_content_wherever_it_is_copied_to() -> None:
    invoke("pull", "serveadrink.ada", "-o", "pulled")
    Path("elsewhere").mkdir()
    for copy in ("elsewhere/mine.py", "pulled/renamed.py"):
        shutil.copy("pulled/hello.py", copy)
        refused = invoke("run", copy, "--robot", "amigo", "--environment", "hospital_room")
        assert (refused.exit_code, codes(refused)) == (2, ["K038"]), refused.output
        assert "serveadrink.ada by ada" in refused.stderr
    for edited, code in (("pulled/hello.py", 2), ("elsewhere/mine.py", 0)):
        Path(edited).write_text(PLAN + "# edited\n")
        ran = invoke("run", edited, "--robot", "amigo", "--environment", "hospital_room")
        assert ran.exit_code == code, ran.output


def test_a_plan_of_ones_own_beside_pulled_files_runs() -> None:
    invoke("pull", "serveadrink.ada")
    Path("own.py").write_text(PLAN + "# mine\n")
    ran = invoke("run", "own.py", "--robot", "amigo", "--environment", "hospital_room")
    assert ran.exit_code == 0, ran.output


def test_a_damaged_record_lets_no_plan_run() -> None:
    invoke("pull", "serveadrink.ada")
    Path(".planlang-pulled.json").write_text("{")
    refused = invoke("run", "hello.py", "--robot", "amigo", "--environment", "hospital_room")
    assert (refused.exit_code, codes(refused)) == (2, ["K035"])
    assert invoke("pull", "serveadrink.ada", "--force").exit_code == 0


def test_pull_replaces_what_it_wrote_and_nothing_else() -> None:
    Path("hello.py").write_text("mine")
    refused = invoke("pull", "serveadrink.ada")
    assert (refused.exit_code, codes(refused)) == (2, ["C005"])
    assert Path("hello.py").read_text() == "mine"
    assert not Path("serveadrink.ada.omn").exists()
    assert invoke("pull", "serveadrink.ada", "--force").exit_code == 0
    assert invoke("pull", "serveadrink.ada").exit_code == 0
    assert Path("hello.py").read_text() == PLAN


def test_a_refused_upload_is_shown_as_check_shows_it() -> None:
    file = DIAGNOSTICS / "R012_cycle.omn"
    pushed, checked = invoke("push", file, "--kind", "recipe", "--name", "cycle"), invoke("check", file)
    assert (pushed.exit_code, codes(pushed)) == (2, ["R012"])
    assert pushed.stderr == checked.stderr
    assert "cycle" not in invoke("search", "--limit", "100").stdout


def test_an_update_makes_the_next_revision_and_earlier_ones_stay() -> None:
    shutil.copy(RECIPE, "mine.omn")
    words = ("push", "mine.omn", "--kind", "recipe", "--name", "updated")
    assert invoke(*words).stdout == "serveadrink.updated: revision 1\n"
    assert codes(invoke(*words)) == ["K036"], "it is there already"
    assert invoke(*words, "--update").stdout == ("serveadrink.updated: revision 1 has this content already\n")
    with Path("mine.omn").open("a") as file:
        file.write("\n# better\n")
    assert invoke(*words, "--update").stdout == "serveadrink.updated: revision 2\n"
    invoke("pull", "serveadrink.updated", "--revision", "1")
    assert Path("serveadrink.updated.omn").read_bytes() == RECIPE.read_bytes()
    invoke("pull", "serveadrink.updated")
    assert Path("serveadrink.updated.omn").read_bytes() == Path("mine.omn").read_bytes()
    assert invoke("pull", "serveadrink.updated", "--revision", "7").exit_code == 2


def test_nothing_is_updated_by_a_name_that_nobody_gave_or_by_another(server: RunningServer) -> None:
    missing = invoke("push", RECIPE, "--kind", "recipe", "--name", "missing", "--update")
    assert codes(missing) == ["K039"]
    Path("mine.omn").write_bytes(RECIPE.read_bytes() + b"\n# mine\n")
    others = invoke("push", "mine.omn", "--kind", "recipe", "--name", "serveadrink.ben", "--update")
    assert (others.exit_code, codes(others)) == (2, ["K036"])
    assert "not yours" in others.stderr


def test_who_changes_something_needs_a_key_which_is_never_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, server: RunningServer
) -> None:
    monkeypatch.delenv("PLANLANG_KEY")
    refused = invoke("rate", "serveadrink.ada", "8")
    assert (refused.exit_code, codes(refused)) == (2, ["K036"])
    assert "--key-file" in refused.stderr
    (tmp_path / "wrong").write_text("0" * 64)
    wrong = invoke("rate", "serveadrink.ada", "8", "--key-file", tmp_path / "wrong")
    assert codes(wrong) == ["K036"]
    assert "0000" not in wrong.output
    (tmp_path / "odd").write_text("two\nlines")
    assert codes(invoke("rate", "serveadrink.ada", "8", "--key-file", tmp_path / "odd")) == ["K034"]
    (tmp_path / "right").write_text(server.key("carl") + "\n")
    right = invoke("rate", "serveadrink.ada", "8", "--key-file", tmp_path / "right")
    assert right.stdout == (
        "serveadrink.ada: saved your rating of 8; shown: 5.0, the median of 1 rating and two neutral ones of 5\n"
    ), right.output


def test_news_are_those_of_what_was_subscribed_to() -> None:
    invoke("rate", "serveadrink.ada", "9")
    invoke("rate", "serveadrink.ben", "9")
    watched = invoke("watch", "serveadrink.ben", "--after", "0", "--once")
    assert watched.exit_code == 0, watched.output
    assert [line.split()[2:] for line in watched.stdout.splitlines()] == [
        ["created", "serveadrink.ben", "by", "ben"],
        ["rated", "serveadrink.ben", "by", "ada"],
    ]
    data = json.loads(invoke("watch", "--once", "--json").stdout)
    assert data["news"] == [], "without --after, what has been is left out"


def test_ctrl_c_is_the_usual_end_of_watching() -> None:
    assert invoke("watch", "serveadrink.ben", "--once").exit_code == 0
    words = [sys.executable, "-m", "executive", "watch", "serveadrink.ada", "--every", "0.1", "--after", "0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert "serveadrink.ada" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
    assert (process.returncode, said) == (0, "watching serveadrink.ada, serveadrink.ben\n")


def test_watching_goes_on_when_the_server_was_away(server: RunningServer, monkeypatch: pytest.MonkeyPatch) -> None:
    words = [sys.executable, "-m", "executive", "watch", "serveadrink.ada", "--every", "0.1", "--after", "0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        server.stop()
        server.start()
        monkeypatch.setenv("PLANLANG_KEY", server.key("ben"))  # Ada cannot rate what is hers
        assert invoke("rate", "serveadrink.ada", "1").exit_code == 0
        last = server.store.last_news()
        lost = threading.Timer(30, process.kill)
        lost.start()
        assert any(int(line.split()[0]) == last for line in process.stdout)
        lost.cancel()
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)
    assert process.returncode == 0


def test_without_the_server_what_was_pulled_is_there_and_said_to_be_old(
    server: RunningServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planlang.knowledge.connection.FIRST_PAUSE", 0.001)
    assert invoke("pull", "serveadrink.ada", "-o", "first").exit_code == 0
    found = invoke("search", "ServingFoodOrDrink")
    server.stop()
    try:
        same = invoke("search", "ServingFoodOrDrink")
        assert (same.stdout, codes(same)) == (found.stdout, ["K033"])
        again = invoke("pull", "serveadrink.ada", "-o", "second")
        assert (again.exit_code, codes(again)) == (0, ["K038", "K033"]), again.output
        assert (tmp_path / "second" / "hello.py").read_text() == PLAN
        for words in (("pull", "serveadrink.ben"), ("rate", "serveadrink.ada", "3"), ("search", "--label", "tea")):
            missing = invoke(*words)
            assert (missing.exit_code, codes(missing)) == (1, ["K031"]), missing.output
    finally:
        server.start()


@pytest.mark.parametrize(
    "url", ["", "serveadrink", "http://ada:secret@127.0.0.1", "http://ada:secret/1@127.0.0.1", "ada:secret@127.0.0.1"]
)
def test_an_address_that_is_none_is_bad_input(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PLANLANG_SERVER")
    refused = invoke("search", *(["--from", url] if url else []))
    assert (refused.exit_code, codes(refused)) == (2, ["K030"])
    assert "secret" not in refused.output
    assert "ada" not in refused.output


def test_the_file_of_a_store_in_place_of_an_address_is_named_with_what_serves_it() -> None:
    refused = invoke("search", "--from", "nothing.sqlite")
    assert "nothing.sqlite" in refused.output
    assert "planlang serve --store FILE" in refused.output


def test_an_entry_a_file_and_a_subscription_end_by_their_commands(
    server: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PLANLANG_KEY", server.key("dora"))
    for name in ("a.model", "b.model"):
        Path(name).write_text(name)
    words = ("--kind", "object", "--name", "old", "--attach", "a.model", "--attach", "b.model")
    assert invoke("push", BOTTLE, *words).exit_code == 0
    assert "watching bottlemodel.old" in invoke("watch", "bottlemodel.old", "--once").output
    kept = invoke("watch", "bottlemodel.older", "--stop")
    assert (kept.exit_code, codes(kept)) == (2, ["K047"])
    assert invoke("watch", "bottlemodel.old", "--stop").exit_code == 0
    assert "no subscriptions" in invoke("watch", "--once").output
    assert invoke("delete", "bottlemodel.old", "--file", "a.model").stdout == "bottlemodel.old: deleted a.model\n"
    assert [one.name for one in server.store.entry("bottlemodel.old").attachments] == ["b.model"]
    for others in ("serveadrink.ben", "none.none"):
        refused = invoke("delete", others)
        assert refused.exit_code == 2, refused.output
    assert invoke("delete", "bottlemodel.old").stdout == "bottlemodel.old: deleted all of it\n"
    assert "bottlemodel.old" not in [one.uid for one in server.store.entries()]


def test_a_rating_of_an_entry_of_ones_own_is_refused_without_advice_on_uploads() -> None:
    refused = invoke("rate", "serveadrink.ada", "9")
    assert (refused.exit_code, codes(refused)) == (2, ["K036"])
    assert "your own entry; only others can rate it" in refused.stderr
    assert "help:" not in refused.stderr
