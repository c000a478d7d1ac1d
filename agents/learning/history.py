"""A memory for learned policies: what has changed since some steps ago, with the robot's own motion taken out.

Each point of the present scan is put into the frame of an earlier scan, and the earlier range along that bearing is
compared with the point's distance. A still world leaves nothing; what is left is the speed at which obstacles come up
(positive) or draw back (negative) along each beam. The same is done with the goal. The same code runs in training and
in play.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.geometry import F32
from bug_gym.policy import checked_starts
from bug_gym.schema.errors import shortened
from bug_gym.schema.values import AtLeastOne

Bools = NDArray[np.bool_]

TOP_SPEED = 2.0
"""Speeds are cut to this [m/s]."""
MOST_STEPS = 1000
"""Steps that a history may look back: it keeps a scan of each robot for every one of them."""
Lag = Annotated[AtLeastOne, Field(le=MOST_STEPS)]
"""How many steps ago a History looks."""
Lags = Annotated[tuple[Lag, ...], Field(max_length=100)]
"""Of one History."""


def history_width(robot: RobotModel, lags: Sequence[int]) -> int:
    """How many numbers `History.add` gives a row."""
    return len(lags) * (robot.beams + 2)


class History:
    """The last scans of n robots.

    Args:
        robot: the robots, all alike.
        lags: how many steps ago are looked at, each at least 1.
        rows: how many robots, n.

    Raises:
        ValueError: a lag that is not from 1 to MOST_STEPS, or a scanner that does not look all around.
    """

    def __init__(self, robot: RobotModel, lags: Sequence[int], rows: int) -> None:
        if not 1 <= min(lags) <= max(lags) <= MOST_STEPS:
            raise ValueError(f"lags are at least 1 step and at most {MOST_STEPS}, got {list(lags)}")
        if not robot.is_full_circle:
            raise ValueError("a history needs a scanner that looks all around")
        self.robot, self.lags = robot, tuple(lags)
        angles = robot.first_angle + robot.angle_step * np.arange(robot.beams)
        self._cos, self._sin = np.cos(angles).astype(np.float32), np.sin(angles).astype(np.float32)
        self._past: F32 = np.zeros((max(lags), rows, robot.beams + 5), dtype=np.float32)
        self._next = 0

    @property
    def rows(self) -> int:
        """How many robots, n."""
        return int(self._past.shape[1])

    def add(self, flat: F32, starts: Bools) -> F32:
        """Take the present observations in, and tell what has changed.

        Args:
            flat: flat observations (n, D).
            starts: (n,) True where an episode begins: nothing has changed there.

        Returns:
            (n, lags * (B + 2)): for each lag the speed along each beam [m/s], then the goal's velocity in the robot's
            frame [m/s], within +-TOP_SPEED.
        """
        now = flat[:, : self.robot.beams + 5]
        self._past[:, starts] = now[starts]
        length = len(self._past)
        found = [self._change(now, self._past[(self._next - lag) % length], lag) for lag in self.lags]
        self._past[self._next] = now
        self._next = (self._next + 1) % length
        return np.concatenate(found, axis=1)

    def peek(self, flat: F32, rows: NDArray[np.int64]) -> F32:
        """What `add` would give for some rows (k,) with observations (k, D), without taking them in."""
        now = flat[:, : self.robot.beams + 5]
        length = len(self._past)
        found = [self._change(now, self._past[(self._next - lag) % length][rows], lag) for lag in self.lags]
        return np.concatenate(found, axis=1)

    def _change(self, now: F32, past: F32, lag: int) -> F32:
        beams, duration = self.robot.beams, np.float32(lag * self.robot.step)
        turn, shift = _motion(past[:, beams + 2 :], now[:, beams + 2 :])
        cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
        x, y = self._cos * now[:, :beams], self._sin * now[:, :beams]
        # The present points in the frame of the earlier scan.
        x, y = cos * x - sin * y + shift[:, :1], sin * x + cos * y + shift[:, 1:]
        distance = np.minimum(np.hypot(x, y), np.float32(self.robot.range))
        place = (np.arctan2(y, x) - self.robot.first_angle) / self.robot.angle_step
        before = np.floor(place)
        share = (place - before).astype(np.float32)
        index = before.astype(np.int64) % beams
        earlier = np.take_along_axis(past[:, :beams], index, axis=1)
        earlier += share * (np.take_along_axis(past[:, :beams], (index + 1) % beams, axis=1) - earlier)
        goal, old_goal = now[:, beams : beams + 2], past[:, beams : beams + 2]
        # The goal's way since then, in the present frame.
        gone_x, gone_y = old_goal[:, :1] - shift[:, :1], old_goal[:, 1:] - shift[:, 1:]
        moved = goal - np.concatenate([cos * gone_x + sin * gone_y, cos * gone_y - sin * gone_x], axis=1)
        change = np.concatenate([earlier - distance, moved], axis=1) / duration
        return np.clip(change, -TOP_SPEED, TOP_SPEED).astype(np.float32)

    def save(self) -> dict[str, Any]:
        """A copy of what it remembers."""
        return {"past": self._past.copy(), "next": self._next}

    def restore(self, saved: dict[str, Any]) -> None:
        """Go back to what `save` gave.

        Raises:
            ValueError: it is of other robots, or of another number of them.
        """
        if np.shape(saved["past"]) != self._past.shape:
            raise ValueError(f"got memories of shape {np.shape(saved['past'])}, expected {self._past.shape}")
        self._past[:] = saved["past"]
        self._next = saved["next"]


def with_history(
    flat: F32,
    state: tuple[History, ...] | None,
    episode_start: Bools | None,
    *,
    robot: RobotModel,
    lags: Sequence[int],
) -> tuple[F32, tuple[History, ...] | None]:
    """What a policy with a memory sees: observations followed by what its History tells.

    Args:
        flat: flat observations (n, D).
        state: (History,) as the last call returned it; None: nothing is remembered.
        episode_start: (n,) True where an episode begins; None: nowhere.
        robot: the robots.
        lags: of the History; empty: the policy has none, and sees the observations as they are.

    Returns:
        What it sees (n, ...), and the state, changed in place.

    Raises:
        ValueError: the state is of another policy or number of robots, or `episode_start` of another length.
    """
    rows = len(flat)
    starts = np.zeros(rows, dtype=bool) if episode_start is None else checked_starts(episode_start, rows)
    if not lags:
        return flat, state
    (history,) = (History(robot, lags, rows),) if state is None else _checked_memory(state)
    if history.rows != rows:
        raise ValueError(f"got the memory of {history.rows} robots for {rows} observations")
    if (history.robot, history.lags) != (robot, tuple(lags)):
        raise ValueError("got the memory of another policy's robot")
    told = history.add(flat, np.ones(rows, dtype=bool) if state is None else starts)
    return np.concatenate([flat, told], axis=1), (history,)


def _checked_memory(state: Any) -> tuple[History]:
    if not (isinstance(state, tuple) and len(state) == 1 and isinstance(state[0], History)):
        raise ValueError(f"expected the memory that the last call returned, got {shortened(state)}")
    return state


def _motion(before: F32, after: F32) -> tuple[F32, F32]:
    """The robots' turn (n,) [rad] and way (n, 2) [m] from pose to pose (n, 3), in the frame of the earlier one."""
    heading = before[:, 2]
    cos, sin = np.cos(heading), np.sin(heading)
    dx, dy = after[:, 0] - before[:, 0], after[:, 1] - before[:, 1]
    return after[:, 2] - heading, np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=1)
