"""Paths of an omnidirectional base, pulled straight and checked exactly.

First A* over a clearance field, which assumes a round silhouette. Where that has no room but the robot itself stands
free (near a bed, at a cabinet), the base may leave and arrive without turning; the exact check decides in the end. A
tight path is slower, for places where that finds none: a base that is not round has to turn before it drives on, so the
search is over positions and headings, and the path has the fewest steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from heapq import heappop, heappush
from itertools import islice, pairwise

import numpy as np

from executive.motion.clearance import Grid, Mask
from executive.motion.errors import GoalInCollision, NoPath, OutsideLimits, StartInCollision
from executive.motion.floods import EVERY, Cell, Poses, around, flood, has
from executive.motion.outlines import HEADINGS, TURN
from planlang.geometry import Array
from planlang.records import dataclass

Planar = tuple[float, float, float]
"""x, y [m] and yaw [rad] in the map."""
Square = tuple[int, int]
"""Row and column of a grid's cell."""
Touching = Callable[[float, float, float], Sequence[tuple[str, str]]]
"""Exact check: pairs of bodies that collide with the base at x, y, yaw; empty if it is free."""
TIGHT = 10.0
"""Cost of a metre without room, in metres with plenty."""
COMFORT = 0.25
"""Room beyond which more makes no difference [m]."""
ESCAPE = 0.8
"""Distance from start and goal within which a base may have no room to turn [m]."""
NARROW = 3.0
"""Extra cost of a metre with hardly any room."""


@dataclass(slots=True)
class _Search:
    """State of the search for one path."""

    grid: Grid
    room: Array
    touching: Touching
    start: Planar
    goal: Planar
    resolution: float
    costs: Array = field(init=False)
    known: dict[Planar, Sequence[tuple[str, str]]] = field(default_factory=dict)
    expanded: int = 0

    def __post_init__(self) -> None:
        """Compute the cost per metre (rows, columns): inf where the base may not go."""
        tight = np.zeros(self.room.shape, dtype=bool)
        centres = self.grid.centres()
        for x, y, _ in (self.start, self.goal):
            tight |= np.hypot(centres[..., 0] - x, centres[..., 1] - y) <= ESCAPE
        narrow = 1.0 + NARROW * np.clip(1.0 - self.room / COMFORT, 0.0, 1.0)
        self.costs = np.where(self.room > 0, narrow, np.where(tight, TIGHT, np.inf))

    def pairs(self, pose: Planar) -> Sequence[tuple[str, str]]:
        if pose not in self.known:
            self.known[pose] = self.touching(*pose)
        return self.known[pose]

    def cost(self, a: Array, b: Array) -> float:
        """Compute the cost of the straight line between two points (2,); inf if it leaves the allowed cells."""
        length = float(np.hypot(*(b - a)))
        count = max(1, math.ceil(2 * length / self.grid.resolution))
        points = a + (b - a) * ((np.arange(count) + 0.5) / count)[:, None]
        return float(self.costs[self.cells(points)].mean()) * length

    def cells(self, points: Array) -> tuple[Array, Array]:
        """Rows (k,) and columns (k,) of points (k, 2); points outside the grid are moved to its rim."""
        row = np.rint((points[:, 1] - self.grid.y) / self.grid.resolution).astype(int)
        column = np.rint((points[:, 0] - self.grid.x) / self.grid.resolution).astype(int)
        return np.clip(row, 0, self.grid.rows - 1), np.clip(column, 0, self.grid.columns - 1)


def plan_base_path(
    start: Planar,
    goal: Planar,
    grid: Grid,
    clearance: Array,
    touching: Touching,
    *,
    resolution: float = 0.08,
    replans: int = 12,
) -> Array:
    """Plan waypoints (n, 3) of x, y [m] and yaw [rad] from start to goal; yaw is continuous, the shorter way.

    ``clearance`` (rows, columns) is the field over the grid. More room than :data:`COMFORT` makes no difference; within
    :data:`ESCAPE` of start and goal the field may be negative. ``touching(x, y, yaw)`` is called at steps of
    ``resolution`` [m, rad] along the path; the path is planned again around collisions, at most ``replans`` times.
    Raises :class:`StartInCollision` and :class:`GoalInCollision` with the colliding bodies, :class:`OutsideLimits` for
    places off the grid or not finite, and :class:`NoPath` with counts.
    """
    if clearance.shape != (grid.rows, grid.columns):
        raise ValueError(f"expected a field of shape {(grid.rows, grid.columns)}, got {clearance.shape}")
    start, goal = _planar("the start", start), _planar("the goal", goal)
    turn = (goal[2] - start[2] + math.pi) % (2 * math.pi) - math.pi
    goal = (goal[0], goal[1], start[2] + turn)
    half = grid.resolution / 2
    low = (grid.x - half, grid.y - half)
    high = (low[0] + grid.columns * grid.resolution, low[1] + grid.rows * grid.resolution)
    for what, place in (("the start", start), ("the goal", goal)):
        if grid.cell(place[0], place[1]) is None:
            raise OutsideLimits(what, place[:2], low, high)
    search = _Search(grid, clearance, touching, start, goal, resolution)
    if pairs := search.pairs(start):
        raise StartInCollision(start, pairs)
    if pairs := search.pairs(goal):
        raise GoalInCollision(goal, pairs)
    attempts = 0
    while attempts <= replans:
        attempts += 1
        places = _astar(search)
        if places is None:
            break
        paths = list(_turned(search, _pulled(search, places)))
        for path in paths:
            if next(_hits(search, path), None) is None:
                return np.asarray(path[np.append(True, (np.diff(path, axis=0) != 0).any(axis=1))])
        for pose in list(_hits(search, paths[0])):
            _forbid(search, pose, (1.0 + 0.5 * attempts) * grid.resolution)
    counts = {"cells expanded": search.expanded, "exact checks": len(search.known), "attempts": attempts}
    raise NoPath(start, goal, counts)


@dataclass(slots=True)
class Ways:
    """Cheapest ways over a grid from one of its cells to others."""

    shape: tuple[int, int]
    costs: dict[int, float]
    """Cost of the way to each cell that was reached. Cells are numbered row by row, with a rim around the grid."""
    before: dict[int, int]
    """The cell before each cell but the first."""
    expanded: int
    """Number of cells whose neighbours were looked at."""

    def field(self) -> Array:
        """Return the costs as an array (rows, columns), inf where no way leads."""
        costs = np.full((self.shape[0] + 2, self.shape[1] + 2), np.inf)
        costs.flat[list(self.costs)] = list(self.costs.values())
        return costs[1:-1, 1:-1]

    def to(self, cell: Square) -> list[Square] | None:
        """List the cells of the way to a cell, both ends included; None if no way leads there."""
        width = self.shape[1] + 2
        way = [(cell[0] + 1) * width + cell[1] + 1]
        if way[0] not in self.costs:
            return None
        while way[-1] in self.before:
            way.append(self.before[way[-1]])
        return [(one // width - 1, one % width - 1) for one in reversed(way)]


def cheapest_ways(costs: Array, first: Square, last: Square | None = None) -> Ways:
    """Find the cheapest ways from one cell of a grid to all others (Dijkstra), or to the cell ``last`` only (A*).

    A step leads to one of the eight neighbours and costs its length in cells times the mean of the ``costs`` (rows,
    columns) of both: at least 1, inf where no way may lead.
    """
    width: int = costs.shape[1] + 2
    # a rim of forbidden cells makes tests of bounds unnecessary
    entering: list[float] = np.pad(costs, 1, constant_values=np.inf).ravel().tolist()
    start, goal = ((row + 1) * width + column + 1 for row, column in (first, last or first))
    goal_row, goal_column = divmod(goal, width)
    root = math.sqrt(2.0)
    moves = [(1, 0.5), (-1, 0.5), (width, 0.5), (-width, 0.5)]
    moves += [(down + side, root / 2) for down in (width, -width) for side in (1, -1)]

    def to_goal(cell: int) -> float:
        row, column = divmod(cell, width)
        down, side = abs(row - goal_row), abs(column - goal_column)
        return max(down, side) + (root - 1) * min(down, side)

    remaining: Callable[[int], float] = to_goal if last is not None else lambda _: 0.0
    ways = Ways(costs.shape, {start: 0.0}, {}, 0)
    best, before = ways.costs, ways.before
    queue = [(remaining(start), start)]
    done: set[int] = set()
    while queue:
        _, cell = heappop(queue)
        if last is not None and cell == goal:
            break
        if cell in done:
            continue
        done.add(cell)
        so_far, here = best[cell], entering[cell]
        for move, share in moves:
            other = cell + move
            cost = so_far + share * (here + entering[other])
            if cost < best.get(other, math.inf):
                best[other] = cost
                before[other] = cell
                heappush(queue, (cost + remaining(other), other))
    ways.expanded = len(done)
    return ways


def _astar(search: _Search) -> Array | None:
    """Find the corners (n, 2) of the cheapest path over the grid, start and goal included.

    These are the points where the grid path begins, turns or ends, or has no room.
    """
    grid, costs = search.grid, search.costs.copy()
    first, last = (cell for x, y, _ in (search.start, search.goal) if (cell := grid.cell(x, y)) is not None)
    for cell in (first, last):
        costs[cell] = min(costs[cell], TIGHT)
    ways = cheapest_ways(costs, first, last)
    search.expanded += ways.expanded
    cells = ways.to(last)
    if cells is None:
        return None
    steps = [(after[0] - cell[0], after[1] - cell[1]) for cell, after in pairwise(cells)]
    kept = [
        cell
        for i, cell in enumerate(cells)
        if i in (0, len(cells) - 1) or steps[i] != steps[i - 1] or search.room[cell] <= 0
    ]
    middle = [(grid.x + column * grid.resolution, grid.y + row * grid.resolution) for row, column in kept]
    return np.array([search.start[:2], *middle, search.goal[:2]])


def _pulled(search: _Search, places: Array) -> Array:
    """Drop the points (n, 2) that a straight line can skip at no higher cost."""
    legs = [search.cost(a, b) for a, b in pairwise(places)]
    kept = [0]
    while kept[-1] < len(places) - 1:
        i = kept[-1]
        for k in range(len(places) - 1, i, -1):
            if k == i + 1 or _cheaper(search.cost(places[i], places[k]), sum(legs[i:k])):
                kept.append(k)
                break
    return places[kept]


def _cheaper(straight: float, around: float) -> bool:
    return math.isfinite(straight) and straight <= around + 1e-9


def _turned(search: _Search, places: Array) -> Iterator[Array]:
    """Yield the path over points (n, 2) with yaws (n, 3): turned on the way where there is room, then on the spot."""
    yaw, goal_yaw = search.start[2], search.goal[2]
    fine = _refined(search, places)
    inner = np.flatnonzero(search.room[search.cells(fine)] > 0)
    first, last = (int(inner[0]), int(inner[-1])) if len(inner) else (0, len(fine) - 1)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(fine, axis=0).T))])
    kept = np.flatnonzero([i in (first, last) or (fine[i] == places).all(axis=1).any() for i in range(len(fine))])
    if lengths[last] > lengths[first]:
        share = np.clip((lengths[kept] - lengths[first]) / (lengths[last] - lengths[first]), 0.0, 1.0)
        yield np.column_stack([fine[kept], yaw + share * (goal_yaw - yaw)])
    roomiest = int(np.argmax(search.room[search.cells(fine)]))
    for spot in dict.fromkeys((roomiest, 0, len(fine) - 1)):
        places_there = np.unique([*kept, spot])
        before, after = places_there[places_there <= spot], places_there[places_there >= spot]
        yield np.concatenate(
            [
                np.column_stack([fine[before], np.full(len(before), yaw)]),
                np.column_stack([fine[after], np.full(len(after), goal_yaw)]),
            ]
        )


def _refined(search: _Search, places: Array) -> Array:
    """Insert points between points (n, 2), so that they are no farther apart than a cell."""
    pieces = [places[:1]]
    for a, b in pairwise(places):
        count = max(1, math.ceil(float(np.hypot(*(b - a))) / search.grid.resolution))
        pieces.append(a + (b - a) * (np.arange(1, count) / count)[:, None])
        pieces.append(b[None])
    return np.concatenate(pieces)


def _hits(search: _Search, path: Array) -> Iterator[Planar]:
    """Yield the poses of a path (n, 3), at the resolution, that are in collision."""
    return (pose for pose in poses_along(path, search.resolution) if search.pairs(pose))


def poses_along(path: Array, resolution: float) -> Iterator[Planar]:
    """Yield the poses of a path (n, 3) at most ``resolution`` [m, rad] apart, without the first."""
    for a, b in pairwise(path):
        distance = max(math.hypot(b[0] - a[0], b[1] - a[1]), abs(b[2] - a[2]))
        count = max(1, math.ceil(distance / resolution))
        for i in range(1, count + 1):
            x, y, yaw = (b if i == count else a + (b - a) * (i / count)).tolist()
            yield x, y, yaw


def _forbid(search: _Search, pose: Planar, radius: float) -> None:
    """Exclude the surroundings of a pose in collision from the next path."""
    centres = search.grid.centres()
    near = np.hypot(centres[..., 0] - pose[0], centres[..., 1] - pose[1]) <= radius
    search.costs[near] = np.inf


def _planar(what: str, pose: Planar) -> Planar:
    x, y, yaw = (float(value) for value in pose)
    if not all(map(math.isfinite, (x, y, yaw))):
        raise OutsideLimits(what, (x, y, yaw), [-math.inf] * 3, [math.inf] * 3)
    return x, y, yaw


STEPS = (
    *((0, down, side) for down, side in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))),
    (1, 0, 0),
    (-1, 0, 0),
)
"""Steps between poses, straight ones first, so that a path turns as little as possible."""


CONNECTED = 8
"""Poses of the grid from which a tight path may begin, and at which it may end: the nearest that can be reached."""
TIGHT_REPLANS = 40
"""How often a tight path is planned again around steps that touch something."""


def plan_tight_path(
    start: Planar,
    goal: Planar,
    grid: Grid,
    free: Poses,
    touching: Touching,
    resolution: float,
    surely_free: Callable[[Array], Mask] | None = None,
) -> Array:
    """Plan waypoints (n, 3) of x, y [m] and yaw [rad] from start to goal; yaw is continuous.

    ``free`` holds the poses with room. ``touching(x, y, yaw)`` is called at steps of ``resolution`` [m, rad] along the
    path; steps that touch something are removed and the path is planned again, at most :data:`TIGHT_REPLANS` times.
    ``surely_free`` marks poses (m, 3) of which it need not be asked. Raises :class:`NoPath` with counts.
    """
    free, turns, known = free.copy(), np.full_like(free, EVERY), dict[Planar, bool]()

    def hits(path: Array) -> list[Planar]:
        poses = list(poses_along(path, resolution))
        rule_out(poses)
        for pose in poses:
            if pose not in known:
                known[pose] = bool(touching(*pose))
        return [pose for pose in poses if known[pose]]

    def rule_out(poses: Sequence[Planar]) -> None:
        new = [pose for pose in dict.fromkeys(poses) if pose not in known and pose not in (start, goal)]
        if new and surely_free is not None:
            marked = zip(new, surely_free(np.array(new)).tolist(), strict=True)
            known.update((pose, False) for pose, is_free in marked if is_free)

    def connected(pose: Planar) -> list[Cell]:
        cells = (cell for cell in around(pose, grid) if has(free, cell))
        return list(islice((cell for cell in cells if not hits(_path(pose, pose, grid, [cell]))), CONNECTED))

    begin, end, attempts = connected(start), connected(goal), 0
    while attempts <= TIGHT_REPLANS:
        attempts += 1
        cells = _shortest(free, turns, begin, end)
        if cells is None:
            break
        path = _path(start, goal, grid, cells)
        if not hits(pulled := _straightened(path, grid, free)):
            return pulled
        steps = [(a, b, _path(None, None, grid, [a, b])) for a, b in pairwise(cells)]
        rule_out([pose for *_, step in steps for pose in poses_along(step, resolution)])
        blocked = [(a, b) for a, b, step in steps if hits(step)]
        if not blocked:
            return path
        for a, b in blocked:
            _close(free, turns, a, b)
    raise NoPath(start, goal, {"exact checks": len(known), "attempts": attempts})


def _close(free: Poses, turns: Poses, a: Cell, b: Cell) -> None:
    """Exclude a step from further paths: its turn, or else the pose to which it leads."""
    if a[0] == b[0]:
        free[b[1], b[2]] &= ~np.uint16(1 << b[0])
    else:
        turns[a[1], a[2]] &= ~np.uint16(1 << _lower(a, b))


def _shortest(free: Poses, turns: Poses, begin: list[Cell], end: list[Cell]) -> list[Cell] | None:
    """Find a path with the fewest steps from one of some poses to one of others."""
    steps = list(flood(free, begin, turns))
    last = next((cell for cell in end if has(steps[-1], cell)), None)
    if last is None:
        return None
    rows, columns = free.shape
    path = [last]
    for reached in reversed(steps[: next(k for k, reached in enumerate(steps) if has(reached, last))]):
        heading, row, column = path[-1]
        before = (((heading + turn) % HEADINGS, row + down, column + side) for turn, down, side in STEPS)
        inside = (cell for cell in before if 0 <= cell[1] < rows and 0 <= cell[2] < columns)
        path.append(next(cell for cell in inside if has(reached, cell) and _may(turns, cell, path[-1])))
    return path[::-1]


def _may(turns: Poses, a: Cell, b: Cell) -> bool:
    """Check that a step is no forbidden turn."""
    return a[0] == b[0] or has(turns, (_lower(a, b), a[1], a[2]))


def _lower(a: Cell, b: Cell) -> int:
    """Heading from which a left turn leads from one of two poses to the other."""
    return a[0] if (a[0] + 1) % HEADINGS == b[0] else b[0]


def _path(start: Planar | None, goal: Planar | None, grid: Grid, cells: list[Cell]) -> Array:
    """Build the path (n, 3) over the poses of cells, from a start and to a goal near them; yaw is continuous."""
    poses = [
        (grid.x + column * grid.resolution, grid.y + row * grid.resolution, heading * TURN)
        for heading, row, column in cells
    ]
    path = np.array([pose for pose in (start, *poses, goal) if pose is not None])
    path[:, 2] = np.unwrap(path[:, 2])
    return np.asarray(path[np.append(True, (np.abs(np.diff(path, axis=0)) > 1e-9).any(axis=1))])


def _straightened(path: Array, grid: Grid, free: Poses) -> Array:
    """Drop the waypoints that a straight line over free poses can skip."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        first = kept[-1]
        last = first + 1
        while last + 1 < len(path) and _is_free(path[[first, last + 1]], grid, free):
            last += 1
        kept.append(last)
    return path[kept]


def _is_free(line: Array, grid: Grid, free: Poses) -> bool:
    """Check whether the poses next to a straight line (2, 3) are free."""
    turn = float(line[1, 2] - line[0, 2])
    count = 2 * math.ceil(max(float(np.hypot(*np.diff(line[:, :2], axis=0)[0])) / grid.resolution, abs(turn) / TURN))
    poses = line[0] + np.linspace(0.0, 1.0, count + 1)[:, None] * (line[1] - line[0])
    row = np.rint((poses[:, 1] - grid.y) / grid.resolution).astype(int)
    column = np.rint((poses[:, 0] - grid.x) / grid.resolution).astype(int)
    low, high = (rounded(poses[:, 2] / TURN).astype(int) % HEADINGS for rounded in (np.floor, np.ceil))
    free_headings = free[np.clip(row, 0, grid.rows - 1), np.clip(column, 0, grid.columns - 1)]
    return bool((free_headings >> low & free_headings >> high & 1).all())
