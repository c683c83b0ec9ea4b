"""The numeric locale of the host process, which programs with windows set to that of the desktop."""

import locale
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from planlang.protocols import Configuration
from sim import CameraModel, PlanningWorld, RobotBody, Scene
from sim.engine import c_numbers

CART = """<robot name="cart"><link name="base"/><link name="mast">
<collision><origin xyz="0 0 0.25"/><geometry><mesh filename="mast.obj" scale="0.5 0.5 0.5"/></geometry></collision>
</link><joint name="lift" type="prismatic"><parent link="base"/><child link="mast"/><origin xyz="0.35 0 0.125"/>
<axis xyz="0 0 1"/><limit lower="0.25" upper="0.75"/></joint></robot>"""
TETRAHEDRON = "v 0 0 0\nv 0.5 0 0\nv 0 0.5 0\nv 0 0 0.5\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MESH = f"{TETRAHEDRON}o second\n{TETRAHEDRON.replace('f ', 'f -')}"


def _made(folder: Path) -> str | None:
    """Compile a locale with a decimal comma, if the sources of locales are installed."""
    if shutil.which("localedef") is None:
        return None
    place = folder / "de_DE.UTF-8"
    subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", str(place)], capture_output=True, check=False)
    return place.name if (place / "LC_NUMERIC").is_file() else None


@pytest.fixture
def decimal_comma(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The process has chosen a locale with a decimal comma."""
    before = locale.setlocale(locale.LC_NUMERIC)
    for name in ("de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "ru_RU.UTF-8", ""):
        if not name and (name := _made(tmp_path) or ""):
            monkeypatch.setenv("LOCPATH", str(tmp_path))
        try:
            locale.setlocale(locale.LC_NUMERIC, name or "C")
        except locale.Error:
            continue
        if locale.localeconv()["decimal_point"] == ",":
            break
    else:
        pytest.skip("no locale with a decimal comma is installed, nor the sources of one (package locales)")
    yield
    locale.setlocale(locale.LC_NUMERIC, before)


def measures(folder: Path) -> tuple[object, ...]:
    """Numbers of a robot that a world has loaded."""
    folder.mkdir()  # a folder of its own: links are measured once for each file
    (folder / "cart.urdf").write_text(CART)
    (folder / "mast.obj").write_text(MESH)
    world = PlanningWorld(Scene(()), RobotBody(folder / "cart.urdf", CameraModel("base")))
    world.robot.show(Configuration((0.0, 0.0, 0.0), {"lift": 0.5}))
    pose = world.robot.link_pose("mast")
    found = world.robot.limits, pose, [corner.tolist() for corner in world.robot.boxes()]
    world.close()
    return found


@pytest.fixture
def expected(tmp_path: Path) -> tuple[object, ...]:
    """What is read with a decimal point."""
    return measures(tmp_path / "point")


def test_a_robot_is_the_same_where_people_write_a_decimal_comma(
    tmp_path: Path, expected: tuple[object, ...], decimal_comma: None
) -> None:
    assert measures(tmp_path / "comma") == expected
    assert expected[0] == {"lift": (0.25, 0.75)}


def test_the_locale_of_the_host_stays(decimal_comma: None) -> None:
    with c_numbers():
        assert locale.localeconv()["decimal_point"] == "."
    assert locale.localeconv()["decimal_point"] == ","
