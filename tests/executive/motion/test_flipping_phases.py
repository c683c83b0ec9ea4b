"""The seven phases of a real recipe that flips a pancake with two spatulas: all 50 active constraints hold in the end.

Limits, weights and speeds are read from the recipe in place; features are those of its object models.
"""

from __future__ import annotations

import xml.etree.ElementTree as Xml
from pathlib import Path

import numpy as np
import pytest
from constraint_problems import arms_of, at

from executive.motion.constrained_motion import solve_motion
from planlang.designators import an_object
from planlang.diagnostics import BadInput
from planlang.motion_constraints import ConstraintKind, MotionConstraint, Speed, a_constraint, a_feature

OWL, RDF, RDFS = (
    f"{{http://www.w3.org/{name}#}}" for name in ("2002/07/owl", "1999/02/22-rdf-syntax-ns", "2000/01/rdf-schema")
)
PHASES = {
    "aneXbLGX": "approach",
    "bDGnttMX": "touch",
    "cxFaEKPR": "under",
    "dsTvdBVZ": "remove",
    "elqfTiny": "lift",
    "fSzYGaIm": "turn",
    "glRdmVsr": "stop",
}
LEFT, RIGHT, PANCAKE = an_object("LeftSpatula"), an_object("RightSpatula"), an_object("Pancake")
UP = (0.0, 0.0, 1.0)
FEATURES = {  # part of the constraint's name -> tool feature, world feature
    "LeftSpatulaAxis": a_feature("LINE", of=LEFT, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.125)),
    "LeftSpatulaFront": a_feature("LINE", of=LEFT, position=(0.0, 0.0, 0.0475), direction=(0.0, 0.125, 0.0)),
    "LeftSpatulaPlane": a_feature("PLANE", of=LEFT, position=(0.0, 0.0, 0.0), direction=(0.1, 0.0, 0.0)),
    "LeftSpatulaPancake": a_feature("LINE", of=LEFT, position=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 0.125)),
    "RightSpatulaFront": a_feature("LINE", of=RIGHT, position=(0.0, 0.0, 0.0475), direction=(0.0, 0.125, 0.0)),
    "RightSpatulaSide": a_feature("PLANE", of=RIGHT, position=(0.0, 0.0, 0.0), direction=(0.1, 0.0, 0.0)),
    "RightSpatulaPancakeRim": a_feature("LINE", of=RIGHT, position=(0.0, 0.0, 0.0475), direction=(0.0, 0.125, 0.0)),
}
PLANE = a_feature("PLANE", of=PANCAKE, position=(0.0, 0.0, 0.0), direction=UP)
RIM = a_feature("PLANE", of=PANCAKE, position=(0.0, -0.07, 0.0), direction=UP)


def phases_of(recipe: Path) -> dict[str, list[MotionConstraint]]:
    """The constraints of each phase, with the limits that its classes state."""
    above: dict[str, list[str]] = {}
    numbers: dict[str, dict[str, float]] = {}
    for cls in Xml.parse(recipe).getroot().findall(f"{OWL}Class"):
        name = _local(cls.attrib.get(f"{RDF}about", ""))
        above[name], numbers[name] = [], {}
        for below in cls.findall(f"{RDFS}subClassOf"):
            above[name].append(_local(below.attrib.get(f"{RDF}resource", "")))
            for one in below.findall(f"{OWL}Restriction"):
                on, value = one.find(f"{OWL}onProperty"), one.find(f"{OWL}hasValue")
                if on is not None and value is not None and value.text and value.text.strip():
                    numbers[name][_local(on.attrib[f"{RDF}resource"])] = float(value.text)
    phases: dict[str, list[MotionConstraint]] = {phase: [] for phase in PHASES.values()}
    for name, stated in numbers.items():
        if "constrWeight" not in stated:
            continue
        template, _, phase = name.rpartition("_")
        kind = next(kind for one in above[template] if (kind := ConstraintKind.of_owl_class(one)))
        speed = next((speed for one in above[name] if (speed := Speed.of_owl_class(one))), None)
        tool = next(feature for part, feature in FEATURES.items() if part in template)
        right = "Right" in template and not template.endswith("Center")
        phases[PHASES[phase]].append(
            a_constraint(
                kind, tool, RIM if right else PLANE, speed=speed, name=name, weight=stated["constrWeight"],
                lower=stated["constrLowerLimit"], upper=stated["constrUpperLimit"],
            )
        )  # fmt: skip
    return phases


def _local(iri: str) -> str:
    return iri.rsplit("#", 1)[-1]


@pytest.mark.long
@pytest.mark.parametrize("ahead", [0.6, 0.7])
def test_all_active_constraints_hold_at_the_end_of_each_phase_on_the_pr2(corpus: Path, ahead: float) -> None:
    try:
        robot = arms_of("pr2", 2)
    except BadInput as absent:
        pytest.skip(absent.diagnostics[0].message)
    phases = list(phases_of(corpus / "recipes" / "pancake-making-constr@hydro.owl").values())
    active = [[one for one in phase if one.is_active] for phase in phases]
    assert [len(phase) for phase in active] == [9, 8, 8, 9, 8, 8, 0]
    # 0.30 m behind the blade's centre, z along the fingers
    blade = np.column_stack([(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)])
    in_tip = at(0.3, 0.0, 0.0, blade)
    held = {robot.robot.arms[arm].name: arm for arm in range(2)}
    problem = robot.problem(
        {LEFT: (held["left"], in_tip), RIGHT: (held["right"], in_tip)}, {PANCAKE: at(ahead, 0.0, 0.9)}
    )
    start = np.array([robot.robot.postures["carrying"][name] for name in robot.group.names])
    motions = solve_motion(problem, start, phases)
    assert robot.objection(problem, start, phases, motions) is None
    assert not any(motion.given_up for motion in motions)
    assert len(motions[-1].trajectory.positions) == 1
    assert [len(motion.kept) for motion in motions] == [0, 6, 5, 6, 4, 6, 0]
