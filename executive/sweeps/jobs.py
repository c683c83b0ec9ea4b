"""The job of sweeps of plans by name: only the processes in which it runs import it."""

RUNS, READS_RUN = "executive.sweeps.world_run:ended", "executive.runs.assembled:read_files"
"""The job that runs a plan, and what reads its files (:attr:`executive.sweeps.records.Task.reads`)."""
