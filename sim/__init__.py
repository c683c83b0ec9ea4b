"""A simulated world: rooms of simple shapes, one robot, people who take what is offered.

:class:`PyBulletWorld` (``world.py``) is the true world, which is commanded and sensed, and read by its ``truth.py``;
planning asks :class:`PlanningWorld`. ``kinematic.py`` is what both have, ``scene.py`` their contents. Inside,
``bodies.py``, ``description.py`` and ``robot.py`` own what is in the physics client, ``contact.py`` and ``camera.py``
answer questions, ``falling.py`` and ``people.py`` move things, ``snapshots.py`` keeps their state. Only ``engine.py``
imports PyBullet.
"""

from sim.people import ComfortZone
from sim.planning_world import PlanningWorld, Solid
from sim.scene import Body, BodyShape, CameraModel, RobotBody, Scene, perturb
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
    "perturb",
]
