"""Robots of the series whose cameras err: bundled robot files with a table of noise."""

from __future__ import annotations

from pathlib import Path

from planlang.files import bundled

TOP = Path(__file__).resolve().parents[3]
MADE = TOP / ".venv" / "faults"
"""Folder of files that are made."""
EXACT = "exact"
ANGLE = 0.0349
"""2 degrees [rad]."""
NOISE = {
    "5 mm": f"position = 0.005\nangle = {ANGLE}\nmisses = 0.1\n",
    "10 mm": f"position = 0.01\nangle = {ANGLE}\nmisses = 0.1\n",
}
"""Camera -> the table of its noise."""


def robot_with(robot: str, camera: str) -> str:
    """Return what ``--robot`` gets for a bundled robot with a camera; writes its file if it is not there."""
    if camera == EXACT:
        return robot
    file = MADE / f"{robot}-{camera.replace(' ', '')}.toml"
    folder = bundled("ontologies") / "robots"
    MADE.mkdir(parents=True, exist_ok=True)
    texts = {file: (folder / f"{robot}.toml").read_text(encoding="utf-8") + f"\n[camera.noise]\n{NOISE[camera]}"}
    texts |= {MADE / one.name: one.read_text(encoding="utf-8") for one in folder.glob(f"{robot}.[ou]*")}
    for path, text in texts.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    return str(file)
