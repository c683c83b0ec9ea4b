"""Numbers of poses in the units that a user asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence

from executive.cli.inputs import refuse
from planlang.diagnostics import error
from planlang.units import chosen_units, known_unit


class Shown:
    """Numbers of poses with their names, in m and rad or in the units that a user asks for; BadInput for others."""

    def __init__(self, names: Sequence[str]) -> None:
        self._chosen = chosen_units(names)
        shown = {known_unit(name).dimension for name in ("Meter", "Radian")}
        wrong = [name for dimension, name in self._chosen.items() if dimension not in shown]
        help = "locate shows lengths and angles: --units Centimeter --units DegreeAngle"
        refuse([error("C019", f"--units {name}: neither a length nor an angle", help=help) for name in wrong])

    def __call__(self, **numbers: float) -> str:
        """Return the numbers [m, rad] with their names."""
        return "  ".join(f"{name} {self._number(number, name)}" for name, number in numbers.items())

    def _number(self, number: float, name: str) -> str:
        """Return a number as precisely as a millimetre and a milliradian are; adding zero avoids -0.000."""
        si = known_unit("Radian" if name == "yaw" else "Meter")
        own = known_unit(self._chosen.get(si.dimension, "Radian" if name == "yaw" else "Meter"))
        places = max(0, math.ceil(3 + math.log10(own.factor)))
        return f"{round(si.to(own, number), places) + 0.0:.{places}f}"

    def heading(self) -> str:
        """Return the units that a user has asked for, in brackets."""
        return f" [{', '.join(self._chosen.values())}]" if self._chosen else ""
