"""Robots for the tests of motion: chains of real URDF files, read in place."""

from collections.abc import Callable
from pathlib import Path

import pybullet_data
import pytest

from executive.motion.compiled import CompiledChain
from executive.motion.kinematics import Chain
from executive.motion.native import compiler

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


@pytest.fixture(scope="session", params=["compiled", "virtual machine"])
def computed_by(request: pytest.FixtureRequest) -> str:
    """What computes the chains of a test."""
    if request.param == "compiled" and compiler() is None:
        pytest.skip("there is no C compiler")
    kind: str = request.param
    return kind


@pytest.fixture(scope="session")
def chain_of(urdf_of: Callable[[str], Path], computed_by: str) -> Callable[[str], Chain]:
    """The chain of a robot by name, read once."""
    read: dict[str, Chain] = {}

    def chain(robot: str) -> Chain:
        if robot not in read:
            read[robot] = chain_computed_by(computed_by, lambda: Chain.from_urdf(urdf_of(robot), *CHAINS[robot][1:]))
        return read[robot]

    return chain


def chain_computed_by(kind: str, make: Callable[[], Chain]) -> Chain:
    """A chain computed by compiled code or by the virtual machine."""
    with pytest.MonkeyPatch.context() as patch:
        if kind == "virtual machine":
            patch.setenv("CC", "no-such-compiler")
        chain = make()
        assert isinstance(chain.backend, CompiledChain) == (kind == "compiled")
        return chain
