"""A process module: what the robot does for a class of actions. ``--modules template_name.py`` adds it to a run.

A recipe whose step is below ``Whistling`` can be run with it: declare the class there, below a class of the vocabulary.
"""

from planlang import process_module, sleep
from planlang.failures import ManipulationFailure


class OutOfBreath(ManipulationFailure):
    """Plans can recover from failures of your own as from those of planlang."""


@process_module
class Whistling:
    """Takes two seconds, and needs nothing of the robot."""

    name = "template_name"
    actions = ("Whistling",)
    failures = (OutOfBreath,)

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        """Name what is used: two actions that use the same arm wait for each other."""
        return ()

    async def execute(self, action):
        """Do it; plan time passes in ``sleep`` and in motions of ``self.platform`` only."""
        await sleep(2.0)
        return "whistled"
