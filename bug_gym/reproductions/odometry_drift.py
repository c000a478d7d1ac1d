"""Success against odometry drift: which bugs survive when the robot does not know well where it is.

In one sweep the goal is sensed as a beacon, in the other computed from odometry, as by a robot without one. Drift is the worry
of the paper on the potential field with wall following, and of McGuire, de Croon and Tuyls (2019).
"""

from __future__ import annotations

from bug_gym.reproductions import sweep
from bug_gym.reproductions.result import Reproduction, Settings

POLICIES = (
    *("bug0", "bug0_plus", "bug1", "bug2", "com1", "class1", "alg1", "alg2", "rev1", "rev2", "rev3", "dist_bug"),
    *("tangent_bug", "vis_bug_21", "vis_bug_22", "point_bug", "k_bug", "e_bug", "critical_point_bug"),
    *("modified_critical_point_bug", "operative_critical_point_bug"),
    *("apf", "apf_wall_following", "minimum_risk", "hd_bug", "hd_bug_map"),
)
SCENARIOS = ("static", "u_trap")
SEEDS = 50
SURVIVES = 0.9
"""Success that counts as surviving."""

TRANSLATION = (0.0, 0.01, 0.02, 0.05, 0.1)
"""Standard deviation of the distance [m/sqrt(m)]; the heading's is as many rad/sqrt(m) times TURN_SHARE."""
TURN_SHARE = 0.2

BEACON = {"goal.sensing": "beacon", "lidar.beams": 180}
ODOMETRY = {"goal.sensing": "odometry", "lidar.beams": 180}


def drift(noise: float) -> dict[str, float]:
    """The overrides of a drift."""
    return {"odometry.translation_noise": noise, "odometry.rotation_noise": TURN_SHARE * noise}


SWEEPS = (
    sweep.Sweep(
        "Goal sensed as a beacon",
        "odometry noise [m/sqrt(m)]",
        TRANSLATION,
        [{**BEACON, **drift(noise)} for noise in TRANSLATION],
        SCENARIOS,
    ),
    sweep.Sweep(
        "Goal computed from odometry",
        "odometry noise [m/sqrt(m)]",
        TRANSLATION,
        [{**ODOMETRY, **drift(noise)} for noise in TRANSLATION],
        SCENARIOS,
    ),
)


def reproduce(settings: Settings) -> Reproduction:
    """Run both sweeps."""
    policies, seeds = settings.policies or POLICIES, settings.seeds or SEEDS
    found = [sweep.run(one, policies, seeds, settings) for one in SWEEPS]
    notes = [
        f"{seeds} worlds each of {' and '.join(SCENARIOS)}, traps turned at random.",
        f"Rotation noise: {TURN_SHARE:g} rad/sqrt(m) a m/sqrt(m).",
    ]
    for one in found:
        names = [name for name, row in one.summaries.items() if row[-1].success >= SURVIVES]
        notes.append(
            f"{one.sweep.title}: at {TRANSLATION[-1]:g} m/sqrt(m) at least 90 % succeed with {', '.join(names) or 'none'}."
        )
    return Reproduction(
        "odometry-drift",
        [table for one in found for table in sweep.tables(one)],
        notes,
        {"sweeps": [sweep.numbers(one) for one in found]},
        curves=[sweep.curves(one) for one in found],
        episodes=[episode for one in found for episode in one.episodes],
    )
