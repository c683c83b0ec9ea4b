"""The documentation shows what the program does: blocks of code, diagnostic codes, folders, links.

``python -m tests.repository.test_documentation [PAGE...]`` writes the outputs of pages anew, of all if none is named.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import pytest

from tests.support.page_runs import Found, PageRun, renewed
from tests.support.pages import CHECKOUT, all_pages, blocks, commands, fitted, shape
from tests.support.servers import running_server

PAGES = {str(page.relative_to(CHECKOUT)): page.read_text(encoding="utf-8") for page in all_pages()}
PACKAGES = ("planlang", "executive", "sim")
CODES = re.findall(r"^\| `([A-Z]\d{3})` \| .+? \|$", PAGES["docs/reference/codes.md"], flags=re.MULTILINE)
"""The codes of diagnostics that are explained."""
LONG = (
    "README.md",
    *(
        f"docs/guides/{name}.md"
        for name in (
            "ci",
            "cluster",
            "compiling",
            "cooking",
            "debugging_a_failed_run",
            "faults",
            "knowledge",
            "library_use",
            "modules",
        )
    ),
    *(
        f"docs/guides/{name}.md"
        for name in ("published_recipes", "reasoning", "recording", "report", "resuming", "running", "searching")
    ),
    *("docs/guides/comparing.md", "docs/guides/sweeping.md", "docs/guides/testing.md"),
    *("docs/first_steps/first_plan.md", "docs/first_steps/own_robot.md"),
    *("docs/reference/formats.md", "docs/reference/gallery.md"),
)
"""Pages that take longer; beside ``make test-long`` their commands are only parsed, and their programs compiled."""
WITH_NOTHING: dict[str, tuple[str, ...]] = {
    "docs/reference/architecture.md": ("recipe.owl | .omn | .ttl", "planlang/*.py"),
    "docs/reference/formats.md": ('name = "amigo"', "[camera.noise]"),
    "docs/guides/knowledge.md": ("robot cannot do it; alternatives",),
    "docs/reference/faults.md": ("PART.NAME:KIND",),
}
"""How blocks begin that are no code of the page: a drawing, and folders, whose names another test compares; the keys of
robot files, with placeholders, and a table of one; an answer about entries that are in
tests/executive/enabling/test_alternatives.py; the grammar of faults.
"""


@contextmanager
def knowledge_base(folder: Path) -> Iterator[Mapping[str, str]]:
    """The server of the page about the knowledge base, with the keys of two authors."""
    with running_server(folder / "kb.sqlite") as server:
        (folder / "ben.key").write_text(server.key("ben"))
        settings = {
            "PLANLANG_SERVER": server.url,
            "PLANLANG_KEY": server.key("ada"),
            "XDG_CACHE_HOME": str(folder / "cache"),
        }
        with patch.dict("os.environ", settings):
            yield {"https://knowledge.example.org": server.url}


STAGES: dict[str, Callable[[Path], AbstractContextManager[Mapping[str, str]]]] = {
    "docs/guides/knowledge.md": knowledge_base
}
"""What stands around a page while it runs: maps what the page shows to what stands for it here."""


def ran(name: str, folder: Path, *, dry: bool = False) -> Found:
    """What comes of running a page in a folder."""
    stage = nullcontext({}) if dry else STAGES.get(name, lambda _: nullcontext({}))(folder)
    with stage as aliases:
        return PageRun(PAGES[name], folder, dry=dry, exempt=WITH_NOTHING.get(name, ()), aliases=aliases).run()


MARKED = [pytest.param(name, marks=pytest.mark.long if name in LONG else ()) for name in PAGES]


@pytest.mark.parametrize("name", MARKED)
def test_the_blocks_of_a_page_run_and_print_what_it_shows(name: str, tmp_path: Path) -> None:
    found = ran(name, tmp_path)
    assert found.wrong == [], "\n\n".join([name, *found.wrong])
    if found.skipped:
        pytest.skip(f"all else agrees; {', '.join(sorted(set(found.skipped)))}")


@pytest.mark.parametrize("name", LONG)
def test_the_blocks_of_a_long_page_can_be_read(name: str, tmp_path: Path) -> None:
    found = ran(name, tmp_path, dry=True)
    assert found.wrong == [], "\n\n".join([name, *found.wrong])


def test_an_output_without_its_command_is_no_transcript() -> None:
    with pytest.raises(ValueError, match="no command prints this"):
        commands(blocks("```console\nKilled\n```\n")[0])


def test_code_stands_between_fences() -> None:
    with pytest.raises(ValueError, match="line 3: code stands between fences"):
        blocks("words\n\n    code\n")


def test_what_is_counted_in_words_has_to_agree() -> None:
    assert shape("equal to the end: 211 lines") != shape("equal to the end: 212 lines")
    assert shape("x 1.5  211 lines at 3.25 s") == shape("x 2.5  211 lines at 4.5 s")


@pytest.mark.parametrize(
    ("page", "wrong"),
    [
        ("```console\n$ planlang check --no-such-option x.omn\n```\n", "No such option"),
        ("```console\n$ rm x\n```\n", "no command that pages use"),
        ("```console\n$ make nothing\n```\n", "no target nothing"),
        ("```console\n$ cat missing\n...\n```\n", "exit code 1"),
        ("```python\nprint(1)\n```\n", "shows what it prints"),
        ("```python\nprint('a')\n```\n\n```text\nb\n```\n", "this prints\na"),
        ("```toml\nno_such_key = 3\n```\n", "neither an output nor"),
    ],
)
def test_a_page_that_shows_what_is_not_so_is_refused(page: str, wrong: str, tmp_path: Path) -> None:
    assert wrong in "\n".join(PageRun(page, tmp_path).run().wrong)


def test_files_commands_and_programs_of_a_page_see_each_other(tmp_path: Path) -> None:
    page = (
        '```python title="five.py"\nprint(5)\n```\n```console\n$ python five.py\n5\n$ cat none; echo $?\n...\n1\n```\n'
        "```python\nx = 2\n```\n```python\nprint(x)\n```\n```text\n2\n```\n"
    )
    assert PageRun(page, tmp_path).run().wrong == []
    stale = page.replace("\n5\n", "\n6\n").replace("text\n2", "text\n3\n4")
    found = PageRun(stale, tmp_path).run()
    assert renewed(stale, found) == page


def test_published_files_are_listed_and_pages_that_use_them_say_where_they_are() -> None:
    listed = (CHECKOUT / "docs" / "examples" / "published_files.txt").read_text(encoding="utf-8")
    names = {line.split()[0].rpartition("/")[2] for line in listed.splitlines() if not line.startswith("#")}
    for page, text in PAGES.items():
        used = set(re.findall(r"[\w-]+@[\w-]+\.(?!fixed)[\w.]*\w", text))
        assert sorted(used - names) == [], page
        assert not used or "published_recipes" in page or "published_recipes.md)" in text, page


def test_every_page_is_in_the_table_of_contents() -> None:
    listed = re.findall(r"^[a-z_]+/[a-z_]+$", PAGES["docs/index.md"], flags=re.MULTILINE)
    pages = sorted(name.removeprefix("docs/").removesuffix(".md") for name in PAGES if name.count("/") == 2)
    assert sorted(listed) == pages


def test_a_new_output_keeps_what_was_shown_of_the_old_one() -> None:
    old = "a 1\n...\nc 1\nd 1\n...\nf 1\n"
    new = "a 2\nb 2\nc 2\nd 2\ne 2\nf 2\n"
    assert fitted(old, new) == "a 2\n...\nc 2\nd 2\n...\nf 2\n"
    assert fitted("...\nd 1\n...\n", new) == "...\nd 2\n...\n"
    assert fitted("a 1\n", new) == new
    with pytest.raises(LookupError, match="by hand"):
        fitted("...\nx 1\n...\n", new)


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
    for page in (*all_pages(), CHECKOUT / "CONTRIBUTING.md", CHECKOUT / "SECURITY.md"):
        text = page.read_text(encoding="utf-8")
        links = {link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link}
        assert [link for link in sorted(links) if link and not (page.parent / link).exists()] == [], page.name
    listed = re.findall(r"^([a-z_]+/[a-z_/]*) {2,}", PAGES["docs/reference/architecture.md"], flags=re.MULTILINE)
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


def rewrite(names: list[str]) -> None:
    """Run pages and write outputs that no longer agree."""
    for name in names or PAGES:
        with TemporaryDirectory() as folder:
            found = ran(name, Path(folder))
        sys.stdout.write("\n".join([f"{name}: {dict(found.kinds)}", *found.wrong, ""]))
        try:
            (CHECKOUT / name).write_text(renewed(PAGES[name], found), encoding="utf-8")
        except LookupError as problem:
            sys.stdout.write(f"{name}: {problem}\n")


if __name__ == "__main__":
    rewrite(sys.argv[1:])
