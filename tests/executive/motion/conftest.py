"""Robots for the tests of motion: chains of real URDF files, read in place."""

from collections.abc import Callable
from pathlib import Path

import pybullet_data
import pytest

from executive.motion.kinematics import Chain

CHAINS = {
    "amigo": ("amigo@hydro.urdf", "base_link", "grippoint_right"),
    "pr2": ("pr2@hydro.urdf", "base_link", "r_gripper_tool_frame"),
    "panda": ("panda", "panda_link0", "panda_hand"),
}


@pytest.fixture(scope="session")
def panda_urdf() -> Path:
    """The Panda's URDF of pybullet_data."""
    return Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"


@pytest.fixture(scope="session")
def chain_of(panda_urdf: Path, request: pytest.FixtureRequest) -> Callable[[str], Chain]:
    """The chain of a robot by name, read once; skips where the corpus is absent."""
    read: dict[str, Chain] = {}

    def chain(robot: str) -> Chain:
        if robot not in read:
            file, base, tip = CHAINS[robot]
            path = panda_urdf if file == "panda" else request.getfixturevalue("corpus") / "robots" / file
            read[robot] = Chain.from_urdf(path, base, tip)
        return read[robot]

    return chain
