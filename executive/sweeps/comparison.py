"""Comparison of the variants of a sweep, world by world: which is better, and how sure that is."""

from __future__ import annotations

import math
import os
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.runs.files import refuse
from executive.sweeps.files import Sweep
from executive.sweeps.headers import different_parts, environments_of, listed
from executive.sweeps.paired import (
    LEVEL,
    Counts,
    difference_interval,
    holm,
    least_difference,
    mcnemar,
    mean_interval,
    worlds_needed,
)
from executive.sweeps.records import Row, is_reached
from executive.sweeps.table import Cause, causes, fault_line, outcome_of
from planlang import notebooks
from planlang.diagnostics import Diagnostic, Span, note, warning
from planlang.outputs import PNG_OR_SVG, check_outputs, replace, write_text
from planlang.proportions import wilson
from planlang.records import dataclass

if TYPE_CHECKING:
    from planlang.sheets import Sheet

HEAD = ("variant", "worlds", "reached", "", "95 %", "plan time", "")
"""Heads of the columns of variants; plan time is the median where the goal was reached."""
MOST_CAUSES = 3
"""Maximum number of variants of which the text says the most frequent cause of failure."""
FEWEST = 6
"""Fewest worlds that can show a difference: in fewer, p is above 0.05 even if all of them differ."""
MOST_LISTED = 5
"""Maximum number of worlds in which two variants differ that the text lists for each of both."""


@dataclass(frozen=True, slots=True)
class VariantShare:
    """What a variant reached."""

    name: str
    settings: Mapping[str, str]
    """What varies in the sweep, in this variant."""
    worlds: int
    """Number of its worlds with a row."""
    reached: int
    low: float
    high: float
    """95 % confidence interval of the probability to reach the goal (Wilson score interval)."""
    duration: float | None
    """Median plan time where it reached the goal [s]; None if nowhere."""
    outcomes: Mapping[str, int]
    """Outcomes other than reached and failed -> number of worlds."""
    cause: Cause | None = None
    """The most frequent cause for which it did not reach the goal; None if it always did."""
    faults: str = ""
    """How many faults happened in its worlds; empty without faults."""

    @property
    def share(self) -> float:
        """Share of its worlds in which it reached the goal; 0 without worlds."""
        return self.reached / self.worlds if self.worlds else 0.0


@dataclass(frozen=True, slots=True)
class TimeDifference:
    """Difference of plan time, second variant less first, over worlds in which both reached the goal."""

    worlds: int
    mean: float
    """[s]"""
    interval: tuple[float, float] | None
    """95 % bootstrap interval of the mean over worlds [s]; None for fewer than five worlds."""


@dataclass(frozen=True, slots=True)
class Differing:
    """A world that only one of two variants reached, and the commands that repeat it with each."""

    world: Any
    """Key of the world: its seed."""
    reached_by: str
    repeat_first: str
    repeat_second: str


@dataclass(frozen=True, slots=True)
class Pair:
    """Two variants in the worlds in which both have a row."""

    first: str
    second: str
    n11: int
    """Worlds that both reached."""
    n10: int
    """Worlds that only the first reached."""
    n01: int
    """Worlds that only the second reached."""
    n00: int
    """Worlds that neither reached."""
    difference: float
    """Share that the second reached less that of the first, and its 95 % confidence interval (Newcombe)."""
    low: float
    high: float
    p: float
    """Of the exact McNemar test, two-sided."""
    p_holm: float
    """Corrected for the number of pairs by Holm."""
    time: TimeDifference | None
    """None if there is no world that both reached."""
    differing: tuple[Differing, ...]
    least: float | None
    """Least difference that these worlds would find with 80 %, as many of them differing; None if they find none, or if
    none of them differs."""
    needed: int | None
    """Worlds that would find the observed difference with 80 %; None without a difference."""
    only_first: tuple[Any, ...]
    """Worlds without a row of the second variant."""
    only_second: tuple[Any, ...]
    """Worlds without a row of the first variant."""

    @property
    def worlds(self) -> int:
        """Number of worlds in which both have a row."""
        return self.n11 + self.n10 + self.n01 + self.n00

    @property
    def is_different(self) -> bool:
        """True if the shares differ more than chance explains: p, corrected, is below 0.05."""
        return self.p_holm < LEVEL


@dataclass(frozen=True, slots=True)
class Comparison:
    """Variants in the same worlds; ``print`` shows a text, notebooks show tables, ``rows`` fit pandas.DataFrame."""

    variants: tuple[VariantShare, ...]
    pairs: tuple[Pair, ...]
    """All pairs: of the first variant with each other one, of the second with each later one, and so on."""
    rows: tuple[Row, ...]
    """Rows of all worlds and variants, with ``variant``, ``seed``, and a column for each setting that varies."""

    @classmethod
    def of(cls, rows: Sequence[Row], variants: Mapping[str, Mapping[str, str]]) -> Comparison:
        """Compare variants (name -> what varies) by their rows, each with ``variant`` and ``seed``."""
        by_name: dict[str, dict[Any, Row]] = {name: {} for name in variants}
        for row in sorted(rows, key=_by_seed):  # as worlds end in any order, and resamples follow from theirs
            by_name[row["variant"]][row["seed"]] = row
        pairs = list(combinations(by_name.items(), 2))
        counts = [_counts(first, second) for (_, first), (_, second) in pairs]
        values = [mcnemar(one) for one in counts]
        corrected = holm(values)
        compared = [
            _pair(*pair, counts=one, p=(p, p_holm), tests=len(pairs))
            for pair, one, p, p_holm in zip(pairs, counts, values, corrected, strict=True)
        ]
        shares = [_share(name, variants[name], list(own.values())) for name, own in by_name.items()]
        return cls(tuple(shares), tuple(compared), tuple(rows))

    def as_json(self) -> dict[str, Any]:
        """The comparison as JSON."""
        return {
            "variants": [{**asdict(one), "share": one.share} for one in self.variants],
            "pairs": [{**asdict(one), "is_different": one.is_different} for one in self.pairs],
            "rows": list(self.rows),
        }

    def __str__(self) -> str:
        return "\n".join((self.text_of_pairs, *_cause_lines(self.variants)))

    @property
    def text_of_pairs(self) -> str:
        """The text without causes of failure."""
        return "\n".join(_lines(self))

    def _repr_html_(self) -> str:
        """Tables for notebooks, and what is said of each pair."""
        variants = notebooks.table(HEAD, map(_cells, self.variants))
        pairs = notebooks.table(
            ("", "against", "difference", "95 %", "p", "verdict"),
            (
                (one.second, one.first, _points(one.difference), _span(one), f"{one.p_holm:.2g}", _verdict(one))
                for one in self.pairs
            ),
        )
        return variants + pairs if self.pairs else variants

    @property
    def different(self) -> tuple[Pair, ...]:
        """Pairs whose shares differ more than chance explains."""
        return tuple(one for one in self.pairs if one.is_different)

    @property
    def worse(self) -> tuple[Pair, ...]:
        """Those of the first variant with one that reaches the goal less often, by more than chance explains."""
        first = self.variants[0].name if self.variants else None
        return tuple(one for one in self.different if one.first == first and one.difference < 0)

    @property
    def by_variant(self) -> Mapping[str, Sequence[Row]]:
        """Rows of each variant, sorted by seed."""
        rows = sorted(self.rows, key=_by_seed)
        return {one.name: [row for row in rows if row["variant"] == one.name] for one in self.variants}

    @property
    def figure(self) -> Sheet:
        """Goals reached with intervals, worlds not yet reached over plan time, and causes; notebooks show it."""
        from executive.sweeps.figures import figure  # Pillow is slow to import, and most comparisons are not drawn

        return figure(self.by_variant)

    def plot(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write the figure as PNG or SVG, and return the path.

        ``force`` overwrites a file that planlang did not write. Raises BadInput if the file cannot be written.
        """
        target = Path(path)
        refuse(check_outputs({"plot": target}, {}, formats={"plot": PNG_OR_SVG}, force=force))
        replace(target, self.figure.save)
        return target

    def report(
        self,
        path: str | os.PathLike[str],
        *,
        title: str = "Comparison",
        pages: Mapping[tuple[str, Any], Path] | None = None,
        force: bool = False,
    ) -> Path:
        """Write an HTML page with tables, figures and the worlds that differ, and return its path.

        ``pages`` are files to link: variant and seed -> page of that world. ``force`` and errors are those of ``plot``.
        """
        from executive.sweeps.comparison_page import page

        target = Path(path)
        refuse(check_outputs({"report": target}, {}, force=force))
        write_text(target, page(title, self, pages, target.parent))
        return target


def comparison_of(sweeps: Sequence[Sweep]) -> Comparison:
    """Compare sweeps in the worlds that they have in common; each is a variant, or has some.

    The variants of one that is alone keep their names.
    """
    if len(sweeps) == 1 and sweeps[0].variants:
        return Comparison.of(sweeps[0].rows, sweeps[0].variants)
    rows, variants, files = list[Row](), dict[str, Mapping[str, str]](), set[str]()
    for sweep in sweeps:
        file = sweep.file
        while file in files:  # a file compared with itself
            file += " again"
        files.add(file)
        own = {name: f"{file}: {name}" for name in sweep.variants}
        variants |= {own[name]: columns for name, columns in sweep.variants.items()} if own else {file: {}}
        for row in sweep.rows:
            name = own[row["variant"]] if own else file
            rows.append({**row, "variant": name, "seed": row["seed"] if own else row["world"]})
    return Comparison.of(rows, variants)


def notes_on(sweeps: Sequence[Sweep]) -> Iterator[Diagnostic]:
    """Say how sweeps that are compared differ, and warn if they, or variants, are not in the same environment."""
    first = sweeps[0]
    yield from _other_environments(first, first, len(sweeps) == 1)
    for other in sweeps[1:]:
        yield from _other_environments(other, first)
        if told := different_parts(other.header, first.header, environments=False):
            yield note("C039", f"it differs from {first.file}: {'; '.join(told)}", Span(other.file, 1))
        elif environments_of(other.header) == environments_of(first.header):
            yield note("C039", f"{other.file} and {first.file} are files of the same sweep", Span(other.file, 1))


def _other_environments(sweep: Sweep, first: Sweep, is_alone: bool = False) -> Iterator[Diagnostic]:
    """Warn of variants, or of a sweep without some, in another environment than the first variant of all."""
    known, own = environments_of(first.header), environments_of(sweep.header)
    reference = next(iter(known.values()))
    others = [name for name, environment in own.items() if environment and environment != reference]
    if reference and others:
        same = [name for name, environment in known.items() if environment == reference]
        pair = f"{_named(sweep, others, is_alone)} and {_named(first, same, is_alone)}"
        message = f"{pair} are in different environments: their worlds are not the same"
        yield warning("C038", message, Span(sweep.file, 1))


def _named(sweep: Sweep, variants: Sequence[str], is_alone: bool) -> str:
    """Name variants of a sweep, by its file if they are all that it has."""
    if len(variants) == max(1, len(sweep.variants)):
        return sweep.file
    return listed(variants) if is_alone else f"{sweep.file}: {listed(variants)}"


def _by_seed(row: Row) -> tuple[bool, Any]:
    return isinstance(row["seed"], str), row["seed"]


def _counts(first: Mapping[Any, Row], second: Mapping[Any, Row]) -> Counts:
    found = Counter((is_reached(row), is_reached(second[seed])) for seed, row in first.items() if seed in second)
    return Counts(found[True, True], found[True, False], found[False, True], found[False, False])


def _share(name: str, settings: Mapping[str, str], rows: Sequence[Row]) -> VariantShare:
    reached = [row for row in rows if is_reached(row)]
    times = [row["duration"] for row in reached if "duration" in row]
    others = Counter(outcome_of(row) for row in rows if not is_reached(row))
    del others["failed"]
    median = statistics.median(times) if times else None
    interval = wilson(len(reached), len(rows))
    cause = next(iter(causes(rows)), None)
    return VariantShare(
        name, dict(settings), len(rows), len(reached), *interval, median, dict(others), cause, fault_line(rows)
    )


def _pair(
    first: tuple[str, Mapping[Any, Row]],
    second: tuple[str, Mapping[Any, Row]],
    *,
    counts: Counts,
    p: tuple[float, float],
    tests: int,
) -> Pair:
    (name1, rows1), (name2, rows2) = first, second
    both = [(seed, row, rows2[seed]) for seed, row in rows1.items() if seed in rows2]
    differing = [
        Differing(seed, name1 if is_reached(one) else name2, str(one.get("repeat", "")), str(other.get("repeat", "")))
        for seed, one, other in both
        if is_reached(one) != is_reached(other)
    ]
    return Pair(
        name1,
        name2,
        *(counts.n11, counts.n10, counts.n01, counts.n00),
        counts.difference,
        *difference_interval(counts),
        *p,
        time=_time(both),
        differing=tuple(differing),
        least=least_difference(counts.worlds, counts.differing, tests) if differing else None,
        needed=worlds_needed(counts.differing, counts.difference, tests),
        only_first=tuple(seed for seed in rows1 if seed not in rows2),
        only_second=tuple(seed for seed in rows2 if seed not in rows1),
    )


def _time(both: Sequence[tuple[Any, Row, Row]]) -> TimeDifference | None:
    reached = ((one, other) for _, one, other in both if is_reached(one) and is_reached(other))
    values = [
        other["duration"] - one["duration"] for one, other in reached if "duration" in one and "duration" in other
    ]
    if not values:
        return None
    return TimeDifference(len(values), math.fsum(values) / len(values), mean_interval(values))


# The text


def _lines(comparison: Comparison) -> Iterator[str]:
    yield from _aligned([HEAD, *map(_cells, comparison.variants)])
    if any(one.faults for one in comparison.variants):
        yield ""
        yield from (f"{one.name}: {one.faults or 'no faults'}" for one in comparison.variants)
    for one in comparison.pairs:
        yield ""
        yield from _pair_lines(one, len(comparison.pairs))


def _cause_lines(variants: Sequence[VariantShare]) -> Iterator[str]:
    """Yield the most frequent cause of failure of each variant, the most frequent first, with a world to repeat."""
    failing = sorted(((one, one.cause) for one in variants if one.cause), key=lambda pair: -pair[1].count)
    if failing:
        yield "\nmost frequent cause of failure"
    for one, cause in failing[:MOST_CAUSES]:
        name = f"{cause.name}: {cause.sentence}" if cause.sentence else cause.name
        yield f"  {one.name}, {cause.count} of {_worlds(one.worlds)}: {name}"
        yield f"    {cause.repeat or f'world {cause.world}'}"
    if len(failing) > MOST_CAUSES:
        yield f"  of {len(failing) - MOST_CAUSES} more: the table of each file has all causes"


def _cells(one: VariantShare) -> tuple[str, ...]:
    time = "" if one.duration is None else f"{one.duration:.1f} s"
    others = ", ".join(f"{number} {outcome}" for outcome, number in one.outcomes.items())
    share, interval = f"{100 * one.share:.1f} %", f"{100 * one.low:.1f} to {100 * one.high:.1f} %"
    return one.name, str(one.worlds), str(one.reached), share, interval, time, others


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield lines of a table: the first column and the last to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for first, *middle, last in rows:
        numbers = (f"{text:>{width}}" for text, width in zip(middle, widths[1:-1], strict=True))
        yield f"{first:<{widths[0]}}  {'  '.join(numbers)}  {last}".rstrip()


def _pair_lines(pair: Pair, tests: int) -> Iterator[str]:
    yield f"{pair.second} against {pair.first}: {_verdict(pair)}"
    for name, alone in ((pair.first, pair.only_first), (pair.second, pair.only_second)):
        if alone:
            yield f"  {_worlds(len(alone))} only of {name}, not compared: {_listed(alone)}"
    if not pair.worlds:
        yield "  no world has a row of both"
        return
    yield (
        f"  reached by both {pair.n11}, only by {pair.first} {pair.n10}, only by {pair.second} {pair.n01}, "
        f"by neither {pair.n00}"
    )
    yield f"  difference {_points(pair.difference)} (95 %: {_span(pair)})"
    yield f"  {_chance(pair, tests)}"
    if pair.time is not None:
        yield f"  {_time_line(pair.time)}"
    yield f"  {_power_line(pair)}"
    for name in (pair.first, pair.second):
        yield from _differing_lines(pair, name)


def _verdict(pair: Pair) -> str:
    if not pair.is_different:
        return "no difference shown"
    return f"different, {pair.second if pair.difference > 0 else pair.first} reaches the goal more often"


def _chance(pair: Pair, tests: int) -> str:
    """What the test says, in plain words, with its name and value."""
    corrected = f", {_number(pair.p_holm)} with Holm's correction for {tests} pairs" if tests > 1 else ""
    test = f"exact McNemar test: p = {_number(pair.p)}{corrected}"
    if pair.n10 + pair.n01 == 0:
        return f"both ended alike in each world ({test})"
    of = next((of for of in (100, 1000, 10_000) if of * pair.p >= 1), 10_000)
    often = f"{round(of * pair.p)} of {of:,}" if of * pair.p >= 1 else f"less than 1 of {of:,}"
    return f"if both were equally good, {often} comparisons would differ as much by chance ({test})"


def _number(p: float) -> str:
    return f"{p:.2g}" if p >= 1e-4 else "0.0001 or less"


def _time_line(time: TimeDifference) -> str:
    where = f"plan time in the {_worlds(time.worlds)} that both reached"
    longer = f"{time.mean:+.1f} s on average"
    if time.interval is None:
        return f"{where}: {longer}; too few for an interval"
    return f"{where}: {longer} (95 %: {time.interval[0]:+.1f} to {time.interval[1]:+.1f} s)"


def _power_line(pair: Pair) -> str:
    """What these worlds would show, and how many the observed difference needs."""
    of = f"{_worlds(pair.worlds)}, of which {len(pair.differing)} differ,"
    if not pair.differing and pair.worlds >= FEWEST:
        return f"none of {_worlds(pair.worlds)} differs, which does not tell how large a difference they would show"
    if pair.least is None:
        return f"{_worlds(pair.worlds)} {'is' if pair.worlds == 1 else 'are'} too few to show any difference"
    shown = f"{of} show a difference of {100 * pair.least:.0f} points or more in 80 of 100 cases"
    if pair.is_different or pair.needed is None:
        return shown
    return f"{shown}; one of {abs(100 * pair.difference):.1f} points needs about {pair.needed} worlds"


def _differing_lines(pair: Pair, name: str) -> Iterator[str]:
    found = [one for one in pair.differing if one.reached_by == name]
    if not found:
        return
    yield f"  reached only by {name}:"
    for one in found[:MOST_LISTED]:
        yield f"    world {one.world}: {one.repeat_first}"
        yield f"    {'':>{len(f'world {one.world}')}}  {one.repeat_second}"
    if len(found) > MOST_LISTED:
        yield f"    and {len(found) - MOST_LISTED} more: {_listed([one.world for one in found[MOST_LISTED:]])}"


def _listed(worlds: Sequence[Any]) -> str:
    return ", ".join(map(str, worlds[:10])) + (", ..." if len(worlds) > 10 else "")


def _worlds(number: int) -> str:
    return f"{number} world" + "s" * (number != 1)


def _points(difference: float) -> str:
    return f"{100 * difference:+.1f} points"


def _span(pair: Pair) -> str:
    return f"{100 * pair.low:+.1f} to {100 * pair.high:+.1f}"
