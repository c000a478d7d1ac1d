"""Does the tracker see ghosts in still worlds, and how soon and how well does it know what moves?

A plain driver goes through still worlds (mazes, rooms, fields, real maps) and through moving ones, with both kinematics,
range noise of 0 and 0.03 m, and 64 to 360 beams; the tracker sees the same scans, and is judged by the truth of the
simulation. In a still world no track may be called moving at any time. Among movers the counts are those of multiple
object tracking; a mover is to be known within 0.6 s of being in sight: met by three beams or more and by half of those
toward it, nearer than nine tenths of the range, at 0.2 m/s or more. That is asked of each time that one comes into sight,
also of those that had been known just before and of which the beams had been too few for a moment; and of each mover once,
when it has stayed in sight for 0.6 s for the first time. Real maps and recorded pedestrians are taken from the folder of
`--data`, where it is given.

The filter's own numbers are held against what came: the squared innovations (NIS) against their 95 % bound, 5.99. Errors
of the side that faces the robot, which is what a robot may touch and what the spread of a prediction is about, are held
against 1 and 2 sigma of the filter's covariance (68.3 % and 95.4 % of a Gaussian along a line; of discs, whose side is
known). Errors of the centres, which lie deeper where a thing is larger than thought, are held against that of
`Tracks.centre` (39.3 % and 86.5 % of a Gaussian in the plane).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from bug_gym.agents.prediction.samples import crossing
from bug_gym.config import Scenario, dump
from bug_gym.evaluation.progress import progress_bar
from bug_gym.held_out import TEST_SEEDS
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.reproductions.tracking_runs import CONFIRMED_IN, DRIVERS, Counts, frames, judge
from bug_gym.workers import each, starred

STILL = ("maze", "rooms", "static")
MAPS = {"depot": 12.0, "tb3_sandbox": 3.0}
"""Real maps in `ros_maps/` of the data folder, and how far from one another start and goal lie [m]."""
MOVING = ("dynamic", "rush", "crowd")
SCENES = {"ETH": "pedestrians_eth.csv", "hotel": "pedestrians_hotel.csv"}
STILL_WORLDS, MOVING_WORLDS = 1000, 100
"""Of each family."""
VARIANTS = tuple(product(("holonomic", "differential"), (0.0, 0.03), (64, 120, 180, 360)))
"""Kinematics, range noise [m] and beams; the worlds of a family have them in turn."""
ASKED_SHARE = 0.95
"""Of the movers, known in time."""
BOUND = 5.991
"""95 % of the squared innovations are below: chi-square of two degrees of freedom."""
ONE_SIGMA, TWO_SIGMA = 1.0 - math.exp(-0.5), 1.0 - math.exp(-2.0)
"""Shares of a Gaussian in the plane."""
ONE_SIGMA_ALONG, TWO_SIGMA_ALONG = math.erf(math.sqrt(0.5)), math.erf(math.sqrt(2.0))
"""Shares of a Gaussian along a line."""


def reproduce(settings: Settings) -> Reproduction:
    """Track in all worlds; `seeds` is the number of worlds of each family.

    Raises:
        ValueError: a data folder without the maps or the recorded scenes.
    """
    still, moving = families(settings.data)
    tasks = [
        (label, scenario, seed)
        for group, worlds in ((still, STILL_WORLDS), (moving, MOVING_WORLDS))
        for label, scenario in group.items()
        for seed in range(TEST_SEEDS, TEST_SEEDS + (settings.seeds or worlds))
    ]
    found: dict[str, list[Counts]] = {label: [] for label in (*still, *moving)}
    episodes = []
    with progress_bar(shown=settings.progress) as track:
        runs = each(partial(starred, watch), [task[1:] for task in tasks], settings.workers, in_order=True)
        for (label, scenario, seed), counts in zip(tasks, track(runs, "worlds", len(tasks)), strict=True):
            found[label].append(counts)
            episodes.append(as_replayable(label, scenario, seed, len(counts.ghosts)))
    ghosts = {label: ghost_numbers(found[label]) for label in still}
    known = {label: mover_numbers(found[label]) for label in moving}
    claims = list(check(ghosts, known))
    return Reproduction(
        "tracking",
        [still_table(ghosts), mover_table(known), filter_table(known)],
        [text for text, holds in claims if not holds]
        + ([] if settings.data else ["no real maps and recorded pedestrians: give their folder with --data"]),
        {"still": ghosts, "moving": known, "claims": dict(claims)},
        all(holds for _, holds in claims),
        episodes=episodes,
    )


def families(data: Path | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Scenarios of still and of moving worlds, by what they are called."""
    still: dict[str, Any] = {name: name for name in STILL}
    moving: dict[str, Any] = {name: name for name in MOVING}
    if data is None:
        return still, moving
    paths = [data / "ros_maps" / f"{name}.yaml" for name in MAPS] + [data / name for name in SCENES.values()]
    if missing := [str(path) for path in paths if not path.is_file()]:
        raise ValueError(f"expected with --data a folder of real maps and pedestrians; it lacks {', '.join(missing)}")
    for path, separation in zip(paths, MAPS.values(), strict=False):
        still[path.stem] = {"world": {"family": "ros_map", "path": str(path.absolute()), "separation": separation}}
    return still, moving | {label: dump(crossing(data / name)) for label, name in SCENES.items()}


def watch(scenario: Scenario | str | dict[str, Any], seed: int) -> Counts:
    """What is counted in one world."""
    driver, overrides = driven_by(seed)
    return judge(frames(scenario, seed, driver, overrides=overrides))


def driven_by(seed: int) -> tuple[str, dict[str, Any]]:
    """Who drives in the world of a seed, and what is changed in its scenario."""
    kinematics, noise, beams = VARIANTS[seed % len(VARIANTS)]
    driver = DRIVERS[seed // len(VARIANTS) % len(DRIVERS)]
    return driver, {"robot.kinematics": kinematics, "lidar.noise": noise, "lidar.beams": beams}


def as_replayable(label: str, scenario: Any, seed: int, ghosts: int) -> Replayable:
    """An episode, for the page; what fails in it is the tracker."""
    driver, overrides = driven_by(seed)
    end = f"{ghosts} still {'thing' if ghosts == 1 else 'things'} called moving" if ghosts else "no ghosts"
    return Replayable(driver, label, seed, not ghosts, end, "", driver, scenario, overrides)


def ghost_numbers(worlds: Sequence[Counts]) -> dict[str, Any]:
    """In how many still worlds something was called moving."""
    haunted = sum(bool(counts.ghosts) for counts in worlds)
    low, high = wilson_interval(haunted, len(worlds))
    return {
        "worlds": len(worlds),
        "with_ghosts": haunted,
        "low": round(low, 5),
        "high": round(high, 5),
        "ghosts": sum(len(counts.ghosts) for counts in worlds),
        "scans": sum(counts.scans for counts in worlds),
    }


def mover_numbers(worlds: Sequence[Counts]) -> dict[str, Any]:
    """How movers were known in some worlds; shares and means that nothing went into are None."""
    seen, misses, false, switches, known_before, firsts, firsts_known = (
        sum(getattr(counts, name) for counts in worlds)
        for name in ("seen", "misses", "false", "switches", "known_before", "firsts", "firsts_known")
    )
    waits, gaps, innovations, errors, sides = (
        np.array([value for counts in worlds for value in getattr(counts, name)])
        for name in ("waits", "gaps", "innovations", "errors", "sides")
    )
    return {
        "worlds": len(worlds),
        "came_into_sight": len(waits),
        "known_in_time": share(waits <= CONFIRMED_IN + 1e-6),
        "known_in_twice": share(waits <= 2.0 * CONFIRMED_IN + 1e-6),
        "known_before": known_before,
        "firsts": firsts,
        "firsts_known": round(firsts_known / firsts, 4) if firsts else None,
        "seen": seen,
        "misses": misses,
        "false": false,
        "switches": switches,
        "mota": round(1.0 - (misses + false + switches) / seen, 4) if seen else None,
        "motp": round(float(gaps.mean()), 4) if len(gaps) else None,
        "ghosts": sum(len(counts.ghosts) for counts in worlds),
        "nis": round(float(innovations.mean()), 3) if len(innovations) else None,
        "nis_below_bound": share(innovations < BOUND),
        "side_within_one_sigma": share(sides <= 1.0),
        "side_within_two_sigma": share(sides <= 4.0),
        "within_one_sigma": share(errors <= 1.0),
        "within_two_sigma": share(errors <= 4.0),
    }


def share(holds: np.ndarray[Any, np.dtype[np.bool_]]) -> float | None:
    """Share of what holds."""
    return round(float(holds.mean()), 4) if len(holds) else None


def check(ghosts: dict[str, Any], known: dict[str, Any]) -> Iterator[tuple[str, bool]]:
    """What the tracker is to do, and whether it does."""
    for label, one in ghosts.items():
        yield f"{label}: nothing that stands is called moving", one["with_ghosts"] == 0
    for label, one in known.items():
        if one["known_in_time"] is not None:
            yield f"{label}: 95 % of the movers are known within {CONFIRMED_IN} s", one["known_in_time"] >= ASKED_SHARE
        if one.get("firsts_known") is not None:  # a record from before it was asked has none
            told = f"{label}: 95 % of the movers are known once they have first been in sight for {CONFIRMED_IN} s"
            yield told, one["firsts_known"] >= ASKED_SHARE


def still_table(ghosts: dict[str, Any]) -> Table:
    """Ghosts by family."""
    rows = [
        [
            label,
            *(str(one[name]) for name in ("worlds", "with_ghosts", "ghosts", "scans")),
            f"{100.0 * one['high']:.2f}",
        ]
        for label, one in ghosts.items()
    ]
    header = ["worlds", "number", "with a ghost", "ghosts", "scans", "at most (95 %) [%]"]
    return Table("Still worlds in which something was called moving", header, rows)


def mover_table(known: dict[str, Any]) -> Table:
    """Movers by family."""
    names = (
        *("came_into_sight", "known_before", "known_in_time", "known_in_twice", "firsts", "firsts_known"),
        *("seen", "misses", "false", "switches"),
        *("mota", "motp", "ghosts"),
    )
    rows = [[label, str(one["worlds"]), *(cell(one[name]) for name in names)] for label, one in known.items()]
    header = ["worlds", "number", "came into sight", "known before", f"known in {CONFIRMED_IN} s", f"in {2 * CONFIRMED_IN} s",
              f"movers in sight for {CONFIRMED_IN} s", "known by then", "times in sight", "misses", "false", "switches", "MOTA",
              "MOTP [m]", "still things called moving"]  # fmt: skip
    return Table("Movers: when they were known, and how they were followed", header, rows)


def filter_table(known: dict[str, Any]) -> Table:
    """The filter's own numbers against what came."""
    names = (
        "nis",
        "nis_below_bound",
        "side_within_one_sigma",
        "side_within_two_sigma",
        "within_one_sigma",
        "within_two_sigma",
    )
    rows = [[label, *(cell(one[name]) for name in names)] for label, one in known.items()]
    gaussian = (ONE_SIGMA_ALONG, TWO_SIGMA_ALONG, ONE_SIGMA, TWO_SIGMA)
    rows.append(["a Gaussian", "2", "0.95", *(f"{one:.3f}" for one in gaussian)])
    header = ["worlds", "NIS", f"NIS below {BOUND:.2f}", "facing side within 1 sigma", "within 2 sigma",
              "centre within 1 sigma", "within 2 sigma"]  # fmt: skip
    return Table("The spread that the filter reports", header, rows)


def cell(value: float | None) -> str:
    """A number of a table."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.3f}"
