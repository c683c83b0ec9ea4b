"""The documentation shows what the program does: outputs of commands, diagnostic codes, folders, links.

``python tests/repository/test_documentation.py`` writes the outputs and the table of codes anew. A line ``...`` in an
output stands for any number of lines. Numbers are compared only when the pages are written.
"""

from __future__ import annotations

import re
import runpy
import shlex
from contextlib import chdir
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.cli.app import app
from executive.runs.options import RunOptions, RunResult

CHECKOUT = Path(__file__).resolve().parents[2]
README = CHECKOUT / "README.md"
PAGES = {page.name: page.read_text(encoding="utf-8") for page in (README, *sorted(CHECKOUT.glob("docs/**/*.md")))}
OF_THEIR_OWN = ("knowledge.md", "locations.md")
"""Pages whose outputs another test compares."""
PACKAGES = ("planlang", "executive", "sim")

CODES = re.findall(r"^\| `([A-Z]\d{3})` \| .+? \|$", PAGES["codes.md"], flags=re.MULTILINE)
"""The codes of diagnostics that are explained."""
BLOCK = re.compile(r"```console\n\$ planlang (.+)\n((?:(?!```).*\n)*)```")
ELISION = "...\n"
FIRST_RUN_ONLY = "building the reachability map"
"""How lines about what is kept for later runs begin; pages show a second run."""


def output(command: str, folder: Path) -> str:
    """Return what ``planlang`` with these arguments prints in a folder, stdout and stderr in the order of writing."""
    with chdir(folder):
        ended = CliRunner().invoke(app, shlex.split(command), prog_name="planlang")
    lines = ended.output.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith(FIRST_RUN_ONLY))


def agrees(shown: str, real: str) -> bool:
    """Return whether an output is as a page shows it, ``...`` standing for any lines."""
    parts = [re.escape(part) for part in shown.split(ELISION)]
    return re.fullmatch(r"(?:.*\n)*?".join(parts), real) is not None


def shape(text: str) -> str:
    """An output without its numbers, which may differ in the last digits from machine to machine, and times."""
    return re.sub(r" +", " ", re.sub(r"(?<![\w@.])-?\d+(\.\d+)?|(?<=\dT)\d+", "#", text))


def fitted(shown: str, real: str) -> str:
    """A new output in the place of an old one; where that left lines out, the new one leaves the same ones out.

    As many lines as before are kept at each end; an excerpt between two ``...`` is looked for, numbers aside, and
    LookupError tells one that is no longer there.
    """
    first, *excerpts = shown.split(ELISION)
    if not excerpts:
        return real
    lines = real.splitlines(keepends=True)
    *middle, last = excerpts
    end = first.count("\n")
    parts = ["".join(lines[:end])]
    for excerpt in middle:
        number, shapes = excerpt.count("\n"), shape(excerpt)
        places = range(end, len(lines) - number + 1)
        start = next((place for place in places if shape("".join(lines[place : place + number])) == shapes), None)
        if start is None:
            raise LookupError(f"choose an excerpt of the new output by hand, in the place of\n{excerpt}")
        end = start + number
        parts.append("".join(lines[start:end]))
    parts.append("".join(lines[len(lines) - last.count("\n") :]))
    return ELISION.join(parts)


def prepare(command: str, folder: Path, corpus: Path) -> bool:
    """Put what a command reads into its folder: a trace, real OWL files; False when these are not at hand."""
    if command.startswith(("replay", "report")) and not (folder / "run.jsonl").exists():
        output("run serve_a_drink --trace run.jsonl", folder)
    if command.startswith("sweep-merge") and not (folder / "first.jsonl").exists():
        output("sweep serve_a_drink --worlds 2 --shard 1/2 --out first.jsonl", folder)
    if "serve.py" in command and not (folder / "serve.py").exists():
        edit_plan_and_recipe(folder)
    for name, there in (("corpus", corpus), ("docs", CHECKOUT / "docs")):
        if f"{name}/" in command and not (folder / name).exists():
            (folder / name).symlink_to(there)
    for name in re.findall(r"\S+@\S+", command):
        found = next(corpus.rglob(name), None)
        if found is None:
            return False
        if not (folder / name).exists():
            (folder / name).symlink_to(found)
    return True


def edit_plan_and_recipe(folder: Path) -> None:
    """Leave a plan that a person has edited, of a recipe that has changed since."""
    recipe, plan = folder / "serve.omn", folder / "serve.py"
    text = (CHECKOUT / "recipes" / "serve_a_drink.omn").read_text(encoding="utf-8")
    recipe.write_text(text, encoding="utf-8")
    output("compile serve.omn -o serve.py", folder)
    compiled = plan.read_text(encoding="utf-8")
    plan.write_text(compiled.replace('"""Grasp a bottle."""', '"""Grasp a bottle gently."""'), encoding="utf-8")
    recipe.write_text(text.replace("let go of the bottle when", "give the bottle away once"), encoding="utf-8")


def shown_outputs() -> dict[str, list[str]]:
    """Command -> its output as the pages show it; a command stands on several pages, and runs once."""
    commands: dict[str, list[str]] = {}
    for name, page in PAGES.items():
        for command, shown in BLOCK.findall(page) if name not in OF_THEIR_OWN else ():
            commands.setdefault(command, []).append(shown)
    return commands


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder where all commands run: what one writes another reads."""
    return tmp_path_factory.mktemp("commands")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Try each command that README shows; ``make test-long`` scenarios that take longer and those of other pages."""
    if "command" in metafunc.fixturenames:
        from tests.support.scenarios import run_by  # as a script this file sees no other tests

        here = dict(BLOCK.findall(PAGES["README.md"]))
        ran = {command: run_by(shlex.split(command)) for command in shown_outputs()}
        short = [one for one, scenario in ran.items() if one in here and (scenario is None or scenario.is_quick)]
        marked = [one if one in short else pytest.param(one, marks=pytest.mark.long) for one in ran]
        metafunc.parametrize("command", marked, ids=str)


@pytest.mark.xdist_group("documentation")  # in one process: they share the folder
def test_an_output_in_the_documentation_is_what_its_command_prints(
    command: str, folder: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The goal of a scenario with the same command is reached as well: the run is the same."""
    from tests.support.extras import skip_without_pr2
    from tests.support.scenarios import Judged, judged_run, run_by

    skip_without_pr2(command)
    scenario = run_by(shlex.split(command))
    ended: list[Judged] = []

    def run(options: RunOptions) -> RunResult:
        assert scenario is not None
        ended.append(judged_run(scenario, options))
        return ended[0].result

    if scenario is not None:
        monkeypatch.setattr("executive.cli.run.run_plan_file", run)
    corpus = request.getfixturevalue("corpus") if "@" in command or "corpus/" in command else folder
    assert prepare(command, folder, corpus), "the corpus lacks a file that the documentation uses"
    real = output(command, folder)
    for shown in shown_outputs()[command]:
        assert agrees(shape(shown), shape(real)), f"planlang {command} prints:\n{real}"
    assert scenario is None or [one.reached for one in ended] == [True], ended


def test_a_new_output_keeps_what_was_shown_of_the_old_one() -> None:
    old = "a 1\n...\nc 1\nd 1\n...\nf 1\n"
    new = "a 2\nb 2\nc 2\nd 2\ne 2\nf 2\n"
    assert fitted(old, new) == "a 2\n...\nc 2\nd 2\n...\nf 2\n"
    assert fitted("...\nd 1\n...\n", new) == "...\nd 2\n...\n"
    assert fitted("a 1\n", new) == new
    with pytest.raises(LookupError, match="by hand"):
        fitted("...\nx 1\n...\n", new)


def test_the_recipes_in_the_documentation_are_bundled_ones() -> None:
    files = ("recipes/serve_a_drink.omn", "ontologies/environments/hospital_room.omn", "ontologies/searching.omn")
    bundled = "".join((CHECKOUT / file).read_text(encoding="utf-8") for file in files)
    blocks = re.findall(r"```manchester\n(.+?)```", "".join(PAGES.values()), flags=re.DOTALL)
    assert blocks
    for block in blocks:
        for part in block.split("...\n"):
            assert part in bundled


def test_the_plan_tests_in_the_readme_pass(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.+?)```", PAGES["README.md"], flags=re.DOTALL)
    tests = [block for block in blocks if "def test_" in block]
    assert tests
    for number, block in enumerate(tests):
        path = tmp_path / f"test_readme_{number}.py"
        path.write_text(block, encoding="utf-8")
        names = runpy.run_path(str(path))
        for name, value in names.items():
            if name.startswith("test_"):
                value()


def test_the_table_of_codes_explains_each_once_in_order() -> None:
    assert sorted(set(CODES)) == CODES


def test_every_code_that_the_program_says_is_explained_and_every_explained_code_is_said() -> None:
    said: set[str] = set()
    for package in PACKAGES:
        for path in sorted((CHECKOUT / package).rglob("*.py")):
            said.update(re.findall(r'"([A-Z]\d{3})"', path.read_text("utf-8")))
    assert sorted(said - set(CODES)) == [], "said, not explained in docs/reference/codes.md"
    assert sorted(set(CODES) - said) == [], "explained, never said"


def test_every_file_and_folder_that_a_page_names_is_there() -> None:
    for page in (README, CHECKOUT / "CONTRIBUTING.md", CHECKOUT / "SECURITY.md", *CHECKOUT.glob("docs/**/*.md")):
        text = page.read_text(encoding="utf-8")
        links = {link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link}
        assert [link for link in sorted(links) if link and not (page.parent / link).exists()] == [], page.name
    listed = re.findall(r"^([a-z_]+/[a-z_/]*) {2,}", PAGES["architecture.md"], flags=re.MULTILINE)
    assert listed
    assert [folder for folder in listed if not (CHECKOUT / folder).is_dir()] == []


@pytest.mark.parametrize("thing", ["relation", "process module", "recovery", "robot", "dialect"])
def test_each_guide_of_contributing_is_followed_by_a_test(thing: str) -> None:
    text = (CHECKOUT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    guide = text.partition(f"## How to add a {thing}")[2].partition("\n## ")[0]
    test = (CHECKOUT / "tests" / "extending" / f"test_add_a_{thing.replace(' ', '_')}.py").read_text(encoding="utf-8")
    blocks = re.findall(
        r"```(?:python|manchester|toml)\n(.+?)```", re.sub(r"(?m)^   (?=\S| )", "", guide), flags=re.DOTALL
    )
    assert blocks
    if "GUIDE" not in test:  # a test that reads the guide itself follows it in any case
        lines = {line.strip().replace('"', "") for line in re.split(r"\n|\\n", test)}
        shown = [line.strip().replace('"', "") for block in blocks for line in block.splitlines()]
        assert [line for line in shown if line not in lines and "project.entry-points" not in line] == []


def rewrite() -> None:
    """Write outputs that no longer agree, and the table of codes, into the pages."""
    import tempfile

    corpus = CHECKOUT.parent / "shared" / "corpus"

    def renewed(block: re.Match[str]) -> str:
        command, shown = block.groups()
        with tempfile.TemporaryDirectory() as folder:
            if not prepare(command, Path(folder), corpus):
                return block.group()
            real = output(command, Path(folder))
        return block.group() if agrees(shown, real) else f"```console\n$ planlang {command}\n{fitted(shown, real)}```"

    for page in (README, *CHECKOUT.glob("docs/**/*.md")):
        if page.name not in OF_THEIR_OWN:
            page.write_text(BLOCK.sub(renewed, PAGES[page.name]), encoding="utf-8")


if __name__ == "__main__":
    rewrite()
