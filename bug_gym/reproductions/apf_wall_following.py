"""Potential field with wall following: its scenes, routes and claims run again, beside its opponents.

The paper's table of path lengths and its displayed formulas are lost, so there is nothing to compare with number by
number: scenes are rebuilt in its manner, and its sentences are put to the test. Shorter than the minimum risk method,
TangentBug and Bug2? Does it stand odometry that drifts, for which it is proposed? What is each of its parts worth?
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely

from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions import apf_worlds, sweep
from bug_gym.reproductions.apf_tracks import (
    Track,
    Variant,
    along_wall,
    angle_curve,
    drive,
    on_the_spot,
    over_time,
    reversals,
    told,
    turning_radii,
)
from bug_gym.reproductions.apf_worlds import CLEARANCE, WALL_X
from bug_gym.reproductions.claims import as_percent, finite, mean, numbers
from bug_gym.reproductions.oni_wang_table_1 import OVERRIDES, allowed_difference
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Curves, Reproduction, Settings, Table
from bug_gym.workers import each, starred

SEEDS, ABLATION_SEEDS = 200, 500
OURS = "apf_wall_following"

METHODS: dict[str, Variant] = {
    OURS: (OURS, {"clearance": CLEARANCE}),
    "minimum_risk": ("minimum_risk", {}),
    "tangent_bug, 2 m": ("tangent_bug", {"clearance": CLEARANCE, "r_max": 2.0}),
    "bug2": ("bug2", {"clearance": CLEARANCE}),
    "apf": ("apf", {}),
}
"""The paper's four, and the field alone."""
PARTS: dict[str, Mapping[str, Any]] = {
    "whole": {},
    "reset=False": {"reset": False},
    "projection=False": {"projection": False},
    "form=unwrapped": {"form": "unwrapped"},
    "leave=free": {"leave": "free"},
    "leave=distance": {"leave": "distance", "projection": False},
    "leave=heading": {"leave": "heading", "projection": False},
}
"""What is left out: conditions 1 and 3, the angle; and the two rules that the paper calls too simple."""

ALPHAS: dict[str, Mapping[str, Any]] = {
    "alpha=90, alpha_gain=0": {"alpha": 90.0, "alpha_gain": 0.0},
    "alpha=92, alpha_gain=0": {"alpha": 92.0, "alpha_gain": 0.0},
    "whole": {},
}
"""The two of Fig. 6, which the distance does not change, and ours, which it does."""
AT_THE_WALL = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 40.0)
"""Times since the wall was met at which Fig. 6 is told [s]."""

PHASES, OVER_TIME = ("8a", "8c", "12a", "12b"), ("8a", "8c")
"""Scenes whose walls are told one by one; and those whose V and distance are drawn, as in Fig. 9."""

ROUTES = ("AB", "AC", "AD", "BA", "BC", "BD", "CA", "CB", "CD", "DA", "DB", "DC")
IDEAL = {
    "left": (17.10, 225.97, 42.82, 130.18, 106.83, 31.68, 138.28, 10.90, 59.82, 44.90, 57.24, 266.11),
    "right": (74.52, 83.19, 45.57, 16.73, 10.90, 96.07, 139.41, 132.66, 87.72, 39.13, 32.38, 41.04),
}
"""Lengths [m] of a point that goes straight until contact and follows the rounded contour of the map at 1 m."""
CYCLES = {("left", "AC"), ("left", "BC"), ("left", "DC")}
"""Routes that are cycles without the projection of condition 3."""
CLOSED_FORMS: dict[str, tuple[str, Mapping[str, Any], float, tuple[float, float]]] = {
    "U": ("u_trap", {}, 0.5, (37.26, 37.26)),
    **{
        f"hook, {start} to {goal}": (
            "hook",
            {"world.start": [*start, 0.0], "world.goal": list(goal), "world.bounds": [-15, -15, 35, 25]},
            0.4,
            lengths,
        )
        for start, goal, lengths in (
            ((7, 0), (30, 0), (40.45, 80.1)),
            ((7, 0), (-10, 0), (78.11, 30.4)),
            ((7, 3), (9, 20), (96.75, 18.0)),
            ((30, 0), (7, 0), (56.31, 33.3)),
        )
    },
}
"""Scenario, its places, clearance, and the lengths of such a point there, turning left and right; right of the hook to 1 %."""

DRIFTING = (OURS, "bug2", "tangent_bug", "minimum_risk")
BIASES = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Of the gyroscope at 1 m/s [degrees/s]."""
NOISES = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Of the odometry's distance [m/sqrt(m)]; the heading's is a fifth [rad/sqrt(m)]."""
DRIFT_SCENARIOS = ("static", "u_trap", "hook")


# ---------------------------------------------------------------------------------------------- scenes


class Part(NamedTuple):
    """What one part of the reproduction found."""

    tables: list[Table]
    data: dict[str, Any]
    holds: bool = True
    curves: Sequence[Curves] = ()
    notes: Sequence[str] = ()
    episodes: Sequence[Replayable] = ()


def shown(
    label: str, scene: str, track: Track, variant: Variant, scenario: Any, overrides: Mapping[str, Any] | None = None
) -> Replayable:
    """An episode of `drive`, for the page."""
    end = (track.outcome == "success", "gave_up" if track.verdict else track.outcome, track.verdict)
    return Replayable(label, scene, 0, *end, driver_of(variant), scenario, overrides or {}, steps=len(track.modes))


def driver_of(variant: Variant) -> dict[str, Any]:
    """A variant as a policy of a suite."""
    return {"name": variant[0], "parameters": dict(variant[1])}


def still_scenes() -> Part:
    """Lengths of all methods in the scenes; the paper's method arrives in each."""
    lines, data, tracks, episodes = [], {}, {}, []
    for name, scenario in apf_worlds.scenes().items():
        found = {label: drive(scenario, variant) for label, variant in METHODS.items()}
        tracks[name] = found[OURS]
        episodes += [shown(label, name, track, METHODS[label], scenario) for label, track in found.items()]
        lines.append([name, *(told(track) for track in found.values()), str(len(found[OURS].phases))])
        data[name] = {label: {"ending": told(track), "walls": len(track.phases)} for label, track in found.items()}
    holds = all(track.outcome == "success" for track in tracks.values())
    table = Table("Still scenes in the manner of Figs. 7, 8a, 10, 12a: length [m]", ["scene", *METHODS, "walls"], lines)
    return Part(
        [table], {"scenes": data}, holds, [angle_curve("Theta along a U (7c)", tracks["7c"])], episodes=episodes
    )


def moving_scenes() -> Part:
    """Moving obstacles and targets: does it arrive, and how near does it come to anything?"""
    lines, data, episodes, holds = [], {}, [], True
    for name, scenario in apf_worlds.moving_scenes().items():
        found = {
            kind: drive(scenario, METHODS[OURS], {"robot.kinematics": kind}) for kind in ("holonomic", "differential")
        }
        for kind, track in found.items():
            own = {"robot.kinematics": kind}
            episodes.append(shown(OURS, f"{name}, {kind}", track, METHODS[OURS], scenario, own))
            walls = len(track.phases)
            lines.append([name, kind, told(track), str(walls), f"{track.clearance:.2f}"])
            data[f"{name}, {kind}"] = {"ending": told(track), "walls": walls, "clearance": track.clearance}
            holds = holds and track.outcome == "success"
    table = Table(
        "Moving scenes in the manner of Figs. 8b to 8f and 12b",
        ["scene", "robot", "length [m]", "walls", "clearance [m]"],
        lines,
    )
    return Part([table], {"moving": data}, holds, episodes=episodes)


def wall_phases() -> Part:
    """When walls are taken up and left in the scenes of Figs. 9 and 12, and whether V falls where nothing repels."""
    lines, data, curves = [], {}, []
    for name, scenario in {name: (apf_worlds.scenes() | apf_worlds.moving_scenes())[name] for name in PHASES}.items():
        walls = shapely.union_all([shapely.Polygon(corners) for corners in scenario["world"]["polygons"]])
        for kind in ("holonomic", "differential"):
            track = drive(scenario, METHODS[OURS], {"robot.kinematics": kind})
            phases = [
                {**one._asdict(), "from_wall": walls.distance(shapely.Point(one.x, one.y))} for one in track.phases
            ]
            told_of = {"ending": told(track), "free": sum(track.free), "rises": track.rises, "phases": phases}
            data[f"{name}, {kind}"] = told_of
            lines += [
                [name, kind, *(f"{one[key]:.2f}" for key in ("begins", "ends", "entered", "left", "from_wall"))]
                for one in phases
            ]
            if name in OVER_TIME and kind == "holonomic":
                curves += over_time(name, track)
    header = ["scene", "robot", "from [s]", "to [s]", "to the target then [m]", "and then [m]", "still wall at [m]"]
    table = Table("Walls followed in the scenes of Figs. 9 and 12", header, lines)
    return Part([table], {"phases": data}, has_phases(data) and falls(data), curves)


def has_phases(found: Mapping[str, Any]) -> bool:
    """Whether walls are followed as often as the paper says of Fig. 12: twice, in one kind of robot; once, in both."""
    return len(found["12a, holonomic"]["phases"]) == 2 and all(
        len(found[f"12b, {kind}"]["phases"]) == 1 for kind in ("holonomic", "differential")
    )


def falls(found: Mapping[str, Any]) -> bool:
    """Whether V falls at every step in the field in which nothing repels."""
    return all(one["free"] > 0 and one["rises"] == 0 for one in found.values())


def alphas() -> Part:
    """Fig. 6: how far from a straight wall the robot goes, and in which direction, by alpha."""
    found = {}
    for label, changes in ALPHAS.items():
        parameters = {"clearance": CLEARANCE, "turn": "left", **changes}
        track = drive(apf_worlds.straight_wall(), (OURS, parameters))
        found[label] = along_wall(track, parameters, WALL_X, AT_THE_WALL)
    header = ["", *(f"{time:g} s" for time in AT_THE_WALL)]
    titles = {"distance": "distance from a straight wall [m]"}
    titles |= {kind: f"direction {kind}, towards the wall [degrees]" for kind in ("expected", "driven")}
    tables = [
        Table(
            f"Fig. 6: {title}",
            header,
            [[label, *(f"{value:z.2f}" for value in one[kind])] for label, one in found.items()],
        )
        for kind, title in titles.items()
    ]
    return Part(tables, {"Fig. 6": {"times": list(AT_THE_WALL), "alphas": found}}, leans(found))


def leans(found: Mapping[str, Any]) -> bool:
    """Whether 92 degrees expect a direction that leans more to the wall than 90, and lead nearer to it: the paper's words."""
    plain, leaning, _ = (found[label] for label in ALPHAS)
    more = all(one > other for one, other in zip(leaning["expected"], plain["expected"], strict=True))
    ways = zip(leaning["distance"], plain["distance"], strict=True)
    return more and all(one < other for one, other in list(ways)[1:])


# ---------------------------------------------------------------------------------------------- routes


def routes(chosen: Sequence[str]) -> Part:
    """The map of Oni and Wang, both sides: straight until contact, without the projection, and with the field."""
    kinds: dict[str, Mapping[str, Any]] = {
        "straight": {"approach": "straight"},
        "straight, no projection": {"approach": "straight", "projection": False},
        "straight, no reset": {"approach": "straight", "reset": False},
        "straight, unwrapped": {"approach": "straight", "form": "unwrapped"},
        "straight, by distance": {"approach": "straight", **PARTS["leave=distance"]},
        "straight, by heading": {"approach": "straight", **PARTS["leave=heading"]},
        "field": {},
    }
    lines, data, episodes, holds = [], {}, [], True
    for turn, ideal in IDEAL.items():
        for route, length in zip(ROUTES, ideal, strict=True):
            if route not in chosen:
                continue
            places = {**OVERRIDES, "world.start": route[0], "world.goal": route[1]}
            variants = {kind: (OURS, {"clearance": 1.0, "turn": turn, **own}) for kind, own in kinds.items()}
            found = {kind: drive("oni_wang", variant, places) for kind, variant in variants.items()}
            for kind, track in found.items():
                episodes.append(shown(kind, f"route {route}, {turn}", track, variants[kind], "oni_wang", places))
            holds = holds and found["field"].outcome == "success" and is_as_long(found["straight"], length)
            cycles = found["straight, no projection"].verdict == "looping"
            holds = holds and cycles == ((turn, route) in CYCLES)
            lines.append([turn, route, f"{length:.2f}", *(told(track) for track in found.values())])
            data[f"{turn} {route}"] = {"ideal": length, **{kind: told(track) for kind, track in found.items()}}
    table = Table("Length [m] on the map of Oni and Wang at 1 m", ["turn", "route", "ideal", *kinds], lines)
    return Part([table], {"routes": data}, holds, episodes=episodes)


def closed_forms() -> Part:
    """The U and the hook, both sides: straight until contact and with the field, beside the length of a point.

    The field is caught some 0.8 m before a wall ahead and slides a little along one askew; with these clearances it goes on
    to it from there, and leaves in the same place. The 1 m of the map has it go back first.
    """
    lines, data, episodes, holds = [], {}, [], True
    for name, (scenario, own, clearance, lengths) in CLOSED_FORMS.items():
        for turn, length in zip(("left", "right"), lengths, strict=True):
            places, found = {**OVERRIDES, **own}, {}
            for kind in ("straight", "field"):
                variant = (OURS, {"clearance": clearance, "turn": turn, "approach": kind})
                found[kind] = drive(scenario, variant, places)
                episodes.append(shown(kind, f"{name}, {turn}", found[kind], variant, scenario, places))
                holds = holds and is_as_long(found[kind], length)
            lines.append([name, turn, f"{length:.2f}", *map(told, found.values())])
            data[f"{name}, {turn}"] = {"ideal": length, **{kind: told(track) for kind, track in found.items()}}
    table = Table("Length [m] in the U and the hook", ["trap", "turn", "ideal", "straight", "field"], lines)
    return Part([table], {"closed forms": data}, holds, episodes=episodes)


def is_as_long(track: Track, ideal: float) -> bool:
    """Whether it arrived by a way of the ideal length, within 1.5 % or three steps."""
    return track.outcome == "success" and abs(track.full_length - ideal) <= allowed_difference(ideal)


# ---------------------------------------------------------------------------------------------- many worlds


def trap_rows(seed: int, variants: Mapping[str, Variant]) -> list[EpisodeRow]:
    """What each variant does in the trap of a seed."""
    return world_rows(apf_worlds.trap(seed), "traps", seed, variants)


def maze_rows(seed: int, variants: Mapping[str, Variant]) -> list[EpisodeRow]:
    """What each variant does in the maze of a seed."""
    return world_rows(maze(seed), "mazes", seed, variants)


def maze(seed: int) -> dict[str, Any]:
    """The scenario of all seeds."""
    return {**apf_worlds.ROBOT, "world": {"family": "maze"}}


WORLDS: dict[Callable[..., list[EpisodeRow]], Callable[[int], dict[str, Any]]] = {
    trap_rows: apf_worlds.trap,
    maze_rows: maze,
}
"""Where each drives."""


def world_rows(scenario: Any, name: str, seed: int, variants: Mapping[str, Variant]) -> list[EpisodeRow]:
    """What each variant does in one world."""
    entry = ScenarioEntry(name, load(scenario), range(seed, seed + 1))
    rows = []
    for label, (policy, parameters) in variants.items():
        rollout = Rollout(PolicyEntry(label, policy, dict(parameters)), entry, [seed], slots=1)
        ((row,),) = rollout.worlds()
        rows.append(row)
    return rows


def compare(
    title: str,
    worlds: Callable[[int, Mapping[str, Variant]], list[EpisodeRow]],
    variants: Mapping[str, Variant],
    seeds: int,
    settings: Settings,
) -> Part:
    """Success, wrong claims and lengths of variants in many worlds; lengths where the first one arrives too."""
    jobs = [(seed, variants) for seed in range(seeds)]
    with progress_bar(shown=settings.progress) as track:
        work = each(partial(starred, worlds), jobs, settings.workers, in_order=True)
        rows = [row for chunk in track(work, title, len(jobs)) for row in chunk]
    by_label = {label: [row for row in rows if row.policy == label] for label in variants}
    first = {row.seed: row for row in next(iter(by_label.values())) if row.success}
    lines, data, holds = [], {}, True
    for label, mine in by_label.items():
        wrong = sum(row.verdict == "unreachable" or row.outcome == "collision" for row in mine)
        shared = [(row, first[row.seed]) for row in mine if row.success and row.seed in first]
        ratio = mean([one.path_length / other.path_length for one, other in shared])
        reached = [row for row in mine if row.success]
        ways, turns = ([getattr(row, name) for row in reached] for name in ("path_length", "total_turning"))
        lines.append([label, as_percent(mine), str(wrong), f"{mean(ways):.2f}", f"{ratio:.2f}", f"{mean(turns):.1f}"])
        data[label] = {**numbers(mine), "wrong": wrong, "length_ratio": finite(ratio)}
        holds = holds and wrong == 0
    header = ["", "reached [%]", "touched or wrong", "length [m]", "to the first", "turning [rad]"]
    episodes = [
        Replayable(row.policy, title, row.seed, row.success, row.outcome, row.verdict, driver_of(variants[row.policy]),
                   partial(WORLDS[worlds], row.seed), steps=row.steps)
        for row in rows
    ]  # fmt: skip
    return Part([Table(f"{title}, {seeds} worlds", header, lines)], {title: data}, holds, episodes=episodes)


# ---------------------------------------------------------------------------------------------- drift, limits


def drift(seeds: int, settings: Settings) -> Part:
    """Success against the drift of gyroscope and odometry, the goal a beacon or computed."""
    common = {"robot.max_speed": 1.0, "lidar.beams": 180, "time.limit": 300.0}
    biased = [{**common, "goal.sensing": "beacon", "odometry.rotation_bias": math.radians(bias)} for bias in BIASES]
    noisy = [
        {**common, "odometry.translation_noise": noise, "odometry.rotation_noise": 0.2 * noise} for noise in NOISES
    ]
    odometry = "odometry noise [m/sqrt(m)]"
    sweeps = [
        sweep.Sweep("Gyro bias, goal a beacon", "bias at 1 m/s [degrees/s]", BIASES, biased, DRIFT_SCENARIOS),
        sweep.Sweep(
            "Noise, goal a beacon",
            odometry,
            NOISES,
            [{**one, "goal.sensing": "beacon"} for one in noisy],
            DRIFT_SCENARIOS,
        ),
        sweep.Sweep(
            "Noise, goal by odometry",
            odometry,
            NOISES,
            [{**one, "goal.sensing": "odometry"} for one in noisy],
            DRIFT_SCENARIOS,
        ),
    ]
    found = [sweep.run(one, settings.policies or DRIFTING, seeds, settings) for one in sweeps]
    tables = [table for one in found for table in sweep.tables(one)]
    data = {"drift": [sweep.numbers(one) for one in found]}
    episodes = [episode for one in found for episode in one.episodes]
    return Part(tables, data, curves=[sweep.curves(one) for one in found], episodes=episodes)


def limits(seeds: int) -> Part:
    """What the paper names as its own limits: wide turns, uneven lines, abrupt switching; a differential robot in traps."""
    lines, data = [], {}
    for label, variant in METHODS.items():
        tracks = [drive(apf_worlds.trap(seed), variant, {"robot.kinematics": "differential"}) for seed in range(seeds)]
        radii = np.concatenate([turning_radii(track) for track in tracks])
        steps = sum(len(track.modes) for track in tracks)
        turned = sum(reversals(track) for track in tracks)
        switches = sum(sum(a != b for a, b in zip(track.modes, track.modes[1:], strict=False)) for track in tracks)
        way = math.fsum(track.length for track in tracks)
        tight = float(np.median(radii)) if len(radii) else math.nan
        share = sum(on_the_spot(track) for track in tracks) / steps
        found = {
            "radius": finite(tight),
            "reversals": 100.0 * turned / way,
            "switches": 100.0 * switches / way,
            "standing": share,
        }
        data[label] = found
        lines.append([label, *("-" if one is None else f"{one:.2f}" for one in found.values())])
    header = ["", "median turning radius [m]", "reversals a 100 m", "switches a 100 m", "share of steps on the spot"]
    return Part([Table(f"Limits, a differential robot in {seeds} traps", header, lines)], {"limits": data})


def reproduce(settings: Settings) -> Reproduction:
    """Run all of it, the drift in a quarter as many worlds; below ten seeds a few routes only."""
    seeds = settings.seeds or SEEDS
    few = settings.seeds is not None and settings.seeds < 10
    parts = {name: (OURS, {"clearance": CLEARANCE, **changes}) for name, changes in PARTS.items()}
    found = [
        still_scenes(),
        moving_scenes(),
        wall_phases(),
        alphas(),
        routes(ROUTES[:3] if few else ROUTES),
        closed_forms(),
        compare("Traps", trap_rows, METHODS, seeds, settings),
        compare("Mazes", maze_rows, METHODS, seeds, settings),
        compare("What parts are worth, traps", trap_rows, parts, settings.seeds or ABLATION_SEEDS, settings),
        limits(min(seeds, 20)),
        drift(max(seeds // 4, 1), settings),
    ]
    notes = [
        "The paper's Table 1 is lost: no length can be compared with a printed one.",
        "The paper's robot follows two walls in 12a and one in 12b. Held to it are a holonomic robot in 12a, as the walls of "
        "a differential one are not two, and both in 12b.",
        "walls: how often a wall was followed. to the first: mean of length over length of the first line, both arriving.",
        "A holonomic robot of 0.5 m/s where none is named, of 0.3 m/s in 12a and 12b; the map's, the U's and the hook's as in "
        "oni-wang-table-1.",
    ]
    return Reproduction(
        "apf-wall-following",
        [table for part in found for table in part.tables],
        notes,
        {"seeds": seeds, **{key: value for part in found for key, value in part.data.items()}},
        all(part.holds for part in found),
        curves=[curve for part in found for curve in part.curves],
        episodes=[episode for part in found for episode in part.episodes],
    )
