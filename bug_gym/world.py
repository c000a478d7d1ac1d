"""The state of N worlds as arrays, row n = world n.

All state lies in two flat buffers, `floats` (N, Wf) and `ints` (N, Wi): one row is contiguous for the kernels, and a
copy of the buffers is a snapshot. The named arrays of a World are views into them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.config import Scenario
from bug_gym.draws import CONSTANTS, draw, drawn_numbers
from bug_gym.geometry import F64, following
from bug_gym.limits import MEMORY, SMALL, told_bytes
from bug_gym.schema.motions import Bounce, Crowd, Evade, Motion, RandomWalk, Replay, Waypoints
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.standing import is_standing, signed_area, standing
from bug_gym.worlds.layout import SAME_POINT, Layout, Mover, Rings

KINEMATICS = {
    "holonomic": kernels.HOLONOMIC,
    "differential": kernels.DIFFERENTIAL,
    "ackermann": kernels.ACKERMANN,
}
"""Code of what the scenario says of it."""

Steered = Crowd | Evade | Replay


def places_of(motion: Motion | None) -> tuple[tuple[float, ...], ...]:
    """The points that a motion visits: x, y [m], in a record time [s], x, y."""
    if isinstance(motion, Crowd):
        return motion.goals or ()
    return motion.points if isinstance(motion, (Waypoints, Replay)) else ()


class Capacity(NamedTuple):
    """How much one world may hold; worlds of a World are padded to the largest."""

    discs: int = 0
    polygons: int = 0
    walls: int = 4
    ways: int = 0
    steered: int = 0
    """1 where bodies choose a velocity in each step (crowd, evade, replay), else 0."""

    @classmethod
    def of(cls, layout: Layout) -> Capacity:
        """What this layout needs."""
        rings = [ring for polygon in layout.polygons for ring in polygon]
        moving = [np.asarray(mover.outline) for mover in layout.movers if not mover.is_circle]
        motions = [mover.motion for mover in layout.movers] + [layout.target] * len(layout.goals)
        return cls(
            discs=len(layout.circles) + len(layout.movers) - len(moving),
            polygons=len(layout.polygons) + len(moving),
            walls=len(layout.border) + sum(map(len, rings)) + sum(map(len, moving)),
            ways=sum(len(places_of(motion)) for motion in motions),
            steered=int(any(isinstance(motion, Steered) for motion in motions)),
        )

    def joined(self, other: Capacity) -> Capacity:
        """The larger of the two in each respect."""
        return Capacity(*map(max, self, other))


class Snapshot(NamedTuple):
    """All that a World's future depends on, but for the actions."""

    capacity: Capacity
    floats: F64
    ints: NDArray[np.int64]
    observation: NDArray[np.float32]
    digest: str
    """Of the scenario."""
    drawn: F64 | None = None
    """The numbers that each row's episode has drawn; None: what seed and episode give."""


class World:
    """N worlds of one scenario as arrays.

    Args:
        scenario: what the worlds have in common.
        count: how many worlds, N.
        width: length D of a robot's flat observation.
        weights: weight of each reward term by name.
        clearance_scale: clearance at which the reward's clearance term begins [m].
        span: longest distance inside the bounds [m].
        own_terms: how many terms of the reward are the scenario's own.
        clearance_reach: below which each step's clearance is exact [m]; None: below `clearance_scale`.
        capacity: what to leave room for; it grows by itself where a layout needs more.
    """

    def __init__(
        self,
        scenario: Scenario,
        count: int,
        *,
        width: int,
        weights: dict[str, float],
        clearance_scale: float,
        span: float,
        own_terms: int = 0,
        clearance_reach: float | None = None,
        capacity: Capacity | None = None,
    ) -> None:
        self.scenario = scenario
        self._own_terms = own_terms
        self.count = count
        self.robots = scenario.robots.count
        self.footprint = np.array(scenario.robot.footprint, dtype=np.float64)
        self.regions = region_table(scenario.world.regions)
        angles = beam_angles(scenario)
        step = angles[1] - angles[0] if len(angles) > 1 else 2.0 * math.pi
        self.beams = np.stack(kernels.beam_table(len(angles), float(angles[0]), float(step)))
        self._numbers = drawn_numbers(scenario)
        self.drawn = np.tile(np.array(list(self._numbers.values()), dtype=np.float64), (count, 1))
        self.common = self.record_of(scenario)
        reach = clearance_scale if clearance_reach is None else clearance_reach
        constants = {"width": width, "clearance_scale": clearance_scale, "clearance_reach": reach, "span": span}
        constants |= {f"weight_{name}": value for name, value in weights.items()}
        for name, value in constants.items():
            self.common[name] = value
        self.goals = int(self.common["goals"][0])
        self._allocate(capacity or Capacity())
        self.observation: NDArray[np.float32] = np.zeros((count, self.robots, width), dtype=np.float32)

    @staticmethod
    def record_of(scenario: Scenario) -> NDArray[Any]:
        """What a scenario says of all its rows, one record of SPEC (1,); its reward and room for bodies are not in it."""
        robot, lidar, odometry = scenario.robot, scenario.lidar, scenario.odometry
        angles = beam_angles(scenario)
        has_own = scenario.world.has_own_goals or any(place.goal for place in scenario.robots.places)
        constants: dict[str, Any] = {
            "robots": scenario.robots.count,
            "goals": scenario.robots.count if has_own else 1,
            "beams": lidar.beams,
            "footprint": len(robot.footprint),
            "kinematics": KINEMATICS[robot.kinematics],
            "arcs": int(scenario.goes_on_arcs),
            "limit_steps": scenario.time.steps,
            "first_ends": int(scenario.mission == "first"),
            "goal_by_odometry": int(scenario.goal.sensing == "odometry"),
            "regions": len(scenario.world.regions),
            "latency": scenario.latency_steps,
            "step": scenario.time.step,
            "max_speed": robot.max_speed,
            "max_reverse": robot.max_reverse,
            "max_turn_rate": robot.greatest_turn_rate,
            "max_steering": robot.max_steering,
            "wheelbase": robot.wheelbase,
            "max_acceleration": math.inf if robot.max_acceleration is None else robot.max_acceleration,
            "full_speed": robot.max_speed,
            "full_reverse": robot.max_reverse,
            "full_turn_rate": robot.greatest_turn_rate,
            "full_steering": robot.max_steering,
            "body_reach": robot.reach,
            "goal_radius": scenario.goal.radius,
            "reach": lidar.range,
            "no_return": lidar.range,
            "min_range": lidar.min_range,
            "first_angle": angles[0],
            "angle_step": angles[1] - angles[0] if lidar.beams > 1 else 2.0 * math.pi,
            "range_noise": lidar.noise,
            "dropout": lidar.dropout,
            "translation_noise": odometry.translation_noise,
            "rotation_noise": odometry.rotation_noise,
            "translation_bias": odometry.translation_bias,
            "rotation_bias": odometry.rotation_bias,
            "span": world_span(scenario),
            "margin": MARGIN,
            "largest_factor": max((region.factor for region in scenario.world.regions), default=1.0),
        }
        record = np.zeros(1, dtype=kernels.SPEC)
        for name, value in constants.items():
            record[name] = value
        for name, place in kernels.observation_places(record.view(np.recarray)[0]).items():
            record[f"see_{name}"] = place.begin
        return record

    def _allocate(self, capacity: Capacity) -> None:
        """Lay out the buffers for a capacity, empty.

        Raises:
            ValueError: all worlds together would take more than MEMORY.
        """
        self.capacity = capacity
        robots, walls = self.robots, capacity.walls
        # The other robots stand behind the world's own discs while one robot looks.
        discs = capacity.discs + (robots - 1) * len(self.footprint)
        bodies = discs + capacity.polygons + self.goals
        polygons, ways = capacity.polygons, capacity.ways
        rooms = [kernels.list_room(count) for count in (discs, polygons, walls)]
        self.common["disc_room"], self.common["polygon_room"], self.common["wall_room"] = rooms
        disc_room, polygon_room, wall_room = rooms
        counts = {"discs": discs, "polygons": polygons, "bodies": bodies, "walls": walls, "ways": ways}
        for name, value in counts.items():
            self.common[name] = value
        counts |= {
            "row": 1,
            "robots": robots,
            "listed": disc_room + polygon_room,
            "lookers": bodies if capacity.steered else 0,
            "delayed": robots * self.scenario.latency_steps,
        }
        self._places: dict[str, tuple[int, int]] = {}
        widths = []
        for table in (kernels.FLOAT_ARRAYS, kernels.INT_ARRAYS):
            places = kernels.places(table, counts)
            for name, (begin, _) in places.items():
                self.common[name] = begin
            end = max(begin + size for begin, size in places.values())
            if table is kernels.FLOAT_ARRAYS:  # the scenario's own terms stand behind what kernels know
                places["own_terms"] = (end, self._own_terms * robots)
                end += self._own_terms * robots
            # An odd number of pairs of lines: what lies at the same place in many rows is spread over all of a cache.
            widths.append(kernels.rounded_up(end) | kernels.ALIGNED)
            self._places |= places
        # A snapshot is as large again, but few take one of very many worlds.
        self._describe_rows()
        self.is_behind = False  # whether kernels have gone on since bodies were last brought to now
        memory = self.count * (8 * sum(widths) + 4 * self.robots * int(self.spec["width"][0]))
        if memory > MEMORY:
            what = f"{self.count:,} worlds of {self.scenario.name!r} would take {told_bytes(memory)}"
            raise ValueError(f"{what}, expected at most {told_bytes(MEMORY)}: fewer of them, or smaller ones")
        self.floats: F64 = aligned_zeros(self.count, widths[0], np.float64)
        self.ints: NDArray[np.int64] = aligned_zeros(self.count, widths[1], np.int64)
        self._placed_spans = [
            self._spans(table, kernels.PLACED, width)
            for table, width in zip((kernels.FLOAT_ARRAYS, kernels.INT_ARRAYS), widths, strict=True)
        ]
        beams = int(self.spec["beams"][0])
        floats = kernels.scratch_floats(beams) + robots + 4 * wall_room + kernels.COLUMNS * (disc_room + polygon_room)
        steering = kernels.steering_floats(walls, bodies, robots * len(self.footprint)) if capacity.steered else 0
        integers = max(kernels.scratch_integers(max(disc_room, polygon_room)), robots) + robots
        self.scratch_sizes = (max(kernels.rounded_up(floats), steering), max(integers, bodies))

    def _describe_rows(self) -> None:
        """Give each row a record with its own numbers, where the scenario draws some."""
        self.spec = np.repeat(self.common, self.count) if self._numbers else self.common
        for key, values in zip(self._numbers, self.drawn.T, strict=True):
            self.spec[CONSTANTS[key]] = values

    def draw(self, rows: NDArray[np.int64]) -> None:
        """Draw the numbers of the episodes that rows (n,) have; what nothing else depends on but seed and episode."""
        if not self._numbers:
            return
        found = [draw(self._numbers, int(self.seed[row]), int(self.episode[row])) for row in rows.tolist()]
        self._take_drawn(rows, np.array(found).reshape(len(rows), -1))

    def _take_drawn(self, rows: NDArray[np.int64], drawn: F64) -> None:
        """Give rows (n,) numbers (n, k) that are drawn already."""
        self.drawn[rows] = drawn
        for key, values in zip(self._numbers, drawn.T, strict=True):
            self.spec[CONSTANTS[key]][rows] = values

    def own(self, row: int, constant: str) -> float:
        """A constant of a row's record, which may be drawn for its episode."""
        return float(self.spec[constant][row if len(self.spec) > 1 else 0])

    def body(self, row: int) -> F64:
        """The robots' body in a row: circles x, y, radius (c, 3) [m] in their frame."""
        if "robot.radius" not in self._numbers:
            return self.footprint
        return np.array([[0.0, 0.0, self.own(row, "body_reach")]])

    @property
    def drawn_keys(self) -> tuple[str, ...]:
        """Dotted keys of what the scenario draws for each episode, in the order of the columns of `drawn` (N, D)."""
        return tuple(self._numbers)

    def make_scratch(self) -> tuple[F64, NDArray[np.int64]]:
        """Working memory for the kernels; each thread needs its own."""
        floats, ints = self.scratch_sizes
        return aligned_zeros(1, floats, np.float64)[0], aligned_zeros(1, ints, np.int64)[0]

    # ------------------------------------------------------------------------------------------ named arrays

    def array(self, name: str) -> NDArray[Any]:
        """View (N, size) of a named array of the rows: kernels.FLOAT_ARRAYS, kernels.INT_ARRAYS, or `own_terms`."""
        if self.is_behind and name in OF_MOTION:
            kernels.locate_bodies(self.floats, self.ints, self.spec)
            self.is_behind = False
        return self._view(name)

    def _view(self, name: str) -> NDArray[Any]:
        begin, size = self._places[name]
        buffer: NDArray[Any] = self.ints if name in kernels.INT_ARRAYS else self.floats
        return buffer[:, begin : begin + size]

    @property
    def placed(self) -> list[NDArray[Any]]:
        """Views (N, size) of what `kernels.place_fields` writes."""
        floats, ints = self._placed_spans
        return [self.floats[:, begin:end] for begin, end in floats] + [self.ints[:, begin:end] for begin, end in ints]

    def copy_placed(self, rows: NDArray[np.int64]) -> list[NDArray[Any]]:
        """Copies (n, size) of what `placed` has of rows (n,)."""
        # Of whole rows `take` takes a third of the time; of parts of them it would copy all rows first.
        return [part.take(rows, axis=0) if part.flags.c_contiguous else part[rows] for part in self.placed]

    def _spans(self, table: dict[str, tuple[int, str]], names: frozenset[str], width: int) -> list[tuple[int, int]]:
        """Where in a row of a table these arrays lie: few spans, as what lies NEAR_BY one another, or an end, is in one."""
        spans: list[tuple[int, int]] = []
        for begin, size in (self._places[name] for name in table if name in names):
            if spans and begin - spans[-1][1] <= NEAR_BY:
                begin, size = spans[-1][0], begin + size - spans.pop()[0]
            spans.append((begin, begin + size))
        if spans[0][0] <= NEAR_BY:
            spans[0] = 0, spans[0][1]
        if width - spans[-1][1] <= NEAR_BY:
            spans[-1] = spans[-1][0], width
        return spans

    def _pair(self, first: str) -> F64:
        """View (N, n, 2) of two arrays that follow one another, x then y."""
        begin, size = self._places[first]
        self.array(first)  # as of now
        return self.floats[:, begin : begin + 2 * size].reshape(self.count, 2, size).swapaxes(1, 2)

    def _by_robot(self, name: str) -> F64:
        return self.array(name).reshape(self.count, self.robots, -1)

    @property
    def time(self) -> F64:
        """Time since the start of the episode (N,) [s]."""
        return self.array("time")[:, 0]

    @property
    def seed(self) -> NDArray[np.int64]:
        """Seed of each row (N,)."""
        return self.array("seed")[:, 0]

    @property
    def episode(self) -> NDArray[np.int64]:
        """Number of the episode since the row was seeded (N,)."""
        return self.array("episode")[:, 0]

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps since the start of the episode (N,)."""
        return self.array("steps")[:, 0]

    @property
    def pose(self) -> F64:
        """True poses (N, R, 3): x, y [m], heading [rad]."""
        return self._by_robot("pose")

    @property
    def odometry(self) -> F64:
        """The robots' own estimates of their poses in the frame of the start (N, R, 3)."""
        return self._by_robot("odometry")

    @property
    def velocity(self) -> F64:
        """Body velocities (N, R, 2): ahead [m/s] and turn rate [rad/s], or ahead and to the left [m/s]."""
        return self._by_robot("velocity")

    @property
    def outcome(self) -> NDArray[np.int64]:
        """Outcome codes (N, R), see kernels.RUNNING and its neighbours."""
        return self.array("outcome")

    @property
    def active(self) -> NDArray[np.bool_]:
        """Robots still in play (N, R); the others stand and are obstacles."""
        active: NDArray[np.bool_] = self.outcome == kernels.RUNNING
        return active

    @property
    def goal(self) -> F64:
        """Places of the robots' goals (N, R, 2) [m]."""
        index = self.array("goal_body")[:, :, None]
        places = (np.take_along_axis(self._view(name), index[:, :, 0], axis=1) for name in ("body_x", "body_y"))
        return np.stack(tuple(places), axis=2)

    @property
    def disc_position(self) -> F64:
        """Centres (N, M, 2) of circular obstacles [m]; the moving ones come first, `disc_count` says how many count."""
        return self._pair("body_x")[:, : self.capacity.discs]

    @property
    def disc_velocity(self) -> F64:
        """Velocities (N, M, 2) of circular obstacles [m/s]."""
        return self._pair("body_vx")[:, : self.capacity.discs]

    @property
    def disc_radius(self) -> F64:
        """Radii (N, M) of circular obstacles [m]."""
        return self.array("body_radius")[:, : self.capacity.discs]

    @property
    def disc_count(self) -> NDArray[np.int64]:
        """How many circular obstacles each row has (N,)."""
        return self.array("disc_count")[:, 0]

    @property
    def wall(self) -> F64:
        """Wall segments (N, S, 4) where they stand: x1, y1, x2, y2 [m], a copy; `wall_count` says how many count."""
        size = self.capacity.walls
        corners = self.array("corner").reshape(self.count, size, 2)
        ends = np.take_along_axis(corners, self.array("wall_next")[:, :, None], axis=1)
        walls = np.concatenate([corners, ends], axis=2)
        walls[np.arange(size) >= self.array("wall_count")] = 0.0
        # The walls of a moving polygon are kept relative to its place; they come first, in the polygons' order.
        moving = np.arange(size) < self.array("moving_wall_count")
        rows, numbers = np.nonzero(np.arange(self.capacity.polygons) < self.array("moving_polygon_count"))
        places = self._pair("body_x")[rows, int(self.spec["discs"][0]) + numbers]
        walls[moving] += np.tile(places, 2).repeat(self.array("polygon_walls")[rows, numbers], axis=0)
        return walls

    @property
    def wall_count(self) -> NDArray[np.int64]:
        """How many wall segments each row has (N,)."""
        return self.array("wall_count")[:, 0]

    @property
    def ranges(self) -> NDArray[np.float32]:
        """Last scans (N, R, B) [m]."""
        return self.observation[:, :, : int(self.spec["beams"][0])]

    # ------------------------------------------------------------------------------------------ growth and snapshots

    def grow(self, capacity: Capacity) -> None:
        """Make room for a capacity; the worlds stay as they are, bit for bit."""
        wanted = self.capacity.joined(capacity)
        if wanted == self.capacity:
            return
        old = {name: self.array(name).copy() for name in self._places}
        discs, polygons = int(self.spec["discs"][0]), self.capacity.polygons
        self._allocate(wanted)
        # Bodies are discs, then polygons, then goals: the last two move up.
        disc_shift = int(self.spec["discs"][0]) - discs
        goal_shift = disc_shift + wanted.polygons - polygons
        new_index = np.arange(discs + polygons + self.goals)
        new_index[discs:] += disc_shift
        new_index[discs + polygons :] += goal_shift - disc_shift
        for name, values in old.items():
            if name.startswith("near_"):
                continue  # listed anew
            if name.startswith(PER_BODY):
                if values.shape[1] > 0:  # else nothing has chosen its velocity so far
                    self.array(name)[:, new_index] = values
            else:
                self.array(name)[:, : values.shape[1]] = values
        self.array("goal_body")[:] += goal_shift
        self.array("body_wake")[:] = 0.0
        self.array("listed_until")[:] = -math.inf

    @cached_property
    def _digest(self) -> str:
        return self.scenario.digest

    def save(self) -> Snapshot:
        """Copy all that the future depends on."""
        arrays = (self.floats.copy(), self.ints.copy(), self.observation.copy())
        return Snapshot(self.capacity, *arrays, self._digest, self.drawn.copy())

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of a World of the same scenario and count.

        Raises:
            ValueError: the snapshot is of another scenario, or of another number of worlds.
        """
        if snapshot.digest != self._digest:
            raise ValueError(f"the snapshot is of another scenario than {self.scenario.name!r}")
        if snapshot.observation.shape != self.observation.shape:
            came, expected = snapshot.observation.shape, self.observation.shape
            raise ValueError(f"the snapshot's observations have shape {came}, expected {expected}")
        if snapshot.capacity != self.capacity:
            self._allocate(snapshot.capacity)
        self.is_behind = True
        self.floats[:] = snapshot.floats
        self.ints[:] = snapshot.ints
        self.observation[:] = snapshot.observation
        rows = np.arange(self.count)
        if snapshot.drawn is None:
            self.draw(rows)
        else:
            self._take_drawn(rows, snapshot.drawn)

    def copy_rows(self, source: World, source_rows: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Make rows (n,) copies of rows (n,) of a World of the same scenario, or of its own; both grow to the same room.

        Raises:
            ValueError: the other World is of another scenario.
        """
        if source._digest != self._digest:
            raise ValueError(f"the rows are of {source.scenario.name!r}, expected another World of this very scenario")
        self.grow(source.capacity)
        source.grow(self.capacity)
        # One row for all of them is read once, in half the time or less.
        taken = source_rows[:1] if (source_rows == source_rows[:1]).all() else source_rows
        self.floats[rows] = source.floats[taken]
        self.ints[rows] = source.ints[taken]
        self.observation[rows] = source.observation[taken]
        self._take_drawn(rows, source.drawn[source_rows])
        self.is_behind = True  # as the source may be

    # ------------------------------------------------------------------------------------------ layouts

    def load_all(self, rows: NDArray[np.int64], layouts: Sequence[Layout]) -> None:
        """Put a layout into each of the rows (n,); `Simulation.begin` then starts their episodes."""
        stands = np.array([is_standing(layout) for layout in layouts], dtype=np.bool_)
        if stands.any():
            self._load_standing(rows[stands], [layout for layout in layouts if is_standing(layout)])
        for number in np.flatnonzero(~stands).tolist():
            self.load(int(rows[number]), layouts[number])

    def _load_standing(self, rows: NDArray[np.int64], layouts: Sequence[Layout]) -> None:
        """Put layouts in which nothing moves into rows (n,): the same as one after the other, several times as fast."""
        still = standing(layouts)
        most = (int(sizes.max()) for sizes in (still.circles.size, still.polygons.size, still.corners))
        self.grow(Capacity(*most))
        seed, episode = self.seed[rows], self.episode[rows]
        self.floats[rows] = 0.0
        self.ints[rows] = 0
        self.seed[rows], self.episode[rows] = seed, episode
        self.pose[rows] = [layout.starts for layout in layouts]
        discs, polygons = int(self.spec["discs"][0]), self.capacity.polygons
        goals = np.arange(self.goals) + discs + polygons
        disc_rows, polygon_rows = rows[still.circles.owner], rows[still.polygons.owner]
        bodies = discs + still.polygons.place
        for axis, name in enumerate(("body_x", "body_y")):
            view = self._view(name)
            view[disc_rows, still.circles.place] = still.circle[:, axis]
            view[polygon_rows, bodies] = still.centre[:, axis]
            view[rows[:, None], goals] = [layout.goals[:, axis] for layout in layouts]
        radius = self._view("body_radius")
        radius[disc_rows, still.circles.place] = still.circle[:, 2]
        radius[polygon_rows, bodies] = still.radius
        radius[rows[:, None], goals] = [[layout.goal_room] for layout in layouts]
        wall_rows, wall_places = rows[still.of_world.owner], still.of_world.place
        self._view("corner").reshape(self.count, -1, 2)[wall_rows, wall_places] = still.wall_begin
        self._view("wall_next")[wall_rows, wall_places] = still.wall_next
        for name in ("polygon_first", "polygon_walls", "polygon_side"):
            self._view(name)[polygon_rows, still.polygons.place] = getattr(still, name)
        counts = {
            "disc_count": still.circles.size,
            "polygon_count": still.polygons.size,
            "wall_count": still.of_world.size,
            "border_walls": still.border_walls,
        }
        for name, values in counts.items():
            self._view(name)[rows, 0] = values
        self._view("goal_body")[rows] = goals[np.minimum(np.arange(self.robots), self.goals - 1)]

    def load(self, row: int, layout: Layout) -> None:
        """Put a layout into a row, body after body."""
        self.grow(Capacity.of(layout))
        seed, episode = self.seed[row], self.episode[row]
        self.floats[row] = 0.0
        self.ints[row] = 0
        self.seed[row], self.episode[row] = seed, episode
        self.pose[row] = layout.starts
        writer = _Writer(self, row)
        circular = [mover for mover in layout.movers if mover.is_circle]
        polygonal = [mover for mover in layout.movers if not mover.is_circle]
        for disc, mover in enumerate(circular):
            writer.body(disc, mover.at, float(mover.outline), mover.motion)
        for disc, (x, y, radius) in enumerate(layout.circles, start=len(circular)):
            writer.body(disc, (float(x), float(y)), float(radius), None)
        first_polygon = int(self.spec["discs"][0])
        for number, mover in enumerate(polygonal):
            ring = np.asarray(mover.outline, dtype=np.float64)
            writer.body(first_polygon + number, mover.at, float(np.hypot(*ring.T).max()), mover.motion)
            writer.polygon(number, (ring,))
        moving_walls = writer.walls
        writer.border(layout.border)
        for number, rings in enumerate(layout.polygons, start=len(polygonal)):
            low, high = rings[0].min(axis=0), rings[0].max(axis=0)
            centre = 0.5 * (low + high)
            # A still polygon is a body too, so that whole polygons can be passed over where they are far.
            writer.body(first_polygon + number, tuple(centre), float(np.hypot(*(rings[0] - centre).T).max()), None)
            writer.polygon(number, rings)
        first_goal = first_polygon + self.capacity.polygons
        # A point that moves would slip through walls by rounding.
        room = layout.goal_room if layout.target is None else max(layout.goal_room, SMALL)
        for number, (x, y) in enumerate(layout.goals):
            writer.body(first_goal + number, (float(x), float(y)), room, layout.target)
        counts = {
            "disc_count": len(circular) + len(layout.circles),
            "moving_disc_count": len(circular),
            "polygon_count": len(polygonal) + len(layout.polygons),
            "moving_polygon_count": len(polygonal),
            "wall_count": writer.walls,
            "moving_wall_count": moving_walls,
        }
        for name, value in counts.items():
            self.array(name)[row] = value
        self.array("goal_body")[row] = first_goal + np.minimum(np.arange(self.robots), self.goals - 1)

    def layout(self, row: int) -> Layout:
        """The row as plain data, as it stands now: movers at their present places with their present velocities."""
        reader = _Reader(self, row)
        discs, moving = int(self.disc_count[row]), int(self.array("moving_disc_count")[row, 0])
        moving_polygons = int(self.array("moving_polygon_count")[row, 0])
        position, radius = self.disc_position[row], self.disc_radius[row]
        first_polygon = int(self.spec["discs"][0])
        movers = [reader.mover(float(radius[disc]), disc) for disc in range(moving)]
        rings = reader.rings()
        movers += [reader.mover(rings[number][0], first_polygon + number) for number in range(moving_polygons)]
        goal = first_polygon + self.capacity.polygons
        return Layout(
            border=rings[kernels.BORDER][0],
            starts=self.pose[row].copy(),
            goals=np.array([reader.place(goal + number) for number in range(self.goals)]),
            circles=np.column_stack([position[moving:discs], radius[moving:discs]]),
            polygons=tuple(rings[number] for number in sorted(rings) if number >= moving_polygons),
            movers=tuple(movers),
            target=reader.motion(goal) if self.array("body_law")[row, goal] != kernels.STILL else None,
            goal_room=float(self.array("body_radius")[row, goal]),
        )


PER_BODY = ("body_", "line_", "last_", "leg_", "way_first", "way_count", "way_next", "way_loops")
"""Beginnings of the names of arrays with one entry a body."""


MARGIN = 2.0
"""How much farther than they matter bodies are listed [m]: the less, the fewer; the more, the more seldom."""

NEAR_BY = 512
"""So many numbers are copied in less time than another piece of a row is begun."""

OF_MOTION = frozenset(
    name
    for name in (*kernels.FLOAT_ARRAYS, *kernels.INT_ARRAYS)
    if name.startswith(("body_", "line_", "last_", "way_next"))
) - {"body_radius", "body_speed", "body_law"}
"""Arrays that tell of bodies' motion: those of bodies that nobody was near are brought to now when they are asked for."""


class _Writer:
    """Writes bodies and rings into one row, in order."""

    def __init__(self, world: World, row: int) -> None:
        self.arrays = {name: world.array(name)[row] for name in (*kernels.FLOAT_ARRAYS, *kernels.INT_ARRAYS)}
        self.walls = 0
        self.ways = 0

    def body(self, body: int, at: tuple[float, float], radius: float, motion: Motion | None) -> None:
        """Place a body; `motion` None: it stands."""
        a = self.arrays
        a["body_x"][body], a["body_y"][body] = at
        a["body_radius"][body] = radius
        if isinstance(motion, Bounce):
            a["body_law"][body] = kernels.BOUNCE
            # A speed without a direction was drawn into a velocity by the family that made the layout.
            velocity = motion.velocity or (0.0, 0.0)
            a["body_vx"][body], a["body_vy"][body] = velocity
            a["body_speed"][body] = math.hypot(*velocity)
        elif isinstance(motion, RandomWalk):
            a["body_law"][body] = kernels.RANDOM_WALK
            a["body_speed"][body] = motion.speed
            a["leg_min"][body], a["leg_max"][body] = motion.min_leg, motion.max_leg
        elif isinstance(motion, Waypoints):
            a["body_law"][body] = kernels.WAYPOINTS
            a["body_speed"][body] = motion.speed
            a["way_loops"][body] = int(not motion.stop)
        elif isinstance(motion, Crowd):
            a["body_law"][body] = kernels.CROWD
            a["body_speed"][body], a["body_foresight"][body] = motion.speed, motion.horizon
        elif isinstance(motion, Evade):
            a["body_law"][body] = kernels.EVADE
            a["body_speed"][body], a["body_foresight"][body] = motion.speed, motion.sight
            a["body_calm"][body] = motion.wander
        elif isinstance(motion, Replay):
            a["body_law"][body] = kernels.REPLAY
            a["body_speed"][body] = motion.speed
        self._ways(body, places_of(motion))

    def _ways(self, body: int, places: tuple[tuple[float, ...], ...]) -> None:
        end = self.ways + len(places)
        self.arrays["way_first"][body] = self.ways
        self.arrays["way_count"][body] = len(places)
        for number, place in enumerate(places, start=self.ways):
            self.arrays["way_x"][number], self.arrays["way_y"][number] = place[-2:]
            self.arrays["way_time"][number] = place[0]  # of a record; nobody reads it for other laws
        self.ways = end

    def border(self, ring: F64) -> None:
        """Append the border (k, 2)."""
        self.arrays["border_first"][0] = self.walls
        self._ring(ring)
        self.arrays["border_walls"][0] = self.walls - self.arrays["border_first"][0]

    def polygon(self, number: int, rings: Rings) -> None:
        """Append the rings (k, 2) of a polygon: where they stand, or relative to its place where it moves."""
        self.arrays["polygon_first"][number] = self.walls
        for ring in rings:
            self._ring(ring)
        self.arrays["polygon_walls"][number] = self.walls - self.arrays["polygon_first"][number]
        self.arrays["polygon_side"][number] = inner_side(rings)

    def _ring(self, ring: F64) -> None:
        ring = ring[np.hypot(*(following(ring) - ring).T) > SAME_POINT]
        a, first, end = self.arrays, self.walls, self.walls + len(ring)
        a["corner"][2 * first : 2 * end] = ring.ravel()
        a["wall_next"][first:end] = [*range(first + 1, end), first][: len(ring)]
        self.walls = end


def cut_into_rings(walls: F64) -> Rings:
    """Corners (k, 2) of each ring of a polygon's walls (n, 4): a ring ends where a wall leads to its first corner."""
    rings, begin = [], 0
    for end, corner in enumerate(walls[:, 2:].tolist(), start=1):
        if corner == walls[begin, :2].tolist():
            rings.append(walls[begin:end, :2].copy())
            begin = end
    return tuple(rings)


def inner_side(rings: Rings) -> int:
    """Side of the walls on which a polygon lies, as its rings (k, 2) run: 1 left, -1 right, 0 not the same for all."""
    areas = [signed_area(*ring.T) for ring in rings]
    sides = {math.copysign(1.0, area) * (1.0 if number == 0 else -1.0) for number, area in enumerate(areas)}
    return int(sides.pop()) if len(sides) == 1 else 0


class _Reader:
    """Reads bodies and rings out of one row."""

    def __init__(self, world: World, row: int) -> None:
        self.arrays = {name: world.array(name)[row] for name in (*kernels.FLOAT_ARRAYS, *kernels.INT_ARRAYS)}

    def place(self, body: int) -> tuple[float, float]:
        """Place of a body [m]."""
        return float(self.arrays["body_x"][body]), float(self.arrays["body_y"][body])

    def mover(self, outline: float | F64, body: int) -> Mover:
        """An obstacle that moves; one that isn't there stands where it will come in, or where it left."""
        motion = self.motion(body)
        return Mover(outline, motion.place(0.0) if isinstance(motion, Replay) else self.place(body), motion)

    def motion(self, body: int) -> Motion:
        """Motion of a body from now on.

        Nothing is checked anew: a reflection may turn a velocity so that one of its parts is above what a scenario may say,
        and times of records lie nearer to one another by the rounding of the clock.
        """
        a = self.arrays
        law, speed = a["body_law"][body], float(a["body_speed"][body])
        if law == kernels.WAYPOINTS:
            points, done = self._points(body), int(a["way_next"][body])
            loops = bool(a["way_loops"][body])
            # The way-points still to come: all of them in turn where the body goes round.
            points = points[done:] + points[:done] if loops else points[done:] or points[-1:]
            return Waypoints.model_construct(law="waypoints", points=tuple(points), speed=speed, stop=not loops)
        if law == kernels.RANDOM_WALK:
            low, high = float(a["leg_min"][body]), float(a["leg_max"][body])
            return RandomWalk.model_construct(law="random_walk", speed=speed, min_leg=low, max_leg=high)
        if law == kernels.CROWD:
            points, done = self._points(body), int(a["way_next"][body])
            goals = (*points[done:], *points[:done]) or None
            horizon = float(a["body_foresight"][body])
            return Crowd.model_construct(law="crowd", speed=speed, horizon=horizon, goals=goals)
        if law == kernels.EVADE:
            sight, wander = float(a["body_foresight"][body]), float(a["body_calm"][body])
            return Evade.model_construct(law="evade", speed=speed, sight=sight, wander=wander)
        if law == kernels.REPLAY:
            first, points, done = int(a["way_first"][body]), self._points(body), int(a["way_next"][body])
            times = a["way_time"][first : first + len(points)] - a["time"][0]
            times[np.abs(times) <= kernels.SAME_INSTANT] = 0.0  # now, as the kernels take it, so that the body is there
            records = [(time, *point) for time, point in zip(times.tolist(), points, strict=True)]
            return Replay.model_construct(law="replay", points=tuple(records[done:]))
        velocity = float(a["body_vx"][body]), float(a["body_vy"][body])
        return Bounce.model_construct(law="bounce", velocity=velocity)

    def _points(self, body: int) -> list[tuple[float, float]]:
        first, count = int(self.arrays["way_first"][body]), int(self.arrays["way_count"][body])
        places = (self.arrays[name][first : first + count].tolist() for name in ("way_x", "way_y"))
        return list(zip(*places, strict=True))

    def rings(self) -> dict[int, Rings]:
        """Rings (k, 2) of each polygon by its number, the border's under kernels.BORDER; a mover's about its place."""
        a = self.arrays
        spans = {kernels.BORDER: (int(a["border_first"][0]), int(a["border_walls"][0]))}
        for number in range(int(a["polygon_count"][0])):
            spans[number] = int(a["polygon_first"][number]), int(a["polygon_walls"][number])
        corners = a["corner"].reshape(-1, 2)
        walls = np.hstack([corners, corners[a["wall_next"]]])
        return {number: cut_into_rings(walls[first : first + count]) for number, (first, count) in spans.items()}


"""Numbers that a processor fetches from memory together: two cache lines of 64 bytes."""


def aligned_zeros(rows: int, width: int, kind: type[Any]) -> NDArray[Any]:
    """Zeros (rows, width) of eight bytes each that begin where the processor begins to fetch; so does each row."""
    room = np.zeros(rows * width + kernels.ALIGNED, dtype=kind)
    begin = -(room.ctypes.data // room.itemsize) % kernels.ALIGNED
    return room[begin : begin + rows * width].reshape(rows, width)


def region_table(regions: Sequence[WeightedRegion]) -> F64:
    """Weighted regions as the kernels read them, see kernels.REGION_HEAD: all in one row of numbers."""
    parts = [np.zeros(0)]
    for region in regions:
        if region.polygon is None:
            assert region.circle is not None
            parts.append(np.array([region.factor, *region.circle, 0.0]))
            continue
        rings = [np.array(ring) for ring in (region.polygon.shell, *region.polygon.holes)]
        edges = np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])
        centre = 0.5 * (rings[0].min(axis=0) + rings[0].max(axis=0))
        # Each corner lies in the disc, whatever the rounding.
        radius = np.hypot(*(rings[0] - centre).T).max() * (1.0 + SAME_POINT)
        parts.append(np.concatenate([[region.factor, *centre, radius, len(edges)], edges.ravel()]))
    return np.concatenate(parts)


def world_span(scenario: Scenario) -> float:
    """Length of the diagonal of the bounds [m]: no distance in the world is longer."""
    xmin, ymin, xmax, ymax = scenario.world.box
    return math.hypot(xmax - xmin, ymax - ymin)


def beam_angles(scenario: Scenario) -> F64:
    """Angle of each beam (B,) from the robot's heading [rad], counter-clockwise.

    All round, beam i points at 2 pi i / B; over a narrower field of view the beams spread evenly from -fov/2 to fov/2,
    both included (a single beam looks ahead).
    """
    beams, fov = scenario.lidar.beams, scenario.lidar.fov
    if scenario.lidar.is_full_circle:
        return 2.0 * np.pi * np.arange(beams) / beams
    return np.linspace(-0.5 * fov, 0.5 * fov, beams) if beams > 1 else np.zeros(1)
