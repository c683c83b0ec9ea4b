"""Motion constraints are plain values: they survive a trace, read as code, and refuse what can mean nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import planlang
from planlang.designators import Device, Object, a_device, action, an_object
from planlang.motion_constraints import (
    ConstraintKind,
    Feature,
    FeatureKind,
    Measure,
    MotionConstraint,
    Speed,
    a_constraint,
    a_feature,
)
from planlang.runs.codec import dump, encode, load

PAN = an_object("FryingPan", "http://example.org/kitchen.owl#pan1")
SPATULA = an_object("Spatula")
TOP = a_feature("PLANE", of=PAN, position=(0.0, 0.0, 0.02), direction=(0.0, 0.0, 2.0), name="top")
BLADE = a_feature("LINE", of=SPATULA, position=(0.0, 0.0, 0.0475), direction=(0.0, 1.0, 0.0))
CENTRE = a_feature("POINT", of=PAN, position=(0.0, 0.0, 0.0))
DESCRIBED = a_feature(of=SPATULA, path=("SpatulaBlade", "FrontSide"), held_by=a_device("LeftArm"))

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "constraints.md"

limits = st.none() | st.floats(-3, 3)
features = st.sampled_from([TOP, BLADE, DESCRIBED])
constraints = st.builds(
    lambda kind, tool, world, bounds, weight, speed, frame, name: a_constraint(
        kind, tool, world, lower=bounds[0], upper=bounds[1], weight=weight, speed=speed, frame=frame, name=name
    ),
    st.sampled_from(ConstraintKind),
    features,
    features,
    st.tuples(limits, limits).filter(lambda pair: None in pair or pair[0] <= pair[1]),  # type: ignore[operator]
    st.floats(0, 100),
    st.none() | st.sampled_from(Speed),
    st.none() | st.just("/torso_lift_link"),
    st.none() | st.just("HeightBladePan"),
)


@given(constraints)
def test_a_constraint_survives_a_trace_and_its_repr_is_code_that_makes_it(constraint: MotionConstraint) -> None:
    names: dict[str, Any] = {"a_constraint": a_constraint, "a_feature": a_feature, "Object": Object, "Device": Device}
    for again in (load(json.loads(json.dumps(dump(constraint)))), eval(repr(constraint), names)):
        assert again == constraint
        assert repr(again) == repr(constraint), "names are kept, too"
        assert hash(again) == hash(constraint)


def test_a_constraint_reads_as_a_sentence() -> None:
    height = a_constraint("HEIGHT", BLADE, TOP, lower=0.1, upper=0.15, name="HeightBladePan")
    assert str(height) == "HeightBladePan of Spatula and top 0.1 to 0.15 m"
    assert encode(height) == str(height)
    assert repr(a_constraint("DISTANCE", BLADE, CENTRE, upper=0.1, speed="SLOW")).startswith("a_constraint('DISTANCE',")
    assert str(DESCRIBED) == "Spatula.SpatulaBlade.FrontSide"


def test_constraints_are_fillers_of_actions_and_names_of_the_plan_language() -> None:
    motion = action("ITaSCMotion", constrained_by=(planlang.a_constraint("ABOVE_OF", BLADE, TOP, lower=0.05),))
    assert load(json.loads(json.dumps(dump(motion)))) == motion
    assert planlang.a_feature is a_feature


def test_the_table_knows_the_classes_of_knowrob() -> None:
    kind = ConstraintKind.of_owl_class("http://knowrob.org/kb/motion-constraints.owl#PointingAtConstraint")
    assert kind is ConstraintKind.POINTING_AT
    assert Speed.of_owl_class("SlowMotionConstraint") is Speed.SLOW
    assert ConstraintKind.of_owl_class("MotionConstraint") is None
    assert len({one.value.owl for one in ConstraintKind}) == len(ConstraintKind) == 10
    offsets = [one.value.axis for one in ConstraintKind if one.value.measure is Measure.OFFSET]
    assert len(set(offsets)) == 6


def test_the_page_shows_the_table_and_code_that_runs() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for kind in ConstraintKind:
        row, formula = kind.value, kind.value.formula.replace("|", "\\|")
        assert f"| `{kind.name}` | {row.owl} | {formula} | {row.unit + ' ' if row.unit else ''}|\n" in page


def test_limits_that_cannot_matter_bind_nothing() -> None:
    unlimited = float("inf")
    assert a_constraint("DISTANCE", BLADE, TOP, lower=-0.1, upper=0.1).limits == (-unlimited, 0.1)
    assert a_constraint("PERPENDICULARITY", BLADE, TOP, lower=0.95, upper=1.2).limits == (0.95, unlimited)
    assert a_constraint("HEIGHT", BLADE, TOP, lower=-0.1).limits == (-0.1, unlimited)
    assert a_constraint("PERPENDICULARITY", BLADE, TOP, lower=1.1).limits == (1.1, unlimited), "it cannot hold"


def test_weight_speed_and_name_are_not_what_a_constraint_asks() -> None:
    one = a_constraint("HEIGHT", BLADE, TOP, lower=0.1, weight=1.0, speed="SLOW", name="a")
    assert one.asks_the_same(a_constraint("HEIGHT", BLADE, TOP, lower=0.1, weight=7.0, name="b"))
    assert not one.asks_the_same(a_constraint("HEIGHT", BLADE, TOP, lower=0.1, upper=0.2))
    assert not a_constraint("HEIGHT", BLADE, TOP, weight=0.0).is_active


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: a_constraint("ABOVE", BLADE, TOP), "one of PERPENDICULARITY, HEIGHT"),
        (lambda: a_constraint("HEIGHT", BLADE, PAN), "a feature"),  # type: ignore[arg-type]
        (lambda: a_constraint("PERPENDICULARITY", CENTRE, TOP), "a point has no direction"),
        (lambda: a_constraint("POINTING_AT", BLADE, CENTRE), "a point has no direction"),
        (lambda: a_constraint("HEIGHT", BLADE, TOP, lower=0.2, upper=0.1), "at most the upper limit"),
        (lambda: a_constraint("HEIGHT", BLADE, TOP, lower=float("nan")), "a finite number"),
        (lambda: a_constraint("HEIGHT", BLADE, TOP, weight=-1.0), ">= 0"),
        (lambda: a_constraint("HEIGHT", BLADE, TOP, speed="QUICK"), "one of SLOW, MEDIUM, FAST"),
        (lambda: a_constraint("HEIGHT", BLADE, TOP, frame=""), "something in it"),
        (lambda: a_feature("DISC", of=PAN), "one of POINT, LINE, PLANE"),
        (lambda: a_feature("LINE", of=PAN, position=(0, 0, 0)), "three finite numbers"),
        (lambda: a_feature("LINE", of=PAN, position=(0, 0, 0), direction=(0, 0, 0)), "a vector with a length"),
        (lambda: a_feature("POINT", of=PAN, position=(0, 0)), "three finite numbers"),
        (lambda: a_feature("POINT", of=PAN, position=(0, 0, 0), direction=(0, 0, 1)), "left out for a point"),
        (lambda: a_feature(of=PAN, position=(0, 0, 0)), "beside a position"),
        (lambda: a_feature(of=PAN, path="Rim"), "a tuple of classes"),
        (lambda: Feature(FeatureKind.POINT, "pan", (0.0, 0.0, 0.0)), "an object or a device"),  # type: ignore[arg-type]
    ],
)
def test_what_can_mean_nothing_is_refused_with_the_right_code(wrong: Any, message: str) -> None:
    with pytest.raises((ValueError, TypeError), match=message) as refused:
        wrong()
    assert "right: a_" in str(refused.value)
