"""Figures, page, Parquet and JUnit of a sweep: what they show, of whatever strangers wrote, and always the same."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from browsers import Watched, started_browser
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from executive.sweeps.comparison import Comparison
from executive.sweeps.exports import junit_text, save_parquet
from executive.sweeps.figures import curve, figure, figures, fitted, nice_step, spread
from executive.sweeps.files import header_of, write_sweep
from executive.sweeps.records import Row, World, columns_of
from planlang.diagnostics import BadInput
from planlang.outputs import is_replaceable
from tests.support.cli_runs import invoke
from tests.support.refusals import refusal

EVIL = "<script>alert(1)</script>\u202e\x1b[2J & ]]> \ud800"
PANDA = ("pass_a_drink", "--robot", "panda", "--worlds", "2")


def row(variant: str, seed: int, is_reached: bool, **more: Any) -> dict[str, Any]:
    known = {
        "world": f"{variant} {seed}",
        "repeat": f"planlang run pour --seed {seed}",
        "variant": variant,
        "seed": seed,
    }
    if is_reached:
        return {**known, "outcome": "done", "failure": [], "message": "", "duration": 10.0 + seed, **more}
    failed = {
        "outcome": "failed",
        "failure": ["ObjectNotFound", "GraspMissed"],
        "message": "ObjectNotFound: no bottle1",
    }
    return {**known, **failed, "duration": 3.5, **more}


def compared(first: str = "old", second: str = "new") -> Comparison:
    rows = [row(first, seed, seed % 2 == 0) for seed in range(1, 7)]
    rows += [row(second, seed, seed != 3) for seed in range(1, 7)]
    return Comparison.of(rows, {first: {}, second: {}})


def test_figures_show_each_variant_with_its_interval_its_curve_and_its_causes() -> None:
    drawn = dict(figures(compared().by_variant))
    success, survival, causes = (sheet.svg() for sheet in drawn.values())
    assert ">3 of 6, 50.0 %<" in success
    assert ">5 of 6, 83.3 %<" in success
    assert survival.count('stroke-width="4"') == 2, "two curves"
    assert ">ObjectNotFound &lt; GraspMissed: no bottle1<" in causes
    assert re.findall(r">(\d+)<", causes) == ["3", "1"]


def test_figures_are_left_out_where_there_is_nothing_to_show() -> None:
    assert len(dict(figures({"all": [row("all", 1, True)]}))) == 2
    assert len(dict(figures({"all": [row("all", 1, False)]}))) == 2
    assert len(dict(figures({"all": []}))) == 1


def test_many_variants_and_causes_are_drawn_and_further_causes_are_counted() -> None:
    rows = {f"v{n}": [row(f"v{n}", s, s > n, message=f"cause {chr(97 + s)}") for s in range(12)] for n in range(12)}
    assert ">4 further causes, in 10 worlds<" in figure(rows).svg()


@given(st.lists(st.floats(0, 1e6), min_size=1, max_size=20), st.integers(0, 5))
def test_a_curve_falls_with_each_goal_reached_and_ends_at_those_that_are_never(times: list[float], never: int) -> None:
    times, worlds = sorted(times), len(times) + never
    step, number = nice_step(times[-1])
    points = curve(times, worlds, step * number)
    assert 1 <= number <= 8
    assert points[0] == (0.0, 1.0)
    assert points[-1][0] >= times[-1]
    assert points[-1][1] == pytest.approx(never / worlds)
    assert points == sorted(points, key=lambda point: (point[0], -point[1]))


@given(st.lists(st.floats(0, 100), max_size=8))
def test_labels_keep_their_distance_and_their_order_within_the_plot(places: list[float]) -> None:
    found = spread(sorted(places), 10, 0, 100)
    assert all(after - before >= 10 - 1e-9 for before, after in pairwise(found))
    assert all(-1e-9 <= place <= 100 + 1e-9 for place in found)


def test_a_long_text_keeps_both_ends_and_a_short_one_is_whole() -> None:
    assert fitted("robot=amigo", 13, 200) == "robot=amigo"
    assert re.fullmatch(r"robot=a+\.\.\.a+ grip=new", fitted(f"robot={'a' * 100} grip=new", 13, 200))
    assert fitted("a\nb\u202e", 13, 200) == "a b\\u202e"


def test_plots_are_pictures_with_equal_bytes(tmp_path: Path) -> None:
    for name in ("one.png", "two.png", "one.svg", "two.svg"):
        assert compared().plot(tmp_path / name) == tmp_path / name
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()
    with Image.open(tmp_path / "one.png") as picture:
        assert picture.width == 860
    ElementTree.parse(tmp_path / "one.svg")
    compared().plot(tmp_path / "one.svg")
    (tmp_path / "mine.svg").write_text("<svg/>")
    with refusal("C005"):
        compared().plot(tmp_path / "mine.svg")
    with refusal("C004"):
        compared().plot(tmp_path / "plot.pdf")
    assert compared().figure._repr_svg_().startswith("<svg")


class _Elements(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))


def test_the_page_has_tables_figures_worlds_that_differ_and_links_to_pages_of_failed_worlds(tmp_path: Path) -> None:
    page = compared().report(
        tmp_path / "page.html", title="pour", pages={("old", 1): tmp_path / "a b" / "world-1.html"}
    )
    text = page.read_text()
    elements = _Elements(text)
    assert "<h1>pour</h1>" in text
    assert "new against old: worlds that differ" in text
    assert "<td>no difference shown</td>" in text
    assert text.count("planlang run pour --seed 5</code>") == 3, "both commands of the world, and that of the failure"
    links = [attributes["href"] for tag, attributes in elements.tags if tag == "a"]
    assert links == ["./a%20b/world-1.html"] * 2
    assert sum(tag == "svg" for tag, _ in elements.tags) == 3
    assert compared().report(page, title="pour", pages={}).read_text() != text
    assert is_replaceable(page)


def test_the_page_is_readable_in_light_and_dark_and_asks_for_nothing(tmp_path: Path) -> None:
    page = compared().report(tmp_path / "page.html", pages={("old", 1): tmp_path / "world-1.html"})
    with started_browser() as browser:
        for scheme, width in (("light", 1200), ("dark", 1200), ("light", 400)):
            shown = Watched(browser, color_scheme=scheme, viewport={"width": width, "height": 900})
            shown.page.goto(page.as_uri())
            assert (shown.said, shown.asked, shown.findings()) == ([], [], [])
            assert shown.page.evaluate("document.documentElement.scrollWidth") == width
            assert shown.page.evaluate("document.documentElement.classList.contains('dark')") == (scheme == "dark")
            shown.page.click("#theme")
            assert shown.page.evaluate("document.documentElement.classList.contains('dark')") == (scheme == "light")


def test_texts_of_strangers_are_escaped_on_page_figure_and_in_junit(tmp_path: Path) -> None:
    rows = [row(EVIL, 1, False, message=EVIL, failure=[EVIL], repeat=EVIL), row("b", 1, True)]
    comparison = Comparison.of(rows, {EVIL: {}, "b": {}})
    text = comparison.report(tmp_path / "page.html", title=EVIL).read_text()
    assert sum(tag == "script" for tag, _ in _Elements(text).tags) == 1
    assert not {"\u202e", "\x1b"} & set(text)
    ElementTree.fromstring(comparison.figure.svg())
    root = ElementTree.fromstring(junit_text(EVIL, comparison.by_variant).encode())
    failure = root.find(".//failure")
    assert failure is not None
    assert failure.attrib["message"].startswith("<script>alert(1)</script>\\u202e\\u001b[2J & ]]> \\ud800")
    assert comparison.plot(tmp_path / "plot.png").stat().st_size > 0


def test_junit_has_a_test_for_each_world_and_variant_with_cause_and_command() -> None:
    rows = {
        "a": [row("a", 1, True), row("a", 2, False)],
        "b": [row("b", 1, False, outcome="crashed", failure=["OutOfTime"])],
    }
    text = junit_text("pour", rows)
    root = ElementTree.fromstring(text.encode())
    assert (root.attrib["tests"], root.attrib["failures"], root.attrib["errors"]) == ("3", "1", "1")
    tests = [
        (one.attrib["classname"], one.attrib["name"], [child.tag for child in one]) for one in root.iter("testcase")
    ]
    assert tests == [("a", "world 1", []), ("a", "world 2", ["failure"]), ("b", "world 1", ["error"])]
    failure = root.find(".//failure")
    assert failure is not None
    assert failure.attrib == {"type": "ObjectNotFound", "message": "ObjectNotFound: no bottle1"}
    lines = "ObjectNotFound < GraspMissed\nObjectNotFound: no bottle1\nplanlang run pour --seed 2"
    assert failure.text == lines


def test_parquet_has_the_rows_with_their_types_and_equal_bytes(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    import pyarrow.parquet

    rows = [
        row("a", 1, True, final_state=["bottle1: on table1"], tilts={"bottle1": 2.5}, reached=True),
        row("a", 2, False, final_state=[], large=2**70, mixed=1, text=EVIL),
        {"world": "a 3", "mixed": "two"},
    ]
    for name in ("one.parquet", "two.parquet"):
        save_parquet(tmp_path / name, rows)
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "two.parquet").read_bytes()
    table = pyarrow.parquet.read_table(tmp_path / "one.parquet")
    kinds = {name: str(table.schema.field(name).type) for name in ("seed", "duration", "failure", "reached", "large")}
    assert list(kinds.values()) == ["int64", "double", "list<element: string>", "bool", "double"]
    found = table.to_pylist()
    assert [one["seed"] for one in found] == [1, 2, None]
    assert json.loads(found[0]["tilts"]) == {"bottle1": 2.5}
    assert (found[1]["mixed"], found[2]["mixed"]) == ("1", "two")
    assert is_replaceable(tmp_path / "one.parquet")
    other = tmp_path / "other.parquet"
    pyarrow.parquet.write_table(table.replace_schema_metadata({}), other)
    assert not is_replaceable(other)


def test_without_pyarrow_the_command_that_installs_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.extras.find_spec", lambda name: None)
    done = invoke("sweep", *PANDA, "--parquet", tmp_path / "rows.parquet")
    assert done.exit_code == 2
    assert "C012" in done.stderr
    assert "pip install" in done.stderr
    assert "or leave out --parquet" in done.stderr


def ended(worlds: Sequence[World], job: str, on: str, *, out: Path, about: Any, **more: object) -> list[Row]:
    """Rows of worlds in which the plan fails, and the file of the sweep."""
    rows = [{**columns_of(world), "outcome": "failed", "duration": 2.0} for world in worlds]
    write_sweep(out, header_of(job, about, worlds, (1, 1)), rows)
    return rows


@pytest.mark.parametrize("command", ["sweep", "compare"])
def test_sweep_and_compare_write_all_files_and_sweep_table_writes_them_again(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    monkeypatch.setattr("executive.commands.sweep.run", ended)
    vary = ("--vary", "schedule=1,2") if command == "compare" else ()
    names = ("csv", "parquet", "plot", "report", "junit")
    files = {name: tmp_path / f"new.{'png' if name == 'plot' else name}" for name in names}
    again = {name: tmp_path / f"again.{'png' if name == 'plot' else name}" for name in names}
    rows = tmp_path / "rows.jsonl"
    done = invoke(command, *PANDA, *vary, "--output", rows, *(w for n, f in files.items() for w in (f"--{n}", f)))
    assert done.exit_code == (0 if command == "compare" else 1), done.stderr
    shown = invoke("sweep-table", rows, *(w for n, f in again.items() for w in (f"--{n}", f)))
    assert shown.exit_code == 1, shown.stderr
    for name in ("csv", "parquet", *(["plot"] if vary else [])):
        assert files[name].read_bytes() == again[name].read_bytes()
    assert "<h1>pass_a_drink</h1>" in files["report"].read_text()
    suites = ElementTree.parse(files["junit"]).getroot()
    assert [one.attrib["tests"] for one in suites] == ["2"] * (2 if vary else 1)


def test_pages_of_failed_worlds_are_linked_also_from_a_page_that_compares_files(tmp_path: Path) -> None:
    header = {"sweep": "written by planlang", "version": "0", "job": "j", "shard": [1, 1], "worlds_sha256": "0"}
    words: list[object] = []
    for name in ("one", "two"):
        rows = [{"world": 1, "outcome": "failed"}, {"world": 2, "outcome": "done"}]
        lines = [{**header, "about": {}, "worlds": [1, 2]}, *rows]
        (tmp_path / f"{name}.jsonl").write_text("".join(f"{json.dumps(one)}\n" for one in lines))
        (tmp_path / name).mkdir()
        (tmp_path / name / "world-1.html").write_text("")
        words += ["--reports", tmp_path / name]
    done = invoke(
        "sweep-table", tmp_path / "one.jsonl", tmp_path / "two.jsonl", *words, "--report", tmp_path / "p.html"
    )
    assert done.exit_code == 0, done.stderr
    links = [one["href"] for tag, one in _Elements((tmp_path / "p.html").read_text()).tags if tag == "a"]
    assert links == ["./one/world-1.html", "./two/world-1.html"]


def test_the_files_are_checked_before_the_first_world(tmp_path: Path) -> None:
    done = invoke("compare", *PANDA, "--vary", "schedule=1,2", "--plot", tmp_path / "plot.pdf")
    assert (done.exit_code, "C004" in done.stderr) == (2, True)
    with pytest.raises(BadInput):
        compared().report(tmp_path / "none" / "page.html")
