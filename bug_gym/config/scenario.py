"""A scenario: all that defines a task."""

from __future__ import annotations

import hashlib
import json
import math
from typing import Literal, Self

from pydantic import PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from bug_gym.config.own_worlds import AnyFamily
from bug_gym.limits import FLATTEST_ARC, MOST_DELAYED, MOST_TURNS, WIDEST_SWING
from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import RandomWalk, Waypoints
from bug_gym.schema.movers import Target
from bug_gym.schema.own import OWN_PARTS, Named, ObservationFields, RewardTerms
from bug_gym.schema.ranges import Drawn, most_of
from bug_gym.schema.robot import Lidar, Odometry, Robot, Robots
from bug_gym.schema.task import GoalSettings, Reward, Time
from bug_gym.schema.values import GivenName, Part
from bug_gym.worlds.empty import EmptyWorld
from bug_gym.worlds.family import Crew

WHOLE = 1e-6
"""How far from a whole number of steps a time may lie that is meant as one: decimal fractions are not exact."""


class Scenario(Part):
    """All that defines a task: robot, sensors, clock, world, reward."""

    name: GivenName = "custom"
    """What tables and pictures call it; a file's stem where the file gives none."""
    robot: Robot = Robot()
    """The robot's body and its limits."""
    lidar: Lidar = Lidar()
    """The laser scanner."""
    odometry: Odometry = Odometry()
    """How the robot's own estimate of its pose drifts."""
    time: Time = Time()
    """The clock."""
    goal: GoalSettings = GoalSettings()
    """When the goal is reached."""
    world: AnyFamily = EmptyWorld(family="empty")
    """The family of worlds and its parameters."""
    reward: Reward = Reward()
    """Weights of the reward's terms."""
    reward_terms: RewardTerms = Named()
    """Further terms of the reward, by name: functions over named arrays (bug_gym.own_parts)."""
    observation_fields: ObservationFields = Named()
    """Further fields of the observation, by name: functions likewise."""
    robots: Robots = Robots()
    """How many robots."""
    mission: Literal["all", "first"] = "all"
    """Whether the mission ends when "all" robots' runs have ended, or for all with the "first" that arrives. Who has arrived
    stands in the way of others with the same goal: `goal.radius` says how many find room there."""

    _drawn_for: float | None = PrivateAttr(None)  # see `cut_off`; no value of a scenario, so no digest has it

    def cut_off(self, limit: float) -> Self:
        """The same worlds with a lower time limit [s].

        A family may draw what its limit leaves room for, as `replay` does with the time at which its record is entered. A
        scenario that says a limit says this with it; who cuts episodes off from outside wants the same episodes, shorter.
        """
        shorter = self.model_copy(update={"time": self.time.model_copy(update={"limit": limit})})
        shorter._drawn_for = self.crew.time_limit
        return shorter

    @property
    def digest(self) -> str:
        """What tells it from other scenarios: of all values, defaults too, which may change with the version."""
        data = self.model_dump(mode="json")
        said = {key: value for key, value in data.items() if value or key not in OWN_PARTS}
        text = json.dumps(said, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def crew(self) -> Crew:
        """Whom its worlds are made for."""
        return Crew(self.robot, self.robots, self.goal.radius, self._drawn_for or self.time.limit)

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        try:
            self.world.check(self.robot)
        except PydanticCustomError as error:
            context = error.context or {}
            raise wrong(context["reason"], f"world.{context['key']}") from None
        self._check_body()
        self._check_latency()
        self._check_swing()
        self._check_turns()
        self._check_places()
        for name in self.reward_terms:
            if name in Reward.model_fields:
                raise wrong("this name is taken: the reward has such a term already", f"reward_terms.{name}")
        return self

    def _check_body(self) -> None:
        """Only a round body's radius may be drawn, of one robot: others are the same circles for all."""
        several = self.robots.count > 1 or self.robot.circles is not None
        if isinstance(self.robot.radius, Drawn) and several:
            reason = f"got {self.robot.radius}, expected one number where there are several robots, or circles"
            raise wrong(reason, "robot.radius")

    @property
    def latency_steps(self) -> int:
        """Steps from an action to the one in which it acts."""
        return round(self.robot.latency / self.time.step)

    def _check_latency(self) -> None:
        """An action begins to act where a step begins, and few are under way at once."""
        steps = self.robot.latency / self.time.step
        if not steps <= MOST_DELAYED:
            reason = f"got {self.robot.latency:g}, expected at most {MOST_DELAYED} steps of {self.time.step:g} s"
            raise wrong(reason, "robot.latency")
        if abs(steps - round(steps)) > WHOLE:
            reason = f"got {self.robot.latency:g}, expected a whole number of steps of {self.time.step:g} s"
            raise wrong(reason, "robot.latency")

    @property
    def _greatest_motion(self) -> tuple[float, float]:
        """How far a robot that turns goes [m], and by how much it turns [rad], in a step at most."""
        return most_of(self.robot.max_speed) * self.time.step, self.robot.greatest_turn_rate * self.time.step

    @property
    def goes_on_arcs(self) -> bool:
        """Whether robots go on arcs and no chords: those that leave the chord of a step by more than FLATTEST_ARC."""
        way, turn = self._greatest_motion
        return self.robot.kinematics != "holonomic" and 0.125 * way * turn > FLATTEST_ARC

    def _check_swing(self) -> None:
        """A body bends its way so little in a step that its arc can be tested chord by chord."""
        if self.robot.kinematics == "holonomic":
            return
        way, turn = self._greatest_motion
        way = way if self.goes_on_arcs else 0.0
        beside = max(math.hypot(x, y) for x, y, _ in self.robot.footprint)
        if turn * (way + turn * beside) > WIDEST_SWING**2:
            most = 2.0 * WIDEST_SWING**2 / (way + math.sqrt(way**2 + 4.0 * beside * WIDEST_SWING**2))
            key = "max_steering" if self.robot.kinematics == "ackermann" else "max_turn_rate"
            came = f"got {getattr(self.robot, key):g}, which turns the body by {turn:g} rad in a step"
            where = [f"circles {beside:g} m beside its origin"] * (beside > 0.0) + [f"a way of {way:g} m"] * (way > 0.0)
            steps = " (time.step)" if way > 0.0 else ""
            raise wrong(f"{came}{steps}, expected at most {most:g} rad with {' and '.join(where)}", f"robot.{key}")

    def _check_turns(self) -> None:
        """No body has more way-points or legs in a step than the step goes through (kernels.motion.move_body)."""
        for key, motion in self.world.motions():
            if isinstance(motion, Waypoints) and not motion.stop:
                ends = zip(motion.points, (*motion.points[1:], motion.points[0]), strict=True)
                tour = sum(math.dist(a, b) for a, b in ends)
                turns, part = len(motion.points) * motion.speed * self.time.step / max(tour, 1e-300), "points"
                if tour == 0.0:
                    continue  # it stays there
            elif isinstance(motion, RandomWalk):
                turns, part = 2.0 * self.time.step / (motion.min_leg + motion.max_leg), "max_leg"
            else:
                continue
            if turns > MOST_TURNS:
                came = f"got {turns:.3g} turns in a step of {self.time.step:g} s (time.step)"
                raise wrong(f"{came}, expected at most {MOST_TURNS:,}", f"world.{key}.{part}")

    def _check_places(self) -> None:
        """Each robot starts clear of what is fixed and of the robots before it, and its goal is free."""
        bodies: list[tuple[tuple[float, float, float], ...]] = []
        for index, place in enumerate(self.robots.places[: self.robots.count]):
            key, body = f"robots.places.{index}", self.robot.body(place.start)
            touched = self.world.obstruction(body)
            for other, earlier in enumerate(bodies):
                if any(math.dist(a[:2], b[:2]) < a[2] + b[2] for a in body for b in earlier):
                    touched = touched or f"robots.places.{other}"
            if touched:
                reason = f"got {list(place.start)}, expected room for the robot; in its way: {touched}"
                raise wrong(reason, f"{key}.start")
            if place.goal is not None:
                if isinstance(getattr(self.world, "target", None), Target):
                    reason = (
                        f"got {list(place.goal)}, expected none beside world.target: it moves the goals of all robots"
                    )
                    raise wrong(reason, f"{key}.goal")
                self.world.check_point(place.goal, f"{key}.goal")
            bodies.append(body)


Scenario.model_rebuild()  # once, while this is imported: threads that load their first scenarios would each do it
