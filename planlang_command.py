"""Entry point of the command ``planlang``; beside the packages, so that nothing of them is imported before it runs.

Signals, closed streams, and other packages named like ours are dealt with first: importing takes a quarter of a second,
in which Ctrl-C has to work, too.
"""

from __future__ import annotations

import gc
import importlib
import importlib.util
import io
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from types import FrameType

INTERRUPTED, IN_THE_WAY, UNWRITTEN = 130, 2, 2
YOUNG = 200_000
"""New objects after which the collector looks for garbage: of those of importing, reading and assembling nearly all
stay (of the first 100,000 of a run 650 do not)."""
ENDING = ("SIGTERM", "SIGHUP")
"""Signals that end a run as Ctrl-C does: the robot is halted, files are completed."""

_received: list[int] = []


def main() -> None:
    """Run the command; ends the process with its exit code, 128 and its number after a signal other than Ctrl-C."""
    try:
        gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
        # Products of matrices are small here: further threads of BLAS only cost memory, 40 MB and more for each core.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        _handle_signals()
        _open_closed_streams()
        _check_packages()
        importlib.import_module("executive.cli.app").main()
    except KeyboardInterrupt:
        with suppress(OSError):
            sys.stderr.write("interrupted\n")
        sys.exit(_code(INTERRUPTED))
    except OSError:
        if _flushed():
            raise
        sys.exit(UNWRITTEN)  # stderr cannot be written either: nothing can be said
    except SystemExit as end:
        sys.exit(_code(end.code) if _flushed() else _code(end.code) or UNWRITTEN)
    finally:
        # The interpreter ends with looking twice through all objects for garbage: a twelfth of a short run.
        gc.freeze()


def _code(code: object) -> int | str | None:
    return 128 + _received[0] if _received and code == INTERRUPTED else code  # type: ignore[return-value]


def _flushed() -> bool:
    """Write what the standard streams hold; a full disk would end the interpreter with a code of its own."""
    is_written = True
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            is_written = False
    return is_written


def _handle_signals() -> None:
    for name in ENDING:
        number = getattr(signal, name, None)
        # one that is ignored stays so: nohup does that
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _end)


def _end(number: int, frame: FrameType | None) -> None:
    """Interrupt as Ctrl-C does, also where a shell started the command in the background and so ignores SIGINT."""
    _received.append(number)
    raise KeyboardInterrupt


def _open_closed_streams() -> None:
    """Give closed standard streams to /dev/null: else the next file that is opened would be stdout."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115  open as long as the process
    # letters that its encoding lacks; stderr does so by itself
    if isinstance(sys.stdout, io.TextIOWrapper):  # whoever calls main() may have put another stream there
        sys.stdout.reconfigure(errors="backslashreplace")


def _check_packages() -> None:
    """End with a message if another package is found under the name of one of ours.

    Ours lie beside this file. Where planlang is installed for editing, they lie in the checkout, beside its original.
    """
    for name in ("planlang", "executive", "sim"):
        found = importlib.util.find_spec(name)
        where = "nothing" if found is None else found.origin or next(iter(found.submodule_search_locations or ()), "")
        place = Path(where).resolve()
        beside = place.parents[1] if place.name == "__init__.py" else place.parent
        if where and not (beside / Path(__file__).name).is_file():
            sys.stderr.write(
                f"error: Python finds {where} instead of planlang's package {name}\n"
                "    help: rename it, or take its folder off PYTHONPATH\n"
            )
            sys.exit(IN_THE_WAY)


if __name__ == "__main__":
    main()
