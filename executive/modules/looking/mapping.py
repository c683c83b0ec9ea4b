"""Process module that writes the robot's believed semantic map to a file."""

from __future__ import annotations

from pathlib import Path

from executive.belief.map_writing import map_text
from executive.modules.platform import PlatformModule
from planlang.designators import Action
from planlang.kernel import checkpoint
from planlang.language.process_module import process_module
from planlang.outputs import write_text


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
