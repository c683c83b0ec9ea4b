"""Runs that are recorded: their traces, what a resumed run takes over, and the check of a replay.

General layout, each file importing only those above it: ``codec`` (values as JSON), ``recorded_run`` (a trace that is
read back, and the part that can be taken over), ``run_tree`` (its nodes), ``trace`` (written as a run goes on),
``repeating`` (an interrupted run, run again to its last record), ``journal`` (a run that can be resumed),
``replay_check``. They implement the Observer and the Recorded of
:mod:`planlang.kernel`.
"""

from planlang.runs.recorded_run import DamagedTrace, Past, RecordedRun, differences, refuse_other, restore
from planlang.runs.repeating import Repetition
from planlang.runs.run_tree import RunTree, TaskNode
from planlang.runs.trace import Different, Trace, with_paths

__all__ = [
    "DamagedTrace",
    "Different",
    "Past",
    "RecordedRun",
    "Repetition",
    "RunTree",
    "TaskNode",
    "Trace",
    "differences",
    "refuse_other",
    "restore",
    "with_paths",
]
