"""The first layer of every learned policy: the observation as numbers near one, made for the robot that sees it.

What decides is the clearance of a beam, not its range: 0.5 / (clearance + 0.3 m) spends half of the scale on the last
half metre before contact, where a linear range spends a tenth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from bug_gym.agents.learning.history import TOP_SPEED, history_width
from bug_gym.agents.learning.robot_model import RobotModel

CLEARANCE_GAIN, CLEARANCE_SOFTENING = 0.5, 0.3
"""Of the encoding gain / (clearance + softening) [m]."""


class RobotEncoding(BaseFeaturesExtractor):
    """Encodes observations, Dict or flat.

    Features: B clearances (1.6 at contact, 0 where nothing is seen), cosine, sine and two scales of the distance of
    the goal, the velocity over its limits; of each peer direction, clearance and velocity; the scenario's own fields over their
    greatest size; of each lag of a history the speeds along the beams and the goal's velocity.

    Args:
        observation_space: the Dict space, or the flat one followed by what a History gives.
        robot: `RobotModel.as_dict()`.
        lags: of the History, if there is one.
        linear: encode 1 - range / longest range instead of clearances, to show what those are worth.
    """

    def __init__(
        self,
        observation_space: gym.Space[Any],
        robot: Mapping[str, Any],
        lags: Sequence[int] = (),
        *,
        linear: bool = False,
    ) -> None:
        model = RobotModel.from_dict(robot)
        width = model.beams + 6 + 5 * model.peers + model.own_width + history_width(model, lags)
        super().__init__(observation_space, width)
        self.robot, self.linear = model, linear
        self.history = history_width(model, lags)
        top = (model.max_speed, model.max_speed if model.kinematics == "holonomic" else model.max_turn_rate)
        self.register_buffer("top_speeds", torch.tensor(top), persistent=False)
        self.top_speeds: torch.Tensor
        self.register_buffer("own_scales", torch.tensor(model.own_scales), persistent=False)
        self.own_scales: torch.Tensor

    def forward(self, observations: torch.Tensor | dict[str, torch.Tensor]) -> torch.Tensor:
        """Features (n, F) of flat observations (n, D) or fields (n, ...)."""
        beams, peers = self.robot.beams, self.robot.peers
        if isinstance(observations, dict):
            ranges, goal, velocity = (observations[name] for name in ("ranges", "goal", "velocity"))
            others = observations["peers"] if peers else None
        else:
            ranges, goal = observations[:, :beams], observations[:, beams : beams + 2]
            velocity = observations[:, beams + 5 : beams + 7]
            others = observations[:, beams + 7 : beams + 7 + 4 * peers].reshape(-1, peers, 4) if peers else None
        distance = torch.linalg.vector_norm(goal, dim=1, keepdim=True)
        parts = [
            self._ranges(ranges),
            goal / (distance + 1e-6),
            0.1 * distance,
            torch.clamp(0.5 * distance, max=1.0),
            velocity / self.top_speeds,
        ]
        if others is not None:
            parts.append(self._peers(others).flatten(1))
        if self.robot.own:
            parts.append(self._own(observations) / self.own_scales)
        if self.history and not isinstance(observations, dict):
            parts.append(observations[:, self.robot.width :] / TOP_SPEED)
        return torch.cat(parts, dim=1)

    def _own(self, observations: torch.Tensor | dict[str, torch.Tensor]) -> torch.Tensor:
        """The scenario's own fields (n, O)."""
        if isinstance(observations, dict):
            return torch.cat([observations[name].flatten(1) for name, _, _ in self.robot.own], dim=1)
        return observations[:, self.robot.width - self.robot.own_width : self.robot.width]

    def _ranges(self, ranges: torch.Tensor) -> torch.Tensor:
        if self.linear:
            return 1.0 - ranges / self.robot.range
        return _nearness(ranges - self.robot.radius) - _nearness_at(self.robot.range - self.robot.radius)

    def _peers(self, others: torch.Tensor) -> torch.Tensor:
        """Features (n, R - 1, 5) of other robots (n, R - 1, 4)."""
        place, velocity = others[..., :2], others[..., 2:]
        distance = torch.linalg.vector_norm(place, dim=-1, keepdim=True)
        clearance = _nearness(distance - 2.0 * self.robot.radius)
        return torch.cat([place / (distance + 1e-6), clearance, velocity / self.robot.max_speed], dim=-1)


def _nearness(clearance: torch.Tensor) -> torch.Tensor:
    return CLEARANCE_GAIN / (torch.clamp(clearance, min=0.0) + CLEARANCE_SOFTENING)


def _nearness_at(clearance: float) -> float:
    return CLEARANCE_GAIN / (clearance + CLEARANCE_SOFTENING)
