"""Tables of the homes: what was reached of what is possible, by template and robot, and why the rest was not."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from executive.sweeps import Row
from executive.sweeps.table import causes
from planlang.proportions import wilson
from tests.benchmarks.homes.witness import is_right_reason

BEGIN, END = "<!-- begin of the table of homes -->", "<!-- end of the table of homes -->"
MOST_CAUSES = 25


def is_possible(row: Row) -> bool:
    """Return True unless the witness calls the task impossible."""
    return bool(row.get("reached")) or row.get("witness", {}).get("answer") != "impossible"


def is_proved(row: Row) -> bool:
    """Return True if a task is known to be possible: it was reached, or the witness has a certificate."""
    return bool(row.get("reached")) or row.get("witness", {}).get("answer") == "possible"


def is_false_success(row: Row) -> bool:
    """Return True for a run that claims to be done while the goal does not hold."""
    return row["outcome"] == "done" and not row.get("reached")


def is_rightly_refused(row: Row) -> bool:
    """Return True for an impossible task that ended with the right reason before any harm."""
    reason = is_right_reason(row["witness"], row.get("failure", ()), row.get("message") or row.get("cause") or "")
    return reason and not row.get("harm") and row["outcome"] != "done"


def fisher(one: tuple[int, int], other: tuple[int, int]) -> float:
    """Return the p-value, two-sided, of the exact test that two (count, total) have one probability."""
    (a, n), (b, m) = one, other
    successes = a + b
    ways = [math.comb(n, k) * math.comb(m, successes - k) for k in range(successes + 1)]
    return sum(way for way in ways if way <= ways[a]) / math.comb(n + m, successes)


def tables(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of all tables, in Markdown: of the acceptance series if there is one, else of all rows."""
    every = [row for row in rows if row["outcome"] != "not drawn"]
    drawn = [row for row in every if row.get("series") == "acceptance"] or every
    robots = list(dict.fromkeys(row["robot"] for row in drawn if "robot" in row))
    yield "Reached of what is possible, with Wilson's 95 % interval."
    yield ""
    yield from _by_robot(drawn, robots)
    yield ""
    yield from _by_template(drawn, robots)
    yield ""
    yield from _impossible(drawn, robots)
    yield from _series(every)
    yield ""
    yield "Why possible tasks were not reached: class and first sentence, number, and a command that repeats one."
    yield ""
    found = causes([row for row in drawn if is_possible(row)])
    yield from _grid(
        ("tasks", "failure", "message", "for example"),
        ((str(one.count), one.name, _cell(one.sentence), f"`{one.repeat}`") for one in found[:MOST_CAUSES]),
    )
    if len(found) > MOST_CAUSES:
        yield f"\n{len(found) - MOST_CAUSES} further causes, {sum(one.count for one in found[MOST_CAUSES:])} tasks."


def _by_robot(rows: Sequence[Row], robots: Sequence[str]) -> Iterator[str]:
    head = (
        "robot", "world", "tasks", "reached", "share", "of what is proved possible", "false successes", "opened",
        "closed", "CPU median [s]",
    )  # fmt: skip
    lines = []
    for robot in robots:
        for displaced in (False, True):
            own = [row for row in rows if row.get("robot") == robot and bool(row.get("displaced")) == displaced]
            if not own:
                continue
            lines.append((
                robot, "displaced" if displaced else "as its map", str(len(own)), *_reached(own),
                _proved(own),
                str(sum(map(is_false_success, own))), _leaves(own, "open"), _leaves(own, "close"),
                f"{sorted(row.get('cpu', 0.0) for row in own)[len(own) // 2]:.1f}",
            ))  # fmt: skip
    yield from _grid(head, lines)


def _by_template(rows: Sequence[Row], robots: Sequence[str]) -> Iterator[str]:
    templates = sorted({row["template"] for row in rows if "template" in row})
    worlds = [(robot, displaced) for robot in robots for displaced in (False, True)]
    worlds = [one for one in worlds if any(_of(row, *one) for row in rows)]
    lines = []
    for template in templates:
        cells = []
        for world in worlds:
            own = [row for row in rows if row.get("template") == template and _of(row, *world)]
            cells.append(" ".join(_reached(own)))
        lines.append((template, *cells))
    yield from _grid(("template", *(f"{r}, displaced" if d else r for r, d in worlds)), lines)


def _of(row: Row, robot: str, displaced: bool) -> bool:
    return row.get("robot") == robot and bool(row.get("displaced")) == displaced


def _reached(rows: Sequence[Row]) -> tuple[str, str]:
    """Return what was reached of what is possible, and its share with its interval."""
    possible = [row for row in rows if is_possible(row)]
    if not possible:
        return "0/0", "-"
    count = sum(bool(row.get("reached")) for row in possible)
    low, high = wilson(count, len(possible))
    return f"{count}/{len(possible)}", f"{count / len(possible):.0%} ({low:.0%} to {high:.0%})"


def _proved(rows: Sequence[Row]) -> str:
    """Return what was reached of what the witness has a certificate for, or was reached."""
    proved = [row for row in rows if is_proved(row)]
    return _reached(proved)[0]


def _leaves(rows: Sequence[Row], kind: str) -> str:
    counts = [row["leaves"][kind] for row in rows if is_possible(row) and "leaves" in row]
    total = sum(wanted for wanted, _ in counts)
    return f"{sum(served for _, served in counts)}/{total}" if total else "-"


def _impossible(rows: Sequence[Row], robots: Sequence[str]) -> Iterator[str]:
    yield "The witness on tasks that failed: impossible ones by kind, and those that ended with the right reason."
    yield "What is open counts as possible, but is not proved."
    yield ""
    lines = []
    for robot in robots:
        own = [row for row in rows if row.get("robot") == robot]
        broken = [row for row in own if not is_possible(row)]
        kinds = Counter(row["witness"]["kind"] for row in broken)
        right = sum(map(is_rightly_refused, broken))
        unproved = sum(row.get("witness", {}).get("answer") == "open" for row in own)
        said = ", ".join(f"{kind} {number}" for kind, number in sorted(kinds.items())) or "-"
        lines.append((robot, f"{len(broken)}/{len(own)}", said, f"{right}/{len(broken)}", str(unproved)))
    yield from _grid(("robot", "impossible", "kinds", "right reason", "open"), lines)


def _series(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the comparison of development and acceptance, if there are rows of both."""
    counts = {}
    for series in ("development", "acceptance"):
        own = [row for row in rows if row.get("series") == series and is_possible(row)]
        counts[series] = sum(bool(row.get("reached")) for row in own), len(own)
    (a, n), (b, m) = counts["development"], counts["acceptance"]
    if n and m:
        p = fisher((a, n), (b, m))
        yield ""
        yield f"Development {a}/{n}, acceptance {b}/{m}: Fisher's exact test, two-sided, p = {p:.3f}."


def _grid(head: Sequence[str], lines: Iterable[Sequence[str]]) -> Iterator[str]:
    rows = [list(head), *map(list, lines)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [" | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    yield f"| {lines[0]} |"
    yield f"|{'|'.join('-' * (width + 2) for width in widths)}|"
    yield from (f"| {line} |" for line in lines[1:])


def _cell(text: str) -> str:
    return text.replace("|", "/").replace("\n", " ")[:160]


def documented(page: str, text: str, first: str = BEGIN, last: str = END) -> str:
    """Return a page with the tables between its markers; raises ValueError if it has none."""
    before, begin, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not (begin and end):
        raise ValueError(f"the page lacks the lines {first} and {last}")
    return f"{before}{first}\n\n{text}\n\n{last}{after}"
