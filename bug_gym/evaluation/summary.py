"""What many rows say together: summaries by policy and scenario, and paired differences between policies."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan, nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bug_gym.checks import shortened
from bug_gym.evaluation.missions import Mission, missions
from bug_gym.evaluation.rows import FIELD_TYPES, EpisodeRow, json_fields
from bug_gym.intervals import (
    Interval,
    Statistic,
    exact_mcnemar,
    interquartile_mean,
    interquartile_means,
    means,
    stratified_bootstrap,
    wilson_interval,
)

OVERALL = "(all)"
"""Stands where a scenario's name would, in a summary over all scenarios."""

PRIVILEGED = " (privileged)"
"""How the label of a policy ends that reads the map."""

COMPARED = ("success", "spl", "time_ratio", "path_length", "time", "min_clearance")
"""Fields that `compare` compares."""
_ON_SUCCESS = {"time", "steps", "path_length", "time_ratio", "min_clearance", "turns", "total_turning"}
"""Fields that say something of a solved episode only: a crash after a second is no short time."""


@dataclass(frozen=True, slots=True)
class Summary:
    """What many episodes of one policy say, in one scenario or in all; a mean over nothing is NaN.

    Success and SPL are of missions, see `missions.Mission`: of worlds, whose robots arrive together or for one another.
    Everything else is of rows, which are robots. Intervals are of 95 %.
    """

    policy: str
    scenario: str
    """Name of the scenario, or OVERALL: all rows of the policy pooled."""
    n: int
    """Missions: worlds, or rows where each robot is alone."""
    success: float
    """Share of the missions that were accomplished, with its Wilson interval."""
    success_low: float
    success_high: float
    spl_n: int
    """Missions in which SPL is defined."""
    spl: float
    """Mean SPL over those."""
    spl_iqm: float
    """Interquartile mean of SPL, with its interval by bootstrap within scenarios."""
    spl_iqm_low: float
    spl_iqm_high: float
    path_ratio: float
    """Path, and the rest of the way to the goal, over shortest path, mean over successes, see the function `path_ratio`."""
    time: float
    """Time [s], mean over successes."""
    time_ratio: float
    """Earliest time of meeting a moving target over time, mean over successes."""
    collision: float
    """Share of collisions."""
    timeout: float
    """Share of timeouts."""
    ended: float
    """Share of runs that the arrival of another robot ended."""
    gave_up: float
    """Share of episodes in which the policy gave up."""
    verdicts: dict[str, int]
    """With which verdicts it gave up, and how often."""
    min_clearance: float
    """Smallest clearance of an episode [m], mean over successes: a collision has none, and is counted above."""
    decision_time: float
    """Median over rows of the mean time of a decision [s]."""

    def as_dict(self) -> dict[str, Any]:
        """Fields in order, fit for strict JSON as those of a row are."""
        return json_fields(self)


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Mean of a field of `policy` minus that of `baseline` in the same worlds, with its 95 % interval.

    Of success, where few pairs differ, the bootstrap's interval leaves 0 out too often; `p_value` does not.
    """

    policy: str
    baseline: str
    field: str
    n: int
    """Pairs in which both have the field."""
    mean: float
    low: float
    high: float
    p_value: float
    """Exact McNemar test, for success only, else NaN; not corrected for the number of comparisons."""

    def as_dict(self) -> dict[str, Any]:
        """Fields in order, fit for strict JSON as those of a row are."""
        return json_fields(self)


def summarise(rows: Sequence[EpisodeRow], *, resamples: int = 2000, seed: int = 0) -> list[Summary]:
    """Summaries by scenario and policy in order of first appearance, then over all scenarios.

    Over all there is none of a policy that did not drive in each of them: it could not be compared.
    """
    groups: dict[tuple[str, str], list[EpisodeRow]] = {}
    for row in rows:
        groups.setdefault((row.scenario, row.policy), []).append(row)
        groups.setdefault((OVERALL, row.policy), []).append(row)
    if not groups:
        raise ValueError("no rows to summarise")
    scenarios, policies = dict.fromkeys(row.scenario for row in rows), dict.fromkeys(row.policy for row in rows)
    if OVERALL in scenarios:
        raise ValueError(f"no scenario may be named {OVERALL!r}")
    for policy in policies:
        _by_world(groups[OVERALL, policy])
    everywhere = [policy for policy in policies if all((scenario, policy) in groups for scenario in scenarios)]
    keys = [(scenario, policy) for scenario in scenarios for policy in policies if (scenario, policy) in groups]
    keys += [(OVERALL, policy) for policy in everywhere]
    return [_summary(key, groups[key], resamples=resamples, seed=seed) for key in keys]


def path_ratio(row: EpisodeRow) -> float:
    """Path over shortest path of an episode; NaN where none is known or there is none.

    The shortest path leads to the goal itself, a robot stops at its rim: the rest of the way counts too.
    """
    if not 0.0 < row.shortest_path_length < inf:
        return nan
    return (row.path_length + row.goal_distance) / row.shortest_path_length


def _summary(key: tuple[str, str], rows: Sequence[EpisodeRow], *, resamples: int, seed: int) -> Summary:
    solved, outcomes, together = (
        [row for row in rows if row.success],
        Counter(row.outcome for row in rows),
        missions(rows),
    )
    accomplished = sum(mission.success for mission in together)
    success = wilson_interval(accomplished, len(together))
    strata = _by_scenario((mission.scenario, mission.spl) for mission in together)
    spls = [value for stratum in strata for value in stratum]
    iqm = _bootstrap(strata, interquartile_means, resamples=resamples, seed=seed)
    return Summary(
        scenario=key[0],
        policy=key[1],
        n=len(together),
        success=accomplished / len(together),
        success_low=success.low,
        success_high=success.high,
        spl_n=len(spls),
        spl=_mean(spls),
        spl_iqm=interquartile_mean(spls) if spls else nan,
        spl_iqm_low=iqm.low,
        spl_iqm_high=iqm.high,
        path_ratio=_mean(path_ratio(row) for row in solved),
        time=_mean(row.time for row in solved),
        time_ratio=_mean(row.time_ratio for row in solved),
        collision=outcomes["collision"] / len(rows),
        timeout=outcomes["timeout"] / len(rows),
        ended=outcomes["ended"] / len(rows),
        gave_up=outcomes["gave_up"] / len(rows),
        verdicts=dict(sorted(Counter(row.verdict for row in rows if row.outcome == "gave_up").items())),
        min_clearance=_mean(row.min_clearance for row in solved),
        decision_time=float(np.median([row.decision_time_mean for row in rows])),
    )


def paired_difference(
    rows_a: Sequence[EpisodeRow], rows_b: Sequence[EpisodeRow], field: str, *, resamples: int = 2000, seed: int = 0
) -> PairedDifference:
    """Difference a minus b of a field over the worlds (scenario, seed) that both policies drove in.

    Success and SPL are those of missions; of anything else the difference is taken robot by robot and its mean is the
    world's. Time, path, clearance and turning are compared where both robots succeeded: where the first arrival ends a
    mission they are those of the two that arrived first, whatever their numbers. No field is compared where it is NaN or
    infinite for either: n says in how many worlds it was. The interval is a bootstrap of worlds within scenarios.
    """
    comparable = [name for name, kind in FIELD_TYPES.items() if kind is not str and name not in ("seed", "robot")]
    if field not in comparable:
        raise ValueError(f"field must be one of {', '.join(comparable)}, came {shortened(field)}")
    by_world_a, by_world_b = _by_world(rows_a), _by_world(rows_b)
    common = [world for world in by_world_a if world in by_world_b]
    if not common:
        raise ValueError("the two policies have no world in common")
    a, b = (missions([rows[world] for world in common]) for rows in (by_world_a, by_world_b))
    strata = _by_scenario((one.scenario, _gap(one, other, field)) for one, other in zip(a, b, strict=True))
    differences = [value for stratum in strata for value in stratum]
    interval = _bootstrap(strata, means, resamples=resamples, seed=seed)
    p_value = exact_mcnemar(differences.count(1.0), differences.count(-1.0)) if field == "success" else nan
    names = rows_a[0].policy, rows_b[0].policy
    return PairedDifference(*names, field, len(differences), _mean(differences), *interval, p_value)


def _gap(one: Mission, other: Mission, field: str) -> float:
    """Difference of a field between two missions in the same world; NaN where it cannot be compared."""
    if field in ("success", "spl"):
        return float(getattr(one, field)) - float(getattr(other, field))
    pairs = list(zip(one.rows, other.rows, strict=True))
    if field in _ON_SUCCESS and one.ends_with_first:  # another robot may win here than there
        pairs = [(one.winner, other.winner)] if one.winner and other.winner else []
    elif field in _ON_SUCCESS:
        pairs = [(a, b) for a, b in pairs if a.success and b.success]
    gaps = [float(getattr(a, field)) - float(getattr(b, field)) for a, b in pairs]
    return _mean(gap for gap in gaps if isfinite(gap))


def compare(
    rows: Sequence[EpisodeRow], baseline: str, *, resamples: int = 2000, seed: int = 0
) -> list[PairedDifference]:
    """Differences to the baseline in each of COMPARED, of each other policy that has a world in common with it."""
    by_policy: dict[str, list[EpisodeRow]] = {}
    for row in rows:
        by_policy.setdefault(row.policy, []).append(row)
    if baseline not in by_policy:
        raise ValueError(f"baseline must be one of {', '.join(by_policy) or 'no policies'}, came {shortened(baseline)}")
    reference = by_policy.pop(baseline)
    worlds = _by_world(reference).keys()
    return [
        paired_difference(others, reference, field, resamples=resamples, seed=seed)
        for others in by_policy.values()
        if worlds & _by_world(others).keys()
        for field in COMPARED
    ]


def default_baseline(rows: Sequence[EpisodeRow]) -> str:
    """The policy that others are compared with where nobody names one: a good one of those that do not read the map.

    Of the policies that drove in the most scenarios it is the one with the greatest share of successes; between equals
    the greater mean SPL decides, then who comes first. Chosen by the rows that it is then compared in, it looks a little
    better than it is.

    Raises:
        ValueError: no rows.
    """
    by_policy: dict[str, list[EpisodeRow]] = {}
    for row in rows:
        by_policy.setdefault(row.policy, []).append(row)
    if not by_policy:
        raise ValueError("no rows to choose a baseline from")
    fair = [policy for policy in by_policy if not policy.endswith(PRIVILEGED)] or list(by_policy)

    def merit(policy: str) -> tuple[int, float, float]:
        mine = missions(by_policy[policy])
        spl = _mean(mission.spl for mission in mine)
        return (
            len({mission.scenario for mission in mine}),
            sum(mission.success for mission in mine) / len(mine),
            0.0 if isnan(spl) else spl,
        )

    return max(fair, key=merit)


def _by_world(rows: Sequence[EpisodeRow]) -> dict[tuple[str, int, int], EpisodeRow]:
    """Rows of one policy by the world and robot they are of; a row that came twice would count twice."""
    if len({row.policy for row in rows}) != 1:
        raise ValueError(f"expected rows of one policy, came {sorted({row.policy for row in rows})}")
    worlds = {(row.scenario, row.seed, row.robot): row for row in rows}
    if len(worlds) != len(rows):
        repeated = Counter((row.scenario, row.seed, row.robot) for row in rows).most_common(1)[0]
        raise ValueError(f"{rows[0].policy} has {repeated[1]} rows for (scenario, seed, robot) = {repeated[0]}")
    return worlds


def _by_scenario(values: Iterable[tuple[str, float]]) -> list[list[float]]:
    """Finite values grouped by scenario, which has to have one."""
    strata: dict[str, list[float]] = {}
    for scenario, value in values:
        if isfinite(value):
            strata.setdefault(scenario, []).append(value)
    return list(strata.values())


def _bootstrap(strata: Sequence[ArrayLike], statistic: Statistic, *, resamples: int, seed: int) -> Interval:
    """`stratified_bootstrap`, with NaN bounds where nothing was measured."""
    return stratified_bootstrap(strata, statistic, resamples=resamples, seed=seed) if strata else Interval(nan, nan)


def _mean(values: Iterable[float]) -> float:
    """Mean of the values that are not NaN; NaN over none."""
    known = [value for value in values if not isnan(value)]
    return float(np.mean(known)) if known else nan
