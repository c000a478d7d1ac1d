"""Policies for several robots of one world: each by itself, or a team whose robots tell one another what they know.

`policy.predict(observations, state) -> (actions, state)` takes what PettingZoo gives, observations by agent, and what
evaluations have, rows of (world, robot). A team writes two methods: `start(robots) -> memories` and
`act(views, memories) -> velocities`.

What robots of a team know of one another they have told one another, in the *team's frame*: the odometry frame of the
first robot that was heard. Nothing comes through the env. Where the frames of two robots lie to one another they find
out when they first hear from one another: each sees where the other is (`peers`), and two such sights give the
distance and both headings. From then on odometry alone says where each has been, with its error; how near it is
to others now they may see anew.
"""

from __future__ import annotations

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kinematics
from bug_gym.config import Scenario
from bug_gym.geometry import Point, wrap
from bug_gym.inertia import are_cut_at_once, scans_kept, stoppable_actions
from bug_gym.log import warn_once
from bug_gym.policy import (
    STANDING,
    Drawing,
    Memory,
    MisfitError,
    NoParameters,
    Policy,
    ScriptedPolicy,
    Velocity,
    action_of,
    brake,
    braking_radius,
    checked_memories,
    checked_starts,
    checked_velocity,
    flat_observation,
    keep_scan,
    source_scenario,
)
from bug_gym.swaying import sway
from bug_gym.view import Sensors, View, require_sensors

TOGETHER = 1e-3
"""Distance below which two robots are at one place, and see no direction to one another [m]."""

START_DISTANCE = 2.0
"""How far apart robots of a team had better start: nearer ones begin by making room (Oni and Wang, section 4.3) [m]."""


@dataclass(frozen=True)
class Frame:
    """Where a robot's odometry frame lies in the team's."""

    x: float = 0.0
    """Its origin [m]."""
    y: float = 0.0
    """Likewise [m]."""
    heading: float = 0.0
    """Direction of its x axis [rad]."""

    @functools.cached_property
    def lies(self) -> tuple[float, float, float]:
        """All three."""
        return self.x, self.y, self.heading

    @functools.cached_property
    def direction(self) -> Point:
        """Cosine and sine of its heading."""
        return math.cos(self.heading), math.sin(self.heading)

    def to_team(self, place: Point) -> Point:
        """A place of the odometry frame in the team's [m]."""
        cos, sin = self.direction
        return self.x + cos * place[0] - sin * place[1], self.y + sin * place[0] + cos * place[1]

    def to_odometry(self, place: Point) -> Point:
        """A place of the team's frame in the odometry frame [m]."""
        cos, sin = self.direction
        dx, dy = place[0] - self.x, place[1] - self.y
        return cos * dx + sin * dy, cos * dy - sin * dx


class Word(NamedTuple):
    """What a robot tells its partners; places in the team's frame."""

    place: Point
    """Where it is [m]."""
    view: View
    """What it sees, in its odometry frame."""
    frame: Frame
    """Where that lies."""

    @property
    def heading(self) -> float:
        """Of its body [rad]."""
        return wrap(self.view.heading + self.frame.heading)

    @property
    def goal_distance(self) -> float:
        """How far it has to go in a straight line [m]."""
        return self.view.goal_distance

    @property
    def velocity(self) -> Point:
        """How it moves [m/s]."""
        ahead, left = self.view.own_velocity
        heading = self.heading
        cos, sin = math.cos(heading), math.sin(heading)
        return cos * ahead - sin * left, sin * ahead + cos * left

    @property
    def goal(self) -> Point:
        """Where its goal is [m]."""
        return self.frame.to_team(self.view.goal_position)


@dataclass
class TeamMemory(Memory):
    """What one robot of a team keeps of one episode."""

    frame: Frame | None = None
    """Where its odometry frame lies; None until it is heard."""
    word: Word | None = None
    """What it told last."""
    sight: Word | None = None
    """The same from where it is seen to be now; None: there, or nobody looks."""
    view: View | None = None
    """What it saw when it was heard last."""
    is_heard: bool = False
    """Whether it answers now; one that does not stands where it was heard last."""
    winner: int | None = None
    """Number of the robot that is known to arrive first, for which the others have stopped."""
    holds: int = 0
    """How often it has stopped for a partner to pass."""
    held: float = 0.0
    """How long it has stood so, in all [s]."""


def is_by_agent(observation: Any, agents: Sequence[str]) -> bool:
    """Whether observations come by agent, as PettingZoo gives them; some may be missing.

    Raises:
        ValueError: they are no fields, and not of agents of this env.
    """
    if not isinstance(observation, Mapping) or "ranges" in observation:
        return False
    if strange := sorted(str(name) for name in observation if name not in agents):
        raise ValueError(f"got observations of {strange}, expected agents out of {list(agents)}")
    return True


class EachAlone:
    """A single robot's policy for each robot of a world, with a memory of its own.

    Args:
        policy: the single robot's.
        agents: the names of the robots.
    """

    def __init__(self, policy: Policy, agents: Sequence[str]) -> None:
        self.policy = policy
        self.agents = tuple(agents)

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, tuple[Any, ...] | None]:
        """Actions for the robots of one world, or of many.

        Args:
            observation: by agent, where an agent that is missing or None is out of play; or a batch of rows of (world,
                robot), which goes to the single robot's policy as it is.
            state: as the last call returned it; None begins an episode.
            episode_start: (n,) for a batch, as the single robot's policy takes it.
            deterministic: likewise.

        Returns:
            Actions by agent and the state, one a robot; for a batch what the single robot's policy returns.

        Raises:
            ValueError: observations of other agents, or a state of another team.
        """
        if not is_by_agent(observation, self.agents):
            return self.policy.predict(observation, state, episode_start, deterministic)
        observation = {agent: seen for agent, seen in observation.items() if seen is not None}
        states = [None] * len(self.agents) if state is None else list(checked_states(state, len(self.agents)))
        if isinstance(self.policy, ScriptedPolicy):
            return self._scripted(self.policy, observation, states)
        actions = {}
        for agent, seen in observation.items():
            number = self.agents.index(agent)
            actions[agent], states[number] = self.policy.predict(seen, states[number], None, deterministic)
        return actions, tuple(states)

    def _scripted(
        self, policy: ScriptedPolicy, observations: Mapping[str, Any], memories: list[Any]
    ) -> tuple[dict[str, NDArray[Any]], tuple[Any, ...]]:
        """The same of a policy written by hand, which reads the scans of all at once; a robot's state is its memory."""
        if not observations:
            return {}, tuple(memories)
        rows = np.array([flat_observation(seen, policy.sensors) for seen in observations.values()])
        known = []
        for row, agent in enumerate(observations):
            number = self.agents.index(agent)
            if memories[number] is None:
                memories[number] = policy.first_memory(rows[row : row + 1], 0)
            known.append(memories[number])
        actions = policy.decide(rows, policy.checked(known, len(known)))
        return {agent: action[()] for agent, action in zip(observations, actions, strict=True)}, tuple(memories)

    def __getattr__(self, name: str) -> Any:
        """Everything else is the single robot's policy's: its sensors, parameters, drawing."""
        if name in ("policy", "agents"):  # not there yet while a copy is made
            raise AttributeError(name)
        return getattr(self.policy, name)


class PeersAsMovers:
    """A policy that was made for a robot alone, where there are several: it sees the others with its scanner only.

    Args:
        policy: made for the sensors without `peers`.
        sensors: those of the robot, with `peers`.
    """

    def __init__(self, policy: Policy, sensors: Sensors) -> None:
        self.policy = policy
        self.sensors = sensors
        (self._peers,) = (slice(field.begin, field.end) for field in sensors.fields if field.name == "peers")

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Any, ...] | None]:
        """As the policy's own, for observations with `peers`."""
        flat = flat_observation(observation, self.sensors)
        return self.policy.predict(np.delete(flat, self._peers, axis=-1), state, episode_start, deterministic)


def without_peers(sensors: Sensors) -> Sensors:
    """The same robot alone in its world: the scenario's own fields, which stand behind `peers`, move up."""
    peers = next((field for field in sensors.fields if field.name == "peers"), None)
    if peers is None:
        return sensors
    gap = peers.end - peers.begin
    fields = tuple(
        replace(field, begin=field.begin - gap) if field.begin > peers.begin else field
        for field in sensors.fields
        if field is not peers
    )
    return replace(sensors, fields=fields)


def checked_states(state: Any, robots: int) -> tuple[Any, ...]:
    """A state of so many robots.

    Raises:
        ValueError: of another number, or no tuple.
    """
    if not isinstance(state, (tuple, list)):
        raise ValueError(f"the state is a tuple of one a robot, got {type(state).__name__}")
    if len(state) != robots:
        raise ValueError(f"got the state of a team of {len(state)}, expected {robots} robots")
    return tuple(state)


class TeamPolicy(ABC):
    """A policy that drives several robots of one world. They see their observations, and what partners tell them.

    Args:
        sensors: what a driver knows of each of the robots, which are alike.
        agents: the names of the robots.
        discrete: whether actions are numbers of the discrete action table instead of velocities.
        **parameters: the algorithm's own, see its `Parameters`.

    Raises:
        MisfitError: fewer robots than the algorithm needs.
        ValueError: what is no Sensors, such as an env.
        TypeError: an unknown parameter.
    """

    Parameters: ClassVar[type[Any]] = NoParameters
    """The algorithm's own parameters: a frozen dataclass with a sentence, and a unit, under each field."""

    privileged: ClassVar[bool] = False
    """Whether it reads the world's map."""

    least_robots: ClassVar[int] = 2
    """How many robots the algorithm needs at least."""
    most_robots: ClassVar[float] = math.inf
    """How many it drives at most."""

    wants_room: ClassVar[bool] = False
    """Whether robots that start nearer to one another than START_DISTANCE are worth a warning."""

    turns_on_the_spot: ClassVar[bool] = True
    """Whether it needs robots that can: ackermann robots are refused then."""
    room: float = 0.0
    """What is kept about the body where inertia carries a robot nearer to walls than the algorithm wants [m]."""

    parameters: Any
    """Those of this policy; an algorithm with parameters of its own gives the type."""

    def __init__(self, sensors: Sensors, *, agents: Sequence[str], discrete: bool = False, **parameters: Any) -> None:
        require_sensors(sensors, self)
        if not self.least_robots <= len(agents) <= self.most_robots:
            more = "" if self.most_robots == self.least_robots else " or more"
            told = f"{type(self).__name__} drives {self.least_robots} robots{more}"
            raise MisfitError(f"{told}, the scenario has {len(agents)}")
        self.sensors = sensors
        self.agents = tuple(agents)
        self.discrete = discrete
        self._velocities = kinematics.discrete_choices(sensors.drive) if discrete else None
        self.parameters = self.Parameters(**parameters)

    @property
    def robots(self) -> int:
        """How many robots it drives."""
        return len(self.agents)

    @abstractmethod
    def start(self, robots: int) -> tuple[TeamMemory, ...]:
        """Memories of a new episode, one a robot."""

    @abstractmethod
    def act(self, views: Sequence[View | None], memories: Sequence[Any]) -> Sequence[Velocity]:
        """Desired velocities in the robots' frames [m/s], x ahead, y left; memories are changed in place.

        Args:
            views: what each robot sees; None: it is out of play, or does not answer.
            memories: one a robot. Each has told its `word` already, of this instant if `is_heard`.
        """

    def draw(self, memory: Any) -> Drawing:
        """What to show of one robot's memory in a picture, in its odometry frame."""
        return Drawing()

    def predict(
        self,
        observation: Any,
        state: tuple[TeamMemory, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Any, tuple[TeamMemory, ...]]:
        """Actions for the robots of one world, or of many.

        Args:
            observation: by agent, where an agent that is missing or None is out of play; or a batch, Dict or flat, whose
                rows are (world, robot): robot r of world w is row w R + r.
            state: one memory a row, as the last call returned it; None starts new ones.
            episode_start: (n,) for a batch, the `dones` of the step before as stable-baselines3 hands them on. A world all of
                whose rows are marked begins an episode; where some are, these are out of play, as in
                `make_robots_vec_env(..., restart="world")`. None: all are in play.
            deterministic: ignored, a scripted policy always is.

        Returns:
            Actions by agent, or an array (n, ...) of them; and the state, changed in place.

        Raises:
            ValueError: observations of other agents or of another size, a number of rows that is no multiple of the
                robots, or a state of another team or policy.
        """
        if is_by_agent(observation, self.agents):
            rows = [observation.get(agent) for agent in self.agents]
            flat = [None if row is None else flat_observation(row, self.sensors) for row in rows]
            memories = self.started(1) if state is None else self._checked(state, self.robots)
            actions = self.decide(flat, memories)
            in_play = zip(self.agents, actions, flat, strict=True)
            return {agent: action[()] for agent, action, seen in in_play if seen is not None}, tuple(memories)
        return self._predict_rows(flat_observation(observation, self.sensors), state, episode_start)

    def _predict_rows(
        self, flat: NDArray[np.float32], state: Any, episode_start: Any
    ) -> tuple[NDArray[Any], tuple[TeamMemory, ...]]:
        """Actions for rows of (world, robot)."""
        robots = self.robots
        if flat.ndim != 2 or not len(flat) or len(flat) % robots:
            raise ValueError(f"got observations of shape {flat.shape}, expected rows of worlds of {robots} robots each")
        worlds = len(flat) // robots
        memories = self.started(worlds) if state is None else self._checked(state, len(flat))
        ended = np.zeros((worlds, robots), dtype=np.bool_)
        if episode_start is not None:
            ended = checked_starts(episode_start, len(flat)).reshape(worlds, robots)
            for world in np.flatnonzero(ended.all(axis=1)).tolist():
                memories[world * robots : (world + 1) * robots] = self.start(robots)
                ended[world] = False
        actions = []
        for world, out_of_play in enumerate(ended.tolist()):
            rows = slice(world * robots, (world + 1) * robots)
            seen = [None if is_out else row for row, is_out in zip(flat[rows], out_of_play, strict=True)]
            actions += self.decide(seen, memories[rows])
        return np.stack(actions), tuple(memories)

    def started(self, worlds: int) -> list[TeamMemory]:
        """Memories of new episodes in so many worlds, one a row of (world, robot)."""
        return [memory for _ in range(worlds) for memory in self.start(self.robots)]

    def decide(
        self, observations: Sequence[NDArray[np.float32] | None], memories: Sequence[TeamMemory]
    ) -> list[NDArray[Any]]:
        """Actions for the robots of one world.

        Args:
            observations: flat ones (D,); None: the robot is out of play, or does not answer.
            memories: one a robot, changed in place.

        Raises:
            ValueError: a number that is not finite.
        """
        views = self._views(observations, memories)
        self.listen(views, memories)
        velocities = self.act(views, memories)
        wishes = []
        for view, velocity, memory in zip(views, velocities, memories, strict=True):
            goes = view is not None and not memory.verdict
            wishes.append(checked_velocity(self, velocity) if goes else STANDING)
        if self._velocities is not None and self.sensors.drive.kinematics != "ackermann":
            swayed = zip(views, wishes, memories, strict=True)
            wishes = [self._swaying(view, wish, memory) for view, wish, memory in swayed]
        actions = self.last_word(views, memories, self._actions(views, wishes))
        if self._scans_kept:
            for view, memory in zip(views, memories, strict=True):
                keep_scan(memory, view, self._scans_kept)
        latency = self.sensors.drive.latency
        if latency > 0 and not self.discrete:
            for memory, action in zip(memories, actions, strict=True):
                memory.under_way = [*memory.under_way, action.copy()][-latency:]
        return actions

    def last_word(
        self, views: Sequence[View | None], memories: Sequence[Any], actions: list[NDArray[Any]]
    ) -> list[NDArray[Any]]:
        """What is sent in place of the actions that the velocities just desired come to."""
        return actions

    def _views(
        self, observations: Sequence[NDArray[np.float32] | None], memories: Sequence[TeamMemory]
    ) -> list[View | None]:
        """What each robot sees."""
        told = [seen for seen in observations if seen is not None]
        if not told:
            return [None] * len(memories)
        rows = np.concatenate(told).reshape(len(told), -1)
        each = iter(View.of_rows(rows, self.sensors, braking_radius(self.sensors)))
        views = [None if seen is None else next(each) for seen in observations]
        for view, memory in zip(views, memories, strict=True):
            if view is not None:
                view.lately = memory.lately
                if self.sensors.drive.latency > 0 and not self.discrete:
                    view.under_way = memory.under_way
        return views

    @functools.cached_property
    def _scans_kept(self) -> int:
        return scans_kept(self.sensors)

    def _actions(self, views: Sequence[View | None], wishes: Sequence[Velocity]) -> list[NDArray[Any]]:
        """The actions for velocities; of robots that do not answer, to stand."""
        if not self._are_cut_at_once:
            pairs = zip(views, wishes, strict=True)
            return [action_of(self.sensors, view, wish, self._velocities, self.room) for view, wish in pairs]
        seen = [view for view in views if view is not None]
        braked = [brake(view, wish) for view, wish in zip(views, wishes, strict=True) if view is not None]
        actions = stoppable_actions(seen, range(len(seen)), braked, self.room) if seen else []
        if len(actions) < len(views):
            drive, told = self.sensors.drive, iter(actions)
            return [kinematics.steering(drive, STANDING) if view is None else next(told) for view in views]
        return actions

    def _swaying(self, view: View | None, wish: Velocity, memory: TeamMemory) -> Velocity:
        """A wish that discrete actions can do: none of them stands, so who is to stand sways."""
        if wish != STANDING or view is None:
            memory.sway = None
            return wish
        assert self._velocities is not None
        wish, memory.sway = sway(view, self._velocities, memory.sway)
        return wish

    @functools.cached_property
    def _are_cut_at_once(self) -> bool:
        """Whether what robots ask for is cut for all at once."""
        return not self.discrete and are_cut_at_once(self.sensors)

    # ---------------------------------------------------------------------------------- what they tell one another

    def listen(self, views: Sequence[View | None], memories: Sequence[TeamMemory]) -> None:
        """Let each robot tell where it is, once it knows where its odometry frame lies."""
        for view, memory in zip(views, memories, strict=True):
            memory.is_heard, memory.view = view is not None, memory.view if view is None else view
        for robot, (view, memory) in enumerate(zip(views, memories, strict=True)):
            if view is None:
                continue
            if memory.frame is None:
                memory.frame = self._frame(robot, view, memories)
                if self.wants_room:
                    self._warn_of_crowding(robot, memories)
            memory.word = word_of(view, memory.frame)

    def _frame(self, robot: int, view: View, memories: Sequence[TeamMemory]) -> Frame:
        """Where the odometry frame of a robot lies that is heard for the first time, by one that is heard now where one is."""
        for other, memory in sorted(enumerate(memories), key=lambda each: not each[1].is_heard):
            if memory.frame is not None and memory.view is not None and other != robot:
                return met(memory.frame, memory.view, view, peer_slot(other, robot), peer_slot(robot, other))
        return Frame()

    def _warn_of_crowding(self, robot: int, memories: Sequence[TeamMemory]) -> None:
        """Say that robots start near one another, for all that they do at first is to make room.

        Who is heard for the first time on its way has not started there: as one that did not answer, or rows that
        stable-baselines3's `evaluate_policy` has counted enough episodes of, which it goes on calling first observations.
        """
        here, view = memories[robot].frame, memories[robot].view
        if here is None or view is None or math.hypot(*view.position) > TOGETHER:
            return
        place = here.to_team(view.position)
        for memory in memories[:robot]:
            if memory.view is None or math.hypot(*memory.view.position) > TOGETHER:
                continue
            gap = math.inf if memory.word is None else math.dist(place, memory.word.place)
            if TOGETHER < gap < START_DISTANCE - TOGETHER:
                name = type(self).__name__
                warn_once(
                    f"{name}: robots start {gap:.4g} m apart, expected at least {START_DISTANCE:g} m: "
                    "nearer than that one of them has to wait before both have set out",
                    about=f"where robots of {name} start",
                )

    def _checked(self, state: Any, rows: int) -> list[TeamMemory]:
        """The memories of a state.

        Raises:
            ValueError: memories of another team or policy.
        """
        return checked_memories(checked_states(state, rows), rows, self._memory_type)

    @functools.cached_property
    def _memory_type(self) -> type[Memory]:
        return type(self.start(self.robots)[0])


def peer_slot(robot: int, other: int) -> int:
    """Which line of `peers` tells one robot about another."""
    return other if other < robot else other - 1


def word_of(view: View, frame: Frame) -> Word:
    """What a robot tells of what it sees."""
    return Word(frame.to_team(view.position), view, frame)


def met(known: Frame, theirs: View, own: View, slot_of_own: int, slot_of_theirs: int) -> Frame:
    """Where a robot's odometry frame lies, from what it and another one see of one another at the same instant.

    Args:
        known: the other's frame.
        theirs: what the other sees.
        own: what this one sees.
        slot_of_own: line of the other's `peers` that tells about this one.
        slot_of_theirs: line of this one's `peers` that tells about the other.

    Returns:
        The frame. Robots at one place look at the goal instead; ones that see no peers, because each is alone in a
        world of its own, started from one pose.
    """
    if not any(field.name == "peers" for field in own.sensors.fields):
        return known
    x, y = theirs.field("peers")[slot_of_own, :2].tolist()
    back_x, back_y = own.field("peers")[slot_of_theirs, :2].tolist()
    if math.hypot(x, y) > TOGETHER:
        turn = math.atan2(y, x) + math.pi - math.atan2(back_y, back_x)
    else:
        turn = theirs.goal_bearing - own.goal_bearing
    place = known.to_team(theirs.to_odometry(x, y))
    frame_heading = wrap(known.heading + theirs.heading + turn - own.heading)
    cos, sin = math.cos(frame_heading), math.sin(frame_heading)
    ox, oy = own.position
    return Frame(place[0] - cos * ox + sin * oy, place[1] - sin * ox - cos * oy, frame_heading)


def agents_of(source: Any) -> tuple[str, ...]:
    """The names of the robots of a PettingZoo env, or of a scenario with several robots; of anything else none.

    A Simulation of several robots has rows of (world, robot) and no names.
    """
    if names := getattr(source, "possible_agents", ()):
        return tuple(names)
    if not isinstance(source, (Scenario, str, Path, Mapping)):
        return ()
    robots = source_scenario(source).robots.count
    return tuple(f"robot_{number}" for number in range(robots)) if robots > 1 else ()
