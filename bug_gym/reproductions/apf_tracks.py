"""Episodes of the reproduction apf-wall-following step by step: what its figures show, and how a robot turned."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from bug_gym.agents import make_policy
from bug_gym.agents.potential_field.apf_wall_following import ApfWallFollowingParameters
from bug_gym.agents.potential_field.forces import attractive_potential
from bug_gym.agents.potential_field.wall_follower import expected_bearing
from bug_gym.reproductions.result import Curves
from bug_gym.simulation import Simulation
from bug_gym.view import View

Variant = tuple[str, Mapping[str, Any]]
"""Name and parameters of a policy."""
SAMPLES = 12
"""Points of a curve over time."""


class Track(NamedTuple):
    """One episode, step by step."""

    outcome: str
    verdict: str
    path: Any
    """True poses (T, 3)."""
    modes: list[str]
    distances: list[float]
    """To the target at each step [m]."""
    values: list[float]
    """Of the attractive potential, the Lyapunov function of the field."""
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
    def phases(self) -> int:
        """How often a wall was followed."""
        return sum(
            now != "potential_field" and before == "potential_field"
            for before, now in zip(["potential_field", *self.modes], self.modes, strict=False)
        )


def drive(scenario: Any, variant: Variant, overrides: Mapping[str, Any] | None = None) -> Track:
    """Drive one episode and keep what the figures show."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    name, parameters = variant
    policy: Any = make_policy(name, simulation, **parameters)
    state: tuple[Any, ...] | None = None
    observation = simulation.reset(seeds=[0])
    path, modes, distances, values, angles, ended = [simulation.world.pose[0, 0].copy()], [], [], [], [], False
    while not ended:
        action, state = policy.predict(observation[:, 0], state)
        assert state is not None
        memory, goal = state[0], simulation.info()["goal_distance"][0, 0]
        modes.append(memory.mode)
        distances.append(float(goal))
        field, turning = getattr(policy, "field", None), getattr(memory, "turning", None)
        speed = math.hypot(*View(observation[0, 0], policy.sensors).own_velocity)
        values.append(attractive_potential(field.gains, (float(goal), 0.0), (speed, 0.0)) if field else math.nan)
        angles.append(math.degrees(turning.cumulative) if turning is not None else math.nan)
        step = simulation.step(action[:, None])
        observation = step.observation
        path.append(simulation.world.pose[0, 0].copy())
        ended = bool(memory.verdict) or bool(step.terminated.any() or step.truncated.any())
    info = simulation.info()
    return Track(
        outcome=str(info["outcome"][0, 0]),
        verdict=memory.verdict,
        path=np.array(path),
        modes=modes,
        distances=distances,
        values=values,
        angles=angles,
        step=simulation.scenario.time.step,
        clearance=float(info["min_clearance"][0, 0]),
    )


def told(track: Track) -> str:
    """The length of a way that arrived, or how it ended."""
    return f"{track.length + track.distances[-1]:.2f}" if track.outcome == "success" else track.verdict or track.outcome


def over_time(title: str, track: Track) -> Curves:
    """Distance and Lyapunov value over time, as shares of the greatest."""
    chosen = np.linspace(0, len(track.distances) - 1, SAMPLES).astype(int)
    lines = {}
    for name, values in (("distance to the target", track.distances), ("Lyapunov value", track.values)):
        share = np.asarray(values)[chosen] / max(values)
        lines[name] = [(float(one), float(one), float(one)) for one in share]
    return Curves(title, "time [s]", "share of the greatest", times(track, chosen), lines)


def angle_curve(title: str, track: Track) -> Curves:
    """The cumulative angle over time, in turns; zero in the field."""
    chosen = np.linspace(0, len(track.angles) - 1, SAMPLES).astype(int)
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


def times(track: Track, chosen: Any) -> list[float]:
    """Times of some steps [s]."""
    return [round(float(number) * track.step, 0) for number in chosen]


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
