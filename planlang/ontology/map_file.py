"""Reads a sensed map (occupancy grid, point cloud, octree) as the statement that there is such a map.

Its content is not read here, but by the code that builds the obstacles of the world.
"""

from __future__ import annotations

import re
from pathlib import Path

from planlang.diagnostics import Span
from planlang.ontology.terms import OWL, RDF, ROBOEARTH, Literal, expand
from planlang.ontology.triples import Parsed, Triples

OCCUPANCY_GRID, POINTS, OCTREE = (f"{ROBOEARTH}{name}" for name in ("OccupancyGridMap", "PointMap", "OctoMap"))
_COMMENTS = rb"(?:#[^\n]{0,200}\n){0,10}"
_NUMBER = rb"[-+]?(?:[0-9.]+(?:[eE][-+]?[0-9]+)?|nan|NaN)"
_BEGINNINGS = {
    OCTREE: re.compile(rb"# Octomap OcTree "),
    POINTS: re.compile(
        rb"ply\r?\n|" + _COMMENTS + rb"(?:(?:VERSION|FIELDS)[ \t]|" + _NUMBER + rb"(?:[ \t]+" + _NUMBER + rb"){2})"
    ),
}


def sensed_map(content: bytes) -> str | None:
    """Detect a point cloud or an octree by its first bytes, and name its class (IRI); None for other files."""
    return next((cls for cls, beginning in _BEGINNINGS.items() if beginning.match(content)), None)


def read_map_file(path: Path, base: str, cls: str) -> Parsed:
    """State an individual of the map's class with a link to the file."""
    span, triples = Span(str(path)), Triples(str(path))
    own = f"{base}#map"
    triples.state(base, RDF.type, OWL.Ontology, span)
    triples.state(own, RDF.type, cls, span)
    triples.state(own, expand("linkToMapFile"), Literal(path.name), span)
    return Parsed(triples, [])
