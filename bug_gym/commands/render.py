"""`bug-gym render`: episodes of policies, as a page that plays them, a film or a picture."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bug_gym.commands.arguments import add_world, assignments, at_least_one, policy_entry, split_policies, told_path
from bug_gym.files import writable

if TYPE_CHECKING:
    from bug_gym.evaluation.rollout import Rollout


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "names",
        metavar="NAME",
        nargs="+",
        help="POLICY... SCENARIO, a POLICY as NAME[:PARAMETER=VALUE...]; or SCENARIO alone with --policies",
    )
    parser.add_argument("--policies", help="NAME[:PARAMETER=VALUE...],..., instead of names before the scenario")
    add_world(parser)
    parser.add_argument(
        "--out",
        type=told_path,
        required=True,
        help="a .html that plays it, a .gif, a .mp4, or a .png of the whole path",
    )
    parser.add_argument("--every", type=at_least_one, default=1, help="steps from one frame to the next (default: 1)")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.config import load  # loads pydantic
    from bug_gym.drawing.clips import GIF, MP4, PNG  # loads the compiler
    from bug_gym.evaluation.entries import ScenarioEntry  # loads the compiler
    from bug_gym.evaluation.rollout import Rollout  # loads the compiler
    from bug_gym.replay.player import HTML  # loads the compiler

    out = writable(options.out, [HTML, GIF, MP4, PNG])
    policies, place = _named(options)
    scenario, entries = load(place, assignments(options.overrides), trust=options.trust), map(policy_entry, policies)
    seeds = range(options.seed, options.seed + 1)
    rollouts = [Rollout(entry, ScenarioEntry(scenario.name, scenario, seeds), seeds) for entry in entries]
    if out.suffix.lower() == HTML:
        _write_page(out, rollouts, options.every)
    else:
        _draw(out, rollouts, options)
    print(out)
    _tell(rollouts)


def _named(options: argparse.Namespace) -> tuple[list[str], str]:
    """The policies and the scenario that were named."""
    *before, scenario = options.names
    if options.policies is None and not before:
        raise ValueError(
            f"got no policy to drive in {scenario}, expected POLICY... {scenario} or --policies POLICY,..."
        )
    if options.policies is not None and before:
        raise ValueError(f"got {', '.join(before)} as well as --policies, expected one of the two")
    return (before if options.policies is None else split_policies(options.policies)), scenario


def _write_page(out: Path, rollouts: list[Rollout], every: int) -> None:
    from bug_gym.evaluation.progress import progress_bar  # loads the compiler
    from bug_gym.evaluation.replays import recorded  # loads the compiler
    from bug_gym.replay import write_player  # loads the compiler

    with progress_bar(shown=True) as track:
        write_player(out, *(recorded(one, every=every) for one in track(rollouts, "episodes", len(rollouts))))


def _draw(out: Path, rollouts: list[Rollout], options: argparse.Namespace) -> None:
    """A film, or a picture of the whole path."""
    from bug_gym.drawing.canvas import Canvas  # loads the compiler
    from bug_gym.drawing.clips import GIF, MP4, grid, save_gif, save_mp4, save_png, together  # loads the compiler
    from bug_gym.evaluation.pictures import film, portrait  # loads the compiler
    from bug_gym.evaluation.progress import progress_bar  # loads the compiler

    time = rollouts[0].scenario.scenario.time
    scenes = [(one, Canvas(one.simulation, size=options.size, title=one.entry.label)) for one in rollouts]
    save = {GIF: save_gif, MP4: save_mp4}.get(out.suffix.lower())
    if save is None:
        save_png(out, grid([portrait(*scene) for scene in scenes]))
        return
    frames = together([film(*scene, every=options.every) for scene in scenes])
    with progress_bar(shown=True) as track:
        most = time.steps // options.every + 1
        save(out, track(frames, "frames, at most", most), 1.0 / (time.step * options.every))


def _tell(rollouts: list[Rollout]) -> None:
    """How each episode ended."""
    from bug_gym.evaluation.live import endings  # loads the compiler

    for one in rollouts:
        for line in endings(one):
            print(f"  {line}")
