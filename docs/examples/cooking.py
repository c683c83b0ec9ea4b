"""The module of a cook, who does what no simulated robot can do: cracking eggs, mixing, flipping, frosting.

The module only takes its time. What becomes of eggs, flour and dough is declared for the classes of these actions in
ontologies/object_change.omn, and applied by planlang when the module is done.
"""

from planlang import process_module, sleep

SECONDS = {
    "Cracking": 5.0,
    "CrackingAnEgg": 5.0,
    "AddingSth": 5.0,
    "Mixing": 60.0,
    "Stirring": 60.0,
    "FlippingAnObject": 5.0,
    "ApplyingStuffToSurface": 60.0,
}
"""Class of actions -> how long they take."""


@process_module
class Cooking:
    """Stands by while somebody cooks."""

    name = "cooking"
    actions = tuple(SECONDS)
    failures = ()

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        return ()

    async def execute(self, action):
        await sleep(next(SECONDS[cls] for cls in self.platform.ancestors(action.type) if cls in SECONDS))
