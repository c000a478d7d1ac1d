"""`bug-gym render`: episodes of policies, as a film or a picture."""

from __future__ import annotations

import argparse
from pathlib import Path

from bug_gym.commands.arguments import add_scenario, assignments, at_least_one, policy_entry
from bug_gym.files import writable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "policies", metavar="POLICY", nargs="+", help="NAME[:PARAMETER=VALUE...]; several: side by side"
    )
    add_scenario(parser)
    parser.add_argument("--out", type=Path, required=True, help="a .gif, a .mp4, or a .png of the whole path")
    parser.add_argument("--every", type=at_least_one, default=1, help="steps from one frame to the next (default: 1)")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.config import load  # loads pydantic
    from bug_gym.drawing.canvas import Canvas  # loads the compiler
    from bug_gym.drawing.clips import GIF, MP4, PNG, grid, save_gif, save_mp4, save_png, together  # loads the compiler
    from bug_gym.evaluation.entries import ScenarioEntry  # loads the compiler
    from bug_gym.evaluation.pictures import film, portrait  # loads the compiler
    from bug_gym.evaluation.progress import progress_bar  # loads the compiler
    from bug_gym.evaluation.rollout import Rollout  # loads the compiler

    out = writable(options.out, [GIF, MP4, PNG])
    save = {GIF: save_gif, MP4: save_mp4}.get(out.suffix.lower())
    scenario, entries = load(options.scenario, assignments(options.overrides)), map(policy_entry, options.policies)
    seeds = range(options.seed, options.seed + 1)
    rollouts = [Rollout(entry, ScenarioEntry(scenario.name, scenario, seeds), seeds) for entry in entries]
    scenes = [(one, Canvas(one.simulation, size=options.size, title=one.entry.label)) for one in rollouts]
    if save is None:
        save_png(out, grid([portrait(*scene) for scene in scenes]))
    else:
        frames = together([film(*scene, every=options.every) for scene in scenes])
        with progress_bar(shown=True) as track:
            most = scenario.time.steps // options.every + 1
            save(out, track(frames, "frames, at most", most), 1.0 / (scenario.time.step * options.every))
    print(out)
    for one in rollouts:
        info = one.simulation.info()
        for robot in range(one.simulation.robots):
            outcome, time, length = (info[name][0, robot] for name in ("outcome", "time", "path_length"))
            label = one.entry.label if one.simulation.robots == 1 else f"{one.entry.label}, robot_{robot}"
            print(f"  {label}: {one.verdict() or outcome} after {time:.1f} s and {length:.2f} m")
