"""Whether there is a display for the window of ``--gui``.

PyBullet ends the process without a word when it cannot open its window, so that this is found out before.
"""

from __future__ import annotations

import ctypes
import os
import sys

from planlang.diagnostics import Diagnostic, error


def no_display() -> list[Diagnostic]:
    """An error if no window can be opened here; on systems other than Linux a display is taken for granted."""
    if not sys.platform.startswith("linux") or _opens_x_display():
        return []
    name = os.environ.get("DISPLAY")
    reason = f"the display {name} cannot be opened" if name else "there is no display (DISPLAY is not set)"
    return [error("C013", f"--gui needs a window, and {reason}", help="--picture scene.png shows the end of a run")]


def _opens_x_display() -> bool:
    if not os.environ.get("DISPLAY"):
        return False
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if display is None:
        return False
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return True
