"""Robots for the tests of motion: chains of real URDF files, read in place."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pybullet_data
import pytest

from executive.motion.kinematics import Chain

ROBOTS = Path(__file__).resolve().parents[3] / "ontologies" / "robots"
CHAINS = {
    "amigo": (ROBOTS / "amigo.urdf", "base_link", "grippoint_right"),
    "pr2": ("pr2@hydro.urdf", "base_link", "r_gripper_tool_frame"),
    "panda": (Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf", "panda_link0", "panda_hand"),
}


@pytest.fixture(scope="session")
def urdf_of(request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """The URDF file of a robot by name; skips where the corpus is needed and absent."""

    def path(robot: str) -> Path:
        file = CHAINS[robot][0]
        corpus: Path = request.getfixturevalue("corpus") if isinstance(file, str) else Path()
        return corpus / "robots" / file

    return path


@pytest.fixture(scope="session")
def chain_of(urdf_of: Callable[[str], Path]) -> Callable[[str], Chain]:
    """The chain of a robot by name, read once."""
    return cache(lambda robot: Chain.from_urdf(urdf_of(robot), *CHAINS[robot][1:]))
