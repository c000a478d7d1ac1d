"""Families of worlds: one function each, from a scenario and random numbers to a Layout.

To add a family: a model in config.py, a function here, a line in FAMILIES. The `field` family is compiled
(kernels.place_fields), because new worlds are needed at hundreds of thousands a minute while agents train.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels, maps
from bug_gym.config import (
    ONI_WANG_PLACES,
    ONI_WANG_POLYGON,
    BarnWorld,
    BeachWorld,
    Bounce,
    CorridorWorld,
    CrossingWorld,
    Crowd,
    EmptyWorld,
    Evade,
    ExplicitWorld,
    FieldWorld,
    ForestWorld,
    HookWorld,
    MazeWorld,
    Motion,
    OniWangWorld,
    RandomWalk,
    Region,
    Replay,
    ReplayWorld,
    RingWorld,
    RoomsWorld,
    RosMapWorld,
    Scenario,
    StartRegion,
    UrbanWorld,
    UTrapWorld,
    Waypoints,
    dump,
    load,
)
from bug_gym.floor_plans import (
    TRIES,
    Rng,
    as_polygons,
    boxes,
    city_buildings,
    corridor_legs,
    corridor_walls,
    irregular_polygon,
    room_walls,
    scatter,
    streams,
)
from bug_gym.geometry import F64
from bug_gym.recordings import load_recording
from bug_gym.ros_map import load_outlines, load_ros_map
from bug_gym.world import Layout, Mover, Rings, World, side_by_side

Free = Callable[[float, float], bool]


def rectangle(xmin: float, ymin: float, xmax: float, ymax: float) -> F64:
    """Corners (4, 2) of an axis-parallel rectangle."""
    return np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]], dtype=np.float64)


def border_of(world: Any) -> F64:
    """Corners (k, 2) of the border of a family's world."""
    return np.array(world.corners, dtype=np.float64)


def clearance(circles: F64, rings: Sequence[F64], x: float, y: float) -> float:
    """Distance from a point to the nearest circle or ring edge [m], negative inside a circle."""
    nearest = math.inf
    if len(circles):
        nearest = float((np.hypot(circles[:, 0] - x, circles[:, 1] - y) - circles[:, 2]).min())
    point = np.array([x, y])
    for ring in rings:
        a, along = ring, np.roll(ring, -1, axis=0) - ring
        share = ((point - a) * along).sum(1) / np.maximum((along**2).sum(1), 1e-300)
        gaps = a + np.clip(share, 0.0, 1.0)[:, None] * along - point
        nearest = min(nearest, float(np.hypot(gaps[:, 0], gaps[:, 1]).min()))
    return nearest


def contains(ring: F64, x: float, y: float) -> bool:
    """Whether a point lies inside a ring (even-odd rule)."""
    x1, y1 = ring[:, 0], ring[:, 1]
    x2, y2 = np.roll(x1, -1), np.roll(y1, -1)
    straddles = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return bool(np.count_nonzero(straddles & (x < crossing)) % 2)


def is_clear(circles: F64, polygons: Sequence[Rings], border: F64, room: float) -> Free:
    """A test whether a disc of radius `room` [m] fits at a point."""
    rings = [border, *(ring for polygon in polygons for ring in polygon)]

    def free(x: float, y: float) -> bool:
        if not contains(border, x, y) or clearance(circles, rings, x, y) < room:
            return False
        return not any(
            contains(polygon[0], x, y) and not any(contains(hole, x, y) for hole in polygon[1:]) for polygon in polygons
        )

    return free


def draw_point(region: Sequence[float], rng: Rng, free: Free, what: str) -> tuple[float, float]:
    """A point of a rectangle, evenly over what is free in it.

    Raises:
        ValueError: no free point was found.
    """
    xmin, ymin, xmax, ymax = region
    for _ in range(TRIES):
        x, y = float(rng.uniform(xmin, xmax)), float(rng.uniform(ymin, ymax))
        if free(x, y):
            return x, y
    raise ValueError(f"no free place for the {what} in {list(region)} after {TRIES} tries")


def draw_start(scenario: Scenario, start: object, rng: Rng, free: Free) -> tuple[float, float, float]:
    """A start pose: fixed, drawn from a region, or from the whole of the bounds.

    Raises:
        ValueError: no place was found where all robots are free.
    """
    if isinstance(start, tuple):
        return start
    region = start.region if isinstance(start, Region) else scenario.world.box
    heading = start.heading if isinstance(start, StartRegion) else None
    for _ in range(TRIES):
        x, y = draw_point(region, rng, free, "start")
        pose = x, y, float(rng.uniform(-math.pi, math.pi)) if heading is None else heading
        if has_room_for_all(scenario, pose, free):
            return pose
    raise ValueError(f"no free place for all {scenario.robots.count} robots in {list(region)} after {TRIES} tries")


def has_room_for_all(scenario: Scenario, pose: Sequence[float], free: Free) -> bool:
    """Whether robots side by side about a free pose are all free; those with places of their own are elsewhere."""
    if scenario.robots.count == 1 or scenario.robots.places:
        return True
    return all(free(x, y) for x, y, _ in side_by_side(pose, scenario.robots.count))


def draw_goal(scenario: Scenario, goal: object, rng: Rng, free: Free) -> tuple[float, float]:
    """A goal: fixed, drawn from a region, or from the whole of the bounds."""
    if isinstance(goal, tuple):
        return goal
    region = goal.region if isinstance(goal, Region) else scenario.world.box
    return draw_point(region, rng, free, "goal")


def draw_both(
    scenario: Scenario, start: object, goal: object, rng: Rng, start_free: Free, goal_free: Free, separation: float
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """A start and a goal at least `separation` [m] apart.

    Raises:
        ValueError: no such pair was found.
    """
    for _ in range(TRIES):
        pose = draw_start(scenario, start, rng, start_free)
        place = draw_goal(scenario, goal, rng, goal_free)
        if math.hypot(pose[0] - place[0], pose[1] - place[1]) >= separation:
            return pose, place
    raise ValueError(f"no start and goal at least {separation} m apart after {TRIES} tries")


def with_direction(motion: Motion | None, rng: Rng) -> Motion | None:
    """The motion with its direction drawn where it has only a speed."""
    if isinstance(motion, Bounce) and motion.velocity is None and motion.speed is not None:
        angle = rng.uniform(-math.pi, math.pi)
        return Bounce(law="bounce", velocity=(motion.speed * math.cos(angle), motion.speed * math.sin(angle)))
    return motion


def finish(
    scenario: Scenario,
    start: Sequence[float],
    goal: tuple[float, float],
    *,
    circles: F64 | None = None,
    polygons: tuple[Rings, ...] = (),
    movers: tuple[Mover, ...] = (),
    target: Motion | None = None,
) -> Layout:
    """The layout of a world, its robots placed as the scenario says: by their own places, or side by side.

    Raises:
        ValueError: a robot or a goal would be in an obstacle or outside.
    """
    check_spacing(scenario)
    starts, goals = robot_places(scenario, start, goal)
    layout = Layout(
        border=border_of(scenario.world),
        starts=starts,
        goals=goals,
        circles=np.zeros((0, 3)) if circles is None else circles,
        polygons=polygons,
        movers=movers,
        target=target,
        goal_room=goal_room(scenario),
    )
    check_places(scenario, layout)
    return layout


def robot_places(scenario: Scenario, start: Sequence[float], goal: tuple[float, float]) -> tuple[F64, F64]:
    """Poses (R, 3) and goals (1, 2) or (R, 2) of the robots, where the world's own are `start` and `goal`."""
    robots, places = scenario.robots.count, scenario.robots.places
    starts = np.array([place.start for place in places[:robots]]) if places else side_by_side(start, robots)
    goals = [place.goal or goal for place in places[:robots]] if any(place.goal for place in places) else [goal]
    return starts.astype(np.float64), np.array(goals, dtype=np.float64)


def goal_room(scenario: Scenario) -> float:
    """Distance that a moving goal keeps from still obstacles [m]: unless told, the robot can always reach it."""
    world, needed = scenario.world, max(scenario.goal.radius, scenario.robot.reach)
    if not isinstance(world, (EmptyWorld, ExplicitWorld)) or world.target is None or world.target.room is None:
        return needed
    return world.target.room


def check_spacing(scenario: Scenario) -> None:
    """Raises where robots that start side by side would overlap."""
    reach = scenario.robot.reach
    if scenario.robots.count > 1 and not scenario.robots.places and reach > 1.0:
        raise ValueError(f"robots that reach {reach:g} m overlap where they start 2 m apart: give each its own place")


def check_places(scenario: Scenario, layout: Layout) -> None:
    """Raises where a robot starts, or a goal lies, in an obstacle or outside."""
    circles, polygons = obstacles_of(layout.circles, layout.polygons, layout.movers)
    for number, pose in enumerate(layout.starts.tolist()):
        for x, y, radius in scenario.robot.body(tuple(pose)):
            # 1e-9: what touches when it starts is free, whatever the rounding
            if not is_clear(circles, polygons, layout.border, radius - 1e-9)(x, y):
                raise ValueError(f"robot {number} cannot start at {pose}: an obstacle or the border is in its way")
    for x, y in layout.goals.tolist():
        if not is_clear(circles, polygons, layout.border, 0.0)(x, y):
            raise ValueError(f"the goal {[x, y]} lies in an obstacle or outside")


def obstacles_of(circles: F64, polygons: tuple[Rings, ...], movers: Sequence[Mover]) -> tuple[F64, tuple[Rings, ...]]:
    """Still obstacles and movers that are there, where they begin, as circles (n, 3) and polygons."""
    movers = [mover for mover in movers if mover.is_there]
    round_ones = [(*mover.at, float(mover.outline)) for mover in movers if mover.is_circle]
    others = [(np.asarray(mover.outline) + mover.at,) for mover in movers if not mover.is_circle]
    return np.vstack([circles, np.array(round_ones).reshape(-1, 3)]), (*polygons, *others)


# ---------------------------------------------------------------------------------------------- the families


def empty(scenario: Scenario, world: EmptyWorld, rng: Rng) -> Layout:
    """Nothing but the border."""
    border = border_of(world)
    start_free = is_clear(np.zeros((0, 3)), (), border, scenario.robot.reach)
    goal_free = is_clear(np.zeros((0, 3)), (), border, drawn_goal_room(scenario, world))
    goal = target_place(world)
    start, place = draw_both(scenario, world.start, goal, rng, start_free, goal_free, world.separation)
    return finish(scenario, start, place, target=target_motion(world, rng))


def target_place(world: EmptyWorld | ExplicitWorld) -> object:
    """Where the goal is, or where it is drawn from: the world's goal or its target's start."""
    if world.target is None:
        return world.goal
    return world.target.at if world.target.at is not None else Region(region=world.target.region or world.box)


def drawn_goal_room(scenario: Scenario, world: EmptyWorld | ExplicitWorld) -> float:
    """Clearance of a goal that is drawn [m]; one that moves begins with the room that it keeps."""
    return scenario.robot.reach if world.target is None else goal_room(scenario)


def target_motion(world: EmptyWorld | ExplicitWorld, rng: Rng) -> Motion | None:
    """How the goal moves."""
    return None if world.target is None else with_direction(world.target.motion, rng)


def explicit(scenario: Scenario, world: ExplicitWorld, rng: Rng) -> Layout:
    """Every obstacle written down; start and goal may be drawn from regions."""
    circles = np.array(world.circles, dtype=np.float64).reshape(-1, 3)
    polygons = tuple(
        tuple(np.array(ring, dtype=np.float64) for ring in (polygon.shell, *polygon.holes))
        for polygon in world.polygons
    )
    movers = []
    for mover in world.movers:
        shape, motion = mover.shape, with_direction(mover.motion, rng)
        assert motion is not None
        outline = shape.circle if shape.polygon is None else np.array(shape.polygon.shell, dtype=np.float64)
        assert outline is not None
        movers.append(Mover(outline, mover.at, motion))
    border = border_of(world)
    in_the_way = obstacles_of(circles, polygons, movers)
    start_free = is_clear(*in_the_way, border, scenario.robot.reach)
    goal_free = is_clear(*in_the_way, border, drawn_goal_room(scenario, world))
    start, goal = draw_both(scenario, world.start, target_place(world), rng, start_free, goal_free, 0.0)
    return finish(
        scenario,
        start,
        goal,
        circles=circles,
        polygons=polygons,
        movers=tuple(movers),
        target=target_motion(world, rng),
    )


def u_trap(scenario: Scenario, world: UTrapWorld, rng: Rng) -> Layout:
    """A U that opens toward -x, turned about its middle."""
    x0, x1, x2 = world.mouth_x, world.mouth_x + world.depth, world.mouth_x + world.depth + world.wall
    inner, outer = world.half_width, world.half_width + world.wall
    outside = [(x0, -outer), (x2, -outer), (x2, outer), (x0, outer)]
    ring = np.array([*outside, (x0, inner), (x1, inner), (x1, -inner), (x0, -inner)])
    ring = turned(ring, world.centre, world.rotation, rng)
    free = is_clear(np.zeros((0, 3)), ((ring,),), border_of(world), scenario.robot.reach)
    start, goal = draw_both(scenario, world.start, world.goal, rng, free, free, 0.0)
    return finish(scenario, start, goal, polygons=((ring,),))


def turned(ring: F64, centre: tuple[float, float], rotation: float | str, rng: Rng) -> F64:
    """A ring (k, 2) turned about a point by an angle [rad], or by one that is drawn."""
    angle = float(rng.uniform(-math.pi, math.pi)) if rotation == "random" else float(rotation)
    if angle == 0.0:
        return ring
    cos, sin = math.cos(angle), math.sin(angle)
    middle = np.array(centre)
    corners: F64 = (ring - middle) @ np.array([[cos, sin], [-sin, cos]]) + middle
    return corners


def hook(scenario: Scenario, world: HookWorld, rng: Rng) -> Layout:
    """A square box with a slit in its upper wall, turned about its middle."""
    (x, y), outer, inner = world.centre, world.half_side, world.half_side - world.wall
    left, right = x + world.slit_at - 0.5 * world.slit, x + world.slit_at + 0.5 * world.slit
    outside = [(right, y + outer), (x + outer, y + outer), (x + outer, y - outer), (x - outer, y - outer)]
    inside = [(left, y + inner), (x - inner, y + inner), (x - inner, y - inner), (x + inner, y - inner)]
    upper_left = [(x - outer, y + outer), (left, y + outer)]
    ring = np.array([*outside, *upper_left, *inside, (x + inner, y + inner), (right, y + inner)])
    ring = turned(ring, world.centre, world.rotation, rng)
    free = is_clear(np.zeros((0, 3)), ((ring,),), border_of(world), scenario.robot.reach)
    start, goal = draw_both(scenario, world.start, world.goal, rng, free, free, 0.0)
    return finish(scenario, start, goal, polygons=((ring,),))


def ring(scenario: Scenario, world: RingWorld, rng: Rng) -> Layout:
    """A closed square ring round the goal, or round the start."""
    x, y = world.centre
    outer = rectangle(x - world.outer, y - world.outer, x + world.outer, y + world.outer)
    inner = rectangle(x - world.inner, y - world.inner, x + world.inner, y + world.inner)
    clear = is_clear(np.zeros((0, 3)), ((outer, inner),), border_of(world), scenario.robot.reach)

    def shut_in(px: float, py: float) -> bool:
        return clear(px, py) and max(abs(px - x), abs(py - y)) < world.inner

    def outside(px: float, py: float) -> bool:
        return clear(px, py) and max(abs(px - x), abs(py - y)) > world.outer

    start_free, goal_free = (outside, shut_in) if world.inside == "goal" else (shut_in, outside)
    start = draw_start(scenario, world.start, rng, start_free)
    goal = draw_goal(scenario, world.goal, rng, goal_free)
    return finish(scenario, start, goal, polygons=((outer, inner),))


def maze(scenario: Scenario, world: MazeWorld, rng: Rng) -> Layout:
    """A perfect maze by randomised depth-first search, some of its walls taken away again for loops."""
    columns, rows = world.cells
    open_right, open_up = carve(columns, rows, world.loops, rng)
    polygons = maze_walls(world, open_right, open_up)
    places = [(column, row) for column in range(columns) for row in range(rows)]
    free = is_clear(np.zeros((0, 3)), polygons, border_of(world), scenario.robot.reach)
    for _ in range(TRIES):
        first, last = (places[int(i)] for i in rng.integers(0, len(places), 2))
        start, goal = cell_centre(world, *first), cell_centre(world, *last)
        if math.dist(start, goal) < world.separation:
            continue
        pose = (*start, float(rng.uniform(-math.pi, math.pi)))
        if has_room_for_all(scenario, pose, free):
            return finish(scenario, pose, goal, polygons=polygons)
    raise ValueError(f"found no two cells of the maze {world.separation} m apart, the first with room for all robots")


def carve(columns: int, rows: int, loops: float, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Which cells are open to their right (columns - 1, rows) and upper (columns, rows - 1) neighbours."""
    open_right, open_up = np.zeros((columns - 1, rows), dtype=bool), np.zeros((columns, rows - 1), dtype=bool)
    seen = np.zeros((columns, rows), dtype=bool)
    trail = [(int(rng.integers(columns)), int(rng.integers(rows)))]
    seen[trail[0]] = True
    while trail:
        x, y = trail[-1]
        ways = [(x + dx, y + dy) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        ways = [(u, v) for u, v in ways if 0 <= u < columns and 0 <= v < rows and not seen[u, v]]
        if not ways:
            trail.pop()
            continue
        u, v = ways[int(rng.integers(len(ways)))]
        if v == y:
            open_right[min(x, u), y] = True
        else:
            open_up[x, min(y, v)] = True
        seen[u, v] = True
        trail.append((u, v))
    open_right |= rng.random(open_right.shape) < loops
    open_up |= rng.random(open_up.shape) < loops
    return open_right, open_up


def cell_centre(world: MazeWorld, column: int, row: int) -> tuple[float, float]:
    """Middle of a cell [m]."""
    (width, height), (xmin, ymin, _, _) = world.passages, world.bounds
    return xmin + column * (width + world.wall) + 0.5 * width, ymin + row * (height + world.wall) + 0.5 * height


def maze_walls(world: MazeWorld, open_right: np.ndarray, open_up: np.ndarray) -> tuple[Rings, ...]:
    """The walls between the cells as polygons, joined where they meet."""
    (width, height), (xmin, ymin, xmax, ymax) = world.passages, world.bounds
    thick = world.wall
    columns, rows = world.cells
    walls = []
    for x, y in zip(*np.nonzero(~open_right), strict=True):
        left, low = xmin + (x + 1) * (width + thick) - thick, ymin + y * (height + thick)
        walls.append((left, low - thick, left + thick, low + height + thick))
    for x, y in zip(*np.nonzero(~open_up), strict=True):
        left, low = xmin + x * (width + thick), ymin + (y + 1) * (height + thick) - thick
        walls.append((left - thick, low, left + width + thick, low + thick))
    # A wall that ends at the border goes on a little beyond it, so that no beam slips between the two.
    frame = boxes([(xmin - thick, ymin - thick, xmax + thick, ymax + thick)])
    return as_polygons(boxes(walls).intersection(frame))


def corridor(scenario: Scenario, world: CorridorWorld, rng: Rng) -> Layout:
    """A passage that shifts sideways; start and goal at its ends."""
    places, levels = corridor_legs(world, rng)
    xmin, _, xmax, _ = world.bounds
    half = 0.5 * world.width
    start, goal = (xmin + half, float(levels[0]), 0.0), (xmax - half, float(levels[-1]))
    return finish(scenario, start, goal, polygons=corridor_walls(world, places, levels))


def rooms(scenario: Scenario, world: RoomsWorld, rng: Rng) -> Layout:
    """Rooms with doors between neighbours: a tree of them, and some more."""

    def build() -> tuple[Rings, ...]:
        open_right, open_up = carve(world.columns, world.rows, world.loops, rng)
        return room_walls(world, open_right, open_up, rng)

    return draw_within(scenario, world, rng, build)


def urban(scenario: Scenario, world: UrbanWorld, rng: Rng) -> Layout:
    """Blocks between streets; nobody starts or arrives in a closed courtyard."""
    return draw_within(scenario, world, rng, lambda: city_buildings(world, rng))


def crossing(scenario: Scenario, world: CrossingWorld, rng: Rng) -> Layout:
    """Streams of movers; start and goal at first wherever no mover comes, to their left and to their right."""
    xmin, ymin, xmax, ymax = world.bounds
    start = world.start or StartRegion(region=(xmin, ymin, xmin + world.apron, ymax))
    goal = world.goal or Region(region=(xmax - world.apron, ymin, xmax, ymax))
    movers = streams(world, rng)
    reach = scenario.robot.reach

    def free(x: float, y: float) -> bool:
        """Clear of the border, and in a strip where it is drawn."""
        return clear(x, y) and not xmin + world.apron - reach < x < xmax - world.apron + reach

    clear = is_clear(*obstacles_of(np.zeros((0, 3)), (), movers), border_of(world), reach)
    pose, place = draw_both(scenario, start, goal, rng, free, free, world.separation)
    return finish(scenario, pose, place, movers=movers)


ATTEMPTS = 20  # at a whole world


def draw_within(
    scenario: Scenario, world: RoomsWorld | UrbanWorld, rng: Rng, build: Callable[[], tuple[Rings, ...]]
) -> Layout:
    """A world whose walls are drawn first, then start and goal in what is free and not enclosed.

    Raises:
        ValueError: no world had room for start and goal; why the last one had none.
    """
    fault = ValueError()
    for _ in range(ATTEMPTS):
        polygons = build()
        # Holes count as filled: a closed courtyard is no place to be.
        filled = tuple(rings[:1] for rings in polygons)
        free = is_clear(np.zeros((0, 3)), filled, border_of(world), scenario.robot.reach)
        try:
            start, goal = draw_both(scenario, world.start, world.goal, rng, free, free, world.separation)
            return finish(scenario, start, goal, polygons=polygons)
        except ValueError as error:
            fault = error
    raise ValueError(f"{fault}; none of {ATTEMPTS} worlds had room for start and goal")


def forest(scenario: Scenario, world: ForestWorld, rng: Rng) -> Layout:
    """Many thin trunks."""

    def grow(start: Pose, goal: Place) -> Layout:
        trees = scattered(scenario, world, world.trees, start, goal, rng)
        return finish(scenario, start, goal, circles=trees)

    return draw_around(scenario, world, rng, grow)


def beach(scenario: Scenario, world: BeachWorld, rng: Rng) -> Layout:
    """Irregular obstacles and pedestrians who walk among them."""

    def furnish(start: Pose, goal: Place) -> Layout:
        discs = scattered(scenario, world, world.obstacles, start, goal, rng)
        polygons = tuple((irregular_polygon(x, y, radius, world.corners_each, rng),) for x, y, radius in discs.tolist())
        walkers = pedestrians(scenario, world, discs, start, goal, rng)
        return finish(scenario, start, goal, polygons=polygons, movers=walkers)

    return draw_around(scenario, world, rng, furnish)


Pose = tuple[float, float, float]
Place = tuple[float, float]


def draw_around(
    scenario: Scenario, world: ForestWorld | BeachWorld, rng: Rng, furnish: Callable[[Pose, Place], Layout]
) -> Layout:
    """A world whose start and goal are drawn first, then the obstacles around them.

    Raises:
        ValueError: no world had room for all; what the last one lacked.
    """
    border, reach = border_of(world), scenario.robot.reach
    start_free = is_clear(np.zeros((0, 3)), (), border, start_room(scenario, world))
    goal_free = is_clear(np.zeros((0, 3)), (), border, goal_room_of(world))
    fault = ValueError()
    for _ in range(ATTEMPTS):
        start, goal = draw_both(scenario, world.start, world.goal, rng, start_free, goal_free, world.separation)
        try:
            layout = furnish(start, goal)
        except ValueError as error:
            fault = error
            continue
        # Gaps are wide enough by construction; a border that is no box may have narrow places of its own.
        if world.solvable is None or len(border) == 4 or all_reachable(layout, max(world.solvable, reach)):
            return layout
        fault = ValueError(f"no path at a clearance of {world.solvable:g} m")
    raise ValueError(f"{fault}; {ATTEMPTS} worlds were tried")


def start_room(scenario: Scenario, world: ForestWorld | BeachWorld) -> float:
    """Distance from the robot's origin at the start to anything [m]."""
    return max(scenario.robot.reach + world.start_clearance, world.solvable or 0.0)


def goal_room_of(world: ForestWorld | BeachWorld) -> float:
    """Distance from the goal to anything [m]."""
    return max(world.goal_clearance, world.solvable or 0.0)


def all_reachable(layout: Layout, radius: float) -> bool:
    """Whether each robot, were it a disc of some radius [m], can get to its goal."""
    from bug_gym.shortest_path import reachable

    goals = np.broadcast_to(layout.goals, (len(layout.starts), 2))
    return all(
        reachable(layout.circles, layout.polygons, layout.border, start, goal, radius=radius)
        for start, goal in zip(layout.starts[:, :2], goals, strict=True)
    )


def scattered(
    scenario: Scenario, world: ForestWorld | BeachWorld, count: int, start: Pose, goal: Place, rng: Rng
) -> F64:
    """Still circles (count, 3) around start and goal, with the gaps that the family promises.

    Raises:
        ValueError: not all of them found a place.
    """
    gap = None if world.solvable is None else 2.0 * world.solvable
    free = is_apart(scenario, world, start, goal, edge=gap or 0.0)
    circles = scatter(count, world.sizes, world.box, free, rng, gap=gap)
    if len(circles) < count:
        raise ValueError(f"only {len(circles)} of {count} obstacles found a free place{told_share(world, circles)}")
    return circles


def told_share(world: ForestWorld | BeachWorld, circles: F64) -> str:
    """How full a world of circles (k, 3) is, as the end of a sentence."""
    return f"; they cover {100.0 * share_of_box(circles[:, 2], world.box):.0f} % of the world"


def is_apart(
    scenario: Scenario, world: ForestWorld | BeachWorld, start: Pose, goal: Place, *, edge: float
) -> Callable[[float, float, float], bool]:
    """A test whether a circle leaves start and goal their room and keeps a distance `edge` [m] from the border."""
    starts, goals = robot_places(scenario, start, goal)
    border = border_of(world)
    keep = [(*pose[:2], start_room(scenario, world)) for pose in starts.tolist()]
    keep += [(*place, goal_room_of(world)) for place in goals.tolist()]

    def free(x: float, y: float, radius: float) -> bool:
        if any(math.hypot(x - px, y - py) < radius + room for px, py, room in keep):
            return False
        return contains(border, x, y) and clearance(np.zeros((0, 3)), [border], x, y) >= radius + edge

    return free


def pedestrians(
    scenario: Scenario, world: BeachWorld, obstacles: F64, start: Pose, goal: Place, rng: Rng
) -> tuple[Mover, ...]:
    """Walkers who begin clear of the obstacles, of start and of goal.

    Raises:
        ValueError: not all of them found a place.
    """
    apart, radius = is_apart(scenario, world, start, goal, edge=0.0), world.radius

    def free(x: float, y: float, size: float) -> bool:
        gaps = np.hypot(obstacles[:, 0] - x, obstacles[:, 1] - y) - obstacles[:, 2]
        return apart(x, y, size) and bool((gaps >= size).all())

    places = scatter(world.pedestrians, (radius, radius), world.box, free, rng, gap=0.0)
    if len(places) < world.pedestrians:
        taken = told_share(world, np.concatenate([obstacles, places]))
        raise ValueError(f"only {len(places)} of {world.pedestrians} pedestrians found a free place{taken}")
    least, most = PEDESTRIAN_LEGS
    speeds = rng.uniform(*world.speeds, len(places)).tolist()
    motions: list[Motion] = [
        Crowd(law="crowd", speed=speed)
        if world.law == "crowd"
        else RandomWalk(law="random_walk", speed=speed, min_leg=least, max_leg=most)
        for speed in speeds
    ]
    return tuple(Mover(radius, (x, y), motion) for (x, y, _), motion in zip(places.tolist(), motions, strict=True))


PEDESTRIAN_LEGS = (3.0, 10.0)
"""Least and greatest time for which a pedestrian who walks at random keeps a direction [s]."""


def ros_map(scenario: Scenario, world: RosMapWorld, rng: Rng) -> Layout:
    """A map of ROS's map_server; start and goal in its free cells.

    Raises:
        ValueError: no start and goal were found, or none with a path between them.
    """
    plan = load_ros_map(world.path)
    # 1.02: free space may come as near to a wall as 0.99 of the radius it is made for.
    radius = max(world.solvable or 0.0, 1.02 * scenario.robot.reach)
    polygons, rooms = map_walls(world), map_rooms(world, radius)

    def free(x: float, y: float) -> bool:
        return plan.is_free(x, y) and room_at(rooms, x, y) >= 0

    box = plan.free_box
    start, goal = world.start or StartRegion(region=box), world.goal or Region(region=box)
    for _ in range(TRIES):
        pose, place = draw_both(scenario, start, goal, rng, free, free, world.separation)
        if world.solvable is None or room_at(rooms, *pose[:2]) == room_at(rooms, *place) >= 0:
            return finish(scenario, pose, place, polygons=polygons)
    raise ValueError(f"no start and goal with a path at a clearance of {radius:g} m after {TRIES} tries")


@lru_cache(maxsize=8)
def map_walls(world: RosMapWorld) -> tuple[Rings, ...]:
    """The polygons of a map that reach into the bounds."""
    xmin, ymin, xmax, ymax = world.box
    polygons = load_outlines(world.path, unknown_is_wall=world.unknown_is_wall)
    shells = [(rings, rings[0].min(axis=0), rings[0].max(axis=0)) for rings in polygons]
    return tuple(
        rings for rings, low, high in shells if low[0] < xmax and low[1] < ymax and high[0] > xmin and high[1] > ymin
    )


@lru_cache(maxsize=8)
def map_rooms(world: RosMapWorld, radius: float) -> NDArray[np.object_]:
    """The connected parts, as shapely's polygons, of where a disc of some radius [m] may be on a map."""
    import shapely

    from bug_gym.shortest_path import free_space

    free = free_space(np.zeros((0, 3)), map_walls(world), border_of(world), radius=radius)
    rooms: NDArray[np.object_] = shapely.get_parts(free)
    shapely.prepare(rooms)
    return rooms


def room_at(rooms: NDArray[np.object_], x: float, y: float) -> int:
    """Number of the room that a point lies in, -1 where it lies in none."""
    import shapely

    holding = np.flatnonzero(shapely.contains_xy(rooms, x, y))
    return int(holding[0]) if len(holding) else -1


def oni_wang(scenario: Scenario, world: OniWangWorld, rng: Rng) -> Layout:
    """The map of Fig. 1 in Oni and Wang; start and goal by letter."""
    (x, y), goal = ONI_WANG_PLACES[world.start], ONI_WANG_PLACES[world.goal]
    heading = math.atan2(goal[1] - y, goal[0] - x)
    return finish(scenario, (x, y, heading), goal, polygons=((np.array(ONI_WANG_POLYGON),),))


def barn(scenario: Scenario, world: BarnWorld, rng: Rng) -> Layout:
    """A world of the BARN benchmark."""
    worlds = maps.load_barn(world.path)
    if world.world is None:
        chosen = worlds[sorted(worlds)[int(rng.integers(len(worlds)))]]
    elif world.world in worlds:
        chosen = worlds[world.world]
    else:
        raise ValueError(f"no world {world.world} in {world.path}; it holds {sorted(worlds)}")
    return finish(scenario, chosen.start, chosen.goal, circles=chosen.circles)


def replay(scenario: Scenario, world: ReplayWorld, rng: Rng) -> Layout:
    """Pedestrians of a recording from a time on; the robot goes across their flow."""
    recording, limit = load_recording(world.path), scenario.time.limit
    since = world.start_time
    if since is None:
        first, last = world.window or recording.times
        since = float(rng.uniform(first, max(first, last - limit)))
    xmin, ymin, xmax, ymax = world.bounds
    room = world.radius
    inside = recording.within((xmin + room, ymin + room, xmax - room, ymax - room))
    movers = []
    for track in inside.tracks:
        records = track.records - [since, 0.0, 0.0]
        if records[-1, 0] >= 0.0 and records[0, 0] <= limit:
            # The records have been checked as they were read; pydantic would take as long again for each episode.
            motion = Replay.model_construct(law="replay", points=tuple(map(tuple, records.tolist())))
            movers.append(Mover(world.radius, motion.place(0.0), motion))
    border = border_of(world)
    present = obstacles_of(np.zeros((0, 3)), (), movers)
    start_free = is_clear(*present, border, scenario.robot.reach + CROSSING_ROOM)
    if world.start is None:
        start, goal = draw_crossing(scenario, world, recording.flow(), rng, start_free)
    else:
        goal_free = is_clear(np.zeros((0, 3)), (), border, scenario.robot.reach)
        start, goal = draw_both(scenario, world.start, world.goal, rng, start_free, goal_free, 0.0)
    return finish(scenario, start, goal, movers=tuple(movers))


CROSSING_ROOM = 0.5
"""Free space round a robot that starts among pedestrians, and between a goal and the border [m]."""


def draw_crossing(
    scenario: Scenario, world: ReplayWorld, flow: float, rng: Rng, start_free: Free
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """A start and a goal at opposite sides of the bounds, straight across a direction of flow [rad].

    Raises:
        ValueError: no free start was found.
    """
    xmin, ymin, xmax, ymax = world.bounds
    room = scenario.robot.reach + CROSSING_ROOM
    low, high = np.array([xmin + room, ymin + room]), np.array([xmax - room, ymax - room])
    for _ in range(TRIES):
        heading = flow + float(rng.choice([-0.5, 0.5])) * math.pi
        across = np.array([math.cos(heading), math.sin(heading)])
        middle = rng.uniform(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
        with np.errstate(divide="ignore"):
            ends = np.where(across > 0.0, high - middle, low - middle) / across
            begins = np.where(across > 0.0, low - middle, high - middle) / across
        start, goal = middle + begins.max() * across, middle + ends.min() * across
        pose = float(start[0]), float(start[1]), heading
        if start_free(*pose[:2]) and has_room_for_all(scenario, pose, start_free):
            return pose, (float(goal[0]), float(goal[1]))
    raise ValueError(f"no free start found among the pedestrians after {TRIES} tries")


FAMILIES: dict[str, Callable[..., Layout]] = {
    "empty": empty,
    "explicit": explicit,
    "u_trap": u_trap,
    "hook": hook,
    "ring": ring,
    "maze": maze,
    "corridor": corridor,
    "rooms": rooms,
    "crossing": crossing,
    "forest": forest,
    "urban": urban,
    "beach": beach,
    "oni_wang": oni_wang,
    "barn": barn,
    "replay": replay,
    "ros_map": ros_map,
}
"""Families made in Python, by their `family` key; `field` is compiled."""


# ---------------------------------------------------------------------------------------------- drawing worlds


def draw_layout(scenario: Scenario, seed: int, episode: int) -> Layout:
    """The world of one episode, for a family made in Python.

    Raises:
        ValueError: start, goal or obstacles found no place.
    """
    # The salt keeps these numbers apart from any other use of the same seed.
    rng = np.random.default_rng([kernels.STREAM_WORLD, seed, episode])
    return FAMILIES[scenario.world.family](scenario, scenario.world, rng)


TARGET_LAWS = {
    "bounce": kernels.BOUNCE,
    "random_walk": kernels.RANDOM_WALK,
    "crowd": kernels.CROWD,
    "evade": kernels.EVADE,
}
"""Laws under which a field's goal may move."""

HORIZON = float(Crowd.model_fields["horizon"].default)
"""How far ahead the crowd of a field looks [s]."""


def field_record(scenario: Scenario, world: FieldWorld) -> np.ndarray:
    """The parameters of a `field` world as the record (1,) that kernels.place_fields reads.

    Raises:
        ValueError: a parameter that the family cannot have.
    """
    check_spacing(scenario)
    if scenario.robots.places:
        raise ValueError("a field draws the starts of its robots: give robots.count instead of a list of places")
    target = world.target_motion
    if isinstance(target, (Waypoints, Replay)) or (isinstance(target, Crowd) and target.goals is not None):
        fault = "crowd with goals" if isinstance(target, Crowd) else target.law
        raise ValueError(
            f"a field's target_motion can be bounce, random_walk, crowd or evade, not {fault}: its free space is drawn"
        )
    circles = {"circles": world.obstacles, "mixed": (world.obstacles + 1) // 2}.get(world.shapes, 0)
    moving = round(world.moving * world.obstacles)
    moving_circles = round(moving * circles / world.obstacles) if world.obstacles else 0
    xmin, ymin, xmax, ymax = world.bounds
    start, goal = world.start or StartRegion(region=world.bounds), world.goal or Region(region=world.bounds)
    start_box = start.region if isinstance(start, StartRegion) else (start[0], start[1], start[0], start[1])
    heading = start.heading if isinstance(start, StartRegion) else start[2]
    goal_box = goal.region if isinstance(goal, Region) else (*goal, *goal)
    bits = {"bounce": kernels.BOUNCE_BIT, "random_walk": kernels.WALK_BIT, "crowd": kernels.CROWD_BIT}
    laws = sum(bits[law] for law in set(world.laws))
    velocity = target.velocity if isinstance(target, Bounce) else None
    speed = math.hypot(*velocity) if velocity else getattr(target, "speed", 0.0)
    record = np.zeros(1, dtype=kernels.FIELD)
    values = {
        "discs": circles + world.pedestrians,
        "moving_discs": moving_circles + world.pedestrians,
        "pedestrians": world.pedestrians,
        "polygons": world.obstacles - circles,
        "moving_polygons": moving - moving_circles,
        "squares": int(world.shapes == "squares"),
        "laws": laws,
        "target_law": kernels.STILL if target is None else TARGET_LAWS[target.law],
        "xmin": xmin,
        "ymin": ymin,
        "xmax": xmax,
        "ymax": ymax,
        "size_min": world.sizes[0],
        "size_max": world.sizes[1],
        "speed_min": world.speeds[0],
        "speed_max": world.speeds[1],
        "gap": -1.0 if world.solvable is None else 2.0 * world.solvable,
        "separation": world.separation,
        "start_clearance": world.start_clearance,
        "goal_clearance": world.goal_clearance,
        "start_heading": math.nan if heading is None else heading,
        "target_speed": speed,
        "target_vx": velocity[0] if velocity else (math.nan if target and target.law == "bounce" else 0.0),
        "target_vy": velocity[1] if velocity else 0.0,
        "leg_min": getattr(target, "min_leg", 1.0),
        "leg_max": getattr(target, "max_leg", 3.0),
        "pedestrian_radius": world.pedestrian_radius,
        "pedestrian_speed_min": world.pedestrian_speeds[0],
        "pedestrian_speed_max": world.pedestrian_speeds[1],
        "horizon": HORIZON,
        "target_foresight": target.sight if isinstance(target, Evade) else getattr(target, "horizon", HORIZON),
        "target_calm": getattr(target, "wander", 0.0),
    }
    corners = ("xmin", "ymin", "xmax", "ymax")
    values |= {f"start_{name}": value for name, value in zip(corners, start_box, strict=True)}
    values |= {f"goal_{name}": value for name, value in zip(corners, goal_box, strict=True)}
    for name, value in values.items():
        record[name] = value
    return record


def covered_share(world: World, row: int) -> float:
    """Share of the bounds that the obstacles placed so far would cover, 0 to 1 (overlaps count twice)."""
    first_polygon = int(world.spec["discs"][0])
    radius = world.array("body_radius")[row]
    last_polygon = first_polygon + int(world.array("polygon_count")[row, 0])
    radii = np.concatenate([radius[: int(world.disc_count[row])], radius[first_polygon:last_polygon]])
    return share_of_box(radii, world.scenario.world.box)


def share_of_box(radii: F64, box: tuple[float, float, float, float]) -> float:
    """Share of a box that discs of these radii (k,) [m] cover, 0 to 1 (overlaps count twice)."""
    xmin, ymin, xmax, ymax = box
    return float(np.pi * (radii**2).sum() / ((xmax - xmin) * (ymax - ymin)))


# ---------------------------------------------------------------------------------------------- saving worlds


def as_explicit(scenario: Scenario, layout: Layout) -> Scenario:
    """The scenario with one layout written out: every obstacle, mover, start and goal of it, and nothing drawn.

    Loaded again it gives the same layout bit for bit. Random walks keep their law and speed; which ways they take is
    drawn from the seed, as ever.

    Raises:
        ScenarioError: a layout that no scenario can have, such as one with a robot in an obstacle.
    """
    xmin, ymin = layout.border.min(axis=0).tolist()
    xmax, ymax = layout.border.max(axis=0).tolist()
    is_box = np.array_equal(layout.border, rectangle(xmin, ymin, xmax, ymax))
    goals = layout.goals.tolist()
    world: dict[str, Any] = {
        "family": "explicit",
        "bounds": [xmin, ymin, xmax, ymax] if is_box else layout.border.tolist(),
        "regions": scenario.world.regions,
        "circles": layout.circles.tolist(),
        "polygons": [polygon_data(rings) for rings in layout.polygons],
        "movers": [mover_data(mover) for mover in layout.movers],
        "start": layout.starts[0].tolist(),
    }
    if layout.target is None:
        world["goal"] = goals[0]
    else:
        world["target"] = {"at": goals[0], "motion": layout.target, "room": layout.goal_room}
    data = {**dump(scenario), "world": world}
    if scenario.robots.count > 1:
        places: list[dict[str, Any]] = [{"start": pose} for pose in layout.starts.tolist()]
        if len(goals) > 1:
            places = [{**place, "goal": goal} for place, goal in zip(places, goals, strict=True)]
        data["robots"] = places
    return load(data)


def polygon_data(rings: Rings) -> Any:
    """A polygon as a scenario has it."""
    shell, *holes = (ring.tolist() for ring in rings)
    return {"shell": shell, "holes": holes} if holes else shell


def mover_data(mover: Mover) -> dict[str, Any]:
    """A mover as a scenario has it."""
    outline = np.asarray(mover.outline).tolist()
    return {"shape": {"circle" if mover.is_circle else "polygon": outline}, "at": mover.at, "motion": mover.motion}
