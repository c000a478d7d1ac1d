"""Whether incomplete bugs come to an end before a ring round the goal, however noisy their scanner.

There is no way into the ring. Bugs without a proof cannot know that, but have to give up some time; noise opens walls and
corners where there are none, so there is always one more to look behind. At 10 m sight ends on the walls besides.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions.bug_no_way import INCOMPLETE
from bug_gym.reproductions.claims import FIRST_SEED, of, run
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

POLICIES = tuple(policy for policy in INCOMPLETE if policy != "hd_bug_map")
"""All that end by themselves and promise no more."""

KINEMATICS = ("holonomic", "differential")
NOISES = (0.0, 0.01, 0.02, 0.03)
"""Standard deviations of a range [m]; without noise every seed is the same episode, and one is driven."""

RANGE = 10.0
"""Range of the scanner [m]."""

LIMIT = 600.0
"""Time to come to an end [s]; the scenario gives 240, but `minimum_risk` is patient for 300 after it has come nearer."""

SEEDS = 200


def reproduce(settings: Settings) -> Reproduction:
    """Drive every policy at every noise; held where each run ended with a verdict."""
    policies, seeds = settings.policies or POLICIES, settings.seeds or SEEDS
    for policy in policies:
        make_policy(policy, load("ring"))  # an unknown one is found out before the work
    rows: list[EpisodeRow] = []
    for noise in NOISES:
        count = seeds if noise else 1
        rows += run(policies, [world(*one) for one in cases(noise)], count, settings, name="ring-verdicts")
    lines, data = [], {}
    for policy in policies:
        for kinematics in KINEMATICS:
            found = {f"{noise:g}": ends(of(rows, policy=policy, scenario=label(kinematics, noise))) for noise in NOISES}
            data[f"{policy}, {kinematics}"] = found
            lines.append([policy, kinematics, *map(shown, found.values())])
    table = Table(
        f"Ends before the ring, {seeds} seeds a noise: looping / stuck / unreachable / none, latest end [s]",
        ["policy", "robot", *(f"{noise:g} m" for noise in NOISES)],
        lines,
    )
    held = all(one["none"] == 0 for found in data.values() for one in found.values())
    episodes = replayable(rows, list(policies), [world(*one) for noise in NOISES for one in cases(noise)])
    return Reproduction("ring-verdicts", [table], NOTES, {"seeds": seeds, "results": data}, held, episodes=episodes)


def cases(noise: float) -> list[tuple[str, float]]:
    """Kinematics and noise of the worlds with one noise."""
    return [(kinematics, noise) for kinematics in KINEMATICS]


def label(kinematics: str, noise: float) -> str:
    """What rows call a world."""
    return f"{kinematics}, {noise:g} m"


def world(kinematics: str, noise: float) -> dict[str, Any]:
    """The ring for a robot, with a scanner so noisy."""
    overrides = {"robot.kinematics": kinematics, "lidar.range": RANGE, "lidar.noise": noise, "time.limit": LIMIT}
    return {"scenario": "ring", "overrides": overrides, "label": label(kinematics, noise)}


def ends(rows: Sequence[EpisodeRow]) -> dict[str, Any]:
    """How often runs ended with which verdict, the seeds of those that did not, and when the last one ended [s]."""
    verdicts = Counter(row.verdict if row.outcome == "gave_up" else "none" for row in rows)
    return {
        **{verdict: verdicts[verdict] for verdict in ("looping", "stuck", "unreachable", "none")},
        "collisions": sum(row.outcome == "collision" for row in rows),
        "without_verdict": [row.seed for row in rows if row.outcome != "gave_up"],
        "latest": max(row.time for row in rows),
    }


def shown(found: dict[str, Any]) -> str:
    """Ends at one noise as a cell."""
    counts = " / ".join(str(found[verdict]) for verdict in ("looping", "stuck", "unreachable", "none"))
    return f"{counts}, {found['latest']:.0f}"


NOTES = [
    f"{LIMIT:g} s, beams to {RANGE:g} m, default parameters, seeds from {FIRST_SEED:,} on.",
    "Without noise every seed is the same episode, which is driven once.",
    'Nobody here can prove "unreachable"; who comes round the whole ring may say so all the same, and it is true.',
]
