"""Writes the pictures of docs/recording.md anew: ``python tests/support/recording_pictures.py``.

It needs rerun 0.41, whose viewer runs without a screen, and a driver for Vulkan. That of Chromium computes all by
itself: ``VK_ICD_FILENAMES=/usr/lib/chromium/vk_swiftshader_icd.json LD_LIBRARY_PATH=/usr/lib/chromium``.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT))

from PIL import Image  # noqa: E402
from report_pictures import SERVED, raised_bottle  # noqa: E402
from rerun.experimental import ViewerClient  # noqa: E402

from executive.runs.plan_run import run_plan_file  # noqa: E402

PORT = 9890
MENU = 36
"""Height of the viewer's menu, which is left out [pixels]."""
WIDTH = 1280
DRAWN = 5.0
"""Until the viewer has drawn what it was asked for [s]; it does not report when it has."""


def picture(recording: Path, moment: float) -> Image.Image:
    """The viewer's window at a moment of plan time [s]."""
    with ViewerClient.spawn(headless=True, port=PORT, hide_welcome_screen=True, detach_process=False) as viewer:
        viewer.open(str(recording))
        time.sleep(DRAWN)
        viewer.set_time("plan time", duration=moment, play_state="paused")
        time.sleep(DRAWN)
        shown = Image.open(io.BytesIO(viewer.take_screenshot())).convert("RGB")
    shown = shown.crop((0, MENU, *shown.size))
    return shown.resize((WIDTH, round(shown.height * WIDTH / shown.width)), Image.Resampling.LANCZOS)


def main() -> None:
    """Write the pictures of a run that recovers, and of one that fails."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run_plan_file(replace(SERVED, record=folder / "done.rrd"))
        run_plan_file(replace(SERVED, environment=raised_bottle(folder), seed=0, record=folder / "failed.rrd"))
        for file, recording, moment in (
            ("recording.png", "done.rrd", 8.0),
            ("recording_failed.png", "failed.rrd", 5.4),
        ):
            picture(folder / recording, moment).save(CHECKOUT / "docs" / file, optimize=True)


if __name__ == "__main__":
    main()
