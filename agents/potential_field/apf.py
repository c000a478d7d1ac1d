"""A potential field alone, whose forces know of velocities: what wall following is worth is seen beside it.

Source: Ge and Cui (2002); the APF mode of the paper on potential field and wall following. Sensing assumed: a scan, goal,
gyroscope, wheels. Memory kept: the nearest points of the last half second. States: potential_field. Guarantee: none; in
a local minimum it stops for good, and says "stuck". Length bound: none.

Reported, by the paper on wall following: such fields are caught in local minima, and those that know of places alone serve
in still scenes only. Found: so; it is stuck in all still scenes made in that paper's manner, and arrives in 18 % of 200
traps: docs/results/apf-wall-following.md. Rebuilt, as no formula can be read, from the potentials of Ge and Cui: across the
line of sight the repulsion has the distance to the robot's centre where theirs, for a point, has the gap. Added is a floor:
along a wall nothing comes nearer, and nothing would repel. A differential robot stands 0.19 m before the slab and in the U
with it, and 0.04 m with next to none.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from bug_gym.agents.potential_field.field import Field, FieldMemory, FieldParameters
from bug_gym.agents.potential_field.local_minimum import MinimumMemory, is_caught, travel_direction
from bug_gym.agents.walls.boundary import WAIT, Boundary
from bug_gym.policy import STANDING, Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


@dataclass
class ApfMemory(Memory):
    """Memory of APF."""

    felt: FieldMemory = field(default_factory=FieldMemory)
    """Of the forces."""
    minimum: MinimumMemory = field(default_factory=MinimumMemory)
    """Of the watch for local minima."""


class Apf(ScriptedPolicy):
    """APF.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what `Field` refuses.
    """

    Parameters = FieldParameters
    parameters: FieldParameters
    foresight = True

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.boundary = Boundary(sensors, foresees=self.foresees)
        self.field = Field(self.parameters, sensors, safe_radius=self.boundary.safe_radius)

    def start(self) -> ApfMemory:
        """Memory of a new episode."""
        return ApfMemory(mode="potential_field")

    def act(self, view: View, memory: ApfMemory) -> Velocity:
        """One decision."""
        forces = self.field.feel(view, memory.felt)
        is_caught(view, memory.minimum, forces, travel_direction(view, memory.minimum))
        is_blocked = any(not one.is_moving for one in forces.obstacles)
        if is_blocked and memory.minimum.waited > WAIT:
            memory.verdict = "stuck"
            return STANDING
        heading = self.boundary.goal_heading(view)
        if heading is not None:
            return self.field.safe_step(view, heading, self.sensors.drive.max_speed)
        return self.field.velocity(view, forces)

    def draw(self, memory: ApfMemory) -> Drawing:
        """The forces."""
        return Drawing(segments=self.field.segments(memory.felt))
