"""Pouring out of bowls, which are wider than the robot's hand can hold over something and tilt."""

from planlang import process_module, sleep


@process_module
class Pouring:
    """Stands by while somebody pours."""

    name = "pouring"
    actions = ("FluidFlow-Translation",)
    failures = ()

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        return ()

    async def execute(self, action):
        await sleep(10.0)
