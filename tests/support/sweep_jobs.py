"""Jobs of sweeps that end in every way."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planlang.diagnostics import BadInput, error

World = Mapping[str, Any]


def square(world: World) -> dict[str, Any]:
    """Compute something; also leave a line in the world's log, if it has one."""
    if "log" in world:
        with Path(world["log"]).open("a", encoding="utf-8") as log:
            log.write(f"{world['world']}\n")
    return {"outcome": "done", "square": world["world"] ** 2}


def ends(world: World) -> dict[str, Any]:
    """End as the world says."""
    match world.get("how"):
        case "abort":
            os.abort()
        case "killed once":
            marker = Path(world["marker"])
            if not marker.exists():
                marker.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
            time.sleep(600)
        case "fill":
            return {"size": len(bytearray(10**9))}
        case "mistake":
            raise ZeroDivisionError("the mass is zero")
        case "refuse":
            raise BadInput([error("C001", "no such recipe")])
        case "no JSON":
            return {"world": object()}
    return square(world)
