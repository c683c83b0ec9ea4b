"""A run takes any robot interface: a decorator with exactly the members of the protocol is enough."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.runs.options import RunOptions
from planlang.protocols import RobotInterface
from tests.support.noisy_camera import NoisyCamera
from tests.support.scenarios import at_home, judged_run, parsed, scenarios


@pytest.mark.pr2
def test_what_is_stirred_is_mixed_in_truth_though_the_camera_is_decorated() -> None:
    scenario, made = scenarios()["stir_soup"], list[NoisyCamera]()

    def decorated(robot: RobotInterface) -> RobotInterface:
        made.append(NoisyCamera(robot))
        return made[-1]

    options = RunOptions.of(parsed([*map(at_home, scenario.arguments), "--json"]))
    ended = judged_run(scenario, replace(options, interface=decorated))
    assert (ended.result.message, ended.unmet) == ("done", ())
    own = {name for one in (NoisyCamera, made[0]) for name in vars(one) if not name.startswith("_")}
    members = {*vars(RobotInterface), *RobotInterface.__annotations__}
    assert own == {name for name in members if not name.startswith("_")}
