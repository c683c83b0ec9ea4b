"""Facts about many polyhedra as arrays."""

import numpy as np

from executive.motion.facets import Facets
from executive.motion.spheres import Faceted
from planlang.geometry import Array, Pose


def some(rng: np.random.Generator) -> list[Faceted | None]:
    """Polyhedra, not all of them known."""
    sizes = [(4, 4), None, (8, 6), None, (6, 8), (5, 5)]
    return [
        None if size is None else Faceted(rng.normal(size=(size[0], 3)), rng.normal(size=(size[1], 4)), rng.random())
        for size in sizes
    ]


def rows(facets: Facets) -> list[tuple[Array, Array, float]]:
    """Corners, planes and what is beyond of each."""
    corners, planes = (
        np.split(array, first[1:-1])
        for array, first in ((facets.corners, facets.corner_first), (facets.planes, facets.plane_first))
    )
    return list(zip(corners, planes, facets.beyond.tolist(), strict=True))


def test_polyhedra_are_moved_chosen_and_joined_as_each_by_itself() -> None:
    rng = np.random.default_rng(0)
    each = some(rng)
    places = np.stack([Pose(tuple(rng.normal(size=3)), (0.0, 0.6, 0.0, 0.8)).matrix() for _ in each])
    alone = [None if one is None else one.moved(at) for one, at in zip(each, places, strict=True)]
    together = Facets.of(each).moved(places)
    assert together.known.tolist() == [one is not None for one in each]
    kept = np.array([True, True, False, False, True, True])
    halves = Facets.joined([together.only(kept), Facets.unknown(1), together.only(~kept)])
    wanted = [alone[0], alone[1], alone[4], alone[5], None, alone[2], alone[3]]
    assert len(halves) == len(wanted)
    for (corners, planes, beyond), one in zip(rows(halves), wanted, strict=True):
        if one is None:
            assert len(corners) + len(planes) == 0
            continue
        np.testing.assert_allclose(corners, one.corners, atol=1e-12)
        np.testing.assert_allclose(planes, one.planes, atol=1e-12)
        assert beyond == one.beyond
