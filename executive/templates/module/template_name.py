"""A process module: code that performs a class of actions. ``--modules template_name.py`` adds it to a run.

It performs steps below ``Whistling``. Declare that class in the recipe, as a subclass of a class of the vocabulary.
"""

from planlang import process_module, sleep
from planlang.failures import ManipulationFailure


class OutOfBreath(ManipulationFailure):
    """Plans can recover from your own failures like from planlang's."""


@process_module
class Whistling:
    """Takes two seconds, and needs no part of the robot."""

    name = "template_name"
    actions = ("Whistling",)
    failures = (OutOfBreath,)

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        """Name the resources: of two actions that need the same arm, one waits for the other."""
        return ()

    async def execute(self, action):
        """Perform the action; plan time passes only in ``sleep`` and in motions of ``self.platform``."""
        await sleep(2.0)
        return "whistled"
