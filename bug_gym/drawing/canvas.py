"""Pictures of a world: a row of a Simulation as it is now. Reads only.

A frame is painted at PAINT times its size on surfaces in memory and averaged down: edges come out smooth, and no
display is needed. What does not move is painted once an episode.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bug_gym.drawing import pixels
from bug_gym.drawing.brush import (
    FAINT,
    FLOOR,
    INK,
    KEY,
    OUTCOME_COLORS,
    PAGE,
    ROBOTS,
    Brush,
    Color,
    Pixel,
    Projection,
    load_pygame,
    mixed,
)
from bug_gym.drawing.clips import Frame
from bug_gym.drawing.parts import (
    Sample,
    Sprites,
    goal_color,
    mover_sprites,
    outlines_of,
    paint_areas,
    paint_around,
    paint_free_area,
    paint_goal_areas,
    paint_goals,
    paint_ground,
    paint_movers,
    paint_points,
    paint_returns,
    paint_robot,
    paint_sample,
    paint_segments,
    paint_still,
    paint_trail,
    samples_of,
    scan_ends,
)
from bug_gym.limits import told_bytes
from bug_gym.policy import Drawing
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES

if TYPE_CHECKING:
    import pygame

logger = logging.getLogger("bug_gym")

PAINT = 2
"""Pixels that are painted for one of the frame, along each side; `pixels.halve` averages them."""
FLAT = 48.0
"""Units of a frame's height that a world has at least, however flat it is: a flag within it stays below the caption."""
LARGEST, PIXEL_BYTES = 5_000, 50
"""Longest side of a frame [pixels], and what one of its pixels takes while it is painted: three surfaces, and the frame."""


class Canvas:
    """Draws one row of a Simulation.

    It also remembers the poses that it has seen in this episode: each `draw` and each `record` adds the present ones to
    the path that is drawn. The path begins anew when the row's seed or episode changes or its time goes back.

    Args:
        simulation: the worlds.
        size: longer side of the frame [pixels]; the bounds keep their proportions.
        row: which world.
        title: put before the scenario's name in the caption, such as the policy's name.
        box: what is shown: xmin, ymin, xmax, ymax [m]; None: all of the world.

    Raises:
        ImportError: pygame-ce is not installed.
        ValueError: a size below 100 pixels or above LARGEST, or no such row.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        size: int = 600,
        row: int = 0,
        title: str = "",
        box: tuple[float, float, float, float] | None = None,
    ) -> None:
        load_pygame()
        if size < 100:
            raise ValueError(f"size must be at least 100 pixels, got {size}")
        if size > LARGEST:
            memory = told_bytes(PIXEL_BYTES * size * size)
            raise ValueError(f"size must be at most {LARGEST:,} pixels, got {size}: a picture would take {memory}")
        if not 0 <= row < simulation.count:
            raise ValueError(f"row must be from 0 to {simulation.count - 1}, got {row}")
        self.simulation = simulation
        self.row = row
        self.title = title
        self.unit = size / 600.0
        self.box = box
        xmin, ymin, xmax, ymax = box or simulation.scenario.world.box
        margin = 24.0 * max(self.unit, 0.8)
        scale = (size - 2.0 * margin) / max(xmax - xmin, ymax - ymin)
        # Even sides, because video codecs want them; wide enough for the caption, high enough for a flag below it.
        self.width = max(even(scale * (xmax - xmin) + 2.0 * margin), even(0.4 * size))
        self.height = max(even(scale * (ymax - ymin) + 2.0 * margin), even(FLAT * self.unit + 2.0 * margin))
        self.margin = margin
        self.view = Projection(
            scale, 0.5 * self.width - scale * 0.5 * (xmin + xmax), 0.5 * self.height + scale * 0.5 * (ymin + ymax)
        )
        self._trails: list[list[Pixel]] = [[] for _ in range(simulation.robots)]
        self._goal_trails: list[list[Pixel]] = [[] for _ in range(simulation.world.goals)]
        self._recorded = (-1, -1, -1)
        self._still: pygame.Surface | None = None
        self._sprites: Sprites | None = None
        self._painted_of: tuple[bytes, ...] = ()
        self._ground: pygame.Surface | None = None
        self._large: pygame.Surface | None = None
        self._font: pygame.font.Font | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Surfaces can't be pickled; they are painted anew."""
        none = dict.fromkeys(("_still", "_sprites", "_ground", "_large", "_font"))
        return {**self.__dict__, **none, "_painted_of": ()}

    # ------------------------------------------------------------------------------------------ the path so far

    def record(self) -> None:
        """Add the present poses to the path that `draw` shows."""
        world, row = self.simulation.world, self.row
        present = (int(world.seed[row]), int(world.episode[row]), int(world.steps[row]))
        if present[:2] != self._recorded[:2] or present[2] < self._recorded[2] or present[2] == 0:
            self._clear()
        elif present == self._recorded:
            return
        places = [*world.pose[row].tolist(), *world.goal[row, : world.goals].tolist()]
        view = self.view.enlarged(PAINT)
        for trail, (x, y, *_) in zip([*self._trails, *self._goal_trails], places, strict=True):
            pixel = view.pixel(x, y)
            if not trail or trail[-1] != pixel:
                trail.append(pixel)
        self._recorded = present

    def _clear(self) -> None:
        for trail in (*self._trails, *self._goal_trails):
            trail.clear()

    # ------------------------------------------------------------------------------------------ drawing

    def draw(
        self,
        drawing: Drawing | Sequence[Drawing | None] | None = None,
        *,
        trail: bool = True,
        scan: bool = True,
        note: str = "",
        states: Sequence[str] = (),
    ) -> Frame:
        """The row as it is now.

        Args:
            drawing: what a policy adds, in the frame of its robot's start; a sequence has one for each robot.
            trail: whether to draw the path so far.
            scan: whether to draw the LIDAR's scan.
            note: put behind the outcome, such as a policy's verdict.
            states: written beside robots that are under way, one a robot, such as the state of its policy.

        Returns:
            RGB pixels (H, W, 3) uint8, a fresh array.

        Raises:
            ValueError: the row has not been reset yet, or a drawing for another number of robots or with places that
                are not finite.
        """
        world, row = self.simulation.world, self.row
        if world.wall_count[row] == 0:
            raise ValueError(f"row {row} holds no world yet: reset the simulation before drawing")
        drawings = self._drawings(drawing)
        self.record()
        floor = self._floor()
        brush = self._brush(floor)
        scans = {robot: scan_ends(brush.view, world, row, robot) for robot in range(world.robots) if scan}
        for robot, ends in scans.items():
            paint_free_area(brush, world, row, robot, ends, floor)
        if self.simulation.scenario.world.regions:
            brush.surface.blit(self._ground_surface(), (0, 0), special_flags=brush.pygame.BLEND_RGB_MULT)
        origins = world.array("origin")[row].reshape(world.robots, 3)
        for robot, item in drawings.items():
            paint_areas(brush, item, origins[robot])
        paint_goal_areas(brush, world, row, floor)
        still, sprites = self._episode_surfaces()
        brush.surface.blit(still, (0, 0))
        paint_movers(brush, world, row, sprites)
        for robot, ends in scans.items():
            paint_returns(brush, world, row, robot, ends)
        for robot, item in drawings.items():
            paint_segments(brush, item, origins[robot])
        if trail:
            self._paint_trails(brush)
        for robot, item in drawings.items():
            paint_points(brush, item, origins[robot])
        paint_goals(brush, world, row)
        for robot in range(world.robots):
            paint_robot(brush, world, row, robot)
        if self.box is not None:
            paint_around(brush, self.box)
        return self._finish(brush.surface, samples_of(drawings.values()), note, states)

    def _drawings(self, drawing: Drawing | Sequence[Drawing | None] | None) -> dict[int, Drawing]:
        """Drawings by robot."""
        if drawing is None or isinstance(drawing, Drawing):
            drawing = [drawing]
        if len(drawing) > self.simulation.robots:
            raise ValueError(f"got {len(drawing)} drawings for {self.simulation.robots} robots")
        return {robot: item for robot, item in enumerate(drawing) if item is not None}

    def _outcome(self) -> str:
        """The outcome of all robots: the worst of them, running while one is; of a mission that the first one ends, its."""
        names = {OUTCOMES[code] for code in self.simulation.world.outcome[self.row].tolist()}
        return next(name for name in ("running", "collision", "timeout", "success") if name in names)

    def _floor(self) -> Color:
        outcome = self._outcome()
        return FLOOR if outcome == "running" else mixed(OUTCOME_COLORS[outcome], FLOOR, 0.09)

    def _brush(self, floor: Color) -> Brush:
        """A brush on the large surface, which is all floor."""
        if self._large is None:
            self._large = self._surface()
        self._large.fill(floor)
        return self._brush_on(self._large)

    def _surface(self) -> pygame.Surface:
        surface: pygame.Surface = load_pygame().Surface((PAINT * self.width, PAINT * self.height), 0, 32)
        return surface

    def _brush_on(self, surface: pygame.Surface) -> Brush:
        return Brush(surface, self.view.enlarged(PAINT), PAINT * self.unit)

    def _ground_surface(self) -> pygame.Surface:
        """The weighted regions, painted when they are first asked for."""
        if self._ground is None:
            self._ground = self._surface()
            paint_ground(self._brush_on(self._ground), self.simulation.scenario.world.regions)
        return self._ground

    def _episode_surfaces(self) -> tuple[pygame.Surface, Sprites]:
        """Page, border and still obstacles of this episode, and its movers, painted when they are first asked for."""
        world, row = self.simulation.world, self.row
        bodies = outlines_of(world, row)
        if self._still is None or self._sprites is None or bodies != self._painted_of:
            self._still = self._surface()
            brush = self._brush_on(self._still)
            paint_still(brush, world, row)
            self._still.set_colorkey(KEY, load_pygame().RLEACCEL)
            self._sprites = mover_sprites(brush, world, row)
            self._painted_of = bodies
        return self._still, self._sprites

    def _paint_trails(self, brush: Brush) -> None:
        world = self.simulation.world
        for goal, trail in enumerate(self._goal_trails):
            paint_trail(brush, trail, mixed(goal_color(world, goal), FLOOR, 0.5))
        for robot, trail in enumerate(self._trails):
            color = ROBOTS[robot % len(ROBOTS)]
            paint_trail(brush, trail, color)
            x, y, _ = world.array("origin")[self.row, 3 * robot : 3 * robot + 3].tolist()
            brush.disc(brush.view.pixel(x, y), 4.0 * brush.unit, PAGE, color, 1.75)

    # ------------------------------------------------------------------------------------------ text

    def _finish(self, large: pygame.Surface, samples: Sequence[Sample], note: str, states: Sequence[str] = ()) -> Frame:
        """Average the large surface down, write around it and read the pixels."""
        small = load_pygame().Surface((self.width, self.height), 0, 32)
        pixels.halve(packed(large), packed(small))
        self._write_states(small, states)
        self._write_caption(small, note)
        self._write_legend(small, samples)
        frame = np.empty((self.height, self.width, 3), dtype=np.uint8)
        pixels.unpack(packed(small), frame)
        return frame

    def _write_caption(self, small: pygame.Surface, note: str) -> None:
        """Above the world: whose episode it is on the left; time, outcome and note on the right."""
        world, row, outcome = self.simulation.world, self.row, self._outcome()
        names = [*filter(None, [self.title, self.simulation.scenario.name]), f"seed {world.seed[row]}"]
        colour, room = INK if outcome == "running" else OUTCOME_COLORS[outcome], self.width - 2.0 * self.margin
        state = [*filter(None, [f"{world.time[row]:.1f} s", outcome if outcome != "running" else "", note])]
        right = self._text(" · ".join(state), colour)
        # Who it is comes before what it is about, and before the word for what the colour says.
        while len(state) > 1 and self._text(names[0], INK).get_width() + 0.5 * self.margin > room - right.get_width():
            state.pop()
            right = self._text(" · ".join(state), colour)
        free = max(0.0, room - right.get_width() - 0.5 * self.margin)
        left = self._text(" · ".join(names), INK)
        # On a narrow frame the last names give way, in the end a piece of the first.
        while left.get_width() > free and len(names) > 1:
            names.pop()
            left = self._text(" · ".join(names), INK)
        top = 0.5 * (self.margin - left.get_height())
        small.blit(left, (self.margin, top), (0, 0, free, left.get_height()))
        small.blit(right, (self.margin + room - right.get_width(), top))

    def _write_states(self, small: pygame.Surface, states: Sequence[str]) -> None:
        """Beside each robot that is under way: the first place around it where no other one's text is."""
        game, world = load_pygame(), self.simulation.world
        written: list[pygame.Rect] = []
        inner = game.Rect(self.margin, self.margin, self.width - 2.0 * self.margin, self.height - 2.0 * self.margin)
        off = max(world.own(self.row, "body_reach") * self.view.scale, 4.0 * self.unit) + 5.0 * self.unit
        for robot, state in enumerate(states):
            if not state or OUTCOMES[int(world.outcome[self.row, robot])] != "running":
                continue
            x, y = self.view.pixel(*world.pose[self.row, robot, :2].tolist())
            text = self._text(state, mixed(ROBOTS[robot % len(ROBOTS)], INK, 0.5))
            wide, high = text.get_size()
            middles = [
                (x + off + 0.5 * wide, y),
                (x - off - 0.5 * wide, y),
                (x, y - off - 0.5 * high),
                (x, y + off + 0.5 * high),
            ]
            places = [game.Rect(left - 0.5 * wide, top - 0.5 * high, wide, high) for left, top in middles]
            free = (one for one in places if inner.contains(one) and one.collidelist(written) < 0)
            if (place := next(free, None)) is not None:
                written.append(place)
                self._fade(small, tuple(place))
                small.blit(text, place)

    def _write_legend(self, small: pygame.Surface, samples: Sequence[Sample]) -> None:
        """Below the world: a bar for scale on the right, and the labels of a drawing; where they are many, over it too."""
        draw, column, middle = load_pygame().draw, self.margin, self.height - 0.5 * self.margin
        metres = round_length(0.15 * self.width / self.view.scale)
        text, right = self._text(f"{metres:g} m", FAINT), self.width - self.margin
        left = right - metres * self.view.scale
        draw.line(small, FAINT, (left, middle), (right, middle), max(1, round(2.0 * self.unit)))
        left -= text.get_width() + 0.25 * self.margin
        small.blit(text, (left, middle - 0.5 * text.get_height()))
        brush, width, height = Brush(small, self.view, self.unit), 0.75 * self.margin, 0.4 * self.margin
        bottom, room = True, left - 0.5 * width
        for sample in samples:
            text = self._text(sample.label.replace("_", " "), INK)
            long = 1.25 * width + text.get_width()
            if column + long > room and column > self.margin:
                bottom, column, middle, room = False, self.margin, middle - 0.9 * self.margin, right
            if not bottom:
                self._fade(
                    small, (column - 0.25 * width, middle - 0.45 * self.margin, long + 0.5 * width, 0.9 * self.margin)
                )
            paint_sample(brush, sample, column, middle, width, height)
            small.blit(text, (column + 1.25 * width, middle - 0.5 * text.get_height()))
            column += long + 0.5 * width

    def _fade(self, small: pygame.Surface, place: tuple[float, float, float, float]) -> None:
        """Make what is in a rectangle (left, top, width, height) pale, so that it can be written on."""
        game = load_pygame()
        area = game.Rect(*place)
        behind = game.Surface(area.size)
        behind.fill(PAGE)
        behind.set_alpha(170)
        small.blit(behind, area)

    def _text(self, text: str, color: Color) -> pygame.Surface:
        """Text on a surface of its own."""
        pygame = load_pygame()
        if self._font is not None:
            try:
                return self._font.render(text, True, color)
            except pygame.error:  # somebody called pygame.quit(), which takes all fonts along
                self._font = None
        pygame.font.init()
        self._font = pygame.font.Font(None, round(0.75 * self.margin))
        return self._font.render(text, True, color)


def packed(surface: pygame.Surface) -> pixels.Packed:
    """The pixels (H, W) of a surface of 32 bits, a view that keeps it locked while it lives."""
    view: pixels.Packed = load_pygame().surfarray.pixels2d(surface).T
    return view


def even(length: float) -> int:
    """The nearest even number of pixels."""
    return 2 * round(0.5 * length)


def round_length(length: float) -> float:
    """The largest of 1, 2, 5, 10, ... (and their tenths) that is at most a length [m]."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length)
