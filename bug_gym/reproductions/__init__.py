"""What papers report, run again: the table of reproductions behind `bug-gym reproduce`.

Each is a module with `reproduce(settings) -> Reproduction`; to add one, write the module and a line here.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import cast

from bug_gym.checks import shortened
from bug_gym.naming import nearest_hint
from bug_gym.reproductions.result import Reproduction, Settings

REPRODUCTIONS: dict[str, str] = {
    "oni-wang-table-1": "oni_wang_table_1",
    "bug-bounds": "bug_bounds",
    "bug-no-way": "bug_no_way",
    "ring-verdicts": "ring_verdicts",
    "cylinder-claims": "cylinder_claims",
    "still-things": "still_things",
    "com1-rev3": "com1_rev3",
    "barn": "barn",
    "dynabarn": "dynabarn",
    "lidar-density": "lidar_density",
    "odometry-drift": "odometry_drift",
    "operative-critical-points": "operative_critical_points",
    "hd-bug-tables": "hd_bug_tables",
    "hd-bug-dynamic": "hd_bug_dynamic",
    "hd-bug-targets": "hd_bug_targets",
    "hd-bug-traps": "hd_bug_traps",
    "hd-bug-real": "hd_bug_real",
    "hd-bug-ablation": "hd_bug_ablation",
    "circle-swap": "circle_swap",
    "apf-wall-following": "apf_wall_following",
    "learned": "learned",
    "ppo-curve": "ppo_curve",
    "offline": "offline",
    "predictors": "predictors",
    "tracking": "tracking",
    "scripted-and-learned": "scripted_and_learned",
    "navigator": "navigator",
    "d2t-eaco": "d2t_eaco",
    "price-of-not-knowing": "price_of_not_knowing",
}
"""Name on the command line -> module here."""

TAKERS: dict[str, frozenset[str]] = {
    "seeds": frozenset(REPRODUCTIONS) - {"oni-wang-table-1"},
    "policies": frozenset(REPRODUCTIONS) - {"oni-wang-table-1", "com1-rev3", "hd-bug-targets", "ppo-curve", "tracking"},
    "data": frozenset(
        ["barn", "dynabarn", "operative-critical-points", "hd-bug-real", "offline", "predictors", "tracking"]
        + ["scripted-and-learned", "d2t-eaco", "price-of-not-knowing", "cylinder-claims", "still-things"]
    ),
}
"""What of `Settings` not all of them have a use for -> those that do."""


def reproduction(name: str) -> Callable[[Settings], Reproduction]:
    """The function that runs a reproduction.

    Raises:
        ValueError: no such reproduction; the message offers the nearest names.
    """
    if name not in REPRODUCTIONS:
        hint = nearest_hint(name, REPRODUCTIONS, count=2, cutoff=0.4, separator=";")
        raise ValueError(f"unknown reproduction {shortened(name)}{hint} (known: {', '.join(REPRODUCTIONS)})")
    module = importlib.import_module(f"bug_gym.reproductions.{REPRODUCTIONS[name]}")
    return cast(Callable[[Settings], Reproduction], module.reproduce)


def require_use(name: str, settings: Settings) -> None:
    """Refuse what a reproduction would not look at.

    Raises:
        ValueError: settings are given that it has no use for.
    """
    for setting, takers in TAKERS.items():
        if getattr(settings, setting) not in (None, ()) and name not in takers:
            raise ValueError(f"{name} takes no --{setting} (those that do: {', '.join(sorted(takers))})")
