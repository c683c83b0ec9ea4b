"""Robots built from parts, as URDF: bases, torsos, arms with hands, heads and passive parts, of primitive shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

Vector = tuple[float, float, float]
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
TURNS = (-2.5, 2.5)


@dataclass
class Parts:
    """The links and joints of a robot."""

    elements: list[str] = field(default_factory=list)

    def link(self, name: str, box: Vector | None = None, at: Vector = (0.0, 0.0, 0.0)) -> str:
        """Add a link, and the box that is its shape (extents and centre in its frame, [m])."""
        shape = f'<origin xyz="{_text(at)}"/><geometry><box size="{_text(box)}"/></geometry>' if box else ""
        self.elements.append(f'<link name="{name}">{f"<collision>{shape}</collision>" if box else ""}</link>')
        return name

    def joint(
        self,
        name: str,
        parent: str,
        child: str,
        at: Vector = (0.0, 0.0, 0.0),
        axis: Vector = Z,
        limits: tuple[float, float] = TURNS,
        kind: str = "revolute",
        mimic: str | None = None,
    ) -> str:
        """Add a joint between two links; its frame has the orientation of the parent's."""
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{_text(at)}"/>'
        bounded = kind in ("revolute", "prismatic")
        limit = f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="10" velocity="1"/>' if bounded else ""
        follows = f'<mimic joint="{mimic}"/>' if mimic else ""
        turns = f'<axis xyz="{_text(axis)}"/>' if kind not in ("fixed", "floating") else ""
        self.elements.append(f'<joint name="{name}" type="{kind}">{ends}{turns}{limit}{follows}</joint>')
        return child

    def fixed(self, parent: str, child: str, at: Vector = (0.0, 0.0, 0.0)) -> str:
        """Fix a link to another one."""
        return self.joint(f"{child}_fixed", parent, child, at, kind="fixed")

    def written(self, path: Path) -> Path:
        """Write the URDF."""
        path.write_text(f'<robot name="{path.stem}">{"".join(self.elements)}</robot>')
        return path

    # Bases

    def base(self, kind: str) -> str:
        """Add a base with wheels, legs, or a root that moves; returns the link that carries the robot."""
        root = {"planar": "world", "floating": "world", "odometry": "odom"}.get(kind)
        if root is not None:
            self.link(root)
        base = self.link("base_link", (0.5, 0.44, 0.3), (0.0, 0.0, 0.17))
        if kind in ("planar", "floating"):
            self.joint("world_joint", "world", base, kind=kind)
        if kind == "odometry":
            slides = {"limits": (-100.0, 100.0), "kind": "prismatic"}
            self.joint("odom_x_joint", "odom", self.link("odom_x_frame"), axis=X, **slides)  # type: ignore[arg-type]
            self.joint("odom_y_joint", "odom_x_frame", self.link("odom_y_frame"), axis=Y, **slides)  # type: ignore[arg-type]
            self.joint("odom_t_joint", "odom_y_frame", base, kind="continuous")
        for side, y in (("left", 0.24), ("right", -0.24)):
            if kind == "wheels":
                wheel = self.link(f"{side}_wheel", (0.16, 0.04, 0.16))
                self.joint(f"{side}_wheel_joint", base, wheel, (0.0, y, 0.08), Y, kind="continuous")
            if kind == "legs":
                self.leg(base, side, y / 2)
        return base

    def leg(self, body: str, side: str, y: float) -> None:
        """Add a leg of four joints and a sole 0.8 m below the body."""
        link, at = body, (0.0, y, 0.0)
        for number, (name, axis) in enumerate((("hip_yaw", Z), ("hip_pitch", Y), ("knee", Y), ("ankle", Y))):
            child = self.link(f"{side}_{name}_link", (0.08, 0.08, 0.2), (0.0, 0.0, -0.1))
            link = self.joint(f"{side}_{name}", link, child, at, axis, (-1.5, 1.5))
            at = (0.0, 0.0, -0.2 if number else 0.0)
        self.fixed(link, self.link(f"{side}_sole", (0.2, 0.1, 0.02), (0.03, 0.0, -0.19)))

    # Above it

    def torso(self, body: str, joints: str, height: float = 0.35) -> str:
        """Add a torso of joints: "y" yaw, "p" pitch, "l" lift; returns its last link."""
        at = (0.0, 0.0, height)
        for number, joint in enumerate(joints):
            link = self.link(f"torso_{number}", (0.1, 0.2, 0.1), (0.0, 0.0, 0.05))
            axis, kind = (Y if joint == "p" else Z), ("prismatic" if joint == "l" else "revolute")
            limits = (0.0, 0.4) if joint == "l" else (-0.6, 0.6)
            body = self.joint(f"torso_{number}_joint", body, link, at, axis, limits, kind)
            at = (0.0, 0.0, 0.12)
        return body

    def arm(self, body: str, name: str, joints: int, y: float, *, at: tuple[float, float] = (0.1, 0.1)) -> str:
        """Add an arm of joints name_0 and so on, the shoulder first at x and z; returns its last link."""
        place = (at[0], y, at[1])
        for number in range(joints):
            length = 0.26 if number in (1, 2) else 0.08
            link = self.link(f"{name}_{number}_link", (0.06, 0.06, length - 0.01), (0.0, 0.0, length / 2))
            body = self.joint(f"{name}_{number}", body, link, place, (Z, Y, Y, Z, Y, Z, Y, Z)[number])
            place = (0.0, 0.0, length)
        return body

    def gripper(self, wrist: str, name: str, *, fingers: int = 2, phalanges: int = 1, mimics: bool = False) -> str:
        """Add a palm 3 cm before a wrist, with two sliding fingers, or fingers of phalanges around it, one a thumb."""
        palm = self.fixed(wrist, self.link(f"{name}_palm", (0.05, 0.14, 0.04), (0.0, 0.0, 0.02)), (0.0, 0.0, 0.08))
        for number in range(fingers):
            if fingers == 2 and phalanges == 1:
                side = 1 - 2 * number
                link = self.link(f"{name}_finger{number}", (0.02, 0.012, 0.09), (0.0, side * 0.006, 0.045))
                master = f"{name}_finger0_joint" if number and mimics else None
                at, axis = (0.0, 0.0, 0.04), (0.0, float(side), 0.0)
                self.joint(f"{name}_finger{number}_joint", palm, link, at, axis, (0.0, 0.045), "prismatic", master)
                continue
            finger, side = ("thumb", -1) if number == 0 and fingers > 1 else (f"finger{number}", 1)
            parent, at = palm, (0.025 * (number - fingers / 2) * (side > 0), side * 0.03, 0.04)
            for phalanx in range(phalanges):
                link = self.link(f"{name}_{finger}_{phalanx}_link", (0.014, 0.014, 0.035), (0.0, 0.0, 0.018))
                joint = f"{name}_{finger}_{phalanx}"
                master = f"{name}_{finger}_{phalanx - 1}" if phalanx and mimics else None
                parent = self.joint(joint, parent, link, at, (float(side), 0.0, 0.0), (0.0, 1.2), mimic=master)
                at = (0.0, 0.0, 0.036)
        return palm

    def head(self, body: str, joints: int, z: float = 0.4) -> str:
        """Add a neck of joints and a head with a camera; returns the optical frame of the camera."""
        link, at = body, (0.0, 0.0, z)
        for number in range(joints):
            child = self.link(f"head_{number}", (0.05, 0.05, 0.05))
            link = self.joint(f"head_{number}_joint", link, child, at, (Z, Y, X)[number], (-1.0, 1.0))
            at = (0.0, 0.0, 0.06)
        camera = self.fixed(link, self.link("camera_link", (0.03, 0.1, 0.03)), at)
        return self.fixed(camera, self.link("camera_optical_frame"))

    def lamp(self, link: str, name: str = "lamp") -> None:
        """Add a lamp that tilts beside a link."""
        lamp = self.link(name, (0.03, 0.03, 0.03), (0.04, 0.0, 0.0))
        self.joint(f"{name}_tilt", link, lamp, (0.04, 0.0, 0.02), X, (-1.0, 1.0))


def _text(vector: Sequence[float] | None) -> str:
    return " ".join(f"{value:g}" for value in vector or ())
