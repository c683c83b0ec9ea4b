"""Locations: from relations such as "in reach of the patient" to places for the base and poses of the hand.

General layout: ``relations`` is the table of what each relation means; ``hand`` makes hand poses, ``reach`` solves
them from one base, ``resolver`` samples bases; ``surroundings`` is the view of the believed world that they need.
"""

from executive.locations.block import Block
from executive.locations.hand import ComfortZone, HandFrame, Held
from executive.locations.reach import Reach, ReachSolution
from executive.locations.resolver import Resolver
from executive.locations.surroundings import ArmModel, Base, Surroundings

__all__ = [
    "ArmModel",
    "Base",
    "Block",
    "ComfortZone",
    "HandFrame",
    "Held",
    "Reach",
    "ReachSolution",
    "Resolver",
    "Surroundings",
]
