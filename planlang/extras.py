"""The packages of extras: the command that installs them, and the errors if one that an option needs is missing."""

from __future__ import annotations

import re
import shlex
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec

from planlang.diagnostics import Diagnostic, error
from planlang.words import Option, Text

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


def no_recorder() -> list[Diagnostic]:
    """Report an error (C012) if the package for recordings is not installed."""
    return _missing("record", "rerun-sdk", "a recording", "record", module="rerun")


def no_cluster() -> list[Diagnostic]:
    """Report an error (C012) if the package for clusters is not installed."""
    return _missing("cluster", "distributed", "a cluster", "on")


def no_parquet() -> list[Diagnostic]:
    """Report an error (C012) if the package for Parquet is not installed."""
    return _missing("parquet", "pyarrow", "a Parquet file", "parquet")


def _missing(extra: str, package: str, what: str, option: str, module: str | None = None) -> list[Diagnostic]:
    if find_spec(module or package) is not None:
        return []
    advice = Text(f"{install_command(extra)}, or leave out ", Option(option))
    return [error("C012", f"{what} needs the package {package}, which is not installed", help=advice)]
