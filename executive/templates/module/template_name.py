"""A process module: how the robot performs a class of actions. ``--modules template_name.py`` adds it to a run.

A recipe with a step of class ``Whistling`` needs it; declare that class there, as a subclass of a known class.
"""

from planlang import process_module, sleep
from planlang.failures import ManipulationFailure


class OutOfBreath(ManipulationFailure):
    """A failure of your own; plans recover from it as from those of planlang."""


@process_module
class Whistling:
    """Takes two seconds, and uses no part of the robot."""

    name = "template_name"
    actions = ("Whistling",)
    failures = (OutOfBreath,)

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        """Names of the parts it uses, such as arms; actions that use the same part wait for each other."""
        return ()

    async def execute(self, action):
        """Perform the action; plan time passes only in ``sleep`` and in motions of ``self.platform``."""
        await sleep(2.0)
        return "whistled"
