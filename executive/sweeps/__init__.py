"""Run one job in many worlds, such as a plan with many seeds: processes, resumable files, statistics of outcomes."""

from executive.sweeps.records import Row, World
from executive.sweeps.running import run, workers

__all__ = ["Row", "World", "run", "workers"]
