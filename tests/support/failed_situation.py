"""A failed run in a room with a table, three things on it, and a cupboard: what ``planlang why`` begins with."""

from __future__ import annotations

from executive.why.candidates import Situation
from executive.why.evidence import Evidence
from planlang.geometry import Pose
from sim import Body, Scene
from sim.joints import Articulation, JointKind

TABLE = Body("table1", Pose((2.0, 0.0, 0.37)), (0.6, 1.2, 0.74))
CUP = Body("cup1", Pose((1.9, 0.0, 0.79)), (0.08, 0.08, 0.1), movable=True)
BOX = Body("box1", Pose((1.9, 0.2, 0.79)), (0.1, 0.1, 0.1), movable=True)
SAUCER = Body("saucer1", Pose((1.9, 0.2, 0.845)), (0.06, 0.06, 0.01), movable=True)
CUPBOARD = Body("cupboard1", Pose((0.0, 3.0, 0.5)), (0.5, 0.6, 1.0))
DOOR = Body("door1", Pose((0.26, 3.0, 0.5)), (0.02, 0.6, 1.0))
HINGE = Articulation("door1", JointKind.HINGED, (0.26, 2.7, 0.5), (0.0, 0.0, 1.0), 0.0, 1.57, "cupboard1")
SCENE = Scene((TABLE, CUP, BOX, SAUCER, CUPBOARD, DOOR), joints=(HINGE,))
EVIDENCE = Evidence((), ("cup1 cannot be reached",), {"box1": 3}, "", "", False, True, False, 1, is_grasp_open=True)
SITUATION = Situation(SCENE, frozenset({"cup1"}), "amigo", ("right", "left"), ("amigo", "pr2"), EVIDENCE)
