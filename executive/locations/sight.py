"""From where something is likely to be seen; whether it is, the planning world judges."""

from __future__ import annotations

import numpy as np

from executive.belief.believed_bodies import Block
from planlang.geometry import Array

BEST, WIDTH = 1.2, 0.8
"""Distance from which things are seen best, and over which that fades [m]."""


def sight_score(bases: Array, block: Block, limits: tuple[float, float]) -> Array:
    """How likely a block is seen from bases (n, 3), (n,) in [0, 1]: by distance, and more if it is ahead."""
    dx, dy = block.x - bases[:, 0], block.y - bases[:, 1]
    away = np.hypot(dx, dy)
    miss = np.abs(np.arctan2(np.sin(bases[:, 2] - np.arctan2(dy, dx)), np.cos(bases[:, 2] - np.arctan2(dy, dx))))
    near, far = limits
    likely = np.exp(-(((away - BEST) / WIDTH) ** 2)) * np.exp(-((miss / 1.5) ** 2))
    return np.where((away < far) & (away > min(near, 0.2)), likely, 0.0)
