"""Worlds in URDF whose links have meshes, for tests."""

from __future__ import annotations

from pathlib import Path


def link(name: str, *shapes: str, kind: str = "collision") -> str:
    inner = "".join(f"<{kind}>{one}</{kind}>" for one in shapes)
    return f'<link name="{name}">{inner}</link>\n'


def mesh(name: str, rest: str = "") -> str:
    return f'<geometry><mesh filename="{name}"{rest}/></geometry>'


def flat(folder: Path, *links: str, where: str = "0 0 0") -> Path:
    """A world with these links in one place."""
    path, names = folder / "flat.urdf", [one.split('"')[1] for one in links]
    joints = "".join(
        f'<joint name="to_{name}" type="fixed"><parent link="origin"/><child link="{name}"/>'
        f'<origin xyz="{where}"/></joint>'
        for name in names
    )
    path.write_text(f'<robot name="flat">\n<link name="origin"/>\n{"".join(links)}{joints}</robot>\n')
    return path
