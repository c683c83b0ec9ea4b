"""How a robot file states that the camera errs, and how an option multiplies it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from executive.robots import bind_robot, with_options
from executive.robots.robot_file import read_robot_file
from planlang.diagnostics import BadInput
from planlang.files import bundled
from sim.scene import TYPICAL, CameraNoise

NOISE = """
[camera.noise]
position = 0.005
position_per_metre = 0.002
angle = 0.035
misses = 0.1
misses_far = 0.2

[camera.noise.confusions]
DrinkingBottle = { Cup = 0.02, Vase = 0.01 }
"""


def robot_file(folder: Path, noise: str) -> Path:
    """Amigo's robot file with a camera that errs."""
    source = bundled("ontologies") / "robots"
    text = (source / "amigo.toml").read_text()
    text = re.sub(r'"(amigo\.(urdf|omn))"', lambda found: f'"{source / found[1]}"', text)
    path = folder / "erring.toml"
    path.write_text(text + noise)
    return path


def test_a_camera_is_exact_unless_the_robot_file_states_how_it_errs(tmp_path: Path) -> None:
    exact, erring = read_robot_file(robot_file(tmp_path, "")), read_robot_file(robot_file(tmp_path, NOISE))
    assert exact.camera is not None
    assert exact.camera.noise.is_exact
    assert erring.camera is not None
    confusions = (("DrinkingBottle", "Cup", 0.02), ("DrinkingBottle", "Vase", 0.01))
    assert erring.camera.noise == CameraNoise(0.005, 0.002, 0.035, 0.1, 0.0, 0.2, confusions)


@pytest.mark.parametrize(
    ("noise", "message"),
    [
        ("position = -0.01", "camera.noise.position: must be between 0 and 1 m, not -0.01"),
        ("misses = 1.5", "camera.noise.misses: must be between 0 and 1, not 1.5"),
        ("angle = 'two degrees'", "camera.noise.angle: must be a finite number, not 'two degrees'"),
        ("missed = 0.1", "camera.noise.missed: unknown key"),
        ("confusions = { Cup = 0.1 }", "camera.noise.confusions.Cup: must be a table"),
        (
            "confusions = { Cup = { Bowl = 0.6, Vase = 0.6 } }",
            "camera.noise.confusions.Cup: must be probabilities by class that sum to 1 at most, "
            "not {'Bowl': 0.6, 'Vase': 0.6}",
        ),
    ],
)
def test_a_wrong_value_is_named_with_what_would_be_right(tmp_path: Path, noise: str, message: str) -> None:
    path = robot_file(tmp_path, f"\n[camera.noise]\n{noise}\n")
    with pytest.raises(BadInput) as caught:
        read_robot_file(path)
    (problem,) = caught.value.diagnostics
    assert str(problem.message) == message
    assert problem.code == "B001"
    assert problem.span is not None
    assert "noise" in path.read_text().splitlines()[problem.span.line - 1] or noise in path.read_text().splitlines()


def test_a_factor_multiplies_what_is_stated_or_else_a_typical_camera(tmp_path: Path) -> None:
    erring, amigo = bind_robot(robot_file(tmp_path, NOISE)), bind_robot("amigo")

    def noise(robot: object, factor: float | None) -> CameraNoise:
        changed = with_options(robot, trusts_map=False, camera_noise=factor)  # type: ignore[arg-type]
        assert changed.camera is not None
        return changed.camera.noise

    assert noise(erring, None).position == 0.005
    assert noise(erring, 2.0).position == 0.01
    assert noise(erring, 0.0).is_exact
    assert noise(amigo, None).is_exact
    assert noise(amigo, 1.0) == TYPICAL
