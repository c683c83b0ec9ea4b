"""Other installations of planlang, such as another checkout, whose interpreter runs worlds of a sweep."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

from executive.options.declaring import declared
from executive.options.running import RunSettings
from executive.processes.workers import LAYOUT, Reply, other_environment
from planlang.diagnostics import BadInput, error
from planlang.records import dataclass
from planlang.words import Option, Text

LONGEST_START = 60.0
"""Wall-clock time that an interpreter may take to say what it has installed [s]."""
_ASKED = """
import json
from dataclasses import fields
from importlib.metadata import version
from executive.options.declaring import declared
from executive.options.running import RunSettings
from executive.processes.workers import LAYOUT, Reply, fork_workers
from executive.sweeps.shipping import program
from executive.sweeps.supervised import do, prepared
print(json.dumps({
    "version": version("planlang"),
    "sha256": program(),
    "options": list(declared(RunSettings)),
    "speaks": [LAYOUT.format, *(one.name for one in fields(Reply))],
}))
"""
"""The program that says what is installed, and fails where a worker would."""


@dataclass(frozen=True, slots=True)
class Installation:
    """A planlang that an interpreter has."""

    python: str
    """Absolute path of the interpreter."""
    version: str
    sha256: str
    """Digest of its modules and bundled files."""
    options: frozenset[str]
    """Options of runs that it knows."""


@cache
def installation(python: Path) -> Installation:
    """Ask an interpreter for its planlang. Raises BadInput if it has none that can run worlds of this one's sweeps."""
    found = shutil.which(python)
    if found is None:
        raise BadInput([error("C035", Text("no such interpreter: ", Option("python", python)))])
    path = os.path.abspath(found)  # a link into a virtual environment stays one
    try:
        asked = subprocess.run(
            [path, "-P", "-c", _ASKED],
            capture_output=True,
            text=True,
            timeout=LONGEST_START,
            env=other_environment(),
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise BadInput([error("C035", f"{path} cannot be run: {problem}")]) from None
    if asked.returncode:
        reason = (asked.stderr.strip().splitlines() or [f"exit code {asked.returncode}"])[-1]
        advice = "name the interpreter of an environment with a planlang that can compare"
        raise BadInput([error("C035", f"{path} has no planlang, or one that is too old: {reason}", help=advice)])
    said: dict[str, Any] = json.loads(asked.stdout.splitlines()[-1])
    if said["speaks"] != [LAYOUT.format, *(one.name for one in fields(Reply))]:
        message = f"{path} has planlang {said['version']}, whose processes cannot talk to this one's"
        raise BadInput([error("C035", message)])
    return Installation(path, said["version"], said["sha256"], frozenset(said["options"]))


def check_options(other: Installation, given: dict[str, Any]) -> None:
    """Raise BadInput for options of a run that another installation does not know."""
    names = [name for name in given if name not in other.options and name in declared(RunSettings)]
    if names:
        parts = [part for name in names for part in (", ", Option(name))][1:]
        raise BadInput([error("C035", Text(f"planlang {other.version} of {other.python} does not know ", *parts))])
