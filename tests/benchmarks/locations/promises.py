"""Promises about finding places, beside what was measured."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Promise:
    """One line of the last table."""

    what: str
    measured: str
    bound: str
    kept: bool


@dataclass(slots=True)
class Report:
    """The results of one part of the measurements: promises, and how many answers were wrong."""

    promises: list[Promise] = field(default_factory=list)
    wrong: int = 0
    seconds: float = 0.0
    """CPU time that it took [s]."""

    def add(self, what: str, measured: str, bound: str, kept: bool) -> None:
        """One more line."""
        self.promises.append(Promise(what, measured, bound, kept))

    def at_most(self, what: str, value: float, most: float, unit: str = "", digits: int = 0) -> None:
        """A number that is not to be larger."""
        self.add(what, f"{value:.{digits}f}{unit}", f"<= {most:g}{unit}", value <= most)

    def none(self, what: str, number: int) -> None:
        """A count that is to be zero."""
        self.add(what, str(number), "0", not number)

    def written(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "promises": [asdict(promise) for promise in self.promises],
            "wrong": self.wrong,
            "seconds": self.seconds,
        }

    @staticmethod
    def read(written: dict[str, Any]) -> Report:
        """The inverse of :meth:`written`."""
        promises = [Promise(**promise) for promise in written["promises"]]
        return Report(promises, int(written["wrong"]), float(written["seconds"]))


def table(reports: Iterable[Report]) -> str:
    """All promises, targets beside figures; what is not kept is marked."""
    lines = ["| promise | measured | bound | |", "|---|---|---|---|"]
    lines += [
        f"| {promise.what} | {promise.measured} | {promise.bound} | {_verdict(promise)} |"
        for report in reports
        for promise in report.promises
    ]
    return "\n".join(lines)


def _verdict(promise: Promise) -> str:
    return "missed" if not promise.kept else "kept" if promise.bound else ""


def durations(reports: Mapping[str, Report]) -> str:
    """CPU time of each part."""
    lines = ["| part | CPU time [s] |", "|---|---|"]
    lines += [f"| {name} | {report.seconds:.0f} |" for name, report in reports.items()]
    return "\n".join([*lines, f"| all | {sum(report.seconds for report in reports.values()):.0f} |"])
