"""A brush: colours, and lines, discs and words in metres of the world."""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bug_gym.checks import install_command

if TYPE_CHECKING:
    import pygame


Color = tuple[int, int, int]
Pixel = tuple[float, float]


PAGE: Color = (255, 255, 255)
FLOOR: Color = (250, 250, 247)
INK: Color = (45, 52, 64)
FAINT: Color = (138, 145, 156)
GOAL: Color = (28, 150, 92)
GROUND: Color = (139, 94, 44)  # of a region that can hardly be crossed
KEY: Color = (255, 0, 255)  # stands for "nothing here" on the surface of still things

ROBOTS: tuple[Color, ...] = (
    (32, 96, 200),
    (193, 42, 120),
    (16, 140, 150),
    (120, 72, 190),
    (150, 110, 20),
    (70, 110, 50),
)
"""Colours of the robots, in turn."""

OUTCOME_COLORS: dict[str, Color] = {
    "running": FAINT,
    "success": GOAL,
    "collision": (208, 44, 44),
    "timeout": (196, 128, 0),
    "ended": FAINT,
}

LABEL_COLORS: dict[str, Color] = {
    "hit": (208, 44, 44),
    "leave": (28, 150, 92),
    "candidate": (16, 120, 160),
    "attraction": (26, 148, 82),
    "repulsion": (208, 44, 44),
    "force": (32, 36, 48),
    "target": (193, 42, 120),
    "waypoint": (16, 140, 150),
    "nearest": (196, 128, 0),
    "m_line": (120, 120, 130),
    "list": (120, 120, 130),
    "path": (120, 72, 190),
    "plan": (120, 72, 190),
    "light": (245, 205, 60),
    "shadow": (70, 80, 110),
    "cheap": (28, 150, 92),
    "dear": (208, 44, 44),
    "closed": (120, 120, 130),
    "chosen": (32, 36, 48),
    "way": (120, 72, 190),
    "forecast": (193, 42, 120),
    "to_goal": (208, 44, 44),
    "open_point": (196, 128, 0),
    "virtual": (193, 42, 120),
}
"""Colours of the labels in a policy's Drawing; other labels take one of the robots' colours, always the same."""

DASHED = {"m_line"}
"""Labels whose segments are drawn dashed."""

AREA_SHARE = 0.3
"""How much of its label's colour an area has."""

SQUARE = ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9))
TRIANGLE = ((0.0, -1.25), (1.15, 0.85), (-1.15, 0.85))
DIAMOND = ((-1.3, 0.0), (0.0, -1.3), (1.3, 0.0), (0.0, 1.3))
MARKS: dict[str, tuple[Pixel, ...]] = {
    "hit": SQUARE,
    "dear": SQUARE,
    "leave": TRIANGLE,
    "cheap": TRIANGLE,
    "chosen": DIAMOND,
    "closed": DIAMOND,
    "target": DIAMOND,
    "nearest": TRIANGLE,
}
"""Corners of the marks of labels, so that no colour is needed to tell them apart; the points of others are discs."""


def mixed(color: Color, ground: Color, share: float) -> Color:
    """A colour laid over a ground, with this share of its own."""
    red, green, blue = (round(share * c + (1.0 - share) * g) for c, g in zip(color, ground, strict=True))
    return red, green, blue


def label_color(label: str) -> Color:
    """The colour of a label in a Drawing."""
    return LABEL_COLORS.get(label) or ROBOTS[zlib.crc32(label.encode()) % len(ROBOTS)]


def load_pygame() -> ModuleType:
    """Import pygame, without its greeting.

    Raises:
        ImportError: it is not installed; the message names the extra.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
        import pygame.font
        import pygame.surfarray
    except ImportError as error:
        raise ImportError(f"drawing needs pygame-ce: {install_command('render')}") from error
    return pygame


@dataclass(frozen=True)
class Projection:
    """From places in the world [m] to pixels: x to the right, y up."""

    scale: float
    """Pixels a metre."""
    left: float
    """Column of x = 0."""
    top: float
    """Row of y = 0."""

    def pixel(self, x: float, y: float) -> Pixel:
        """Column and row of a place."""
        return self.left + self.scale * x, self.top - self.scale * y

    def place(self, column: float, row: float) -> tuple[float, float]:
        """The place x, y [m] at a pixel."""
        return (column - self.left) / self.scale, (self.top - row) / self.scale

    def pixels(self, places: NDArray[np.float64]) -> list[Pixel]:
        """Columns and rows of places (k, 2)."""
        columns = self.left + self.scale * places[:, 0]
        rows = self.top - self.scale * places[:, 1]
        return list(zip(columns.tolist(), rows.tolist(), strict=True))

    def enlarged(self, factor: int) -> Projection:
        """The same view with `factor` times as many pixels along each side."""
        return Projection(factor * self.scale, factor * self.left, factor * self.top)


class Brush:
    """Paints shapes on a surface.

    Args:
        surface: what to paint on.
        view: where places of the world are on it.
        unit: width of a fine line [pixels].
    """

    def __init__(self, surface: pygame.Surface, view: Projection, unit: float) -> None:
        self.pygame = load_pygame()
        self.surface = surface
        self.view = view
        self.unit = unit

    def width(self, units: float) -> int:
        """Units as whole pixels, at least one."""
        return max(1, round(units * self.unit))

    def disc(self, at: Pixel, radius: float, color: Color, rim: Color | None = None, rim_units: float = 1.0) -> None:
        """A filled circle, with a rim inside its edge."""
        self.discs([at], [radius], color, rim, rim_units)

    def discs(
        self,
        centers: Sequence[Pixel],
        radii: Sequence[float],
        color: Color,
        rim: Color | None = None,
        rim_units: float = 1.0,
    ) -> None:
        """Filled circles, with a rim inside their edges; each is at least a dot."""
        surface, circle, width = self.surface, self.pygame.draw.circle, self.width(rim_units)
        for at, radius in zip(centers, radii, strict=True):
            if rim is None:
                circle(surface, color, at, max(radius, 1.0))
            else:
                circle(surface, rim, at, max(radius, 1.0))
                circle(surface, color, at, max(radius - width, 1.0))

    def mark(self, at: Pixel, label: str, radius: float) -> None:
        """The mark of a label's points, with a light edge."""
        for size, color in ((radius + self.unit, PAGE), (radius, label_color(label))):
            if label in MARKS:
                corners = [(at[0] + size * column, at[1] + size * line) for column, line in MARKS[label]]
                self.pygame.draw.polygon(self.surface, color, corners)
            else:
                self.disc(at, size, color)

    def ring(self, at: Pixel, radius: float, color: Color, units: float) -> None:
        """A circle that is not filled."""
        self.pygame.draw.circle(self.surface, color, at, radius, self.width(units))

    def area(self, pixels: Sequence[Pixel], color: Color, rim: Color | None = None, rim_units: float = 1.0) -> None:
        """A filled polygon, with a rim along its edge."""
        self.pygame.draw.polygon(self.surface, color, pixels)
        if rim is not None:
            self.line([*pixels, pixels[0]], rim, rim_units)

    def line(self, pixels: Sequence[Pixel], color: Color, units: float) -> None:
        """A line through pixels, round at its corners where it is wide."""
        width = self.width(units)
        self.pygame.draw.lines(self.surface, color, False, pixels, width)
        if width > 3:
            for at in pixels:
                self.pygame.draw.circle(self.surface, color, at, 0.5 * width)

    def veil(self, pixels: Sequence[Pixel], tint: Color) -> None:
        """A filled polygon of coloured glass: what lies beneath it is multiplied by the tint."""
        self.veils([pixels], tint)

    def veils(self, rings: Sequence[Sequence[Pixel]], tint: Color) -> None:
        """Polygons cut out of one pane of coloured glass: where they overlap it is as light as elsewhere."""
        shapes = [np.array(ring) for ring in rings if len(ring) >= 3]
        if not shapes:
            return
        corners = np.concatenate(shapes)
        low = np.maximum(np.floor(corners.min(axis=0)), 0.0).astype(int)
        high = np.minimum(np.ceil(corners.max(axis=0)) + 1.0, self.surface.get_size()).astype(int)
        if (high <= low).any():
            return
        glass = self.pygame.Surface((high - low).tolist(), 0, 32)
        glass.fill(PAGE)
        for shape in shapes:
            self.pygame.draw.polygon(glass, tint, (shape - low).tolist())
        self.surface.blit(glass, low.tolist(), special_flags=self.pygame.BLEND_RGB_MULT)

    def dashes(self, start: Pixel, end: Pixel, color: Color, units: float) -> None:
        """A dashed line."""
        length, dash = math.dist(start, end), 5.0 * self.unit
        count = max(1, math.ceil(length / (2.0 * dash)))
        for number in range(count):
            first = min(2.0 * number * dash / max(length, 1e-9), 1.0)
            last = min((2.0 * number + 1.0) * dash / max(length, 1e-9), 1.0)
            self.line([between(start, end, first), between(start, end, last)], color, units)


def between(start: Pixel, end: Pixel, share: float) -> Pixel:
    """The pixel at a share of the way."""
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
