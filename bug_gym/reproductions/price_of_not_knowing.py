"""What not knowing the map costs: every policy's path over the shortest one, by what it remembers and how far it sees.

All drive the same robot, that of the shipped models, through the same worlds: fields of scattered obstacles, mazes, rooms,
a trap, and with `--data` the maps of ROS's map_server in a folder. Between the bugs, which remember a point or two, and
the planners that are given the map (marked privileged: the visibility graph is the optimum as a robot drives it) stand
HD-BUG, whose list of light areas is a memory of ground, and those that draw a map of their own: `hd_bug_map` and D* Lite in
unknown terrain. A path is compared with the exact shortest one for the same disc. The second half looks at the range of the
LIDAR: what each metre of it is worth.
"""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bug_gym.agents import AGENTS
from bug_gym.agents.learning.folder import lone_names
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import path_ratio
from bug_gym.intervals import means, stratified_bootstrap
from bug_gym.reproductions.claims import FIRST_SEED, as_percent, entry, finite, mean, numbers, of
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Curves, Reproduction, Settings, Table
from bug_gym.reproductions.scripted_and_learned import ROBOT, Described, real_maps

WORLDS = 50
TIME_LIMIT = 1000.0
"""Long enough for the longest laps [s]."""
SCENARIOS: dict[str, Described] = {
    "fields": ("static", {}),
    "mazes": ("maze", {}),
    "rooms": ("rooms", {}),
    "u_trap": ("u_trap", {"world.rotation": "random"}),
}
"""By label."""

UNKNOWN = "d_star_lite (unknown terrain)"
PLANNERS: tuple[Any, ...] = (
    {"name": "d_star_lite", "label": UNKNOWN, "parameters": {"known": False}},
    "a_star",
    "visibility_graph",
)
MAPPER = "hd_bug_map"
"""Draws a map of its own, as D* Lite does."""
LEFT_OUT = ("com",)
"""Second names."""

RANGES = (1.0, 2.0, 3.5, 5.0, 10.0)
"""Of the LIDAR [m]."""
SEERS: tuple[Any, ...] = ("bug2", "dist_bug", "vis_bug_22", "tangent_bug", "hd_bug", entry(MAPPER), PLANNERS[0])
"""Who is driven with each of them."""

SLACK = 0.011
"""By how much the shortest path may come out too long for a path that is driven: see `bug_gym.shortest_path`."""


def reproduce(settings: Settings) -> Reproduction:
    """Drive everybody through everything, then some with each range.

    Raises:
        ValueError: a folder of data without maps.
    """
    scenarios = SCENARIOS if settings.data is None else {**SCENARIOS, **real_maps(settings.data)}
    bugs = [name for name, line in AGENTS.items() if line.family in ("bug", "field") and name not in LEFT_OUT]
    by_label = {label_of(one): one for one in PLANNERS}
    asked = settings.policies or (*bugs, MAPPER, *lone_names(), *by_label)
    policies = [by_label.get(name, entry(name)) for name in asked]
    worlds = settings.seeds or WORLDS
    rows = drive(policies, scenarios, worlds, settings, {})
    episodes = replayable(rows, policies, changed(scenarios, {}))
    labels = list(dict.fromkeys(row.policy for row in rows))
    tables = [price_table(label, of(rows, scenario=label), labels) for label in scenarios]
    data: dict[str, Any] = {"worlds": worlds, "policies": {}, "ranges": {}}
    for policy in labels:
        mine = {label: of(rows, policy=policy, scenario=label) for label in scenarios}
        data["policies"][policy] = {label: described(found) for label, found in mine.items() if found}
    chosen = [one for one in SEERS if not settings.policies or label_of(one) in settings.policies]
    curves = []
    by_range: dict[float, Sequence[EpisodeRow]] = {}
    if chosen:
        names = {label_of(one) for one in chosen}
        driven = [row for row in rows if row.policy in names and row.scenario in SCENARIOS]
        for metres in RANGES:
            # With the range that the robot has anyway, all of them have been driven above.
            by_range[metres] = driven
            if metres != ROBOT["lidar.range"]:
                other = {"lidar.range": metres}
                by_range[metres] = drive(chosen, SCENARIOS, worlds, settings, other)
                episodes += replayable(by_range[metres], chosen, changed(SCENARIOS, other), f"{{}}, {metres:g} m")
        tables += [range_table(label, by_range) for label in SCENARIOS]
        curves = [range_curves(label, by_range) for label in SCENARIOS]
        data["ranges"] = {
            f"{metres:g}": {
                label: {label_of(one): described(of(found, policy=label_of(one), scenario=label)) for one in chosen}
                for label in SCENARIOS
            }
            for metres, found in by_range.items()
        }
    faults = too_short([*rows, *(row for found in by_range.values() for row in found)])
    data["too_short"] = faults
    notes = [
        f"{worlds} worlds a scenario, the same for all; path over the shortest one for the same disc, of those that "
        "arrived, with its 95 % interval; share of the optimum: shortest path over path, 0 for who did not arrive.",
        "privileged: was given the map.",
    ]
    return Reproduction("price-of-not-knowing", tables, notes, data, not faults, curves, rows, episodes=episodes)


def drive(
    policies: Sequence[Any],
    scenarios: Mapping[str, Described],
    worlds: int,
    settings: Settings,
    changes: Mapping[str, Any],
) -> list[EpisodeRow]:
    """Episodes of some policies in all scenarios, with changes of the robot."""
    suite = {
        "name": "price-of-not-knowing",
        "seeds": {"first": FIRST_SEED, "count": worlds},
        "scenarios": changed(scenarios, changes),
    }
    return evaluate(list(policies), suite, workers=settings.workers, progress=settings.progress)


def changed(scenarios: Mapping[str, Described], changes: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The scenarios of a suite, with changes of the robot."""
    return [
        {"scenario": source, "label": label, "overrides": {**ROBOT, **own, "time.limit": TIME_LIMIT, **changes}}
        for label, (source, own) in scenarios.items()
    ]


def label_of(policy: Any) -> str:
    """What tables call one of the policies above."""
    return policy if isinstance(policy, str) else str(policy.get("label", policy["name"]))


def memory_of(label: str) -> str:
    """What a policy keeps, as the docstring of its module says; "" for one that is not of the table."""
    name = label.split(" ")[0]
    if label.endswith("(privileged)"):
        return "the map, which is given"
    if name not in AGENTS:
        return ""
    if AGENTS[name].model:
        return "weights"
    text = str(importlib.import_module(f"bug_gym.agents.{AGENTS[name].entry_point.split(':')[0]}").__doc__)
    told = re.search(r"Memory\s+kept:\s+(.*?)[.;]\s", text, re.DOTALL)
    return " ".join(told[1].split()) if told else ""


def share_of_optimum(row: EpisodeRow) -> float:
    """Shortest path over path, 0 where the goal was not reached."""
    return 1.0 / path_ratio(row) if row.success else 0.0


def described(rows: Sequence[EpisodeRow]) -> dict[str, Any]:
    """What JSON keeps of some episodes of one policy."""
    ratio, low, high = interval([path_ratio(row) for row in rows if row.success])
    shares = interval([share_of_optimum(row) for row in rows])
    return {
        **numbers(rows),
        "path_ratio_interval": [finite(low), finite(high)],
        "path_ratio": finite(ratio),
        "share_of_optimum": [finite(value) for value in shares],
    }


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean with its 95 % interval by bootstrap; NaN of nothing."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return math.nan, math.nan, math.nan
    return mean(known), *stratified_bootstrap([known], means, resamples=1000, seed=0)


def told(values: tuple[float, float, float]) -> str:
    """A mean with its interval as text."""
    if math.isnan(values[0]):
        return "-"
    return f"{values[0]:.3f}" if math.isnan(values[1]) else f"{values[0]:.3f} [{values[1]:.3f}, {values[2]:.3f}]"


def price_table(label: str, rows: Sequence[EpisodeRow], policies: Sequence[str]) -> Table:
    """One scenario, the policy with the largest share of the optimum first."""
    lines = []
    for policy in policies:
        mine = of(rows, policy=policy)
        if not mine:
            continue
        ratio = interval([path_ratio(row) for row in mine if row.success])
        shares = interval([share_of_optimum(row) for row in mine])
        lines.append((shares[0], [policy, as_percent(mine), told(ratio), told(shares), memory_of(policy)]))
    lines.sort(key=lambda line: -line[0])
    header = ["policy", "reached [%]", "path / shortest", "share of the optimum", "remembers"]
    return Table(f"{label}: what not knowing costs", header, [line for _, line in lines])


def range_table(label: str, by_range: Mapping[float, Sequence[EpisodeRow]]) -> Table:
    """Share of the optimum against the range of the LIDAR, one scenario."""
    policies = list(dict.fromkeys(row.policy for rows in by_range.values() for row in rows))
    lines = [
        [policy, *(f"{mean(shares_in(rows, policy, label)):.3f}" for rows in by_range.values())] for policy in policies
    ]
    return Table(f"{label}: share of the optimum by range of the LIDAR [m]", ["policy", *map(str, by_range)], lines)


def range_curves(label: str, by_range: Mapping[float, Sequence[EpisodeRow]]) -> Curves:
    """The same to draw, with its intervals."""
    policies = list(dict.fromkeys(row.policy for rows in by_range.values() for row in rows))
    lines = {policy: [interval(shares_in(rows, policy, label)) for rows in by_range.values()] for policy in policies}
    return Curves(label, "range of the LIDAR [m]", "shortest path over path", list(by_range), lines)


def shares_in(rows: Sequence[EpisodeRow], policy: str, scenario: str) -> list[float]:
    """The shares of the optimum of a policy in a scenario."""
    return [share_of_optimum(row) for row in of(rows, policy=policy, scenario=scenario)]


def too_short(rows: Sequence[EpisodeRow]) -> list[list[Any]]:
    """Policy, scenario and seed of paths that are shorter than the shortest: there should be none."""
    found = [row for row in rows if row.success and path_ratio(row) < 1.0 - SLACK]
    return [[row.policy, row.scenario, row.seed, float(np.round(path_ratio(row), 4))] for row in found]
