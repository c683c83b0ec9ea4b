"""A simulated world: rooms of simple shapes, one robot, people who take what is offered.

:class:`PyBulletWorld` (``world.py``) is what others use; ``scene.py`` says what it is made from. Inside, ``bodies.py``
and ``robot.py`` own what is in the physics client, ``contact.py``, ``rays.py`` and ``camera.py`` answer questions,
``playback.py``, ``sinking.py`` and ``people.py`` move things. Only ``engine.py`` imports PyBullet.
"""

from sim.hulls import Hulled, hull_of
from sim.outline import Solid
from sim.person import Reach, reach_of
from sim.perturb import perturb
from sim.planning_world import PlanningWorld
from sim.scene import Body, CameraModel, RobotBody, Scene
from sim.world import PyBulletWorld

__all__ = [
    "Body",
    "CameraModel",
    "Hulled",
    "PlanningWorld",
    "PyBulletWorld",
    "Reach",
    "RobotBody",
    "Scene",
    "Solid",
    "hull_of",
    "perturb",
    "reach_of",
]
