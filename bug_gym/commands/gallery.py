"""`bug-gym gallery`: every bug on one map."""

from __future__ import annotations

import argparse
from pathlib import Path

from bug_gym.commands.arguments import add_overrides, add_trust, assignments, at_least_one, policy_entries, told_path
from bug_gym.files import writable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("--scenario", default="oni_wang", help="name or path of a scenario (default: oni_wang)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the world (default: 0)")
    parser.add_argument("--policies", help="NAME[:PARAMETER=VALUE...],... (default: every bug)")
    parser.add_argument("--size", type=at_least_one, default=240, help="pixels of each picture (default: 240)")
    parser.add_argument(
        "--out", type=told_path, default=Path("gallery.png"), help="PNG to write (default: gallery.png)"
    )
    parser.add_argument("--gif", type=told_path, help="GIF to write as well")
    add_overrides(parser)
    add_trust(parser)


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.agents import AGENTS  # loads the compiler
    from bug_gym.config import load  # loads pydantic
    from bug_gym.drawing.clips import GIF, PNG  # loads the compiler
    from bug_gym.evaluation.entries import PolicyEntry  # loads the compiler
    from bug_gym.evaluation.gallery import draw_gallery  # loads the compiler

    png, gif = writable(options.out, [PNG]), options.gif and writable(options.gif, [GIF])
    bugs: dict[str, str] = {}  # by their code, so that a second name is no second picture
    for name, line in AGENTS.items():
        if line.family == "bug":
            bugs.setdefault(line.entry_point, name)
    asked = policy_entries(options.policies) if options.policies else []
    entries = asked or [PolicyEntry.of(name) for name in bugs.values()]
    changes = {"lidar.beams": 360, "time.limit": 600.0, **assignments(options.overrides)}
    scenario = load(options.scenario, changes, trust=options.trust)
    draw_gallery(scenario, entries, seed=options.seed, size=options.size, png=png, gif=gif)
    print(f"{png}{f' and {gif}' if gif else ''}")
