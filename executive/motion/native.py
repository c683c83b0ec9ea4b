"""Generated C, compiled once by the system's compiler and kept: shared libraries called through ctypes.

The compiler is that of the environment variable CC, else ``cc``, ``gcc`` or ``clang``. A library's name is a digest of
what it was generated from, of the generator's source, of the compiler and of its flags, so a kept one is always right.
Arithmetic is IEEE's: no fast-math, no contraction to fused operations, no instructions of one processor alone.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

from planlang.cache import Cache

FLAGS = ("-O3", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-shared", "-w")
"""-fno-math-errno only lets sqrt be an instruction; its value is the same."""
SYMBOLIC = () if sys.platform == "darwin" else ("-Wl,-Bsymbolic",)
"""A library's calls of its own functions stay in it, whatever else in the process has their names."""
_CACHE = Cache("native", most=200)


@dataclass(frozen=True, slots=True)
class Compiler:
    """A C compiler: the words that start it, and what tells it from another."""

    command: tuple[str, ...]
    identity: tuple[str, int, int]
    """Real path, size and time of change of the program."""


def compiler() -> Compiler | None:
    """The system's C compiler; None without one. CC set to what is no program means none."""
    said = os.environ.get("CC")
    for words in [shlex.split(said)] if said is not None else [["cc"], ["gcc"], ["clang"]]:
        program = shutil.which(words[0]) if words else None
        if program is not None:
            real = Path(program).resolve()
            stat = real.stat()
            return Compiler((program, *words[1:]), (str(real), stat.st_size, stat.st_mtime_ns))
    return None


def library(facts: object, source: Callable[[], str]) -> ctypes.CDLL | None:
    """The library compiled from what ``source`` returns, which must follow from ``facts`` (by its repr) alone.

    ``source`` is called if the library is not kept yet. None if there is no compiler, or if it cannot do it.
    """
    chosen = compiler()
    if chosen is None:
        return None
    key = repr((facts, _generator(), chosen, FLAGS, SYMBOLIC, platform.machine(), sys.platform))
    with tempfile.TemporaryDirectory(prefix="planlang-") as place:
        made = Path(place) / f"{hashlib.sha256(key.encode()).hexdigest()}.so"
        content = _CACHE.load(key)
        if content is not None:
            made.write_bytes(content)
        elif _compiled(chosen, source(), made):
            _CACHE.keep(key, made.read_bytes())
        else:
            return None
        return _load(made)


def _compiled(chosen: Compiler, source: str, target: Path) -> bool:
    text = target.with_suffix(".c")
    text.write_text(source, encoding="utf-8")
    command = [*chosen.command, *FLAGS, *SYMBOLIC, "-o", str(target), str(text), "-lm"]
    try:  # however long it takes: on a busy machine numbers must have the same last digits as on a quiet one
        done = subprocess.run(command, capture_output=True, check=False)
    except OSError:
        return False
    return done.returncode == 0 and target.is_file()


def _load(path: Path) -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(str(path)) if path.is_file() else None
    except OSError:
        return None


@cache
def _generator() -> str:
    """Digest of everything here that shapes generated code, and the version of what writes it."""
    here = Path(__file__).parent
    digest = hashlib.sha256(version("casadi").encode())
    for path in sorted([*here.glob("*.py"), *here.glob("*.c")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()
