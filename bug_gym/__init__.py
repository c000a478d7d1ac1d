"""Fast 2D navigation among unknown obstacles, and the Bug algorithms to play it.

Importing it registers the environments with Gymnasium, and with PettingZoo where that has a registry; compiled code is
loaded when the first one is made.
"""

from __future__ import annotations

from importlib import import_module
from itertools import product
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import pettingzoo

if TYPE_CHECKING:
    from bug_gym.replay import show
    from bug_gym.robots_env import env, parallel_env
    from bug_gym.schema.own import ObservationField, RewardTerm

    __version__: str

__all__ = ["ObservationField", "RewardTerm", "__version__", "env", "parallel_env", "register_envs", "show"]

SCENARIOS_BY_ID = {
    "BugGym/Navigation-v0": "static",  # unless `scenario=` says another
    "BugGym/Static-v0": "static",
    "BugGym/Dynamic-v0": "dynamic",
    "BugGym/MovingTarget-v0": "moving_target",
    "BugGym/Rush-v0": "rush",
    "BugGym/Maze-v0": "maze",
    "BugGym/Crowd-v0": "crowd",
}
"""The scenario that each of the first ids binds."""

FURTHER = (
    *(
        "ackermann",
        "beach",
        "cellular_automaton",
        "corridor",
        "crossing",
        "d2t_beach",
        "disc",
        "empty",
        "evading_target",
    ),
    *("forest", "hexagon", "hook", "jackal", "oni_wang", "replay", "ring", "rooms", "slab", "terrain", "two_boxes"),
    *("u_trap", "urban"),
)
"""The other scenarios of one robot; those of several are made by `parallel_env`."""

SCENARIOS_BY_FURTHER_ID = {
    f"BugGym/{''.join(word.capitalize() for word in name.split('_'))}-v0": name for name in FURTHER
}
"""The scenario that each of the further ids binds: `BugGym/OniWang-v0` is `oni_wang`."""

FORMS: dict[str, dict[str, str]] = {
    "": {},
    "Flat": {"observation": "flat"},
    "Discrete": {"observation": "flat", "action": "discrete"},
}
"""What stands before `-v0` in a further id of each -> its forms, for learners that take an id and nothing else."""

PREDICTION_ID = "BugGym/Prediction-v0"
"""The id of the task to say where a tracked mover will be."""

LAZY = {
    "env": "bug_gym.robots_env",
    "parallel_env": "bug_gym.robots_env",
    "show": "bug_gym.replay",
    "ObservationField": "bug_gym.schema.own",
    "RewardTerm": "bug_gym.schema.own",
}
"""Names of this package -> the modules that have them; those of environments and replays load compiled code."""

ROBOTS_ID = "BugGym/Robots-v0"
"""The id in PettingZoo's registries."""


def register_envs() -> None:
    """Register the environments; those that are registered already stay as they are."""
    bound = SCENARIOS_BY_ID | SCENARIOS_BY_FURTHER_ID
    for (base, scenario), (form, keywords) in product(bound.items(), FORMS.items()):
        name = base.replace("-v0", f"{form}-v0")
        if name not in gym.registry:
            gym.register(
                name,
                entry_point="bug_gym.navigation_env:NavigationEnv",
                vector_entry_point="bug_gym.vector_env:NavigationVectorEnv",
                kwargs={"scenario": scenario, **keywords},
            )
    if PREDICTION_ID not in gym.registry:
        gym.register(PREDICTION_ID, entry_point="bug_gym.agents.prediction.env:PredictionEnv")
    if hasattr(pettingzoo, "register") and ROBOTS_ID not in pettingzoo.parallel_registry:  # PettingZoo 1.27 and later
        pettingzoo.register("parallel", ROBOTS_ID, "bug_gym.robots_env:parallel_env")
        pettingzoo.register("aec", ROBOTS_ID, "bug_gym.robots_env:env")


def __getattr__(name: str) -> Any:
    """What is imported on first use."""
    if name in LAZY:
        return getattr(import_module(LAZY[name]), name)
    if name == "__version__":
        return _version()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """With what is imported on first use, for who completes a name by the tab key."""
    return sorted({*globals(), *__all__})


def _version() -> str:
    """Of git's tags, when it was installed."""
    from importlib.metadata import PackageNotFoundError, version  # half of the time that an import would take

    try:
        return version("bug-gym")
    except PackageNotFoundError:  # run from a folder, not installed
        return "0.1.0.dev0"


register_envs()
