"""Recorded runs: traces, resumption of interrupted runs, and replays.

General layout, each file importing only those above it: ``codec`` (values as JSON), ``recorded_run`` (reads a trace,
and finds the part that a resumed run can reuse), ``run_tree`` (the nodes of a trace), ``trace`` (writes one),
``repeating`` (repeats an interrupted run up to its last record), ``journal`` (records a resumable run, and resumes
it), ``replay_check`` (compares a replay with a trace). They implement the Observer and the Recorded of
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
