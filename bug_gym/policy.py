"""One interface for all agents, scripted or learned: stable-baselines3's `predict`.

`policy.predict(observation, state, episode_start, deterministic) -> (action, state)` on one observation or on a batch,
Dict or flat. A scripted policy writes two methods: `start() -> Memory` and `act(view, memory) -> velocity`.
"""

from __future__ import annotations

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import compress
from pathlib import Path
from typing import Any, ClassVar, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from bug_gym import kernels, kinematics
from bug_gym.checks import float32_numbers
from bug_gym.config import Scenario, load
from bug_gym.foresight import as_it_lies, left_behind, seen_nearby, seen_then
from bug_gym.inertia import (
    are_cut_at_once,
    as_it_will_lie,
    nearest_number,
    needs_care,
    passing_radius,
    scans_kept,
    shown_points,
    stoppable_action,
    stoppable_actions,
    stoppable_number,
)
from bug_gym.manoeuvring import Turn, arc_action, begun, gone_on
from bug_gym.observation import as_flat
from bug_gym.schema.errors import shortened
from bug_gym.steering import Course, steered_action
from bug_gym.swaying import sway
from bug_gym.view import Sensors, View, require_sensors

Observation = NDArray[np.float32] | Mapping[str, NDArray[np.float32]]
Velocity = tuple[float, float]

STANDING: Velocity = (0.0, 0.0)
CREEP = 1e-6
"""A speed that goes nowhere and keeps its direction, so that a robot that must turn first goes on turning [m/s]."""

AT_ONCE = 64
"""Rows of a batch that are read in one call: what they show stays in a processor's caches until they are decided."""

VERDICTS = ("", "unreachable", "looping", "stuck")
"""What a policy may find out about its task; "" while it goes on."""


class Policy(Protocol):
    """What evaluation and SB3's `evaluate_policy` ask of an agent."""

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], tuple[Any, ...] | None]:
        """Actions for one observation or a batch, and the state to hand in next time."""
        ...


@dataclass
class Memory:
    """What a scripted policy keeps of one episode; each algorithm adds its own registers."""

    mode: str = ""
    """State of its state machine, such as "motion_to_goal"."""
    verdict: str = ""
    """One of VERDICTS; once it says something the robot stands."""
    under_way: list[NDArray[np.float32]] = field(default_factory=list, kw_only=True)
    """Actions (2,) of a robot with latency that have yet to act, the first one first."""
    turn: Turn | None = field(default=None, kw_only=True)
    """A turn in several moves that an ackermann robot is at."""
    lately: list[NDArray[np.float64]] = field(default_factory=list, kw_only=True)
    """Points (2, k) of the scans before this one, odometry frame [m], of a robot that cannot stop before all that one shows."""
    sway: Velocity | None = field(default=None, kw_only=True)
    """Where a robot went whose discrete actions let it not stand, to come back from; robot's frame [m/s]."""
    nearby: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 0)), kw_only=True)
    """Points (2, k) seen nearby, the last scan's and those to which it did not look, odometry frame [m]; see foresight.py."""


@dataclass(frozen=True)
class Drawing:
    """What a policy shows of its mind; coordinates in the odometry frame [m], labels choose colours."""

    points: Sequence[tuple[float, float, str]] = ()
    """x, y and a label such as "hit", "leave", "candidate"."""
    segments: Sequence[tuple[float, float, float, float, str]] = ()
    """x1, y1, x2, y2 and a label such as "m_line"."""
    areas: Sequence[tuple[NDArray[np.float64], str]] = ()
    """Rings (k, 2) and a label such as "light"."""


def source_scenario(source: Any) -> Scenario:
    """The scenario behind an env of any face, a Simulation, or a scenario's own name, path or dict.

    Raises:
        ValueError: nothing of the kind.
    """
    if isinstance(source, (Scenario, str, Path, Mapping)):
        return load(source)
    core = getattr(source, "unwrapped", source)
    core = getattr(core, "simulation", core)
    scenario = getattr(core, "scenario", None)
    if not isinstance(scenario, Scenario):
        raise ValueError(f"expected an env of bug_gym, a Simulation or a Scenario, got {type(source).__name__}")
    return scenario


def space_of(source: Any, kind: str) -> gym.Space[Any] | None:
    """The space of an env of any face for one robot, `kind` "observation" or "action"; None where it has none."""
    for name in (f"single_{kind}_space", f"{kind}_space"):
        space = getattr(source, name, None)
        if agents := getattr(source, "possible_agents", ()):
            space = getattr(source, f"{kind}_space")(agents[0])  # PettingZoo's, each robot has its own
        if isinstance(space, gym.Space):
            return space
    return None


def is_discrete(source: Any) -> bool:
    """Whether the env behind `source` takes discrete actions."""
    return isinstance(space_of(source, "action"), gym.spaces.Discrete)


def require_own_spaces(source: Any, told: str) -> None:
    """Refuse an env in whose wrappers observations or actions become others: a policy would take one number for another.

    Args:
        source: an env of any face, or what has no spaces.
        told: what an error calls the policy.

    Raises:
        ValueError: the spaces of the env and of the one that it wraps differ, or observations are normalised.
    """
    own = getattr(source, "unwrapped", source)
    for kind in ("observation", "action"):
        shown, had = space_of(source, kind), space_of(own, kind)
        if shown is not had and shown != had:
            raise ValueError(
                f"{told} reads the env's own {kind}s: got {shortened(shown)} of a wrapper, expected {shortened(had)}; "
                "make it for env.unwrapped and hand on what that env says (observation='flat' shows one array)"
            )
    layer = source
    while layer is not None and layer is not own:
        if vars(layer).get("norm_obs"):  # stable-baselines3's, which leaves the space as it is
            raise ValueError(
                f"{told} reads the env's own observations: got ones that {type(layer).__name__} normalises"
            )
        layer = getattr(layer, "venv", None)


class MisfitError(ValueError):
    """A policy was made for another robot than the one it is to drive."""


def flat_observation(observation: Observation, sensors: Sensors) -> NDArray[np.float32]:
    """An observation, Dict or flat, one or a batch, as flat numbers (..., D).

    Raises:
        ValueError: an observation of another size than the robot's that a policy was made for, or of no real numbers.
    """
    beams = len(sensors.angles)
    is_flat = isinstance(observation, np.ndarray)  # asked first, as to ask Mapping takes longer
    if not is_flat and isinstance(observation, Mapping):
        came = (np.shape(observation.get("ranges", ())) or (0,))[-1]
        if came != beams:
            raise ValueError(f"this policy was made for {beams} beams, the observation has {came}")
        return as_flat(observation, sensors.fields)
    flat = float32_numbers("an observation", observation)
    length = sensors.width
    if flat.ndim not in (1, 2) or flat.shape[-1] != length:
        raise ValueError(
            f"the observation has shape {flat.shape}; this policy was made for {beams} beams, so for (..., {length})"
        )
    return flat


def checked_starts(episode_start: ArrayLike, rows: int) -> NDArray[np.bool_]:
    """Which of some rows begin an episode (n,).

    Raises:
        ValueError: they are no truth values, or not one a row.
    """
    starts = np.atleast_1d(np.asarray(episode_start))
    if starts.shape != (rows,) or starts.dtype.kind not in "biu":
        raise ValueError(f"episode_start is {rows} bools, got shape {starts.shape} of {starts.dtype}")
    return starts.astype(bool)


@dataclass(frozen=True)
class NoParameters:
    """Parameters of a policy that has none."""


class ScriptedPolicy(ABC):
    """A policy written by hand. It sees its observation and its own memory, nothing else.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete action table instead of velocities.
        **parameters: the algorithm's own, see its `Parameters`.

    Raises:
        ValueError: what is no Sensors, such as an env.
        TypeError: an unknown parameter.
    """

    Parameters: ClassVar[type[Any]] = NoParameters
    """The algorithm's own parameters: a frozen dataclass with a sentence, and a unit, under each field."""

    privileged: bool = False
    """Whether it reads the world's map (a map planner does, and says so)."""
    turns_on_the_spot: ClassVar[bool] = False
    """Whether it needs a robot that can: an ackermann robot is refused then."""
    looks_while_turning: ClassVar[bool] = True
    """Whether it is asked while an ackermann robot turns in several moves; else that is one step to it."""
    foresight: ClassVar[bool] = False
    """Whether it decides by what it will see where its command finds the robot, if commands act late: see foresight.py."""
    one_by_one: ClassVar[bool] = True
    """Whether an evaluation may ask for each robot alone, so that each decision has a time of its own."""

    room: float | None = 0.0
    """What it keeps about the body where inertia carries it nearer to walls than it wants [m]; None: it takes no care."""

    parameters: Any
    """Those of this policy; an algorithm with parameters of its own gives the type."""

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        require_sensors(sensors, self)
        self.sensors = sensors
        self.discrete = discrete
        self._velocities = kinematics.discrete_choices(sensors.drive) if discrete else None
        self._plans_arcs = sensors.drive.kinematics == "ackermann"
        self._follows_course = not discrete and is_steered(sensors)
        self.parameters = self.Parameters(**parameters)

    @functools.cached_property
    def foresees(self) -> bool:
        """Whether commands act late and it decides by what it will see then; discrete ones are kept by nobody."""
        return self.foresight and self.sensors.drive.latency > 0 and not self.discrete

    def _swaying(self, view: View, memory: Memory, wish: Velocity) -> Velocity:
        """A wish that discrete actions can do: none of them stands, so who is to stand sways."""
        if self._velocities is None or self._plans_arcs:
            return wish
        if wish != STANDING:
            memory.sway = None
            return wish
        wish, memory.sway = sway(view, self._velocities, memory.sway)
        return wish

    def _seen(self, view: View, memory: Memory) -> View:
        """What it decides by."""
        if not self.foresees:
            return view
        if self.sensors.is_full_circle:
            return seen_then(view)
        behind = left_behind(view, memory.nearby)
        memory.nearby = np.concatenate([behind, seen_nearby(view)], axis=1)
        return seen_then(view, behind)

    def _meant(self, view: View, velocity: Velocity) -> Velocity:
        """A velocity that it has decided for, in the robot's frame of now."""
        return as_it_lies(view, velocity) if self.foresees else velocity

    @abstractmethod
    def start(self) -> Memory:
        """Memory of a new episode."""

    def first_memory(self, flat: NDArray[np.float32], number: int) -> Memory:
        """Memory of the episode that begins with an observation of a batch (n, D); a map planner looks whose it is."""
        return self.start()

    @abstractmethod
    def act(self, view: View, memory: Any) -> Velocity:
        """Desired velocity in the robot's frame [m/s], x ahead, y left; `memory` is changed in place."""

    def act_each(self, views: Sequence[View], memories: Sequence[Any]) -> Iterable[Velocity]:
        """What `act` says for each of several robots; who can do a part of it for all of them at once does so here."""
        return (self.driver(memory).act(view, memory) for view, memory in zip(views, memories, strict=True))

    def driver(self, memory: Any) -> ScriptedPolicy:
        """Who drives a robot with this memory: the policy itself, or one that differs in what the memory asks for."""
        return self

    def course(self, view: View, memory: Any, velocity: Velocity) -> Course | None:
        """Where the velocity just desired leads on: a differential robot rounds its corners. None: nobody knows."""
        return None

    def arc(self, view: View, memory: Any) -> Velocity | None:
        """The speed [m/s] and turn rate [rad/s] that an ackermann robot drives instead of the velocity just desired.

        None, of policies that do not plan arcs: those that manoeuvring.py finds.
        """
        return None

    def draw(self, memory: Any) -> Drawing:
        """What to show of this memory in a picture."""
        return Drawing()

    def predict(
        self,
        observation: Observation,
        state: tuple[Memory, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Memory, ...]]:
        """Actions for one observation or a batch.

        Args:
            observation: Dict or flat, one or a batch (n, ...).
            state: one Memory a row, as the last call returned it; None starts new ones.
            episode_start: (n,) True where the observation is the first of an episode.
            deterministic: ignored, a scripted policy always is.

        Returns:
            Actions (2,) or (n, 2) float32, or numbers of discrete actions; and the state, changed in place.

        Raises:
            ValueError: an observation of another size than the robot's this policy was made for or with a number that is not
                finite, memories of another policy, or an `episode_start` of another length.
        """
        flat = flat_observation(observation, self.sensors)
        if np.count_nonzero(np.isfinite(flat)) < flat.size:  # .all() takes twice the time
            raise ValueError("the observation holds a number that is not finite")
        is_one = flat.ndim == 1
        count = 1 if is_one else len(flat)
        if state is None:
            memories = [self.first_memory(flat.reshape(count, -1), row) for row in range(count)]
        else:
            memories = self.checked(state, count)
        if episode_start is not None:
            for row, begins in enumerate(checked_starts(episode_start, count).tolist()):
                if begins:
                    memories[row] = self.first_memory(flat.reshape(count, -1), row)
        if is_one:
            return self._action(View(flat, self.sensors), memories[0])[()], tuple(memories)
        actions: list[NDArray[Any]] = []
        for first in range(0, count, AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            actions += self.decide(flat[rows], memories[rows])
        return np.array(actions) if actions else self._no_actions, tuple(memories)

    @property
    def _no_actions(self) -> NDArray[Any]:
        """Those for a batch of no rows."""
        return np.empty(0, dtype=np.int64) if self.discrete else np.empty((0, 2), dtype=np.float32)

    def checked(self, state: Any, rows: int) -> list[Memory]:
        """The memories of a state, one a row.

        Raises:
            ValueError: it is none of this policy, or of so many rows.
        """
        if not isinstance(state, (tuple, list)):
            raise ValueError(f"the state is a tuple of memories, got {type(state).__name__}")
        return checked_memories(state, rows, self._memory_type)

    @functools.cached_property
    def _memory_type(self) -> type[Memory]:
        return type(self.start())

    def _action(self, view: View, memory: Memory) -> NDArray[Any]:
        """The action for what one robot sees."""
        view.under_way, view.lately = memory.under_way, memory.lately
        driver = self.driver(memory)
        seen, velocity = driver._seen(view, memory), STANDING
        if driver._is_asked(seen, memory):
            velocity = checked_velocity(self, driver.act(seen, memory))
        course, arc = driver._beside(seen, memory, velocity)
        velocity = self._swaying(view, memory, driver._meant(view, velocity))
        action = action_of(self.sensors, view, velocity, self._velocities, driver.room, course, arc)
        return self._sent(view, memory, action)

    def decide(self, flat: NDArray[np.float32], memories: Sequence[Memory]) -> list[NDArray[Any]]:
        """The actions for what several robots see, each as of its row alone.

        Args:
            flat: observations (n, D).
            memories: one a row, changed in place.

        Raises:
            ValueError: a number that is not finite.
        """
        views = View.of_rows(flat, self.sensors, braking_radius(self.sensors))
        for view, memory in zip(views, memories, strict=True):
            view.under_way, view.lately = memory.under_way, memory.lately
        drivers = [self.driver(memory) for memory in memories]  # as the decision begins
        each = zip(drivers, views, memories, strict=True)
        seen = [driver._seen(view, memory) for driver, view, memory in each]
        asked = zip(drivers, seen, memories, strict=True)
        goes = [driver._is_asked(then, memory) for driver, then, memory in asked]
        answers = iter(self.act_each(list(compress(seen, goes)), list(compress(memories, goes))))
        actions: list[Any] = [None] * len(views)
        plain, wishes = [], []
        for row, (view, memory) in enumerate(zip(views, memories, strict=True)):
            velocity = checked_velocity(self, next(answers)) if goes[row] else STANDING
            driver = drivers[row]
            course, arc = driver._beside(seen[row], memory, velocity)
            velocity = self._swaying(view, memory, driver._meant(view, velocity))
            if self._are_cut_at_once and driver is self and (course is None or course.aside <= 0.0):
                plain.append(row)
                wishes.append(velocity)
            else:
                actions[row] = action_of(self.sensors, view, velocity, self._velocities, driver.room, course, arc)
        if plain and self.room is not None:
            braked = [brake(views[row], wish) for row, wish in zip(plain, wishes, strict=True)]
            for row, action in zip(plain, stoppable_actions(views, plain, braked, self.room), strict=True):
                actions[row] = action
        return [self._sent(*each) for each in zip(views, memories, actions, strict=True)]

    @functools.cached_property
    def _are_cut_at_once(self) -> bool:
        """Whether what several robots ask for is cut for all of them at once, where none rounds a corner."""
        return not self.discrete and self.room is not None and are_cut_at_once(self.sensors)

    def _beside(self, view: View, memory: Memory, velocity: Velocity) -> tuple[Course | None, Velocity | None]:
        """Where the velocity just desired leads on, and the arc of an ackermann robot."""
        course = self.course(view, memory, velocity) if self._follows_course and memory.turn is None else None
        arc = self.arc(view, memory) if self._plans_arcs and not memory.verdict else None
        if self._plans_arcs and arc is None and not memory.verdict:
            memory.turn = memory.turn or begun(view, velocity, braking_radius(self.sensors))
            arc = memory.turn.arc(view) if memory.turn is not None else None
        return course, arc

    def _is_asked(self, view: View, memory: Memory) -> bool:
        """Whether it says where to go now: it has no verdict, and no turn of several moves is under way."""
        if memory.turn is not None:
            memory.turn = gone_on(view, memory.turn, braking_radius(self.sensors), self.room)
        return not memory.verdict and (memory.turn is None or self.looks_while_turning)

    def last_word(self, view: View, memory: Any, action: NDArray[Any]) -> NDArray[Any]:
        """What is sent in place of the action that the velocity just desired comes to."""
        return action

    def _sent(self, view: View, memory: Memory, action: NDArray[Any]) -> NDArray[Any]:
        """An action, remembered where it acts later, and the scan where it counts later."""
        if memory.verdict and memory.verdict not in VERDICTS:
            expected = ", ".join(map(repr, VERDICTS))
            raise ValueError(
                f"{type(self).__name__}: got the verdict {shortened(memory.verdict)}, expected one of {expected}"
            )
        if self._scans_kept:
            keep_scan(memory, view, self._scans_kept)
        action = self.last_word(view, memory, action)
        latency = self.sensors.drive.latency
        if latency > 0 and not self.discrete:
            memory.under_way = [*memory.under_way, action.copy()][-latency:]
        return action

    @functools.cached_property
    def _scans_kept(self) -> int:
        return 0 if self.room is None else scans_kept(self.sensors)


def keep_scan(memory: Memory, view: View | None, scans: int) -> None:
    """Keep what a scan shows, and so many scans at most; nothing of a robot that does not answer."""
    memory.lately = [*memory.lately, shown_points(view)][-scans:] if view is not None else []


def checked_velocity(policy: object, answered: Any) -> Velocity:
    """What an `act` has answered, where it is a velocity.

    Raises:
        ValueError: it is none: an author's mistake, such as an `act` that ends without `return`.
    """
    try:
        ahead, left = answered
        if math.isfinite(ahead) and math.isfinite(left):
            return ahead, left
    except (TypeError, ValueError, OverflowError):  # nothing, text, another number of parts
        pass
    expected = "a velocity (ahead, left) of finite numbers [m/s]"
    raise ValueError(f"{type(policy).__name__}.act answered {shortened(answered)}, expected {expected}")


def checked_drawing(policy: object, shown: Any) -> Drawing:
    """What a `draw` has answered, where it can be drawn.

    Raises:
        ValueError: it is no Drawing, or one of its parts cannot be one.
    """
    told = f"{type(policy).__name__}.draw answered"
    if not isinstance(shown, Drawing):
        raise ValueError(f"{told} {shortened(shown)}, expected a bug_gym.policy.Drawing")
    for name, (expected, fits) in PARTS.items():
        try:
            wrong = [part for part in getattr(shown, name) if not fits(part)]
        except (TypeError, ValueError) as error:  # no sequence, another number of parts, or no numbers
            raise ValueError(f"{told} {name} of another form, expected {expected} each: {error}") from None
        if wrong:
            raise ValueError(f"{told} {shortened(wrong[0])} among its {name}, expected {expected}")
    return shown


def _are_numbers(part: Any, count: int) -> bool:
    *numbers, _ = part
    return len(numbers) == count and all(map(math.isfinite, numbers))


def _is_area(part: Any) -> bool:
    ring, _ = part
    places = np.asarray(ring, dtype=np.float64)
    return places.ndim == 2 and places.shape[1] == 2 and bool(np.isfinite(places).all())


PARTS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "points": ("(x, y, label) of finite numbers and text", lambda part: _are_numbers(part, 2)),
    "segments": ("(x1, y1, x2, y2, label) of finite numbers and text", lambda part: _are_numbers(part, 4)),
    "areas": ("(ring, label), a ring (k, 2) of finite numbers", _is_area),
}
"""What each part of a Drawing is, by its field."""


def checked_actions(answered: Any, robots: int, numbered: NDArray[np.float32]) -> NDArray[Any]:
    """What a policy has answered for some robots, as actions.

    Args:
        answered: actions (robots, 2), or numbers (robots,) of discrete ones.
        robots: how many were asked for.
        numbered: the discrete actions (m, 2).

    Returns:
        Actions (robots, 2).

    Raises:
        ValueError: anything else.
    """
    actions = np.asarray(answered)
    kind, shape = actions.dtype.kind, actions.shape
    if kind in "fiu" and shape == (robots, 2):
        with np.errstate(over="ignore"):  # what is beyond all numbers is refused as not finite
            numbers = actions.astype(np.float32, copy=False)
        if np.count_nonzero(np.isfinite(numbers)) < numbers.size:  # .all() takes twice the time
            came = actions[~np.isfinite(numbers)][0]
            raise ValueError(f"the policy answered with {came} among its actions, expected finite numbers")
        return numbers
    if kind in "iu" and shape == (robots,) and not ((actions < 0) | (actions >= len(numbered))).any():
        return np.asarray(numbered[actions])
    came = f"{shape} of {actions.dtype}" if actions.ndim else shortened(answered)
    expected = f"actions ({robots}, 2), or numbers ({robots},) of discrete ones, 0 to {len(numbered) - 1}"
    raise ValueError(f"the policy answered with {came}, expected {expected}")


def checked_memories(state: Sequence[Any], rows: int, kind: type[Any]) -> list[Any]:
    """The memories of a state, one a row.

    Raises:
        ValueError: another number of them, or memories of another kind.
    """
    if len(state) != rows:
        raise ValueError(f"got {len(state)} memories for {rows} observations")
    for memory in state:
        if not isinstance(memory, kind):
            came, expected = type(memory).__name__, kind.__name__
            raise ValueError(f"got the memory of another policy: {came}, expected {expected}")
    return list(state)


def action_of(
    sensors: Sensors,
    view: View | None,
    velocity: Velocity,
    discrete: NDArray[np.float64] | None,
    room: float | None,
    course: Course | None = None,
    arc: Velocity | None = None,
) -> NDArray[Any]:
    """The action that drives a robot at a velocity of its frame [m/s], as it can.

    Args:
        sensors: of the robot.
        view: what it sees, before which it brakes; None: it is to stand.
        velocity: the desired one.
        discrete: what discrete actions are (m, 2), where actions are numbers of them: see `kinematics.discrete_choices`.
        room: what is kept about the body where the robot cannot stop at once [m]; None: nothing is cut for that.
        course: where it leads on; None: nobody knows.
        arc: speed [m/s] and turn rate [rad/s] that an ackermann robot drives instead; None: what suits the velocity.
    """
    if discrete is not None and sensors.drive.kinematics != "ackermann":
        if view is None or room is None:
            return as_number(nearest_number(discrete, velocity))
        return as_number(stoppable_number(view, discrete, velocity, room))
    if view is None:
        action = kinematics.steering(sensors.drive, velocity)
        return action if discrete is None else as_number(nearest_number(discrete, action))
    if sensors.drive.kinematics == "ackermann":
        action = arc_action(view, velocity, course, braking_radius(sensors), room, arc)
        return action if discrete is None else as_number(nearest_number(discrete, action))
    if course is not None and course.aside > 0.0:
        return steered_action(view, velocity, course, braking_radius(sensors), room)
    if sensors.drive.latency > 0 and room is not None:
        return stoppable_action(view, as_it_will_lie(view, velocity), room)
    velocity = brake(view, velocity)
    if room is not None and needs_care(sensors):
        return stoppable_action(view, velocity, room)
    return kinematics.steering(sensors.drive, velocity)


def is_steered(sensors: Sensors) -> bool:
    """Whether a robot is driven on arcs (steering.py, manoeuvring.py): a round body and no latency."""
    drive = sensors.drive
    return drive.kinematics != "holonomic" and len(sensors.footprint) == 1 and drive.latency == 0


def braking_radius(sensors: Sensors) -> float:
    """Radius of the disc that must not meet anything ahead [m]: the body, and what the scan may hide."""
    radius = sensors.radius if sensors.drive.kinematics == "holonomic" else sensors.radius + hidden_gap(sensors)
    return max(radius, passing_radius(sensors))


def hidden_gap(sensors: Sensors) -> float:
    """How much nearer a thing may be than the scan shows it [m]."""
    return 2.0 * sensors.range_noise + 0.02


STRAIGHT = math.radians(5.0)
"""Heading error [rad] up to which a body of several circles goes ahead as it lies."""


def free_ahead(view: View, margin: float) -> float:
    """How far the body, each of its circles `margin` [m] larger, can go straight ahead [m]."""
    x, y = view.points
    return min(
        float(kernels.free_distance(x - ahead, y - left, 0.0, radius + margin, view.sensors.range))
        for ahead, left, radius in view.sensors.footprint
    )


def brake(view: View, velocity: Velocity) -> Velocity:
    """The velocity, cut for a differential robot so that this step cannot end in something it sees.

    It drives along its heading while it turns toward the desired direction, so what is ahead counts, not where it
    wants to go.
    """
    drive = view.sensors.drive
    if drive.kinematics == "holonomic":
        return velocity
    speed = math.hypot(*velocity)
    error = abs(math.atan2(velocity[1], velocity[0])) if speed > 0.0 else 0.0
    if error > kinematics.TURN_IN_PLACE:
        return velocity
    radius = braking_radius(view.sensors)
    margin = radius - view.sensors.radius
    if len(view.sensors.footprint) > 1 and error < STRAIGHT:
        free = max(free_ahead(view, margin) - margin, 0.0)
    else:
        free = max(view.free_ahead(radius) - margin, 0.0)
    limit = free / drive.step
    if math.isfinite(drive.max_acceleration):
        limit = min(limit, math.sqrt(2.0 * drive.max_acceleration * free))
    if speed <= limit:
        return velocity
    # A vanishing speed keeps the direction, so that the robot goes on turning.
    share = max(limit, 1e-6) / speed
    return velocity[0] * share, velocity[1] * share


def as_number(choice: int) -> NDArray[np.int64]:
    """The number of a discrete action, as an action."""
    return np.asarray(choice, dtype=np.int64)
