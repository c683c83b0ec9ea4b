"""Process modules that explore: they look around and choose the next best view, and write what is known to a map."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from executive.belief.map_writing import map_text
from executive.belief.memory import EXPLORATION
from executive.modules.platform import Platform, PlatformModule
from planlang.designators import Action, Location, Object, a_posture
from planlang.failures import DesignatorFailure, LookingFailure, LookingGoalUnreachable, PerceptionFailure
from planlang.kernel import checkpoint, sleep
from planlang.language.process_module import process_module
from planlang.outputs import write_text

EXPOSURE = 0.1
"""Time for which the head stays still for an image [s]."""


@process_module
class Exploring(PlatformModule):
    """Looks around and computes the next view."""

    name = "exploration"
    actions = ("EnvironmentExploration",)
    failures = (PerceptionFailure, LookingFailure, DesignatorFailure)
    needs = ("head",)

    async def execute(self, action: Action) -> dict[str, Any]:
        """Look around; return {name: location of the next view} for the name in ``to_location``, {} without one.

        The name in ``outputs_created`` stands for this exploration: checking it finds whether exploration is finished.
        """
        await checkpoint()
        if not self.platform.belief.memory.recognition.runs(EXPLORATION):
            raise PerceptionFailure("the exploration software is stopped; start it with StartSoftwareModules first")
        if self.platform.robot.camera is None:
            raise PerceptionFailure("exploration needs a robot with a camera")
        names = [_named(action.get(one)) for one in ("to_location", "outputs_created")]
        await look_around(self.platform, [name for name in names if name is not None])
        return {} if names[0] is None else {names[0]: a_posture(names[0])}


def _named(value: object) -> str | None:
    return value.name if isinstance(value, Location | Object) else value if isinstance(value, str) else None


async def look_around(platform: Platform, names: Sequence[str] = ()) -> None:
    """Take images from the current base pose until they show nothing new, then choose the next view.

    ``names``: names by which later steps refer to this exploration.
    """
    exploration = platform.exploration
    exploration.names = tuple(dict.fromkeys((*exploration.names, *names)))
    for point in exploration.gazes():
        with suppress(LookingGoalUnreachable):
            await platform.sensing.look_at(point, "the room")
        await sleep(EXPOSURE)
        platform.sensing.see()
        platform.sensing.scan()
    exploration.plan()


@process_module
class Mapping(PlatformModule):
    """Uploads maps by writing them to the file that the user named."""

    name = "mapping"
    actions = ("UploadMapToRoboEarth",)
    failures = ()

    async def execute(self, action: Action) -> str | None:
        """Write the map; return the file's name, None if the user named none."""
        await checkpoint()
        path: Path | None = self.platform.upload
        if path is None:
            return None
        write_text(path, map_text(self.platform.belief))
        return path.name
