"""`bug-gym watch`: policies live in a window, or what somebody drove with `bug-gym play --record`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bug_gym.commands.arguments import add_world, assignments, policy_entry

if TYPE_CHECKING:
    from bug_gym.evaluation.live import Show


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "names",
        metavar="NAME",
        nargs="+",
        help="POLICY... SCENARIO, a POLICY as NAME[:PARAMETER=VALUE...]; or the .json of `bug-gym play --record` alone",
    )
    add_world(parser)


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.drawing.screen import Screen  # loads the compiler
    from bug_gym.evaluation.driven import JSON  # loads the compiler
    from bug_gym.evaluation.live import KEYS, run  # loads the compiler

    *policies, place = options.names
    is_recording = not policies and place.lower().endswith(JSON)
    if not policies and not is_recording:
        raise ValueError(f"got no policy to watch in {place}, expected POLICY... {place}, or a {JSON} alone")
    show = _driven(Path(place), options) if is_recording else _live(policies, place, options)
    screen = Screen()
    print(f"{KEYS[0].upper()}{KEYS[1:]}.")
    try:
        run(show, screen, print)
    finally:
        screen.close()


def _live(policies: list[str], place: str, options: argparse.Namespace) -> Show:
    """Policies in a scenario."""
    from bug_gym.config import load  # loads pydantic
    from bug_gym.evaluation.live import Show, same_world  # loads the compiler

    scenario = load(place, assignments(options.overrides), trust=options.trust)
    worlds = same_world([policy_entry(text) for text in policies], scenario)
    return Show(worlds, first=options.seed, size=options.size)


def _driven(path: Path, options: argparse.Namespace) -> Show:
    """What lies in a file, once it is clear that it can be driven again."""
    from bug_gym.evaluation.driven import again, read_driven, require_same_end  # loads the compiler
    from bug_gym.evaluation.live import Show  # loads the compiler

    if options.overrides:
        raise ValueError(f"{path} says in which worlds it was driven, got {options.overrides[0]} as well")
    scenario, episodes = read_driven(path, trust=options.trust)
    for episode in episodes:
        require_same_end(scenario, episode)
    seeds = [episode.seed for episode in episodes]
    first = seeds.index(options.seed) if options.seed in seeds else 0
    return Show(lambda number: [again(scenario, episodes[number])], first=first, count=len(episodes), size=options.size)
