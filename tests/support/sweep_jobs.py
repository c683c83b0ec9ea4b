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
        case "worker killed once":  # the worker of a cluster: it started the source that started this process
            marker = Path(world["marker"])
            if not marker.exists():
                marker.write_text(f"{os.getpid()} {os.getppid()}", encoding="utf-8")
                os.kill(parent(os.getppid()), signal.SIGKILL)
                time.sleep(600)
        case "hang":
            signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
            time.sleep(600)
        case "fill":
            return {"size": len(bytearray(world.get("size", 10**9)))}
        case "nap":
            time.sleep(world["seconds"])
        case "mistake":
            raise ZeroDivisionError("the mass is zero")
        case "refuse":
            raise BadInput([error("C001", "no such recipe")])
        case "no JSON":
            return {"world": object()}
    return square(world)


def parent(process: int) -> int:
    """The process that started a process."""
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])


def reading(world: World) -> dict[str, Any]:
    """Read a file, and the one beside it that it names; write a page if the world has one."""
    file = Path(world["file"])
    beside = file.resolve().parent / file.read_text(encoding="utf-8").strip()
    if "report" in world:
        Path(world["report"]).write_text(f"page of {world['world']}", encoding="utf-8")
    return {"outcome": "done", "content": beside.read_text(encoding="utf-8"), "message": f"{beside} was read"} | (
        {"original": beside.stat().st_ino == world["inode"]} if "inode" in world else {}
    )


def process(world: World) -> dict[str, Any]:
    """Say which process this is; some worlds never end."""
    if world.get("how") == "hang":
        Path(world["marker"]).write_text(str(os.getpid()), encoding="utf-8")
        time.sleep(600)
    while "marker" in world and not Path(world["marker"]).exists():
        time.sleep(0.01)
    return {"outcome": "done", "process": os.getpid()}
