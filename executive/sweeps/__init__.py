"""One job in many worlds, such as a run by many seeds: supervised processes, files that resume, counts of outcomes."""

from executive.sweeps.records import Row, World
from executive.sweeps.running import run

__all__ = ["Row", "World", "run"]
