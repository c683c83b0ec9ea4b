"""Recorded runs: traces, resumption of interrupted runs, and replays.

General layout, each file importing only those above it: ``codec`` (values as JSON), ``recorded_run`` (reads a trace,
and finds the part that a resumed run can reuse), ``run_tree`` (the nodes of a trace), ``trace`` (writes one),
``repeating`` (repeats an interrupted run up to its last record), ``journal`` (records a resumable run, and resumes
it), ``replay_check`` (compares a replay with a trace). They implement the Observer and the Recorded of
:mod:`planlang.kernel`.
"""

from planlang.runs.recorded_run import DamagedTrace as DamagedTrace
from planlang.runs.recorded_run import Past as Past
from planlang.runs.recorded_run import RecordedRun as RecordedRun
from planlang.runs.recorded_run import differences as differences
from planlang.runs.recorded_run import refuse_other as refuse_other
from planlang.runs.recorded_run import restore as restore
from planlang.runs.repeating import Repetition as Repetition
from planlang.runs.run_tree import RunTree as RunTree
from planlang.runs.run_tree import TaskNode as TaskNode
from planlang.runs.trace import Different as Different
from planlang.runs.trace import Trace as Trace
from planlang.runs.trace import with_paths as with_paths
