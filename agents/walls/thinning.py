"""Beginning anew as a thinner robot, where a bug has gone round in vain.

A gap about as wide as the robot with its clearance may let it in because it came straight, or on an arc, and be none to the
hand that follows the wall: within, every lap is in vain, and a bug that begins anew there goes the same way again. So it keeps
less from walls each time, as one who squeezes through, as far as brake and noise allow. What proves that there is no way for a
thinner robot proves it for one that keeps more.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import fields
from typing import Any

from bug_gym.agents.walls.boundary import HIT_SLACKS, SAFE_SHARE, SLACK, Boundary
from bug_gym.policy import MisfitError, ScriptedPolicy, hidden_gap
from bug_gym.view import Sensors

THINNER = 2.0 / 3.0
"""What a robot keeps from walls beside its body, over what it kept before it began anew."""


def least_margin(sensors: Sensors) -> float:
    """What a robot must keep from walls at least [m].

    Else the discs of Boundary that go somewhere, `hit_radius` and `safe_radius`, are smaller than what the scan may hide and a
    differential robot brakes before: it would stand there for ever.
    """
    gap, slacks = hidden_gap(sensors), SLACK * HIT_SLACKS
    return max(gap / SAFE_SHARE, (gap + slacks * sensors.radius) / (1.0 - slacks))


class ThinningPolicy(ScriptedPolicy):
    """A bug that may begin anew; it refuses what ScriptedPolicy refuses."""

    foresight = True

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self._thinner: dict[int, ThinningPolicy] = {}

    @property
    @abstractmethod
    def kept(self) -> Boundary:
        """How it keeps to walls."""

    def starts(self, memory: Any) -> int:
        """How often it has begun anew."""
        return int(memory.fresh_starts)

    def driver(self, memory: Any) -> ScriptedPolicy:
        """The same bug, thinner for each time that it has begun anew."""
        starts = self.starts(memory)
        if not starts:
            return self
        if starts not in self._thinner:
            self._thinner[starts] = self._made_thinner(starts)
        return self._thinner[starts]

    def _made_thinner(self, starts: int) -> ThinningPolicy:
        """The same bug after so many fresh starts; itself where the scanner does not show so near a wall's corners."""
        radius, clearance = self.sensors.radius, self.kept.clearance
        margin = max(THINNER**starts * (clearance - radius), least_margin(self.sensors))
        own = {one.name: getattr(self.parameters, one.name) for one in fields(self.parameters) if one.init}
        own["clearance"] = min(clearance, radius + margin)
        try:
            return type(self)(self.sensors, discrete=self.discrete, **own)
        except MisfitError:
            return self
