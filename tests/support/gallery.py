"""Writes the pictures of docs/reference/gallery.md anew: ``python tests/support/gallery.py [NAME...]``.

The page is the list of what to run: each of its commands writes a picture, which is made smaller here.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT))

from tests.support.scenarios import CORPUS  # noqa: E402

PAGE = CHECKOUT / "docs" / "reference" / "gallery.md"
PICTURES = CHECKOUT / "docs" / "images" / "gallery"
WIDTH = 640
"""Width of a picture [px], about that of the column of a page."""
MOST_BYTES = 60_000


def commands() -> dict[str, str]:
    """Map the name of each picture to the command of the page that makes it."""
    found = re.findall(r"^(?:\$ )?(planlang run .+ --picture (\w+)\.png)$", PAGE.read_text("utf-8"), flags=re.MULTILINE)
    return {name: command for command, name in found}


def take(name: str, command: str) -> None:
    """Run a command in a folder of its own, and write its picture in the size of the page.

    Published files are those beside this checkout. Raises CalledProcessError if the run fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        for there in (CHECKOUT / "docs", CORPUS):
            (Path(folder) / there.name).symlink_to(there)
        program = Path(sys.executable).with_name("planlang")
        subprocess.run([program, *shlex.split(command)[1:]], cwd=folder, check=True)
        with Image.open(Path(folder) / f"{name}.png") as scene:
            size = (WIDTH, round(scene.height * WIDTH / scene.width))
            scene.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(PICTURES / f"{name}.webp", quality=85)


def main(names: list[str]) -> None:
    """Make the pictures of these names, of all commands if there are none."""
    known = commands()
    if unknown := sorted(set(names) - set(known)):
        raise SystemExit(f"the gallery has no {', '.join(unknown)}; it has {', '.join(known)}")
    for name in names or known:
        take(name, known[name])


if __name__ == "__main__":
    main(sys.argv[1:])
