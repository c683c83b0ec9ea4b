"""Comparisons pair rows by their worlds, say what differs, and drop no world silently."""

from __future__ import annotations

import random
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from executive.sweeps.comparison import Comparison, comparison_of, notes_on
from executive.sweeps.files import Sweep
from executive.sweeps.headers import differences

A, B = "grip=old", "grip=new"
NAMES = {A: {"grip": "old"}, B: {"grip": "new"}}


def row(variant: str, seed: int, *, reached: bool, duration: float = 10.0) -> dict[str, Any]:
    known = {"world": f"{variant} {seed}", "repeat": f"planlang run pour --set {variant} --seed {seed}"}
    outcome = {"outcome": "done" if reached else "failed", "duration": duration}
    return {**known, "variant": variant, "seed": seed, **NAMES[variant], **outcome}


def rows_of(first: str, second: str) -> list[dict[str, Any]]:
    """Rows of two variants in worlds from 1 on; a letter says whether it was reached (r), failed (f) or is missing."""
    letters = {A: first, B: second}
    return [
        row(name, seed, reached=letter == "r", duration=10.0 + (name == B) * seed)
        for name, text in letters.items()
        for seed, letter in enumerate(text, 1)
        if letter != "-"
    ]


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=40))
def test_each_world_is_in_one_of_four_counts_and_those_that_differ_are_listed(worlds: list[tuple[bool, bool]]) -> None:
    rows = [
        row(name, seed, reached=both[number]) for seed, both in enumerate(worlds) for number, name in enumerate((A, B))
    ]
    (pair,) = Comparison.of(rows, NAMES).pairs
    counts = [worlds.count(both) for both in ((True, True), (True, False), (False, True), (False, False))]
    assert [pair.n11, pair.n10, pair.n01, pair.n00] == counts
    differing = {seed: A if first else B for seed, (first, second) in enumerate(worlds) if first != second}
    assert {one.world: one.reached_by for one in pair.differing} == differing


def test_the_order_of_rows_changes_nothing_that_is_said() -> None:
    rows = rows_of("rrfrfrfrrf", "rffrrrrfrr")
    mixed = random.Random(3).sample(rows, len(rows))
    assert Comparison.of(mixed, NAMES).variants == Comparison.of(rows, NAMES).variants
    (one,), (other,) = Comparison.of(mixed, NAMES).pairs, Comparison.of(rows, NAMES).pairs
    assert one == other


def test_a_difference_in_most_worlds_is_called_different_and_one_in_few_is_not() -> None:
    clear = str(Comparison.of(rows_of("f" * 8 + "r" * 4, "r" * 12), NAMES))
    assert f"{B} against {A}: different, {B} reaches the goal more often\n" in clear
    assert f"reached by both 4, only by {A} 0, only by {B} 8, by neither 0" in clear
    assert "difference +66.7 points" in clear
    assert "if both were equally good, 8 of 1,000 comparisons would differ as much by chance" in clear
    assert "world 1: planlang run pour --set grip=old --seed 1\n" in clear
    assert "planlang run pour --set grip=new --seed 1\n" in clear
    assert "and 3 more: 6, 7, 8" in clear
    unclear = str(Comparison.of(rows_of("frrrrfff", "rrrrrfff"), NAMES))
    assert f"{B} against {A}: no difference shown\n" in unclear
    assert "worlds, of which 1 differ, show a difference of" in unclear
    assert "needs about" in unclear


def test_worlds_that_all_end_alike_do_not_tell_which_difference_they_would_show() -> None:
    alike = Comparison.of(rows_of("ffffff", "ffffff"), NAMES)
    assert alike.pairs[0].least is None
    assert "  none of 6 worlds differs, which does not tell how large a difference they would show" in str(alike)
    assert "  1 world is too few to show any difference" in str(Comparison.of(rows_of("f", "f"), NAMES))


def test_the_most_frequent_cause_is_said_of_the_three_variants_that_failed_most_of_it() -> None:
    def failed(variant: str, *causes: str) -> list[dict[str, Any]]:
        return [
            {"world": f"{variant} {seed}", "variant": variant, "seed": seed, "repeat": f"run {variant} {seed}"}
            | {"outcome": "failed", "failure": [cause], "message": f"{cause}: it is far. Go nearer."}
            for seed, cause in enumerate(causes, 1)
        ]

    rows = [*failed("a", "Lost"), *failed("b", "Lost", "Far", "Far"), *failed("c", "Far"), *failed("d", "Far")]
    found = Comparison.of(rows, {name: {} for name in "abcde"})
    assert [one.cause and one.cause.count for one in found.variants] == [1, 2, 1, 1, None]
    assert str(found).endswith(
        "\n\nmost frequent cause of failure\n"
        "  b, 2 of 3 worlds: Far: it is far\n    run b 2\n"
        "  a, 1 of 1 world: Lost: it is far\n    run a 1\n"
        "  c, 1 of 1 world: Far: it is far\n    run c 1\n"
        "  of 1 more: the table of each file has all causes"
    )
    assert "most frequent cause" not in found.text_of_pairs


def test_worlds_of_one_variant_only_are_named_and_not_compared() -> None:
    comparison = Comparison.of(rows_of("rr-rr", "r-frr"), NAMES)
    (pair,) = comparison.pairs
    assert (pair.worlds, pair.only_first, pair.only_second) == (3, (2,), (3,))
    assert f"1 world only of {A}, not compared: 2" in str(comparison)
    assert f"1 world only of {B}, not compared: 3" in str(comparison)
    assert [one.worlds for one in comparison.variants] == [4, 4]
    nothing = Comparison.of(rows_of("r-", "-r"), NAMES)
    assert "no world has a row of both" in str(nothing)


def test_plan_time_is_compared_where_both_reached_the_goal() -> None:
    (pair,) = Comparison.of(rows_of("rrrrrrf", "rrrrrfr"), NAMES).pairs
    assert pair.time is not None
    assert (pair.time.worlds, pair.time.mean) == (5, 3.0)
    assert pair.time.interval is not None
    low, high = pair.time.interval
    assert 1.0 <= low < 3.0 < high <= 5.0
    assert "plan time in the 5 worlds that both reached: +3.0 s on average (95 %: " in str(
        Comparison.of(rows_of("rrrrrrf", "rrrrrfr"), NAMES)
    )


def test_of_three_variants_all_pairs_are_compared_with_a_correction() -> None:
    names = {**NAMES, "none": {}}
    rows = rows_of("f" * 9 + "r", "r" * 10) + [
        {"world": f"none {seed}", "variant": "none", "seed": seed, "outcome": "failed"} for seed in range(1, 11)
    ]
    pairs = Comparison.of(rows, names).pairs
    assert [(one.first, one.second) for one in pairs] == [(A, B), (A, "none"), (B, "none")]
    assert all(one.p_holm >= one.p for one in pairs)
    assert "with Holm's correction for 3 pairs" in str(Comparison.of(rows, names))


def test_sweeps_are_compared_by_their_files_and_rows_of_them_are_told_apart() -> None:
    def sweep(file: str, reached: str) -> Sweep:
        rows = [{"world": n, "outcome": "done" if one == "r" else "failed"} for n, one in enumerate(reached, 1)]
        return Sweep(file, {"about": {}, "worlds": [row["world"] for row in rows]}, tuple(rows))

    comparison = comparison_of([sweep("a.jsonl", "rrf"), sweep("b.jsonl", "rffr"), sweep("a.jsonl", "rrf")])
    assert [one.name for one in comparison.variants] == ["a.jsonl", "b.jsonl", "a.jsonl again"]
    first, same, _ = comparison.pairs
    assert (first.n11, first.n10, first.n01, first.n00, first.only_second) == (1, 1, 0, 1, (4,))
    assert same.differing == ()
    assert {row["variant"] for row in comparison.rows} == {"a.jsonl", "b.jsonl", "a.jsonl again"}


def test_what_differs_between_sweeps_is_said_and_other_environments_are_warned_of() -> None:
    def sweep(file: str, **about: str) -> Sweep:
        return Sweep(file, {"about": about, "version": "1", "job": "x", "worlds": []}, ())

    first = sweep("a", arguments="planlang run x", **{"content of environment": "1"})
    same = sweep("b", arguments="planlang run x", **{"content of environment": "1"})
    other = sweep("c", arguments="planlang run y", **{"content of environment": "2"})
    told = [(one.severity.value, one.code, one.message) for one in notes_on([first, same, other])]
    assert told == [
        ("note", "C039", "b and a are files of the same sweep"),
        ("warning", "C038", "c and a are in different environments: their worlds are not the same"),
        ("note", "C039", "it differs from a: planlang run y, not planlang run x"),
    ]


def with_variants(file: str, **variants: dict[str, Any]) -> Sweep:
    """A sweep whose variants depend on what is stated of each."""
    about = {f"{name}: {key}": value for name, own in variants.items() for key, value in own.items()}
    return Sweep(file, {"about": {"variants": {name: {} for name in variants}, "seconds": 9, **about}, **REST}, ())


REST = {"version": "1", "job": "x", "worlds": [], "worlds_sha256": ""}


def test_variants_in_other_environments_are_warned_of_within_a_file_and_between_files() -> None:
    here, there = {"content of environment": "1"}, {"content of environment": "2"}
    one, both = with_variants("one", a=here, b=here), with_variants("both", a=here, b=there)
    plain = Sweep("plain", {"about": {"seconds": 9, **there}, **REST}, ())
    said = [
        [text.message.partition(" are in")[0] for text in notes_on(sweeps) if text.code == "C038"]
        for sweeps in ([one], [both], [one, both], [both, one], [plain, one], [both, plain])
    ]
    assert said == [
        [],
        ["b and a"],
        ["both: b and one"],
        ["both: b and both: a"],
        ["one and plain"],
        ["both: b and both: a", "plain and both: a"],
    ]


def test_what_differs_between_variants_is_said_in_few_words_and_once() -> None:
    digest = {"content of recipe": "0" * 64, "content of robot": "1" * 64, "settings": {}}
    plain = Sweep("plain", {"about": {"seconds": 9, "arguments": "run x", **digest}, **REST}, ())
    mine = {"arguments": "run y --set a=b", **digest, "settings": {"a": "b"}, "content of robot": "2" * 64}
    file = with_variants("file", old={"arguments": "run y", **digest}, mine=mine)
    (found,) = notes_on([plain, file])
    assert found.message == (
        "it differs from plain: its variants are old, mine; old: run y, not run x; "
        "mine: run y --set a=b, not run x; mine: other contents of robot"
    )
    slower = with_variants("slower", old={**digest, "seconds": 5}, mine={**mine, "seconds": 5})
    (found,) = notes_on([with_variants("known", old=digest, mine=mine), slower])
    assert found.message == "it differs from known: seconds are 5, not 9"
    assert differences(file.header, with_variants("other", old=mine, new=mine).header) == [
        "its variants are old, mine, not old, new",
        "old: without --set a=b",
        "old: other contents of robot",
    ]
    assert differences(file.header, file.header) == []


def test_a_notebook_shows_tables_in_which_names_are_text() -> None:
    names = {"<b>": {}, B: {}}
    rows = [{**one, "variant": "<b>" if one["variant"] == A else B} for one in rows_of("rf", "rr")]
    page = Comparison.of(rows, names)._repr_html_()
    assert "<td>&lt;b&gt;</td>" in page
    assert "<td>no difference shown</td>" in page
