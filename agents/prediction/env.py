"""BugGym/Prediction-v0: say where a tracked mover will be. An episode is one answer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from bug_gym.agents.prediction.features import ANSWERS, WIDTH, cost_of, errors_of
from bug_gym.agents.prediction.samples import LAWS, Samples, law_world, samples_of
from bug_gym.checks import checked_options, checked_seed, real_numbers
from bug_gym.geometry import F32
from bug_gym.held_out import TRAINING_SEEDS

WORLDS = 2**39
"""How many worlds of each law it draws from."""


class PredictionEnv(gym.Env[F32, F32]):
    """A mover was tracked by a robot that drives among things; where will it be?

    ## Description
    A scripted robot drives through a world whose movers follow one of the motion laws, and tracks what it sees move
    (its LIDAR has noise, and the tracker its errors). Each episode asks about one track at one time. The agent sees
    the track, the robot's place and what is near the mover, and answers where the mover will be.

    ## Action Space
    `Box(-1, 1, (8,), float32)`: for each of the horizons 0.8, 1.6, 3.2 and 4.8 s by how much the mover's mean velocity
    until then differs from the velocity that the tracker's Kalman filter has, ahead and to the left of that velocity,
    over 1.5 m/s. All zero is the Kalman filter's prediction. What lies beyond the bounds is cut.

    ## Observation Space
    `Box(-3, 3, (80,), float32)`, all of it in the mover's frame (origin at its place, x along its velocity):

    | numbers | meaning |
    |---|---|
    | 0 - 5 | speed, deviations of place and velocity, radius, age, time unseen |
    | 6 - 23 | mean velocity since 0.2, 0.4, 0.6, 0.8, 1.1, 1.5, 2, 2.5 and 3 s ago, over 1.5 m/s |
    | 24 - 26 | direction of the robot, and how near it is |
    | 27 - 50 | how near the nearest other hit of the scan is in each of 24 sectors, counter-clockwise from ahead |
    | 51 - 57 | for what share of 4.8 s it could go on in seven directions, from ahead to 50 degrees to its sides |
    | 58 | how far to its left what it would touch first ahead lies, over its radius |
    | 59 - 61 | how the wall runs there: cosine and sine of twice its angle from the velocity, 1 |
    | 62 - 79 | the three nearest other movers: place over 4 m, nearness, velocity over 1.5 m/s, 1 |

    Nearness is 1 at contact and 0 from 4 m on.

    ## Rewards
    By how much the answer costs less than the Kalman filter's. A cost is the mean over the horizons of the distance of
    the predicted from the true place, over what it is for the Kalman filter on the average (0.2, 0.45, 1.1 and 1.9 m).

    ## Starting State
    Worlds of the laws in turn, drawn from the seed; all tracks of one world are asked in a drawn order before the next.

    ## Episode End
    Each episode ends with its first answer. `info` then holds `errors`, the distances [m] at the horizons,
    `kalman_errors`, those of the Kalman filter, and `law`.

    ## Arguments
    laws: the motion laws, of bounce, waypoints, random_walk, crowd and evade.

    Raises:
        ValueError: no law, or an unknown one.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, laws: Sequence[str] = LAWS) -> None:
        if not laws or (unknown := set(laws) - set(LAWS)):
            got = sorted(unknown) if laws else list(laws)
            raise ValueError(f"laws: got {got}, expected some of {', '.join(LAWS)}")
        self.laws = tuple(laws)
        self.observation_space = gym.spaces.Box(-3.0, 3.0, (WIDTH,), dtype=np.float32)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (ANSWERS,), dtype=np.float32)
        self._samples: Samples | None = None
        self._order: list[int] = []
        self._worlds = 0
        self._asked = -1

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[F32, dict[str, Any]]:
        """Ask about the next track.

        Raises:
            ValueError: a seed that is no integer from 0 on, options that are no dict, or any.
        """
        checked_options(options, ())
        super().reset(seed=None if seed is None else checked_seed(seed))
        if seed is not None:
            self._order, self._worlds = [], 0
        while not self._order:
            self._enter_next_world()
        self._asked = self._order.pop()
        assert self._samples is not None
        return self._samples.features[self._asked].copy(), {"law": self._law}

    def _enter_next_world(self) -> None:
        self._law = self.laws[self._worlds % len(self.laws)]
        self._worlds += 1
        world_seed = TRAINING_SEEDS + int(self.np_random.integers(WORLDS))
        self._samples = samples_of(law_world(self._law, world_seed), world_seed)
        self._order = self.np_random.permutation(len(self._samples.features)).tolist()

    def step(self, action: F32) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        """Take the answer.

        Raises:
            ValueError: an answer of another shape, or not finite.
            gymnasium.error.ResetNeeded: nothing has been asked.
        """
        answer = real_numbers("an answer", action)
        if answer.shape != (ANSWERS,) or not np.isfinite(answer).all():
            raise ValueError(f"expected {ANSWERS} finite numbers, got {action!r}")
        if self._samples is None or self._asked < 0:
            raise gym.error.ResetNeeded("nothing has been asked: call reset first")
        right = self._samples.answers[self._asked]
        errors, by_filter = errors_of(np.stack([answer, np.zeros(ANSWERS)]), np.stack([right, right]))
        observation = self._samples.features[self._asked].copy()
        self._asked = -1
        info = {"errors": errors, "kalman_errors": by_filter, "law": self._law}
        return observation, float(cost_of(by_filter) - cost_of(errors)), True, False, info
