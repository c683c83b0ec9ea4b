"""Bodies on their way down, and what they would rest on."""

from __future__ import annotations

from planlang.geometry import Pose
from sim.bodies import Bodies
from sim.rays import Rays
from sim.sinking import fall, resting


class Falling:
    """Lets bodies sink to the first surface below; nothing but these falls."""

    def __init__(self, bodies: Bodies, rays: Rays, rate: int) -> None:
        self.bodies, self.rays, self.rate = bodies, rays, rate
        self.on_the_way: dict[str, tuple[float, Pose]] = {}
        """Body -> speed [m/s] and where it will rest."""

    def rest(self, name: str) -> tuple[Pose, str | None]:
        """Where a body would come to rest if it were let go here, and on what (None: there is nothing below)."""
        body = self.bodies.bodies[name]
        with self.rays.without(name):
            return resting(self.bodies.poses[name], body.size, self.rays.down, cylinder=body.shape == "cylinder")

    def begin(self, name: str) -> None:
        """Let a body go; one with nothing below it stays in the air."""
        rest, support = self.rest(name)
        if support is not None:
            self.on_the_way[name] = (0.0, rest)

    def stop(self, name: str) -> None:
        """The body is held, or was put somewhere."""
        self.on_the_way.pop(name, None)

    def step(self) -> None:
        """One step of free fall for every body on its way; it takes its final orientation with the first."""
        for name, (speed, rest) in list(self.on_the_way.items()):
            x, y, floor = rest.position
            height, speed = fall(self.bodies.poses[name].position[2], speed, self.rate)
            if height <= floor:
                self.bodies.place(name, rest)
                del self.on_the_way[name]
            else:
                self.bodies.place(name, Pose((x, y, height), rest.orientation))
                self.on_the_way[name] = (speed, rest)
