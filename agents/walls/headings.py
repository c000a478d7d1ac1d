"""Turning away from a wall: the first heading along which a step is open, and the way through gaps just too narrow.

One rule for straight walls, convex and concave corners, dead ends and thin walls: see Boundary.follow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bug_gym.agents.scan import headings
from bug_gym.geometry import wrap
from bug_gym.view import View

TRIED = math.radians(3.0)
"""Angle between the headings that boundary following tries [rad]; the first open one is refined."""

OUTWARD = math.radians(45.0)
"""How far from the wall's side a robot looks for the middle of a narrow gap [rad]."""

TURNED_ASIDE = math.radians(60.0)
"""Change of direction of a corner, or of a gap that is just too narrow: through a gap the way goes on [rad]."""

TURNED_BACK = math.radians(105.0)
"""Change of direction beyond that of a right-angled corner: it may be a gap that is just too narrow [rad]."""


@dataclass(frozen=True)
class OpenHeadings:
    """How a robot with the hand on a wall finds where to go next."""

    step: float
    """The way of one step [m]."""
    clearance: float
    """Distance to a wall at which a step is to end [m]."""
    inner: float
    """Half the width down to which a gap counts as one [m]."""
    safe_radius: float
    """Of the disc that must be able to go there [m]."""
    leave_length: float
    """Free way beyond a gap that shows it for one [m]."""

    def first(self, view: View, wall_bearing: float, side: int, travel: float) -> float | None:
        """First heading away from the wall along which a step ends on the contour; None: boxed in.

        A gap narrower than twice the clearance would turn the robot back by the noise of a range; it goes on through
        the middle where the gap is wider than twice `inner`.
        """
        turned = self._turn_from(view, wall_bearing, side, self.clearance)
        if turned is None or abs(wrap(turned - travel)) > TURNED_ASIDE:
            inner = self._turn_from(view, wall_bearing, side, self.inner)
            if inner is not None and self._is_gap(view, travel, turned, inner, side):
                angles = self._through(inner, side)
                gaps = [headings.gap_after_step(*view.points, angle, self.step) for angle in angles]
                return float(angles[max(range(9), key=gaps.__getitem__)])
        if turned is None:
            # Nearer to things than the contour, by more than a step: any step that gains distance will do.
            nearest, _ = view.nearest()
            turned = self._turn_from(view, wall_bearing, side, nearest + 0.5 * self.step)
            if turned is None:
                # In the wide place of a blind gap: back out as it came in.
                turned = self._turn_from(view, wall_bearing, side, self.inner)
            if turned is None:
                turned = self._widest_heading(view, wall_bearing, side, nearest)
        return turned

    def back(self, view: View, travel: float) -> float | None:
        """Heading back along which it came, out of the widest place of a blind gap: every way out of that is narrower."""
        backward = travel + math.pi
        return backward if view.free_distance(backward, self.safe_radius) >= self.step else None

    def _through(self, inner: float, side: int) -> list[float]:
        """Bearings among which that of the middle of a narrow gap is, from the first open one on [rad]."""
        return [inner + side * share * OUTWARD / 8.0 for share in range(9)]

    def _is_gap(self, view: View, travel: float, turned: float | None, inner: float, side: int) -> bool:
        """Whether a gap that is just too narrow, and no corner, turns the robot away from the bearing `inner`."""
        if abs(wrap(inner - travel)) >= 0.5 * math.pi:
            return False
        if turned is None or abs(wrap(turned - travel)) > TURNED_BACK:
            return True
        if abs(wrap(turned - inner)) <= TURNED_ASIDE:
            return False
        return any(view.free_distance(way, self.safe_radius) >= self.leave_length for way in self._through(inner, side))

    def _widest_heading(self, view: View, wall_bearing: float, side: int, nearest: float) -> float | None:
        """Bearing along which a step ends furthest from everything; None: no further than `nearest` [m], here.

        Out of a gap that narrows by so little that no single step gains much.
        """
        x, y = view.points
        bearings = wall_bearing + side * np.arange(0.0, 2.0 * math.pi, TRIED)
        is_open = view.free_distances(bearings, self.safe_radius) >= self.step
        gaps = [headings.gap_after_step(x, y, bearing, self.step) for bearing in bearings]
        index = int(np.where(is_open, gaps, 0.0).argmax())
        return float(bearings[index]) if is_open[index] and gaps[index] > nearest else None

    def _turn_from(self, view: View, wall_bearing: float, side: int, clearance: float) -> float | None:
        """First bearing, turning away from the wall, along which a step ends at a clearance [m]; None: none does."""
        x, y = view.points
        turned = headings.first_open_heading(x, y, wall_bearing, side, self.step, clearance, self.safe_radius, TRIED)
        return None if turned < 0.0 else float(wall_bearing + side * turned)
