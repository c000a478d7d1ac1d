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

SHOWN = ("tangent_bug", "ppo_mixed")
"""A scripted and a trained policy for the worlds of one robot; the trained one where the robot is its own."""
TEAM, EACH = "com1_rev3", "orca"
"""Who shows worlds of several robots: where the first arrival ends it, and where each has its goal."""


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
    """The films of each scenario: policy and what is shown, by scenario."""
    folder.mkdir(parents=True, exist_ok=True)
    captions: dict[str, list[tuple[str, str]]] = {}
    for name in scenario_names():
        scenario = load(name)
        several = scenario.robots.count > 1
        shown = ((TEAM,) if scenario.mission == "first" else (EACH,)) if several else SHOWN
        for policy in shown:
            try:
                if not several:
                    make_policy(policy, scenario)
                caption = draw(folder / f"{name}-{policy}.gif", policy, Scene(name, SEEDS.get(name, 1)))
            except MisfitError:  # made for another robot
                continue
            captions.setdefault(name, []).append((policy, caption))
    return captions


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
        return f"`{policy}` in `{scene.scenario}`, seed {scene.seed}: {rollout.simulation.robots} robots."
    return (
        f"`{policy}` in `{scene.scenario}`, seed {scene.seed}: {end.replace('_', ' ')} after "
        f"{info['time'][0, 0]:.1f} s and {info['path_length'][0, 0]:.1f} m."
    )
