"""Whether policies tell rightly that there is no way among thin cylinders close together, as in the BARN benchmark.

The worlds are those of the family `cellular_automaton` (Perille et al. 2020): every fourth is shut for the body itself, the
others have a way at the clearance that the policies keep. The family asks that of the configuration space: a disc is stopped
where a chain of cylinders, none farther from the next than the disc is wide, leads from side to side, and only there.
Policies must not call an open goal unreachable; a complete one must arrive there, and must say so where there is no way.
Of a team two robots begin side by side: one has to arrive, and neither may claim wrongly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from bug_gym.agents import AGENTS, make_policy, parameters_table, team_names
from bug_gym.config import Scenario, dump, load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.policy import MisfitError
from bug_gym.reproductions import bug_no_way
from bug_gym.reproductions.barn import COMMON, PARAMETERS, ROBOTS, STEPS
from bug_gym.reproductions.bug_no_way import Answer, as_replayable, counts, held, not_tried
from bug_gym.reproductions.kept import kept_runs
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.reproductions.team_runs import run_team
from bug_gym.workers import each, starred

SEEDS = 2000
BLOCK = 20
"""Worlds of a policy that one process drives at a time."""
SHUT_EACH = 4
"""One world in so many has no way."""
DRIVEN = ("holonomic", "jackal")
"""Robots of the reproduction `barn`, with its clearances."""
PAIR = {"robots.count": 2, "mission": "first"}
"""What is changed in the worlds for a team."""
POLICIES = (
    *("bug1", "bug2", "com1", "class1", "alg1", "alg2", "dist_bug", "tangent_bug", "vis_bug_21", "vis_bug_22", "rev1"),
    *("bug0", "bug0_plus", "rev2", "rev3", "apf_wall_following", "hd_bug_map", "hd_bug", "point_bug", "k_bug", "e_bug"),
    *("critical_point_bug", "modified_critical_point_bug", "operative_critical_point_bug", "orca", "apf"),
    *("minimum_risk", "bfs", "dijkstra", "a_star", "bidirectional_a_star", "d_star", "d_star_lite", "theta_star"),
    *("rrt_star", "visibility_graph", "d2t_eaco", "d2t_dijkstra", *team_names()),
)
"""All that end by themselves in still worlds; planners are given the map, of teams two robots begin side by side."""


def parameters(policy: str, robot: str) -> dict[str, Any]:
    """What a policy is told: the clearance, a planner as its margin beside the body; some keep a distance of their own."""
    known = {parameter.name for name, parameter in parameters_table() if name == policy}
    if "clearance" in known or policy in team_names():
        return PARAMETERS[robot]
    return {"margin": PARAMETERS[robot]["clearance"] - ROBOTS[robot]["radius"]} if "margin" in known else {}


def robots_of(policy: str) -> list[str]:
    """The robots of DRIVEN that a policy drives.

    Raises:
        ValueError: an unknown policy, or one that drives neither.
    """
    if policy in team_names() or (policy in AGENTS and AGENTS[policy].privileged):
        return list(DRIVEN)  # planners need a live world; both drive any robot
    found, refused = [], None
    for robot in DRIVEN:
        try:
            make_policy(policy, scenario(robot, shut=False), **parameters(policy, robot))
            found.append(robot)
        except MisfitError as error:
            refused = error
    if refused is not None and not found:
        raise refused
    return found


def scenario(robot: str, *, shut: bool) -> Scenario:
    """Worlds with a way at the clearance for a robot of DRIVEN, or without one."""
    world: dict[str, Any] = {"family": "cellular_automaton", "solvable": PARAMETERS[robot]["clearance"]}
    if shut:
        world |= {"solvable": None, "is_shut": True}
    return load({"robot": ROBOTS[robot], "world": world}, {**COMMON, "time.step": STEPS[robot]})


def answers(policy: str, robot: str, seeds: Sequence[int]) -> list[Answer]:
    """What a policy makes of the worlds of some seeds, all shut or all with a way."""
    shut = is_shut(seeds[0])
    if policy in team_names():
        return [mission(policy, robot, seed) for seed in seeds]
    entry = PolicyEntry(policy, policy, parameters(policy, robot))
    world = ScenarioEntry(robot, scenario(robot, shut=shut), range(seeds[0], seeds[-1] + 1))
    rows = [row for (row,) in Rollout(entry, world, list(seeds), slots=1).worlds()]
    return [Answer(policy, robot, row.seed, not shut, row.outcome, row.verdict) for row in rows]


def mission(team: str, robot: str, seed: int) -> Answer:
    """What two robots of a team make of a world: one arrives, or both have given up; the claim of either is the team's."""
    shut = is_shut(seed)
    world = load(scenario(robot, shut=shut), PAIR)
    steps = round(world.time.limit / world.time.step)
    run = run_team(team, dump(world), seed=seed, max_steps=steps, **parameters(team, robot))
    verdict = "unreachable" if "unreachable" in run.verdicts else ", ".join(sorted({*run.verdicts} - {""}))
    ended = next(
        (end for end in ("collision", "success") if end in run.outcomes), "gave_up" if all(run.verdicts) else "timeout"
    )
    return Answer(team, robot, seed, not shut, ended, verdict if ended == "gave_up" or verdict == "unreachable" else "")


def is_shut(seed: int) -> bool:
    """Whether the world of a seed has no way."""
    return seed % SHUT_EACH == SHUT_EACH - 1


def blocks(seeds: int) -> Iterator[Sequence[int]]:
    """Seeds in blocks, those of shut worlds by themselves."""
    for shut in (False, True):
        kind = [seed for seed in range(seeds) if is_shut(seed) is shut]
        yield from (kind[first : first + BLOCK] for first in range(0, len(kind), BLOCK))


def is_wrong_claim(one: Answer) -> bool:
    """Whether it calls a goal unreachable that is not."""
    return one.has_way and one.verdict == "unreachable"


def reproduce(settings: Settings) -> Reproduction:
    """Drive every policy and both robots through every world, and compare what is said with the configuration space.

    `data` is a file of what was found so far: that is not driven again, and what is new is added as it comes.
    """
    seeds = settings.seeds or SEEDS
    policies = settings.policies or POLICIES
    driven = [(policy, robot) for policy in policies for robot in robots_of(policy)]
    with kept_runs(settings.data, Answer, lambda one: (one.policy, one.kind, one.seed), policies) as kept:
        asked = [
            (policy, robot, [seed for seed in block if (policy, robot, seed) not in kept])
            for block in blocks(seeds)
            for policy, robot in driven
        ]
        jobs = [(policy, robot, block) for policy, robot, block in asked if block]
        with progress_bar(shown=settings.progress) as track:
            work = each(partial(starred, answers), jobs, settings.workers)
            for chunk in track(work, "blocks of worlds", len(jobs)):
                kept.add(chunk)
    found = sorted(one for one in kept.found.values() if one.policy in policies and one.seed < seeds)
    counted = {
        f"{policy} {robot}": numbers([one for one in found if (one.policy, one.kind) == (policy, robot)])
        for policy, robot in driven
    }
    wrong = [one for one in found if not one.is_right]
    header = ["policy and robot", *next(iter(counted.values()))]
    lines = [[name, *map(str, line.values())] for name, line in counted.items()]
    notes = [
        "wrong claims: 'unreachable' where a way is open at the clearance.",
        f"wrong: a wrong claim, a collision, no end within {COMMON['time.limit']:g} s, or, of a complete algorithm, any end "
        "that is not as the configuration space says.",
        f"complete: {', '.join(policy for policy in policies if policy in bug_no_way.PROVEN)}.",
        *(f"{one.policy}, {one.kind}, seed {one.seed}: {one.outcome} {one.verdict}" for one in wrong[:40]),
    ]
    data = {
        "seeds": seeds,
        "clearances": {robot: PARAMETERS[robot]["clearance"] for robot in DRIVEN},
        "policies": counted,
        "wrong": [one._asdict() for one in wrong],
    }
    title = f"Ways and no ways among thin cylinders in {seeds} worlds"
    worlds = {(robot, shut): scenario(robot, shut=shut) for robot in DRIVEN for shut in (False, True)}
    episodes = [
        as_replayable(one, parameters(one.policy, one.kind), worlds[one.kind, not one.has_way])._replace(
            overrides=PAIR if one.policy in team_names() else {}
        )
        for one in found
    ]
    notes += not_tried(found)
    return Reproduction("cylinder-claims", [Table(title, header, lines)], notes, data, held(found), episodes=episodes)


def numbers(found: Sequence[Answer]) -> dict[str, Any]:
    """How often one policy with one robot ended in which way, and what it claimed wrongly."""
    line = counts(found)
    claims = sum(is_wrong_claim(one) for one in found)
    return {**line, "wrong claims": claims, "wrong claims [%]": share(claims, line["with a way"])}


def share(part: int, whole: int) -> float | None:
    """In percent, to a hundredth; None of nothing."""
    return round(100.0 * part / whole, 2) if whole else None
