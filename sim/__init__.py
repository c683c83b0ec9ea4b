"""A simulated world: rooms of simple shapes, one robot, and people who take what is offered to them.

:class:`PyBulletWorld` (``world.py``) is the true world: it is commanded and sensed like a robot's real environment;
``truth.py`` is what goals and reports see of it. Planning queries :class:`PlanningWorld`, which :class:`WorldMirror`
brings to the state that is asked about. Both worlds extend ``kinematic.py``; ``scene.py`` describes their contents,
``displacing.py`` lets the true ones differ from a map. ``bodies.py``, ``description.py`` and ``robot.py`` own the
objects in the physics client, ``contact.py`` and ``camera.py`` answer queries, ``falling.py`` and ``people.py`` move
things. What actions, flow and heat change is computed in :mod:`planlang.state`, from what ``mirror.py`` answers for a
state. Only ``engine.py`` imports PyBullet.
"""

from sim.displacing import perturb
from sim.mirror import WorldMirror
from sim.people import ComfortZone
from sim.planning_world import PlanningWorld, Solid
from sim.scene import Body, BodyShape, CameraModel, RobotBody, Scene
from sim.world import PyBulletWorld

__all__ = [
    "Body",
    "BodyShape",
    "CameraModel",
    "ComfortZone",
    "PlanningWorld",
    "PyBulletWorld",
    "RobotBody",
    "Scene",
    "Solid",
    "WorldMirror",
    "perturb",
]
