"""Every option that names a file, with names under which none can be read or written: refused with advice, never a bug.

The tables have all options of all commands, which a test checks.
"""

from __future__ import annotations

import os
import shutil
import typing
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli.app import app
from planlang.knowledge.sqlite_store import SqliteStore

ROBOT = Path(__file__).resolve().parents[1] / "diagnostics" / "robot.urdf"
REST = """from planlang import plan, sleep


@plan
async def rest() -> None:
    await sleep(0.1)
"""
IN_ROOM = "rest.py --robot amigo --environment hospital_room"
NOWHERE = "http://127.0.0.1:9"

OUTPUTS = {
    "compile --output": "compile serve_a_drink -o {}.py",
    "compile --graph": "compile serve_a_drink --graph {}.svg",
    "check --output": "check serve_a_drink --fix -o {}",
    "convert --output": "convert serve_a_drink --to turtle -o {}",
    "merge --output": "merge hospital_room kitchenette -o {}",
    "show --output": "show serve_a_drink -o {}.svg",
    "show --output of a map": "show hospital_room -o {}.png",
    "show --output of a trace": "show run.jsonl -o {}",
    "run --trace": f"run {IN_ROOM} --trace {{}}",
    "run --picture": f"run {IN_ROOM} --picture {{}}.png",
    "run --video": f"run {IN_ROOM} --video {{}}.webp",
    "run --record": f"run {IN_ROOM} --record {{}}",
    "run --report": f"run {IN_ROOM} --report {{}}",
    "run --poses": f"run {IN_ROOM} --poses {{}}",
    "run --upload": f"run {IN_ROOM} --upload {{}}",
    "run --update-map": f"run {IN_ROOM} --update-map {{}}",
    "sweep --output": f"sweep {IN_ROOM} --worlds 1 --out {{}}",
    "sweep --csv": f"sweep {IN_ROOM} --worlds 1 --csv {{}}",
    "sweep --parquet": f"sweep {IN_ROOM} --worlds 1 --parquet {{}}",
    "sweep --plot": f"sweep {IN_ROOM} --worlds 1 --plot {{}}.png",
    "sweep --report": f"sweep {IN_ROOM} --worlds 1 --report {{}}",
    "sweep --junit": f"sweep {IN_ROOM} --worlds 1 --junit {{}}",
    "sweep-merge --output": "sweep-merge sweep.jsonl --out {}",
    "sweep-merge --csv": "sweep-merge sweep.jsonl --out merged.jsonl --csv {}",
    "sweep-merge --parquet": "sweep-merge sweep.jsonl --out merged.jsonl --parquet {}",
    "sweep-merge --plot": "sweep-merge sweep.jsonl --out merged.jsonl --plot {}.png",
    "sweep-merge --report": "sweep-merge sweep.jsonl --out merged.jsonl --report {}",
    "sweep-merge --junit": "sweep-merge sweep.jsonl --out merged.jsonl --junit {}",
    "sweep-table --csv": "sweep-table sweep.jsonl --csv {}",
    "sweep-table --parquet": "sweep-table sweep.jsonl --parquet {}",
    "sweep-table --plot": "sweep-table sweep.jsonl --plot {}.png",
    "sweep-table --report": "sweep-table sweep.jsonl --report {}",
    "sweep-table --junit": "sweep-table sweep.jsonl --junit {}",
    "report --output": "report run.jsonl -o {}",
    "why --apply": f"why run.jsonl {IN_ROOM} --apply {{}}",
    "why --report": f"why run.jsonl {IN_ROOM} --report {{}}",
    "locate --explain": "locate near_the_bed --robot amigo --environment hospital_room --explain {}.png",
    "serve --store": "serve --store {} --new-key ada",
    "backup target": "backup kb.sqlite {}",
    "robot inspect --picture": "robot inspect amigo --picture {}.png",
    "robot inspect --record": "robot inspect amigo --record {}",
    "robot make --output": f"robot make {ROBOT} -o {{}}",
}
"""Each with a name in place of the braces. None of these names lets the work begin."""
FOLDERS = {"new --folder": "new recipe mine --folder {}", "export --output": "export run.jsonl --to neem -o {}"}
INPUTS = {
    "compile recipe": "compile {}",
    "compile --modules": "compile serve_a_drink --modules {}",
    "compile --ontologies": "compile serve_a_drink --ontologies {}",
    "check file": "check {}",
    "convert file": "convert {} --to turtle",
    "merge maps": "merge hospital_room {}",
    "show file": "show {}",
    "match recipe": "match {} --robot amigo",
    "match --robot": "match serve_a_drink --robot {}",
    "match --urdf": "match serve_a_drink --robot amigo --urdf {}",
    "run file": "run {}",
    "run --robot": "run serve_a_drink --robot {}",
    "run --environment": "run serve_a_drink --environment {}",
    "run --world": "run serve_a_drink --world {}",
    "run --models": "run serve_a_drink --models {}",
    "run --apply": "run serve_a_drink --apply {}",
    "run --faults": "run serve_a_drink --faults {}",
    "run --set": "run serve_a_drink --set @{}",
    "run --resume": "run --resume {}",
    "sweep recipe": "sweep {} --worlds 1",
    "sweep-merge files": "sweep-merge {} --out merged.jsonl",
    "sweep-table file": "sweep-table {}",
    "enable recipe": "enable {} --robot amigo --from kb.sqlite",
    "enable --from": "enable serve_a_drink --robot amigo --from {}",
    "replay trace": "replay {}",
    "replay file": "replay run.jsonl {}",
    "report trace": "report {}",
    "why trace": "why {}",
    "export trace": "export {} --to neem -o neem",
    "export --poses": "export run.jsonl --to neem -o neem --poses {}",
    "locate --environment": "locate near_the_bed --robot amigo --environment {}",
    "backup store": "backup {} copy.sqlite",
    "push file": f"push {{}} --kind recipe --name a --to {NOWHERE} --key-file key",
    "push --key-file": f"push rest.py --kind recipe --name a --to {NOWHERE} --key-file {{}}",
    "push --attach": f"push rest.py --kind recipe --name a --to {NOWHERE} --key-file key --attach {{}}",
    "search --robot": f"search --robot {{}} --from {NOWHERE}",
    "robot inspect robot": "robot inspect {}",
    "robot make urdf": "robot make {}",
    "robot make --srdf": f"robot make {ROBOT} --srdf {{}}",
}
ELSEWHERE = {
    *("enable --folder", "enable --trace", "sweep --reports", "pull --output", "serve --access-log"),
    *("sweep --faults", "compare --faults", "report --faults", "why --faults"),
    *("delete --key-file", "rate --key-file", "watch --key-file", "push --key-file", "enable --modules"),
    *(f"compare --{name}" for name in ("output", "csv", "parquet", "plot", "report", "junit", "reports")),
    *(
        "sweep-table --reports",
        "enable --ontologies",
        "enable --urdf",
        "locate --urdf",
        "locate --ontologies",
        "robot inspect --urdf",
    ),
}
"""Options that need a server or a long run first, or are read by the code of another command."""

NAMES = {
    "a name of 300 bytes": "x" * 300,
    "a path of 5,000 bytes": "a/" * 2500 + "x",
    "a null character": "a\0b",
    "half a character": "a\ud800",
    "a file as a folder": "person.txt/x",
    "a pipe as a folder": "pipe/x",
    "a folder that is not there": "no/such/x",
}
WHOLE_NAMES = {
    "a folder": "folder",
    "the root": "/",
    "a link to itself": "loop",
    "a link to nothing": "dangling",
    "a link to a file": "link",
    "a file of a person": "person.txt",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plan, its trace, its sweep and a store."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "rest.py").write_text(REST)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for words in (
            f"run {IN_ROOM} --trace run.jsonl",
            f"sweep {IN_ROOM} --worlds 1 --processes 1 --out sweep.jsonl",
        ):
            done = invoke(words)
            assert done.exit_code == 0, done.output
    SqliteStore(folder / "kb.sqlite").close()
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The current folder, with files of a person that nothing may change."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    (tmp_path / "key").write_text("key")
    (tmp_path / "person.txt").write_text("a person's\n")
    (tmp_path / "target").write_text("written by planlang\n")
    (tmp_path / "folder").mkdir()
    for link, there in (("link", "target"), ("dangling", "made_by_link"), ("loop", "loop")):
        (tmp_path / link).symlink_to(there)
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert (tmp_path / "person.txt").read_text() == "a person's\n"
    assert (tmp_path / "target").read_text() == "written by planlang\n"
    assert [os.readlink(tmp_path / name) for name in ("link", "dangling", "loop")] == ["target", "made_by_link", "loop"]
    assert not (tmp_path / "made_by_link").exists()
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def invoke(words: str, name: str = "") -> Result:
    """Run a command in this process; its words are separated by spaces, the name is not split."""
    arguments = [word.replace("{}", name).replace("near_the_bed", "near the bed") for word in words.split()]
    return CliRunner().invoke(app, arguments, prog_name="planlang")


def check_refused(done: Result, name: str) -> None:
    assert done.exit_code in (2, 71), (name, done.exit_code, done.output[-500:], done.exception)
    assert "error " in done.stderr or "Error" in done.stderr, (name, done.output)
    assert "internal error" not in done.output


@pytest.mark.parametrize("option", [*OUTPUTS, *FOLDERS])
def test_no_output_under_an_impossible_name(option: str, folder: Path) -> None:
    command = (OUTPUTS | FOLDERS)[option]
    for why, name in NAMES.items():
        if option in FOLDERS and why == "a folder that is not there":
            continue
        check_refused(invoke(command, name), why)


@pytest.mark.parametrize("option", OUTPUTS)
def test_no_output_over_a_file_of_a_person_a_folder_or_through_a_link(option: str, folder: Path) -> None:
    command, suffix = OUTPUTS[option], Path(OUTPUTS[option]).suffix
    for why, name in WHOLE_NAMES.items():
        if (option, why) in (("serve --store", "a link to a file"),):
            continue
        command_of_name = command.replace("{}" + suffix, "{}") if suffix in (".py",) else command
        if suffix in (".png", ".svg", ".webp"):
            named = folder / f"{Path(name).name or 'root'}{suffix}"
            if why in ("a link to itself", "a link to nothing", "a link to a file"):
                named.symlink_to(os.readlink(name) if why != "a link to itself" else named.name)
            elif why == "a folder":
                named.mkdir()
            else:
                named.write_text("a person's\n")
            check_refused(invoke(command.replace(f"{{}}{suffix}", named.name)), why)
        else:
            check_refused(invoke(command_of_name, name), why)


@pytest.mark.parametrize("option", INPUTS)
def test_no_input_is_read_under_an_impossible_name_or_from_what_is_no_file(option: str, folder: Path) -> None:
    names = {
        **NAMES,
        "a folder": "folder",
        "a link to itself": "loop",
        "a link to nothing": "dangling",
        "a pipe": "pipe",
    }
    for why, name in names.items():
        if why == "a folder" and option in ("check file", "compile --ontologies", "run --models"):
            continue
        done = invoke(INPUTS[option], name)
        if option == "enable recipe" and done.exit_code == 3:  # it may be the name of a task
            continue
        check_refused(done, why)


def test_the_tables_have_every_option_that_names_a_file() -> None:
    commands = app
    found = set()
    for path, command in _commands(commands, ()):
        for one in command.params:
            shown = str(getattr(one, "metavar", None) or "")
            is_file = any(word in shown for word in ("FILE", "PLAN", "FOLDER", "DIR", "TRACE", "STORE"))
            if is_file and one.opts[0].startswith("-") and one.name not in ("modules", "set"):
                option = max(one.opts, key=len)
                found.add(f"{' '.join(path)} {option}")
    tables = {" ".join(name.split(" of ")[0].split()) for name in (*OUTPUTS, *FOLDERS, *INPUTS)} | ELSEWHERE
    shared = {name for name in found if name.endswith((" --ontologies", " --urdf", " --models", " --key-file"))}
    assert sorted(found - tables - shared) == []


def _commands(command: typing.Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], typing.Any]]:
    inner = getattr(command, "commands", None)
    if inner is None:
        yield path, command
        return
    for name, one in inner.items():
        yield from _commands(one, (*path, name))


@pytest.mark.parametrize(
    "command",
    [
        "compile serve_a_drink -o {}",
        "convert serve_a_drink --to turtle -o {}",
        "sweep-table sweep.jsonl --csv {}",
        f"run {IN_ROOM} --trace {{}}",
        f"run {IN_ROOM} --poses {{}}",
        f"run {IN_ROOM} --report {{}}",
    ],
)
def test_a_full_disk_is_told_and_leaves_nothing(command: str, folder: Path) -> None:
    done = invoke(command, "/dev/full")
    assert (done.exit_code, "No space left" in done.stderr) == (2, True), done.output


def test_of_several_outputs_of_a_run_those_that_can_be_written_are(folder: Path) -> None:
    done = invoke(
        f"run {IN_ROOM} --report /dev/full --update-map map.omn --poses poses.jsonl --trace trace.jsonl --force"
    )
    assert (done.exit_code, "/dev/full cannot be written" in done.stderr) == (2, True), done.output
    assert all((folder / name).stat().st_size for name in ("map.omn", "poses.jsonl", "trace.jsonl"))


def test_a_name_of_255_bytes_is_one_for_an_output_and_for_the_trace_before_it(folder: Path) -> None:
    name = "y" * 255
    for _ in range(2):
        assert invoke("convert serve_a_drink --to turtle -o {} --force", name).exit_code == 0
        done = invoke(f"run {IN_ROOM} --trace {{}}", "z" * 255)
        assert done.exit_code == 0, done.output
    assert (folder / f"{'z' * 251}.old").read_bytes() == (folder / ("z" * 255)).read_bytes()


def test_a_name_that_is_no_text_is_written_and_shown(folder: Path) -> None:
    done = invoke("convert serve_a_drink --to turtle -o {}", "a\udcff")
    assert (done.exit_code, (folder / "a\udcff").exists()) == (0, True), done.output


def test_with_force_a_link_is_replaced_and_what_it_leads_to_stays(folder: Path) -> None:
    os.rename("link", "other")
    assert invoke("convert serve_a_drink --to turtle -o other --force").exit_code == 0
    assert (os.path.islink("other"), "DrinkingBottle" in Path("other").read_text()) == (False, True)
    os.symlink("target", "link")


def test_where_the_current_folder_was_deleted_the_message_says_so(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "gone").mkdir()
    monkeypatch.chdir(folder / "gone")
    (folder / "gone").rmdir()
    for command in ("convert serve_a_drink --to turtle -o x", "new recipe mine", "compile serve_a_drink -o plan.py"):
        done = invoke(command)
        assert (done.exit_code, "current folder was deleted" in done.stderr) == (2, True), (command, done.output)


@pytest.mark.parametrize("cache", ["person.txt", "pipe", "x" * 300, "/dev/null", "loop"])
def test_without_a_cache_that_can_be_written_a_run_goes_on(
    cache: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / cache))
    assert invoke("check serve_a_drink").exit_code == 0


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
@pytest.mark.parametrize("option", OUTPUTS)
def test_no_output_into_a_folder_of_somebody_else(option: str, folder: Path) -> None:
    (folder / "closed").mkdir(mode=0o500)
    check_refused(invoke(OUTPUTS[option], "closed/x"), option)
