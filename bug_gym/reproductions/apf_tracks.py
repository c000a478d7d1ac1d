"""Episodes of the reproduction apf-wall-following step by step: what its figures show, and how a robot turned."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bug_gym.agents import make_policy
from bug_gym.agents.potential_field.apf_wall_following import ApfWallFollowingParameters
from bug_gym.agents.potential_field.forces import Gains, attractive_potential
from bug_gym.agents.potential_field.wall_follower import expected_bearing
from bug_gym.geometry import Point
from bug_gym.reproductions.result import Curves
from bug_gym.simulation import Simulation

Variant = tuple[str, Mapping[str, Any]]
"""Name and parameters of a policy."""
SAMPLED = 1.0
"""Time between two points of a curve [s]."""


class Phase(NamedTuple):
    """A wall that was followed."""

    begins: float
    """When it was taken up [s]."""
    ends: float
    """When it was left, or the episode ended [s]."""
    entered: float
    """Distance to the target then [m]."""
    left: float
    """Distance to the target at that end [m]."""
    x: float
    """Where it was taken up [m]."""
    y: float
    """Likewise."""


class Track(NamedTuple):
    """One episode, step by step."""

    outcome: str
    verdict: str
    path: Any
    """True poses (T, 3)."""
    modes: list[str]
    distances: list[float]
    """To the target at each decision [m]."""
    rest: float
    """Distance to the target at the end [m]."""
    values: list[float]
    """V, of the attractive potential, the Lyapunov function of the field; NaN where there is none."""
    gains: Gains | None
    """Of the field; None where there is none."""
    free: list[bool]
    """Whether a decision is one of the field with nothing that repels."""
    angles: list[float]
    """Theta [degrees], NaN in the field."""
    step: float
    clearance: float
    """Least of the way [m]."""

    @property
    def length(self) -> float:
        """Of the way [m]."""
        return float(np.hypot(*np.diff(self.path[:, :2], axis=0).T).sum())

    @property
    def full_length(self) -> float:
        """Of the way and the rest of it to the target [m], which closed forms give."""
        return self.length + self.rest

    @property
    def phases(self) -> list[Phase]:
        """The walls that were followed, one after the other."""
        is_wall = np.array([False, *(mode != "potential_field" for mode in self.modes), False])
        found, distances = [], [*self.distances, self.rest]
        for first, end in np.flatnonzero(np.diff(is_wall)).reshape(-1, 2).tolist():
            begins, ends = times(self, [first, end])
            x, y, _ = self.path[first].tolist()
            found.append(Phase(begins, ends, distances[first], distances[end], x, y))
        return found

    @property
    def rises(self) -> int:
        """How often V did not fall, of the steps that go on after a free decision; the first has no velocity before it."""
        goes_on = np.hypot(*np.diff(self.path[: len(self.values), :2], axis=0).T) > 1e-6
        return int((np.array(self.free[:-1]) & goes_on & (np.diff(self.values) >= 0.0))[1:].sum())


def drive(scenario: Any, variant: Variant, overrides: Mapping[str, Any] | None = None) -> Track:
    """Drive one episode and keep what the figures show."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    name, parameters = variant
    policy: Any = make_policy(name, simulation, **parameters)
    state: tuple[Any, ...] | None = None
    observation = simulation.reset(seeds=[0])
    field, time_step = getattr(policy, "field", None), simulation.scenario.time.step
    path, modes, free, angles, ended = [simulation.world.pose[0, 0].copy()], [], [], [], False
    offsets = [to_target(simulation)]
    while not ended:
        action, state = policy.predict(observation[:, 0], state)
        assert state is not None
        memory = state[0]
        modes.append(memory.mode)
        free.append(field is not None and memory.mode == "potential_field" and not memory.felt.forces.obstacles)
        turning = getattr(memory, "turning", None)
        angles.append(math.degrees(turning.cumulative) if turning is not None else math.nan)
        step = simulation.step(action[:, None])
        observation = step.observation
        path.append(simulation.world.pose[0, 0].copy())
        offsets.append(to_target(simulation))
        ended = bool(memory.verdict) or bool(step.terminated.any() or step.truncated.any())
    info = simulation.info()
    distances = [math.hypot(*offset) for offset in offsets]
    return Track(
        outcome=str(info["outcome"][0, 0]),
        verdict=memory.verdict,
        path=np.array(path),
        modes=modes,
        distances=distances[:-1],
        rest=distances[-1],
        values=lyapunov_values(field.gains, offsets[:-1], time_step) if field else [math.nan] * len(modes),
        gains=field.gains if field else None,
        free=free,
        angles=angles,
        step=time_step,
        clearance=float(info["min_clearance"][0, 0]),
    )


def to_target(simulation: Simulation) -> Point:
    """p_T - p of the only robot [m]."""
    x, y = (simulation.world.goal[0, 0] - simulation.world.pose[0, 0, :2]).tolist()
    return x, y


def lyapunov_values(gains: Gains, offsets: Sequence[Point], step: float) -> list[float]:
    """V = alpha_p |p_T - p|^m + alpha_v |v_T - v|^2 at each decision, v_T - v as of the step before; none at the first.

    Args:
        gains: of the field.
        offsets: p_T - p at each decision [m].
        step: time between them [s].
    """
    velocities = [(0.0, 0.0), *np.diff(offsets, axis=0) / step]
    return [float(attractive_potential(gains, *one)) for one in zip(offsets, velocities, strict=True)]


def told(track: Track) -> str:
    """The length of a way that arrived, or how it ended."""
    return f"{track.full_length:.2f}" if track.outcome == "success" else track.verdict or track.outcome


def over_time(scene: str, track: Track) -> list[Curves]:
    """Distance over time, filled where a wall is followed; and what V has beside it, as V itself would lie on that line."""
    if track.gains is None:
        raise ValueError("no potential field: there is no V to draw")
    chosen = sampled(track)
    low = [0.0 if mode != "potential_field" else one for mode, one in zip(track.modes, track.distances, strict=True)]
    of_distance = [attractive_potential(track.gains, (one, 0.0), (0.0, 0.0)) for one in track.distances]
    beside = [one - other for one, other in zip(track.values, of_distance, strict=True)]
    both = {
        "distance to the target": ("distance [m], filled along a wall", low, track.distances),
        "V - alpha_p d": ("V less its part of the distance", beside, beside),
    }
    return [
        Curves(
            f"{name}, {scene}",
            "time [s]",
            label,
            times(track, chosen),
            {name: [(high[one], low[one], high[one]) for one in chosen]},
            y_range=(-0.02 * max(high), 1.05 * max(high)),
        )
        for name, (label, low, high) in both.items()
    ]


def angle_curve(title: str, track: Track) -> Curves:
    """The cumulative angle over time, in turns; zero in the field."""
    chosen = sampled(track)
    turns = np.nan_to_num(np.asarray(track.angles)[chosen]) / 360.0
    line = [(float(one), float(one), float(one)) for one in turns]
    return Curves(title, "time [s]", "turns", times(track, chosen), {"Theta": line}, y_range=(-1.02, 1.02))


def along_wall(track: Track, parameters: Mapping[str, Any], wall_x: float, after: Sequence[float]) -> dict[str, Any]:
    """Distance to a wall along y on the robot's right, and its direction there, as in Fig. 6.

    Args:
        track: of a robot that follows that wall until the last of the times.
        parameters: of its policy, with the clearance.
        wall_x: where the wall is [m].
        after: times since it began to follow [s].

    Returns:
        `distance` [m], and by how much the direction that the robot expects and the one that it goes lean to the wall,
        `expected` and `driven` [degrees], each a list as long as `after`.
    """
    first = next(number for number, mode in enumerate(track.modes) if mode != "potential_field")
    steps = [first + round(time / track.step) for time in after]
    distances = (wall_x - track.path[steps, 0]).tolist()
    own = ApfWallFollowingParameters(**parameters)
    settings: dict[str, Any] = {
        "alpha": math.radians(own.alpha),
        "gain": math.radians(own.alpha_gain),
        "clearance": own.clearance,
    }
    # As if the wall were on the left, where to lean to it is to turn by a positive angle.
    expected = [expected_bearing(0.5 * math.pi, one, -1, **settings) for one in distances]
    ways = np.diff(track.path[:, :2], axis=0)[steps]
    driven = np.degrees(np.arctan2(ways[:, 0], ways[:, 1])).tolist()
    return {"distance": distances, "expected": list(map(math.degrees, expected)), "driven": driven}


def sampled(track: Track) -> list[int]:
    """Decisions that a curve shows: one a SAMPLED, and the last."""
    last = len(track.modes) - 1
    return [*range(0, last, round(SAMPLED / track.step)), last]


def times(track: Track, chosen: Sequence[int]) -> list[float]:
    """Times of some decisions [s]."""
    return [round(number * track.step, 3) for number in chosen]


def steps_of(track: Track) -> tuple[Any, Any]:
    """Way [m] and turning [rad] of each step."""
    turned = np.diff(track.path[:, 2])
    return np.hypot(*np.diff(track.path[:, :2], axis=0).T), (turned + math.pi) % (2.0 * math.pi) - math.pi


def turning_radii(track: Track) -> Any:
    """Radius of each arc that is one: a step that goes on and turns by more than half a degree [m]."""
    way, turned = steps_of(track)
    arcs = (way > 1e-3) & (np.abs(turned) > math.radians(0.5))
    return way[arcs] / np.abs(turned[arcs])


def on_the_spot(track: Track) -> int:
    """Steps that turn without going on."""
    way, turned = steps_of(track)
    return int(((way <= 1e-3) & (np.abs(turned) > math.radians(0.5))).sum())


def reversals(track: Track) -> int:
    """How often the sense of turning changes, of turns of more than 30 degrees each."""
    _, turned = steps_of(track)
    count, run, last = 0, 0.0, 0
    for one in turned.tolist():
        run = run + one if run * one >= 0.0 else one
        sense = int(math.copysign(1.0, run)) if abs(run) > math.radians(30.0) else 0
        if sense != 0:
            count += last not in (0, sense)
            last = sense
    return count
