"""Success and path length against the number of LIDAR beams and against range noise.

After the comparison of McGuire, de Croon and Tuyls (2019), who ask how much noise bug algorithms stand.
"""

from __future__ import annotations

from bug_gym.reproductions import sweep
from bug_gym.reproductions.result import Reproduction, Settings

POLICIES = (
    *("bug0", "bug1", "bug2", "com1", "dist_bug", "tangent_bug", "hd_bug", "hd_bug_map"),
    *("critical_point_bug", "modified_critical_point_bug", "operative_critical_point_bug"),
    *("apf", "apf_wall_following", "minimum_risk"),
)
SCENARIOS = ("static", "u_trap")
SEEDS = 50
BEAMS = (8, 12, 16, 24, 32, 64, 180, 360, 720)
NOISES = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)

DENSITY = sweep.Sweep(
    "LIDAR density",
    "beams",
    BEAMS,
    [{"lidar.beams": beams, "lidar.noise": 0.0} for beams in BEAMS],
    SCENARIOS,
)
NOISE = sweep.Sweep(
    "Range noise",
    "standard deviation of a range [m]",
    NOISES,
    [{"lidar.beams": 180, "lidar.noise": noise} for noise in NOISES],
    SCENARIOS,
)


def reproduce(settings: Settings) -> Reproduction:
    """Run both sweeps."""
    policies, seeds = settings.policies or POLICIES, settings.seeds or SEEDS
    found = [sweep.run(one, policies, seeds, settings) for one in (DENSITY, NOISE)]
    return Reproduction(
        "lidar-density",
        [table for one in found for table in sweep.tables(one)],
        [
            f"{seeds} worlds each of {' and '.join(SCENARIOS)}, traps turned at random.",
            "The default clearance, which knows nothing of the noise.",
        ],
        {"sweeps": [sweep.numbers(one) for one in found]},
        curves=[sweep.curves(one) for one in found],
        episodes=[episode for one in found for episode in one.episodes],
    )
