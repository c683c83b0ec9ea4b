"""Robot files of robots that are not bundled: a cart without arms, a Panda arm."""

from __future__ import annotations

from pathlib import Path

BASE = """
name = "mine"
urdf = "robot.urdf"
[base]
radius = 0.36
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
"""
PANDA_ARM = """
[arms.arm]
tip = "panda_grasptarget"
hand = "panda_hand"
approach = [0, 0, 1]
closing = [0, 1, 0]
[arms.arm.gripper]
opened = { panda_finger_joint1 = 0.04, panda_finger_joint2 = 0.04 }
closed = { panda_finger_joint1 = 0.0, panda_finger_joint2 = 0.0 }
fingers = ["panda_leftfinger", "panda_rightfinger"]
max_opening = 0.075
"""
CART = """<robot name="cart"><link name="base"><collision><geometry><box size="0.5 0.5 0.5"/></geometry></collision>
</link></robot>"""


def cart_in(folder: Path) -> Path:
    """Write a robot without arms into a folder; return its robot file."""
    (folder / "robot.urdf").write_text(CART)
    (folder / "cart.toml").write_text(BASE)
    return folder / "cart.toml"
