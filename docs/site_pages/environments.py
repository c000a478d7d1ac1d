"""A page a named scenario, out of its YAML file, its spaces and its weights; and the page of the environment's class."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from make_worlds import default_of, tag

import bug_gym
from bug_gym.config import SCENARIO_FOLDER, Scenario, load, scenario_names
from bug_gym.kernels import OBSERVATION
from bug_gym.navigation_env import NavigationEnv
from bug_gym.observation import fields
from bug_gym.schema.task import Reward
from bug_gym.schema.values import Part
from site_pages import Pages
from site_pages.markup import paragraphs, table, toctree

Captions = Mapping[str, Sequence[tuple[str, str]]]
"""Policy and what its film shows, by scenario."""

HEAD = """# Environments

Each scenario below comes with the package: `gym.make("BugGym/Navigation-v0", scenario=NAME)` or, with one robot, an id of
its own. Its page says what the code says: robot, sensors, spaces, reward. What the families of worlds may be:
[worlds](../worlds.md); how to write a scenario of your own: [scenarios](../guide/scenarios.md); faces for many worlds and
several robots: [environments](../guide/environments.md); the single environment: [NavigationEnv](navigation_env.md).
"""


def pages(captions: Captions) -> Pages:
    """The pages of all scenarios, their index and the page of the class."""
    names = scenario_names()
    made = {f"environments/{name}.md": page(name, captions.get(name, ())) for name in names}
    return {"environments/index.md": index(names), "environments/navigation_env.md": env_page(), **made}


def ids_of(name: str) -> list[str]:
    """The registered ids that bind a scenario, with those of their forms."""
    every = bug_gym.SCENARIOS_BY_ID | bug_gym.SCENARIOS_BY_FURTHER_ID
    bound = [one for one, scenario in every.items() if scenario == name]
    return [one.replace("-v0", f"{form}-v0") for one in bound for form in bug_gym.FORMS]


def said_of(name: str) -> str:
    """The comment at the top of a scenario's file, without the id that it begins with."""
    lines = []
    for line in (SCENARIO_FOLDER / f"{name}.yaml").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    text = " ".join(lines)
    return text.split(": ", 1)[1] if text.startswith("BugGym/") else text


def index(names: Sequence[str]) -> str:
    """All scenarios, those of the first ids before the others."""
    rows = []
    for name in sorted(names, key=lambda name: name not in bug_gym.SCENARIOS_BY_ID.values()):
        scenario = load(name)
        ids = ", ".join(f"`{one}`" for one in ids_of(name)[:: len(bug_gym.FORMS)])
        rows.append([f"[{name}]({name}.md)", ids or "-", str(scenario.robots.count), capital(said_of(name))])
    header = ["scenario", "ids", "robots", "world"]
    ids = f"`{bug_gym.PREDICTION_ID}` asks where a tracked mover will be ([training](../guide/training.md)); "
    ids += f"`{bug_gym.ROBOTS_ID}` stands in PettingZoo's registries, for several robots."
    return paragraphs(HEAD, table(header, rows), ids, toctree(["navigation_env", *names]))


def capital(text: str) -> str:
    """The text, begun with a capital letter."""
    return text[:1].upper() + text[1:]


def page(name: str, captions: Sequence[tuple[str, str]]) -> str:
    """The page of a scenario."""
    scenario = load(name)
    pictures = " ".join(f'![{policy} in {name}]({name}-{policy}.gif){{width="49%"}}' for policy, _ in captions)
    shown = f"{pictures}\n\n*{' '.join(caption for _, caption in captions)}*" if captions else ""
    yaml = (SCENARIO_FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    family = f"Worlds of the family [{tag(type(scenario.world), 'family')}](../worlds.md)."
    return paragraphs(
        f"# {name}",
        f"{capital(said_of(name))} {family}",
        shown,
        f"## Making it\n\n{making(name, scenario)}",
        f"## Robot and sensors\n\n{settings(scenario)}",
        f"## Observation\n\n{observation(scenario)}",
        f"## Action\n\n{action(scenario)}",
        f"## Reward and end\n\n{reward(scenario)}",
        f"## The file\n\nAll that is not said has its default.\n\n```yaml\n{yaml}```",
        "## Versions\n\n- v0: first version." if ids_of(name) else "",
    )


def making(name: str, scenario: Scenario) -> str:
    """The lines that make it."""
    if scenario.robots.count > 1:
        code = f'env = bug_gym.parallel_env("{name}")'
        return f"```python\nimport bug_gym\n\n{code}  # or bug_gym.env: PettingZoo's AEC\n```"
    made = f'"{ids_of(name)[-len(bug_gym.FORMS)]}"' if ids_of(name) else f'"BugGym/Navigation-v0", scenario="{name}"'
    lines = f"env = gym.make({made})\nenvs = gym.make_vec({made}, num_envs=1024)"
    ids = f"\n\nIds: {', '.join(f'`{one}`' for one in ids_of(name))}." if ids_of(name) else ""
    return f"```python\nimport gymnasium as gym\nimport bug_gym\n\n{lines}\n```{ids}"


def settings(scenario: Scenario) -> str:
    """The numbers of the robot, its scanner, clock and goal, each with its meaning."""
    rows = []
    parts: dict[str, Part] = {
        "robot": scenario.robot, "lidar": scenario.lidar, "odometry": scenario.odometry, "time": scenario.time,
        "goal": scenario.goal,
    }  # fmt: skip
    for label, part in parts.items():
        meanings = type(part).meanings()
        for key, field in type(part).model_fields.items():
            value = getattr(part, key)
            plain = (
                value if value is None or isinstance(value, str | int | float) else part.model_dump(mode="json")[key]
            )
            plain = round(plain, 4) if isinstance(plain, float) else plain
            differs = "" if value == field.default else " *"
            rows.append([f"`{label}.{key}`", default_of(plain) + differs, meanings[key]])
    return table(["key", "value", "meaning"], rows) + "\n\n\\* not the default."


def observation(scenario: Scenario) -> str:
    """The fields of the observation."""
    rows = [
        [f"`{one.name}`", str(one.shape), spread(one.low), spread(one.high), OBSERVATION[one.name].meaning]
        for one in fields(scenario)
    ]
    width = fields(scenario)[-1].end
    return (
        'A `Dict` of float32 boxes; with `observation="flat"` one `Box` of their '
        f"{width} numbers in this order.\n\n{table(['field', 'shape', 'low', 'high', 'meaning'], rows)}"
    )


def spread(bounds: Any) -> str:
    """Bounds, those that are alike said once."""
    values = [f"{value:.4g}" for value in np.unique(bounds)] if np.unique(bounds).size == 1 else None
    return values[0] if values else ", ".join(f"{value:.4g}" for value in bounds.ravel()[:4])


def action(scenario: Scenario) -> str:
    """What the two numbers of an action mean for this robot."""
    robot = scenario.robot
    if robot.kinematics == "holonomic":
        told = f"velocity ahead and to the left, over {robot.max_speed:g} m/s"
    elif robot.kinematics == "ackermann":
        told = (
            f"speed, scaled to -{robot.max_reverse:g} ... {robot.max_speed:g} m/s, and steering angle, "
            f"scaled to +-{robot.max_steering:g} rad"
        )
    else:
        told = (
            f"speed, scaled to -{robot.max_reverse:g} ... {robot.max_speed:g} m/s, and turn rate, "
            f"scaled to +-{robot.max_turn_rate:g} rad/s"
        )
    return f'`Box(-1, 1, (2,), float32)`: {told}. With `action="discrete"`: `Discrete(128)`, 32 headings x 4 speeds.'


def reward(scenario: Scenario) -> str:
    """The weights of the reward's terms, and how an episode ends."""
    rows = [[f"`{key}`", f"{getattr(scenario.reward, key):g}", meaning] for key, meaning in Reward.meanings().items()]
    first = " The first arrival ends it for all (`ended`)." if scenario.mission == "first" else ""
    return (
        f"{table(['term', 'weight', 'counted'], rows)}\n\nTerminated by `success` (within {scenario.goal.radius:g} m of the "
        f"goal) or `collision`, truncated after {scenario.time.limit:g} s, {scenario.time.steps} steps (`timeout`).{first}"
    )


def env_page() -> str:
    """The docstring of the single environment, which is its page."""
    text = inspect.cleandoc(str(NavigationEnv.__doc__)).partition("\n\nRaises:")[0]
    first, _, rest = text.partition("\n\n")
    return paragraphs("# NavigationEnv", f"`bug_gym.navigation_env.NavigationEnv`: {first}", rest)
