"""Rules of what becomes of things: heat, classes, sizes and flow."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import field

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Heating:
    """Rule: a thing of one of ``inputs`` becomes ``output`` after ``seconds`` of one side over one of ``sources``."""

    inputs: tuple[str, ...]
    output: str
    sources: tuple[str, ...]
    seconds: float


Size = tuple[float, float, float]


PUDDLE = (0.14, 0.14, 0.008)
"""Size of a puddle if its class states none [m]."""


ROUNDING = 1e-6
"""Error of a sum over many steps [s]."""


def _unknown(cls: str) -> Size | None:
    return None


@dataclass(frozen=True, slots=True)
class Rules:
    """Behaviour of classes of things; the defaults know neither subclasses nor heat."""

    heating: tuple[Heating, ...] = ()
    is_a: Callable[[str, str], bool] = field(default=operator.eq, compare=False)
    """Whether a class is equal to, or a subclass of, another."""
    size: Callable[[str], Size | None] = field(default=_unknown, compare=False)
    """Size [m] of a created thing of a class; None if the class states none."""
    flow_rate: float = 20.0
    """Outflow of a vessel that is turned over [ml/s]."""
    _heatable: dict[str, bool] = field(default_factory=dict, init=False, repr=False, compare=False)

    def result(self, type: str, source: str) -> Heating | None:
        """Find the rule for heating a thing by a source, given their classes; the most specific output wins."""
        fitting = [
            one
            for one in self.heating
            if any(self.is_a(type, cls) for cls in one.inputs) and any(self.is_a(source, cls) for cls in one.sources)
        ]
        return next(
            (
                one
                for one in fitting
                if not any(one is not other and self.is_a(other.output, one.output) for other in fitting)
            ),
            None,
        )

    def can_heat(self, type: str) -> bool:
        """Check whether heat changes things of a class, or has changed them; asked of all things in every step."""
        if type not in self._heatable:
            self._heatable[type] = any(
                self.is_a(type, cls) for one in self.heating for cls in (*one.inputs, one.output)
            )
        return self._heatable[type]
