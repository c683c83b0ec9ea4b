"""The page of public robots: a table of what was drafted, and for each robot what it is and what it brought."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from executive.sweeps.records import first_sentence
from tests.benchmarks.robots_tried.trial import OPENS

BEGIN, END = "<!-- begin of the table of robots -->", "<!-- end of the table of robots -->"
Row = Mapping[str, Any]


def page(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the tables, in Markdown: a summary, what was drafted, and what each robot is and does."""
    makers = {row["truth"].get("maker") for row in rows} - {None}
    right = [row for row in rows if row.get("differs") == []]
    able = [row for row in rows if _widest(row) > OPENS]
    done = [row for row in rows if row.get("reached")]
    untried = sum(map(_is_untried, able))
    rest = f", {len(able) - len(done) - untried} do not, and {untried} were not tried" if untried else ""
    ended = [row for row in rows if "cpu" in row]
    seconds, memory = (max((row[key] for row in ended), default=0) for key in ("cpu", "memory"))
    yield (
        f"{len(rows)} robots of {len(makers)} makers: {len(right)} are drafted as their sources say; "
        f"{len(done)} of the {len(able)} with a hand that opens over {100 * OPENS:.0f} cm bring the bottle{rest}. "
        f"Drafting one takes {seconds:.0f} s of CPU and {memory} MB at most."
    )
    wrong = Counter(kind for row in rows for kind in dict.fromkeys(kind for kind, _ in row.get("differs") or ()))
    if wrong:
        yield ""
        yield f"Differences: {', '.join(f'{kind} of {number}' for kind, number in wrong.most_common())} robots."
    yield ""
    heads = ("robot", "package", "base", "torso", "tips, openings [m]", "camera", "reach", "agrees", "CPU", "brings it")
    yield f"| {' | '.join(heads)} |"
    yield "|---" * len(heads) + "|"
    yield from map(_line, rows)
    yield ""
    for row in rows:
        yield from _about(row)


def _line(row: Row) -> str:
    truth = row["truth"]
    name = f"{row['world']} ({truth['maker']})" if truth.get("maker") else str(row["world"])
    package = f"{truth.get('package', '')} {truth.get('version', '')}".strip()
    if "arms" not in row:
        return f"| {name} | {package} | | | | | | no | | {_cell(_ending(row))} |"
    arms = [f"{arm['tip']}, {_opening(arm)}" for arm in row["arms"].values()]
    reach = [" ".join(f"{count:,}" for count in counts) for counts in row.get("reach", {}).values()]
    reach += [_ending(row["unreached"])] if "unreached" in row else [] if "reach" in row else ["not asked"]
    agrees = "not stated" if row["differs"] is None else "no" if row["differs"] else "yes"
    costs = f"{row['cpu']:.0f} s, {row['memory']} MB"
    brings = "yes" if row.get("reached") else "not tried" if _widest(row) > OPENS and _is_untried(row) else "no"
    base = "stands" if row["fixed"] else "drives"
    cells = (
        name, package, base, row["torso"] or "none", "<br>".join(arms) or "none", row["camera"] or "none",
        "<br>".join(reach), agrees, costs, brings,
    )  # fmt: skip
    return f"| {' | '.join(map(_cell, cells))} |"


def _about(row: Row) -> Iterator[str]:
    """What a source says of a robot, what differs from it, and why it brings nothing."""
    says = row["truth"].get("says")
    sentences = [f"{says}." if says else ""]
    sentences += [f"Different: {'; '.join(words for _, words in row['differs'])}." if row.get("differs") else ""]
    sentences += [_brings(row)]
    if any(sentences):
        yield f"* **{row['world']}**: {' '.join(filter(None, sentences))}"


def _brings(row: Row) -> str:
    if row.get("reached"):
        return ""
    if "arms" in row and _widest(row) > OPENS and _is_untried(row):
        return "It was not tried with the bottle."
    return f"Brings nothing: {_ending(row)}."


def _is_untried(row: Row) -> bool:
    return not any(key in row for key in ("outcome", "message", "crashed", "internal", "refused"))


def _ending(row: Row) -> str:
    """Say in a sentence how it ended for a robot that brings nothing."""
    for kind in ("crashed", "internal", "refused"):
        if row.get(kind):
            said = first_sentence(str(row[kind]))
            return said if kind == "refused" else f"{kind}: {said}"
    if not any(arm["opening"] for arm in row["arms"].values()):
        return "no hand that opens was drafted" if row["arms"] else "no arm was drafted"
    if _widest(row) <= OPENS:
        return f"its hands open by {_widest(row):.3f} m at most, and the bottle is 0.065 m wide"
    return _said(row.get("message") or "") or "it was not tried"


def _said(message: str) -> str:
    """Return the first sentence of a failure and that of what caused it first, without their classes."""
    causes = [line.strip().removeprefix("because of ") for line in message.splitlines() if "because of " in line]
    sentences = [re.sub(r"^[A-Z]\w+: ", "", first_sentence(text)) for text in (message, *causes[-1:])]
    return ", because ".join(dict.fromkeys(filter(None, sentences)))


def _widest(row: Row) -> float:
    return max((arm["opening"] or 0.0 for arm in row.get("arms", {}).values()), default=0.0)


def _opening(arm: Mapping[str, Any]) -> str:
    return f"{arm['opening']:.3f}" if arm["opening"] else "no hand"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
