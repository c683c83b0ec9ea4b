"""Makes the simulated world of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from executive.runs.prepared import RunFiles
from executive.runs.simulated import SimulatedWorld
from sim import PyBulletWorld, Scene

if TYPE_CHECKING:
    from executive.robots import Robot


def simulated_world(files: RunFiles, scene: Scene, robot: Robot) -> SimulatedWorld:
    """Make the simulated world of a run. Raises BadInput for a fault that names what is not there."""
    options = files.options
    if options.fault or options.fault_rate:
        from executive.runs.faulty import FaultyRun  # few runs have faults

        return FaultyRun(files, scene, robot)
    return SimulatedWorld(PyBulletWorld(scene, robot.body(), gui=options.gui, seed=files.seed))
