"""Films of policies and scenarios, driven and drawn when the site is built."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.agents import make_policy
from bug_gym.config import load, scenario_names
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame, save_gif
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.pictures import film
from bug_gym.evaluation.rollout import Rollout
from bug_gym.policy import MisfitError
from site_pages.algorithms import one_a_model

SIZE = 380
"""Longer side of a film [pixels]."""

FRAMES, HELD, FPS = 48, 18, 12.0
"""Most frames of a film, for how many the last one stays, and how many are shown a second."""

ONI_WANG = {"world.bounds": [-3, -14, 31, 13], "world.start": "A", "world.goal": "D", "lidar.range": 40.0}
"""The map of the paper on its own, with beams that reach everywhere."""


class Scene(NamedTuple):
    """Where a policy is shown."""

    scenario: str
    seed: int = 0
    overrides: Mapping[str, Any] = {}
    parameters: Mapping[str, Any] = {}


KINDS: dict[str, Scene] = {
    "floor": Scene("static", 6),
    "bug": Scene("oni_wang", 0, ONI_WANG),
    "mapper": Scene("rooms", 1),
    "planner": Scene("urban", 5),
    "local": Scene("dynamic", 10),
    "field": Scene("static", 6),
    "reciprocal": Scene("circle_swap", 1),
    "team": Scene("oni_wang_pair", 0, {**ONI_WANG}, {"clearance": 1.0}),
}
"""The scene of each family of policies."""

SCENES: dict[str, Scene] = {
    "hd_bug": Scene("hook"),
    "navigator": Scene("maze", 1),
    "k_bug": Scene("static", 6),
    "e_bug": Scene("static", 6),
    "point_bug": Scene("static", 6),
    "critical_point_bug": Scene("dynamic", 10),
    "modified_critical_point_bug": Scene("dynamic", 10),
    "operative_critical_point_bug": Scene("dynamic", 10),
    "apf_wall_following": Scene("u_trap"),
    "d2t_eaco": Scene("beach", 1),
    "d2t_dijkstra": Scene("beach", 1),
}
"""Policies whose idea shows elsewhere."""

LEARNED = {
    "ppo_static": Scene("static", 6),
    "ppo_dynamic": Scene("dynamic", 10),
    "ppo_moving_target": Scene("moving_target", 6),
    "ppo_rush": Scene("rush", 1),
    "ppo_mixed": Scene("crowd", 1),
    "ppo_crossing_robots": Scene("crossing_robots"),
    "sac_dynamic": Scene("dynamic", 10),
    "dqn_candidates": Scene("dynamic", 10),
}
"""Models are shown in worlds of the kind that they were trained in."""

SEEDS = {"static": 6, "dynamic": 10, "moving_target": 6, "urban": 5, "rooms": 9}
"""Seeds of scenarios in which there is something to go round; 1 of the others."""

SCRIPTED, TEAM, EACH = "tangent_bug", "com1_rev3", "orca"
"""Who shows worlds of one robot, of several whose first arrival ends it, and of several that each have a goal."""
TRAINED, TRAINED_OF_TWO = "ppo_mixed", "ppo_crossing_robots"
"""The trained policy beside it, and where two robots see one another."""
ROBOT_OF = "static"
"""The scenario whose robot they were trained with: they drive it where a scenario has another."""


def draw_policies(folder: Path) -> dict[str, str]:
    """The film of each policy; what it shows, by name."""
    folder.mkdir(parents=True, exist_ok=True)
    captions = {}
    for entry in one_a_model():
        name = entry.names[0]
        scene = (SCENES | LEARNED).get(name) or KINDS[entry.family]
        captions[name] = draw(folder / f"{name}.gif", name, scene)
    return captions


def draw_scenarios(folder: Path) -> dict[str, list[tuple[str, str]]]:
    """A film of a scripted policy and one of a trained one for each scenario: policy and what is shown, by scenario."""
    folder.mkdir(parents=True, exist_ok=True)
    captions: dict[str, list[tuple[str, str]]] = {}
    for name in scenario_names():
        for policy, overrides in [(scripted_for(name), {}), *trained_for(name)]:
            scene = Scene(name, SEEDS.get(name, 1), overrides)
            caption = draw(folder / f"{name}-{policy}.gif", policy, scene)
            if overrides:
                caption = f"{caption[:-1]}, with the robot of `{ROBOT_OF}`, which it was trained with."
            captions.setdefault(name, []).append((policy, caption))
    return captions


def scripted_for(name: str) -> str:
    """The scripted policy that shows a scenario."""
    scenario = load(name)
    if scenario.robots.count == 1:
        return SCRIPTED
    return TEAM if scenario.mission == "first" else EACH


def trained_for(name: str) -> list[tuple[str, Mapping[str, Any]]]:
    """The trained policy that shows a scenario, and the changes to it; none where it cannot see what is there."""
    known, own = load(ROBOT_OF), load(name)
    robot: dict[str, Any] = {part: getattr(known, part).model_dump(mode="json") for part in ("robot", "lidar")}
    robot["time.step"] = known.time.step
    for policy, overrides in ((TRAINED_OF_TWO, {}), (TRAINED, {}), (TRAINED, robot)):
        if policy == TRAINED_OF_TWO and own.mission == "first":
            continue
        try:
            make_policy(policy, load(name, overrides))
        except MisfitError:  # made for another robot, or blind to terrain
            continue
        return [(policy, overrides)]
    return []


def thinned(frames: Iterable[Frame]) -> list[Frame]:
    """FRAMES frames of a film at most, evenly apart, and its last one."""
    kept: list[Frame] = []
    apart = 1
    for number, frame in enumerate(frames):
        last = frame
        if number % apart == 0:
            kept.append(frame)
        if len(kept) > FRAMES:
            kept, apart = kept[::2], 2 * apart
    return kept if kept[-1] is last else [*kept, last]


def draw(path: Path, policy: str, scene: Scene) -> str:
    """Drive a policy through a scene to its end and film it; what the film shows."""
    scenario = load(scene.scenario, scene.overrides)
    seeds = range(scene.seed, scene.seed + 1)
    rollout = Rollout(
        PolicyEntry(policy, policy, scene.parameters), ScenarioEntry(scenario.name, scenario, seeds), seeds
    )
    frames = thinned(film(rollout, Canvas(rollout.simulation, size=SIZE, title=policy), every=2))
    save_gif(path, frames + HELD * frames[-1:], FPS)
    info = rollout.simulation.info()
    end = rollout.verdict() or str(info["outcome"][0, 0])
    if rollout.simulation.robots > 1:
        ends = info["outcome"][0].tolist()
        touched = f", {ends.count('collision')} touched something" if "collision" in ends else ""
        arrived = f"{ends.count('success')} of {len(ends)} robots arrived{touched}"
        return f"`{policy}` in `{scene.scenario}`, seed {scene.seed}: {arrived}."
    return (
        f"`{policy}` in `{scene.scenario}`, seed {scene.seed}: {end.replace('_', ' ')} after "
        f"{info['time'][0, 0]:.1f} s and {info['path_length'][0, 0]:.1f} m."
    )
