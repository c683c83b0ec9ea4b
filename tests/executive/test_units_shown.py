"""``--units``: numbers in the unit that a user asks for, and units that are refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.runs.located import Shown
from tests.support.refusals import refusal

TOWEL = """Prefix: : <http://example.org/towels#>
Prefix: unit: <http://qudt.org/vocab/unit#>

Ontology: <http://example.org/towels>

DataProperty: width

DataProperty: warmth

Individual: towel
    Facts: warmth "212"^^unit:DegreeFahrenheit, width "12"^^unit:Inch, width 5
"""


def test_converted_values_are_in_the_unit_asked_for_and_others_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "towel.omn"
    path.write_text(TOWEL, encoding="utf-8")
    units = ["--units", "Centimeter", "--units", "DegreeCelsius"]
    shown = CliRunner().invoke(app, ["convert", str(path), "--to", "manchester", *units])
    assert shown.exit_code == 0
    for words in ('width "30.48"^^unit:Centimeter', 'warmth "100.0"^^unit:DegreeCelsius', "width 5"):
        assert words in shown.output


@pytest.mark.parametrize(
    ("units", "message"),
    [
        (["Parsnip"], "Parsnip is an unknown unit"),
        (["Kilogram"], "no number"),
        (["Inch", "Foot"], "are both measured in m"),
    ],
)
def test_units_that_nothing_can_be_in_are_refused(tmp_path: Path, units: list[str], message: str) -> None:
    path = tmp_path / "towel.omn"
    path.write_text(TOWEL, encoding="utf-8")
    words = [word for name in units for word in ("--units", name)]
    shown = CliRunner().invoke(app, ["convert", str(path), "--to", "manchester", *words])
    assert shown.exit_code == 2
    assert "C019" in shown.output
    assert message in shown.output


def test_poses_are_shown_as_precisely_as_in_metres_and_radians() -> None:
    assert Shown(())(x=1.23456, yaw=-0.0001) == "x 1.235  yaw 0.000"
    assert Shown(("Centimeter", "DegreeAngle"))(x=1.23456, yaw=1.0) == "x 123.5  yaw 57.30"
    assert Shown(("Millimeter",))(x=1.23456) == "x 1235"
    with refusal("C019", naming="Kilogram"):
        Shown(("Kilogram",))
