"""Wall following by an expected direction: that of the repulsion by the nearest wall, turned by alpha.

Source: the paper on potential field and wall following, its wall-following mode and Fig. 6. With the wall on the right the
expected direction is theta_rep - alpha, theta_rep from the nearest point of the wall to the robot: 90 degrees goes along
it, 92 leans to it. Ours: alpha grows with the distance beyond the clearance; and where a step along the expected direction
would not end on the contour, in a concave corner, the heading turns further away until one does.
"""

from __future__ import annotations

import math

from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.contour import BugMemory, Contour
from bug_gym.agents.walls.headings import OpenHeadings
from bug_gym.policy import Velocity
from bug_gym.view import View

MOST = math.radians(30.0)
"""How far the distance to the wall may change alpha [rad]."""


def expected_bearing(wall: float, distance: float, side: int, *, alpha: float, gain: float, clearance: float) -> float:
    """theta_exp, the bearing to go along, not wrapped: turned away from the wall's by the rest of alpha [rad].

    Args:
        wall: bearing of the nearest point of the wall [rad]; the repulsion points the other way.
        distance: to that point [m].
        side: +1 with the wall on the right, -1 on the left.
        alpha: angle between repulsion and expected direction at the clearance [rad].
        gain: by how much more a metre beyond the clearance makes it [rad/m].
        clearance: distance to keep [m].
    """
    lean = min(max(gain * (distance - clearance), -MOST), MOST)
    return wall + side * (math.pi - alpha - lean)


class WallFollower:
    """Follows walls by their expected direction, with the hand and the tests of `Boundary`.

    Args:
        boundary: how the robot goes to walls and away from them.
        alpha: angle between the repulsion and the expected direction [rad].
        gain: change of alpha with the distance beyond the clearance [rad/m].
    """

    def __init__(self, boundary: Boundary, *, alpha: float, gain: float) -> None:
        self.boundary = boundary
        self.alpha, self.gain = alpha, gain
        # A little inside the clearance: with alpha above 90 degrees the robot settles there.
        self.headings = OpenHeadings(
            step=boundary.step,
            clearance=0.5 * (boundary.clearance + boundary.inner),
            inner=boundary.inner,
            safe_radius=boundary.safe_radius,
            leave_length=boundary.leave_length,
        )

    def first_heading(self, view: View, contour: Contour, wall: float, travel: float) -> float | None:
        """theta_exp of the wall that the hand is on, or the first heading beyond it whose step ends on the contour."""
        expected = expected_bearing(
            wall,
            math.dist(contour.wall, view.position),
            contour.side,
            alpha=self.alpha,
            gain=self.gain,
            clearance=self.boundary.clearance,
        )
        return self.headings.first(view, expected, contour.side, travel)

    def follow(self, view: View, memory: BugMemory) -> Velocity:
        """Velocity of one step along the wall; a robot without any open heading waits as `Boundary.follow` tells."""
        return self.boundary.follow(view, memory, self.first_heading)
