"""Com1-Rev3: worked facts, formulas and claims of its paper, and what holds of collision control that makes room.

The paper: Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments", sections 3.2 to 4.3.

Worked facts: both robots start at one place of the map of Fig. 1, turn left and have no bodies to one another. Formulas
(5) to (8) and (17) to (19): one obstacle across the way. Claim of section 4.2: against the pair inspired by Bug1 both
ways together are shorter "by at least half the length of the obstacle", always. Table 2 and Fig. 6 are run in their
manner, on maps of our own: the paper's are not printed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from bug_gym.config import Scenario, load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.teams import team_rows
from bug_gym.intervals import means, stratified_bootstrap, wilson_interval
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.reproductions.sweep import TURNED
from bug_gym.reproductions.team_runs import TeamRun, run_team
from bug_gym.reproductions.team_worlds import (
    CLEARANCE,
    FIG_6,
    GAZEBO,
    Across,
    alone,
    obstacles_across,
    random_world,
    team_scenario,
)
from bug_gym.workers import each

STEP = 0.1
"""Way of one step [m]."""
CONTACT = 0.5
"""Twice the radius of the robots of random worlds [m]."""
ROOMY = ["robots", "worlds", "contacts", "standstills", "detours", "off Com1's solo way", "least gap [m]", "held [%]"]
"""Columns of the table of random worlds."""
SAME_CURVE = 0.1
"""How far from its solo way a place of Com1's may lie [m]: a step."""

PAPER = {"lidar.beams": 360, "lidar.range": 15.0, "time.limit": 600.0}
"""A robot of 0.2 m that sees the goal from wherever an ideal one does."""


class Fact(NamedTuple):
    """A worked fact on the rounded contour."""

    winner: int
    """0: Com1, 1: Rev3."""
    named: float
    """Way of the winner when it is known to win [m]."""
    total: float
    """Its whole way [m]."""
    both: float
    """Both ways together [m]."""
    stops: tuple[float, float] | None
    """Where the other one stops [m]; None: beside the winner, both ways are the same."""


FACTS = {
    "AC": Fact(1, 24.93, 28.38, 53.31, (13.52, 9.00)),
    "AD": Fact(0, 36.22, 42.82, 79.05, (21.00, 2.75)),
    "BA": Fact(1, 50.04, 56.38, 106.41, (15.00, 0.96)),
    "BC": Fact(1, 93.21, 96.66, 189.87, (7.79, -8.00)),
    "CA": Fact(1, 21.75, 28.08, 49.83, (9.65, -8.00)),
    "CD": Fact(0, 54.09, 60.09, 114.17, (7.00, -1.62)),
    "DC": Fact(1, 65.07, 68.52, 133.59, (7.79, -8.00)),
    "AB": Fact(0, 11.52, 17.10, 28.62, None),
    "BD": Fact(0, 22.78, 31.68, 54.46, None),
    "CB": Fact(0, 7.46, 10.90, 18.36, None),
    "DA": Fact(0, 33.78, 44.90, 78.68, None),
    "DB": Fact(0, 51.66, 57.24, 108.91, None),
}
"""By route, on the contour at 1 m with rounded corners."""

ROBOTS = ("Com1", "Rev3")


def allowed(ideal: float) -> float:
    """How far from the ideal a robot's length may be [m]: 1.5 % or three steps."""
    return max(0.015 * ideal, 3.0 * STEP)


class Part(NamedTuple):
    """What one part of the reproduction found."""

    tables: list[Table]
    data: dict[str, Any]
    holds: bool
    notes: list[str]
    episodes: Sequence[Replayable] = ()


def reproduce(settings: Settings) -> Reproduction:
    """Run all parts."""
    parts = {
        "facts": facts(settings),
        "formulas": formulas(settings),
        "claim": claim(settings),
        "room": room(settings),
        "table_2": table_2(settings),
        "fig_6": fig_6(settings),
        "pays": pays(settings),
    }
    tables = [table for part in parts.values() for table in part.tables]
    notes = [note for part in parts.values() for note in part.notes]
    data = {name: {**part.data, "holds": part.holds} for name, part in parts.items()}
    episodes = [episode for part in parts.values() for episode in part.episodes]
    holds = all(part.holds for part in parts.values())
    return Reproduction("com1-rev3", tables, notes, data, holds, episodes=episodes)


def shown(
    policy: str, scenario: str, seed: int, end: str, world: Any, parameters: dict[str, Any], **more: Any
) -> Replayable:
    """An episode, for the page."""
    driver = {"name": policy, "parameters": parameters}
    return Replayable(policy, scenario, seed, end == "success", end, "", driver, world, **more)


# ----------------------------------------------------------------------------------------------- worked facts


def facts(settings: Settings) -> Part:
    """The twelve routes, with HOLD off and on."""
    runs = list(
        each(_route, [(route, hold) for hold in (0.0, 1.5) for route in FACTS], settings.workers, in_order=True)
    )
    rows, data, holds = [], {}, True
    for route, off, on in zip(FACTS, runs[: len(FACTS)], runs[len(FACTS) :], strict=True):
        fact = FACTS[route]
        agrees = _agrees(off, fact) and on["winner"] == fact.winner and _near(on["total"], fact.total)
        holds &= agrees
        data[route] = {"off": off, "on": on, "ideal": fact._asdict(), "agrees": agrees}
        place = "beside it" if fact.stops is None else "({:.2f}, {:.2f})".format(*off["stops"])
        ideal = f"{fact.named:.2f} {fact.total:.2f} {fact.both:.2f}"
        ours = [f"{off[name]:.2f}" for name in ("named", "total", "both")]
        with_hold = [f"{on[name]:.2f}" for name in ("named", "both")]
        mark = "" if agrees else " !"
        rows.append([route, ROBOTS[off["winner"]] + mark, ideal, *ours, place, *with_hold])
    header = ["route", "winner", "ideal: s*, total, sum", "s* [m]", "total [m]", "sum [m]", "other stops at"]
    header += ["HOLD: s* [m]", "HOLD: sum [m]"]
    note = "s*: way of the winner when it is known to win. Five routes are ties, which the lower number wins."
    return Part([Table("Worked facts on the map of Fig. 1, both left", header, rows)], {"routes": data}, holds, [note])


def _route(job: tuple[str, float]) -> dict[str, Any]:
    """One route."""
    route, hold = job
    places = {"world.start": route[0], "world.goal": route[1]}
    rules: dict[str, Any] = {"sides": "left", "partner_rule": "ghost", "hold_distance": hold, "clearance": CLEARANCE}
    run = run_team("com1_rev3", "oni_wang", {**PAPER, **places}, ghosts=True, **rules)
    assert run.winner is not None
    return {
        "winner": run.winner,
        "named": run.won_after,
        "total": float(run.lengths[run.winner]),
        "both": float(run.lengths.sum()),
        "stops": [round(float(value), 2) for value in run.paths[-1, 1 - run.winner, :2]],
        "held": run.memories[1].held,
    }


def _near(came: float, ideal: float) -> bool:
    return abs(came - ideal) <= allowed(ideal)


def _agrees(came: dict[str, Any], fact: Fact) -> bool:
    """Whether a run is as its worked fact says."""
    lengths = all(_near(came[name], getattr(fact, name)) for name in ("named", "total", "both"))
    is_there = fact.stops is None or math.dist(came["stops"], fact.stops) <= allowed(fact.named)
    return came["winner"] == fact.winner and lengths and is_there


# --------------------------------------------------------------------------------------------------- formulas


def formulas(settings: Settings) -> Part:
    """Totals of both algorithms on rectangles and discs of random sizes."""
    obstacles = obstacles_across(settings.seeds or 50)
    runs = list(each(_totals, obstacles, settings.workers, in_order=True))
    kinds: dict[str, Callable[[Across], bool]] = {
        "rectangle": lambda one: not one.is_disc and not one.offset,
        "rectangle, off the axis": lambda one: one.offset > 0.0,
        "disc": lambda one: one.is_disc,
    }
    rows, holds, data = [], True, []
    for kind, belongs in kinds.items():
        mine = [(one, run) for one, run in zip(obstacles, runs, strict=True) if belongs(one)]
        if not mine:
            continue
        pair = [run["com1_rev3"] - one.com1_rev3() for one, run in mine]
        base = [run["bug1_pair"] - one.bug1_pair() for one, run in mine]
        within = sum(
            abs(d) <= allowed(one.com1_rev3()) and fits_meeting(gap, one)
            for d, gap, (one, _) in zip(pair, base, mine, strict=True)
        )
        fits = within == len(mine)
        holds &= fits
        data.append({"kind": kind, "n": len(mine), "com1_rev3": pair, "bug1_pair": base, "holds": fits})
        spans = [f"{min(values):+.2f} to {max(values):+.2f}" for values in (pair, base)]
        rows.append([kind, str(len(mine)), *spans, f"{within} of {len(mine)}"])
    quarter = quarter_of_a_disc([one for one in obstacles if one.is_disc])
    header = ["obstacle", "sizes", "com1_rev3: run minus formula [m]", "bug1_pair: run minus formula [m]", "within"]
    notes = [
        "Within: 1.5 % or three steps; the pair that meets lacks at most twice the gap at which its robots meet.",
        f"(20) says that on a disc the difference is a quarter of the circumference at least: it is less on "
        f"{quarter['below']} of {quarter['n']} discs, by up to {quarter['most']:.2f} m. "
        "2 R phi + g - sqrt(2 R g + g^2) is what it is, with phi = acos(R / (R + g)); it vanishes with g.",
    ]
    return Part(
        [Table("Both ways together on one obstacle", header, rows)], {"kinds": data, "(20)": quarter}, holds, notes
    )


MEETING = CONTACT + 0.1 + 2.0 * STEP
"""Distance at which the robots of `bug1_pair` meet [m]."""


def fits_meeting(difference: float, one: Across) -> bool:
    """Whether a total of `bug1_pair` is the formula's, but for the gap at which its robots meet and turn."""
    return -2.0 * MEETING - allowed(one.bug1_pair()) <= difference <= allowed(one.bug1_pair())


def quarter_of_a_disc(discs: Sequence[Across]) -> dict[str, Any]:
    """On how many discs the difference of the formulas is below that of (20), a quarter of the circumference."""
    lacks = [0.5 * math.pi * one.half - (one.bug1_pair() - one.com1_rev3()) for one in discs]
    below = [lack for lack in lacks if lack > 0.0]
    return {"n": len(discs), "below": len(below), "most": max(below, default=0.0)}


def _totals(one: Across) -> dict[str, float]:
    """Both ways together of both algorithms; the robots start at one place and have no bodies to one another."""
    scenario = one.scenario()
    pair = run_team(
        "com1_rev3", scenario, ghosts=True, clearance=one.clearance, partner_rule="ghost", hold_distance=0.0
    )
    base = run_team("bug1_pair", scenario, ghosts=True, clearance=one.clearance)
    return {"com1_rev3": float(pair.lengths.sum()), "bug1_pair": float(base.lengths.sum())}


# -------------------------------------------------------------------------------------------------- the claim


def claim(settings: Settings) -> Part:
    """In how many random worlds com1_rev3 takes less way than bug1_pair, and by how much."""
    worlds = settings.seeds or 500
    rows, data, episodes = [], {}, []
    for title, most in (("one obstacle", 1), ("one to five obstacles", 5)):
        found = list(each(_compared, [(seed, most) for seed in range(worlds)], settings.workers, in_order=True))
        both = [one for one in found if one["com1_rev3"] is not None and one["bug1_pair"] is not None]
        episodes += [
            shown(name, title, seed, "none arrived" if one[name] is None else "success",
                  partial(random_world, seed, most=most), {"clearance": CLEARANCE})
            for seed, one in enumerate(found)
            for name in ("com1_rev3", "bug1_pair")
        ]  # fmt: skip
        saved = [one["bug1_pair"] - one["com1_rev3"] for one in both]
        less = sum(value > 0.0 for value in saved)
        by_half = sum(value >= 0.5 * one["length"] for value, one in zip(saved, both, strict=True))
        data[title] = {"n": len(found), "both": len(both), "less": less, "by_half": by_half, "saved": saved}
        shares = [share(count, len(both)) for count in (less, by_half)]
        rows.append([title, str(len(found)), str(len(both)), *shares, difference(saved)])
    header = ["worlds", "n", "both arrive", "less way [%]", "less by half the obstacle [%]", "saved [m]"]
    note = (
        "The paper claims that it is less by half the obstacle's length always; half the length is that of the longest "
        "side that any obstacle of the world has across the way."
    )
    table = Table("Ways of both robots together: com1_rev3 and bug1_pair", header, rows)
    return Part([table], data, True, [note], episodes)


def _compared(job: tuple[int, int]) -> dict[str, Any]:
    """Both ways together in one world; None where no robot arrived."""
    seed, most = job
    scenario = random_world(seed, most=most)
    found: dict[str, Any] = {"length": across(scenario)}
    for name in ("com1_rev3", "bug1_pair"):
        run = run_team(name, scenario, seed=seed, clearance=CLEARANCE)
        found[name] = float(run.lengths.sum()) if "success" in run.outcomes else None
    return found


def across(scenario: dict[str, Any]) -> float:
    """Longest extent of an obstacle across the way from start to goal [m]."""
    x, y, heading = scenario["world"]["start"]
    normal = np.array([-math.sin(heading), math.cos(heading)])
    return max(float(np.ptp(np.array(polygon) @ normal)) for polygon in scenario["world"]["polygons"])


def share(count: int, n: int) -> str:
    """A share in percent with its Wilson interval; a dash of nothing."""
    if n == 0:
        return "–"
    interval = wilson_interval(count, n)
    return f"{100.0 * count / n:.1f} [{100.0 * interval.low:.1f}, {100.0 * interval.high:.1f}]"


# ------------------------------------------------------------------------------------------------ making room


def room(settings: Settings) -> Part:
    """Random worlds of 2, 4 and 8 robots: no contact, no standstill, and Com1's curve the one that it drives alone."""
    worlds = settings.seeds or 500
    rows, data, episodes, holds = [], {}, [], True
    for robots in (2, 4, 8):
        found = list(each(_roomy, [(seed, robots) for seed in range(worlds)], settings.workers, in_order=True))
        for seed, one in enumerate(found):
            end = "contact" if one["contact"] else "standstill" if one["standstill"] else "success"
            world = partial(random_world, seed, robots)
            episodes.append(shown("com1_rev3", f"{robots} robots", seed, end, world, {"clearance": CLEARANCE}))
        contacts = sum(one["contact"] for one in found)
        standstills = sum(one["standstill"] for one in found)
        detours = sum(one["detour"] for one in found)
        off = sum(one["off_curve"] > SAME_CURVE for one in found if not one["detour"])
        held, time = sum(one["held"] for one in found), sum(one["time"] for one in found) * robots
        gap = min(one["gap"] for one in found)
        holds &= contacts == standstills == 0 and gap >= CONTACT and off == 0
        data[str(robots)] = {"n": len(found), "contacts": contacts, "standstills": standstills, "detours": detours}
        data[str(robots)] |= {"off_curve": off, "gap": gap, "held_share": held / time}
        counts = [str(value) for value in (contacts, standstills, detours, off)]
        rows.append([str(robots), str(len(found)), *counts, f"{gap:.2f}", f"{100.0 * held / time:.1f}"])
    note = (
        'The paper claims "no waiting time" but to avoid collisions: held is the share of all robots\' time. A detour is '
        "flagged where a robot has waited for more than 10 s, and then goes round its partner as the paper has it. The "
        f"solo way counts as left where a place lies more than {SAME_CURVE} m off it, in worlds without a detour; it is "
        "that of the first robot."
    )
    return Part([Table("Random worlds of one to five rectangles", ROOMY, rows)], data, holds, [note], episodes)


def _roomy(job: tuple[int, int]) -> dict[str, Any]:
    """One world."""
    seed, robots = job
    scenario = random_world(seed, robots)
    run = run_team("com1_rev3", scenario, robots=robots, seed=seed, clearance=CLEARANCE)
    return {
        "contact": "collision" in run.outcomes,
        "standstill": "success" not in run.outcomes and not all(run.verdicts),
        "detour": any(memory.detoured for memory in run.memories),
        "off_curve": off_solo_way(run, scenario, seed),
        "gap": run.least_gap,
        "held": sum(memory.held for memory in run.memories),
        "time": STEP * (len(run.paths) - 1),
    }


def off_solo_way(run: TeamRun, scenario: dict[str, Any], seed: int) -> float:
    """Greatest distance of the first robot's way to that which Com1 drives alone in the same world [m]."""
    single = load(alone(scenario, 0))
    entry = PolicyEntry("com1", "com1", {"clearance": CLEARANCE, "turn": "right"})
    rollout = Rollout(entry, ScenarioEntry("alone", single, range(seed, seed + 1)), [seed])
    places = [rollout.simulation.world.pose[0, 0, :2].copy()]
    while not rollout.is_over:
        rollout.advance()
        places.append(rollout.simulation.world.pose[0, 0, :2].copy())
    return farthest(run.paths[:, 0, :2], np.array(places))


def farthest(places: Any, line: Any) -> float:
    """Greatest distance of places (n, 2) to a way (m, 2) [m]."""
    begin, way = line[:-1], np.diff(line, axis=0)
    square = np.maximum((way * way).sum(axis=1), 1e-12)
    offset = places[:, None] - begin
    along = np.clip((offset * way).sum(axis=2) / square, 0.0, 1.0)
    gaps = np.linalg.norm(offset - along[:, :, None] * way, axis=2)
    return float(gaps.min(axis=1).max())


# --------------------------------------------------------------------------------------- Table 2 and Figure 6

SINGLES = ("bug2", "com1", "rev2", "rev3")


def table_2(settings: Settings) -> Part:
    """Four algorithms between three places of two maps: effectiveness and efficiency, as the paper has the words."""
    jobs = [(name, label, start, goal) for name in SINGLES for label in GAZEBO for start, goal in routes_of(label)]
    found = dict(zip(jobs, each(_single, jobs, settings.workers, in_order=True), strict=True))
    rows, data = [], {}
    for label in GAZEBO:
        for name in SINGLES:
            lengths = [found[name, label, start, goal] for start, goal in routes_of(label)]
            reached = sum(length is not None for length in lengths)
            total = math.fsum(length for length in lengths if length is not None)
            data[f"{label} {name}"] = {"lengths": lengths, "effectiveness": reached / len(lengths)}
            cells = ["F" if length is None else f"{length:.1f}" for length in lengths]
            whole = f"{total:.1f}" if reached == len(lengths) else "infinite"
            rows.append([label, name, *cells, whole, f"{reached / len(lengths):.2f}"])
    header = ["map", "policy", "AB", "AC", "BA", "BC", "CA", "CB", "total [m]", "effectiveness"]
    routes = {job[1:] for job in jobs}
    pairs = [(found["rev2", *route], found["rev3", *route]) for route in routes]
    same = all(after is not None and _near(after, before) for before, after in pairs if before is not None)
    note = (
        "Effectiveness is the share of routes on which the goal is reached; who fails on one has no efficiency, its "
        f"total is infinite. Rev3 drives about as far as Rev2 wherever that arrives: {'yes' if same else 'no'}."
    )
    episodes = [
        shown(job[0], f"map {job[1]}, {job[2]}{job[3]}", 0, "not reached" if length is None else "success",
              partial(route_world, *job[1:]), SINGLE)
        for job, length in found.items()
    ]  # fmt: skip
    return Part([Table("Maps of our own in the manner of Table 2", header, rows)], data, same, [note], episodes)


SINGLE = {"clearance": 0.5, "turn": "left"}
"""Parameters of those who drive alone."""


def routes_of(label: str) -> list[tuple[str, str]]:
    """The routes of a map."""
    return [(start, goal) for start in GAZEBO[label][2] for goal in GAZEBO[label][2] if start != goal]


def _single(job: tuple[str, str, str, str]) -> float | None:
    """Length of one route [m]; None where the goal is not reached."""
    name, label, start, goal = job
    scenario = load(route_world(label, start, goal))
    entry = PolicyEntry(name, name, SINGLE)
    ((row,),) = Rollout(entry, ScenarioEntry(label, scenario, range(1)), [0]).worlds()
    return row.path_length + row.goal_distance if row.success else None


def route_world(label: str, start: str, goal: str) -> dict[str, Any]:
    """The scenario of a route of a map."""
    polygons, circles, places = GAZEBO[label]
    (x, y), end = places[start], places[goal]
    pose = (x, y, math.atan2(end[1] - y, end[0] - x))
    return team_scenario(polygons, [pose], end, circles=circles, radius=0.2)


def fig_6(settings: Settings) -> Part:
    """The starts and goals of Fig. 6 on both maps: exactly one arrives, and it was the nearer one at the stop."""
    jobs = [(figure, label) for figure in FIG_6 for label in GAZEBO]
    rows, data, episodes, holds = [], {}, [], True
    for (figure, label), one in zip(jobs, each(_figure, jobs, settings.workers, in_order=True), strict=True):
        printed = FIG_6[figure]
        holds &= one["holds"]
        data[f"{figure} {label}"] = one
        end = "success" if one["holds"] else "not as the paper says"
        scene = f"Fig. 6 {figure}, map {label}"
        episodes.append(shown("com1_rev3", scene, 0, end, figure_world(figure, label), {"clearance": 0.5}))
        stopped = "({:.1f}, {:.1f})".format(*one["stops"])
        paper = f"{printed[3]} at ({printed[4][0]:.1f}, {printed[4][1]:.1f})"
        rows.append([figure, paper, label, f"{one['stopped']} at {stopped}", "yes" if one["holds"] else "no"])
    header = ["Fig. 6", "the paper: who stops", "map", "ours: who stops", "one arrives, the nearer one"]
    return Part([Table("Starts and goals of Fig. 6 on maps of our own", header, rows)], data, holds, [], episodes)


def _figure(job: tuple[str, str]) -> dict[str, Any]:
    """One start and goal on one map."""
    goal = FIG_6[job[0]][2]
    run = run_team("com1_rev3", figure_world(*job), clearance=0.5)
    if run.winner is None:
        return {"stopped": "none", "stops": [0.0, 0.0], "holds": False}
    named = run.paths[run.named_at, :, :2]
    distances = np.hypot(*(named - np.array(goal)).T)
    is_nearer = bool(distances[run.winner] <= distances[1 - run.winner])
    stands = bool(np.array_equal(run.paths[-1, 1 - run.winner], run.paths[run.named_at, 1 - run.winner]))
    return {
        "stopped": ("com1", "rev3")[1 - run.winner],
        "stops": [round(float(value), 2) for value in run.paths[-1, 1 - run.winner, :2]],
        "holds": run.outcomes.count("success") == 1 and run.outcomes[run.winner] == "success" and is_nearer and stands,
    }


def figure_world(figure: str, label: str) -> dict[str, Any]:
    """The scenario of a start and goal on a map."""
    com1, rev3, goal, _, _ = FIG_6[figure]
    polygons, circles, _ = GAZEBO[label]
    heading = [math.atan2(goal[1] - y, goal[0] - x) for x, y in (com1, rev3)]
    starts = [(*com1, heading[0]), (*rev3, heading[1])]
    return team_scenario(polygons, starts, goal, circles=circles, radius=0.2)


# ------------------------------------------------------------------------------------------- does a team pay?

MAZES = ("maze", "rooms", "u_trap", "static")
"""Where it is asked whether a team pays; the trap is turned as each seed says."""
PAIR = {"robots.count": 2, "mission": "first"}
"""What is changed in them for a team."""
ENDS = {
    (True, False): "success",
    (True, True): "a collision",
    (False, True): "a collision",
    (False, False): "none arrived",
}
"""How an episode ended, by whether a robot arrived, and whether one collided."""


def pays(settings: Settings) -> Part:
    """First arrival of com1_rev3 beside the better of its two members, each driving alone from between their places."""
    worlds = min(settings.seeds or 100, 100)
    rows, data, episodes = [], {}, []
    for name in MAZES:
        found = list(each(_paying, [(name, seed) for seed in range(worlds)], settings.workers, in_order=True))
        episodes += [
            shown(
                "com1_rev3",
                name,
                seed,
                ENDS[one["team"].success, one["team"].collided > 0],
                name,
                {},
                overrides=PAIR | TURNED.get(name, {}),
            )
            for seed, one in enumerate(found)
        ]
        both = [(one["team"], one["best"]) for one in found if one["team"].success and one["best"] is not None]
        differences = [team.time - best.time for team, best in both]
        totals = [team.total_length - best.path_length for team, best in both]
        arrived = [sum(one["team"].success for one in found), sum(one["best"] is not None for one in found)]
        texts = [difference(values) for values in (differences, totals)]
        collided = sum(one["team"].collided > 0 for one in found)
        data[name] = {"n": len(found), "arrived": arrived, "time": differences, "way": totals, "collided": collided}
        rows.append([name, str(len(found)), *(share(count, len(found)) for count in arrived), *texts, str(collided)])
    header = ["world", "n", "team arrives [%]", "best member [%]", "time, team minus best [s]"]
    header += ["way of all minus best [m]", "collisions of the team"]
    note = "The best member is the one that would arrive first alone, which nobody knows beforehand."
    return Part([Table("Does a team pay?", header, rows)], data, True, [note], episodes)


def difference(values: Sequence[float]) -> str:
    """Mean of paired differences with its interval."""
    if not values:
        return "–"
    interval = stratified_bootstrap([values], means)
    return f"{np.mean(values):+.2f} [{interval.low:+.2f}, {interval.high:+.2f}]"


def _paying(job: tuple[str, int]) -> dict[str, Any]:
    """One world: the team, and the member that arrives first where it is alone."""
    name, seed = job
    turned = TURNED.get(name, {})
    pair = load(name, PAIR | turned)
    team = _rows("com1_rev3", {}, pair, seed)
    members = [
        row
        for law, turn in (("com1", "right"), ("rev3", "left"))
        for row in _rows(law, {"turn": turn}, load(name, turned), seed)
        if row.success
    ]
    return {"team": team_rows(team)[0], "best": min(members, key=lambda one: one.time, default=None)}


def _rows(name: str, parameters: dict[str, Any], scenario: Scenario, seed: int) -> list[EpisodeRow]:
    """The rows of one world."""
    entry = ScenarioEntry("world", scenario, range(seed, seed + 1))
    (rows,) = Rollout(PolicyEntry(name, name, parameters), entry, [seed]).worlds()
    return rows
