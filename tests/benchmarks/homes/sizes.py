"""Sizes of what stands in homes, from published ranges; nothing here was chosen by what a robot can do.

Sources of the ranges:

* [K] kitchens: ISO 3055 and EN 1116 (coordinating sizes: worktops at 850 to 950 mm, 600 mm deep, units in steps of
  100 mm); carcasses of 720 mm on plinths of 100 to 150 mm; wall units 300 to 370 mm deep, 500 to 600 mm over worktops.
* [D] drawers and doors: catalogues of fitted kitchens (fronts of 100, 200 and 400 mm; doors of 300 to 600 mm).
* [G] grips: holes 32 mm apart times 3 to 10 (96 to 320 mm), bars 10 to 14 mm, 25 to 40 mm clear; knobs: 25 to 35 mm.
* [C] cooling: IEC 62552 classes on the market: 540 to 600 mm wide, 550 to 650 mm deep, 850 to 1,850 mm high.
* [N] tables, beds and seats: E. Neufert, Architects' Data: dining 720 to 760 mm, coffee tables 400 to 500 mm, beds
  1,900 to 2,100 mm by 900 to 1,000 mm at 450 to 600 mm, seats at 430 to 470 mm; nursing beds 400 to 800 mm.
* [P] people: DIN 33402-2, women's 5th to men's 95th percentile: 1,535 to 1,855 mm tall, 1,200 to 1,400 mm when seated.
* [F] flats: DIN 18101 (leaves of 735, 860 and 985 mm leave 0.67 to 0.93 m) and DIN 18040-2 (0.8 m within a flat, 0.9 m
  for wheelchairs); doorways 2.0 to 2.1 m high; halls 1.1 to 1.6 m wide (Neufert; DIN 18040-2 asks for 1.2 m).
* [W] ways: 900 to 1,200 mm before furniture that is opened (Neufert; NKBA asks for 914 mm), 800 to 1,200 mm else.
* [T] tableware and packages as sold: cups 60 (espresso) to 95 mm (coffee), mugs 80 to 95 mm, glasses 60 to 80 mm,
  bottles of 0.5 to 1 l 60 to 85 mm, cans 66 mm, cartons of 1 l 70 mm square, plates 190 to 270 mm, bowls 120 to 170 mm,
  cutlery 160 to 210 mm; serving bowls up to 300 mm, pots of 3 to 8 l 200 to 280 mm with two handles 60 to 80 mm long.

All lengths are in metres: (depth, width, height) along a thing's own x, y and z; x points to its front.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

Range = tuple[float, float]


class Extents(NamedTuple):
    """Ranges of the three extents of a class of things; ``is_round``: depth and width are one number."""

    cls: str
    depth: Range
    width: Range
    height: Range
    is_round: bool = False


THINGS: Mapping[str, Extents] = {
    "cup": Extents("Cup", (0.06, 0.095), (0.06, 0.095), (0.055, 0.105), is_round=True),
    "mug": Extents("DrinkingMug", (0.08, 0.095), (0.08, 0.095), (0.085, 0.11), is_round=True),
    "glass": Extents("DrinkingGlass", (0.06, 0.08), (0.06, 0.08), (0.09, 0.15), is_round=True),
    "bottle": Extents("DrinkingBottle", (0.06, 0.085), (0.06, 0.085), (0.19, 0.3), is_round=True),
    "can": Extents("DrinkingCan", (0.066, 0.066), (0.066, 0.066), (0.115, 0.168), is_round=True),
    "milk": Extents("CowsMilk-Product", (0.07, 0.075), (0.07, 0.075), (0.195, 0.24)),
    "bowl": Extents("Bowl-Eating", (0.12, 0.17), (0.12, 0.17), (0.055, 0.08), is_round=True),
    "large_bowl": Extents("Bowl-Eating", (0.1, 0.3), (0.1, 0.3), (0.05, 0.12), is_round=True),
    "pot": Extents("SoupPot", (0.2, 0.28), (0.2, 0.28), (0.11, 0.17), is_round=True),
    "plate": Extents("DinnerPlate", (0.19, 0.27), (0.19, 0.27), (0.018, 0.03), is_round=True),
    "fork": Extents("DinnerFork", (0.17, 0.21), (0.022, 0.03), (0.012, 0.02)),
    "knife": Extents("TableKnife", (0.19, 0.23), (0.018, 0.025), (0.01, 0.015)),
    "spoon": Extents("SoupSpoon", (0.17, 0.21), (0.035, 0.045), (0.015, 0.025)),
    "book": Extents("BookCopy", (0.18, 0.24), (0.12, 0.17), (0.012, 0.035)),
    "phone": Extents("CellularTelephone", (0.14, 0.165), (0.066, 0.078), (0.0075, 0.012)),
    "keys": Extents("BunchOfKeys", (0.07, 0.11), (0.03, 0.06), (0.012, 0.025)),
    "box": Extents("CardboardBox", (0.05, 0.2), (0.04, 0.08), (0.1, 0.26)),
    "sponge": Extents("Sponge-CleaningImplement", (0.09, 0.12), (0.06, 0.075), (0.025, 0.045)),
}
"""[T]. Phones, books and keys as on the market."""

MASSES: Mapping[str, Range] = {
    "cup": (0.15, 0.35), "mug": (0.25, 0.4), "glass": (0.15, 0.35), "bottle": (0.3, 1.1), "can": (0.35, 0.53),
    "milk": (1.03, 1.08), "bowl": (0.25, 0.5), "plate": (0.3, 0.75), "fork": (0.04, 0.07), "knife": (0.05, 0.09),
    "spoon": (0.04, 0.07), "book": (0.15, 0.6), "phone": (0.14, 0.23), "keys": (0.05, 0.12), "box": (0.1, 0.8),
    "sponge": (0.01, 0.03), "large_bowl": (0.25, 0.9), "pot": (1.0, 1.8),
}  # fmt: skip
"""[T], in kilograms, with what is in them."""

FURNITURE: Mapping[str, Extents] = {
    "kitchen_table": Extents("KitchenTable", (0.6, 0.9), (0.8, 1.6), (0.72, 0.76)),
    "dining_table": Extents("DiningRoomTable", (0.8, 1.0), (1.2, 2.0), (0.72, 0.76)),
    "coffee_table": Extents("CoffeeTable-PieceOfFurniture", (0.5, 0.8), (0.7, 1.2), (0.4, 0.5)),
    "side_table": Extents("SideTable", (0.4, 0.55), (0.4, 0.6), (0.45, 0.65)),
    "bedside_table": Extents("BedsideTable", (0.35, 0.5), (0.35, 0.5), (0.45, 0.65)),
    "desk": Extents("Desk-PieceOfFurniture", (0.6, 0.8), (1.2, 1.6), (0.72, 0.76)),
    "counter": Extents("CounterTop", (0.6, 0.65), (0.8, 2.4), (0.85, 0.95)),
    "sideboard": Extents("Cabinet-PieceOfFurniture", (0.35, 0.5), (0.8, 1.6), (0.7, 0.95)),
    "bed": Extents("Bed-PieceOfFurniture", (1.9, 2.1), (0.9, 1.0), (0.45, 0.65)),
    "waste_basket": Extents("WasteBasket", (0.22, 0.35), (0.22, 0.35), (0.28, 0.6)),
    "chair": Extents("Chair-PieceOfFurniture", (0.42, 0.5), (0.42, 0.5), (0.43, 0.47)),
    "sofa": Extents("Sofa-PieceOfFurniture", (0.8, 0.95), (1.5, 2.1), (0.42, 0.46)),
}
"""[N], [K]. Chairs and sofas count up to the seat: their backs are in nobody's way."""

ROOM: Extents = Extents("Kitchen", (3.6, 6.0), (3.2, 5.0), (2.4, 2.7))
"""Inside of a room; 12 to 30 square metres, as kitchens with a table and living rooms have."""

HALL: Extents = Extents("Hall", (2.5, 5.0), (1.1, 1.6), (2.4, 2.7))
"""[F] Inside of a hall."""
PARTITION = 0.1
"""Thickness of the wall between two rooms: gypsum on studs."""
DOORWAY, NARROW, DOOR_HEIGHT = (0.8, 1.0), (0.55, 0.7), (2.0, 2.1)
"""[F] Clear widths of doorways, of those of small rooms, and their height."""
NARROW_ONES = 0.05
"""Share of doorways that are so narrow."""
DOOR_HANDLE = (1.0, 1.05)
"""[F] Height of the handle of a room's door, or of the bar of one that slides (DIN 18255)."""
POST = 0.1
"""Least width of the wall beside a doorway."""

CLEAR = (0.9, 1.2)
"""[W] Free floor before what is opened."""
AISLE = (0.8, 1.2)
"""[W] Free floor before other furniture."""

DOOR = Extents("Door", (0.016, 0.022), (0.3, 0.6), (0.4, 1.2))
"""[D] A door of a cupboard."""
CUPBOARD_DEPTH: Mapping[str, Range] = {"base": (0.4, 0.6), "tall": (0.35, 0.6), "wall": (0.3, 0.37)}
PLINTH = (0.05, 0.15)
"""[K] Height of what lies below the lowest door or drawer."""
WALL_UNIT = (1.35, 1.5)
"""[K] Height of the lower side of a wall unit."""
DRAWER_FRONT = (0.1, 0.2, 0.3)
"""[D] Heights of drawers' fronts."""
DRAWER_WIDTH = (0.3, 0.9)
FRIDGE = Extents("Refrigerator", (0.55, 0.65), (0.54, 0.6), (0.85, 1.85))
"""[C]."""
SPACING = 0.032
"""[G] A bar is 3 to 10 of these long."""
BARS, BAR_THICK, BAR_CLEAR, KNOB = (3, 10), (0.01, 0.014), (0.025, 0.04), (0.025, 0.035)
KNOBS = 0.25
"""Share of doors and drawers with a knob instead of a bar."""

STANDING, SEATED, SLEEPING = (1.535, 1.855), (1.2, 1.4), (1.535, 1.855)
"""[P] Heights and lengths of people."""
RAISED = (0.25, 0.75)
"""Height of somebody in bed, from flat to sitting up [N]."""
DEVICES: Mapping[str, Extents] = {
    "coffee_machine": Extents("CoffeeMachine", (0.3, 0.45), (0.18, 0.3), (0.3, 0.4)),
    "toaster": Extents("ToasterOven", (0.28, 0.38), (0.35, 0.48), (0.2, 0.28)),
    "microwave": Extents("MicrowaveOven", (0.33, 0.42), (0.44, 0.52), (0.26, 0.3)),
    "lamp": Extents("ElectricalLightingDevice", (0.15, 0.25), (0.15, 0.25), (0.3, 0.45)),
    "radio": Extents("RadioReceiver", (0.08, 0.15), (0.2, 0.3), (0.12, 0.2)),
    "television": Extents("TelevisionSet", (0.06, 0.2), (0.7, 1.1), (0.45, 0.7)),
}
"""Catalogues."""
POT_HANDLE = (0.07, 0.05, 0.015)
"""[T] Size of each of the two handles of a pot."""
BUTTON = (0.015, 0.03)
"""Diameter of a button."""
