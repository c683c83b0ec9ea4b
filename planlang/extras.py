"""The command that installs the packages of an extra."""

from __future__ import annotations

import re
import shlex
from importlib.metadata import PackageNotFoundError, requires

_REQUIREMENT = re.compile(r"(?P<package>[^;]+?)\s*;.*\bextra == ['\"](?P<extra>[^'\"]+)['\"]")
"""A line of ``Requires-Dist``: https://packaging.python.org/en/latest/specifications/core-metadata/."""


def install_command(extra: str) -> str:
    """Shell command that installs the packages of an extra of planlang.

    It names the packages and not the extra: pip would look for planlang on its index, and planlang may have been
    installed from a checkout or a wheel.
    """
    try:
        lines = requires("planlang") or ()
    except PackageNotFoundError:  # run from its sources
        return shlex.join(["pip", "install", f".[{extra}]"])
    found = (match for line in lines if (match := _REQUIREMENT.match(line)) is not None)
    return shlex.join(["pip", "install", *(one["package"] for one in found if one["extra"] == extra)])
