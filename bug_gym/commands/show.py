"""`bug-gym show`: the world of a scenario and a seed, as a picture or as YAML."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from bug_gym.commands.arguments import add_scenario, assignments, told_path
from bug_gym.files import file_name, replaced_when_done, writable

if TYPE_CHECKING:
    from bug_gym.schema.motions import Motion
    from bug_gym.simulation import Simulation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    add_scenario(parser)
    parser.add_argument("--out", type=told_path, help="PNG to write (default without --save: SCENARIO-SEED.png)")
    parser.add_argument("--save", type=told_path, help="YAML to write: the same world with every obstacle written out")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.config import load  # loads pydantic
    from bug_gym.drawing.canvas import Canvas  # loads the compiler
    from bug_gym.drawing.clips import PNG, save_png  # loads the compiler
    from bug_gym.simulation import Simulation  # loads the compiler

    out, save = options.out and writable(options.out, [PNG]), options.save and writable(options.save, [".yaml", ".yml"])
    simulation = Simulation(load(options.scenario, assignments(options.overrides), trust=options.trust))
    name = simulation.scenario.name
    if out is None and save is None:
        out = writable(f"{file_name(name)}-{options.seed}.png", [PNG])
    simulation.reset(seeds=[options.seed])
    if save:
        _save_world(save, simulation)
        print(f"{save}: {name}, seed {options.seed}, as an explicit world")
    if out:
        save_png(out, Canvas(simulation, size=options.size).draw(scan=False))
        length = simulation.shortest_length()
        told = "no room for the body at start or goal" if math.isnan(length) else f"shortest path {length:.2f} m"
        print(f"{out}: {name}, seed {options.seed}, {told}")


def _save_world(path: Path, simulation: Simulation) -> None:
    from bug_gym.config import to_yaml  # loads pydantic
    from bug_gym.scenarios import as_explicit  # loads the compiler

    seed, layout = simulation.world.seed[0], simulation.world.layout(0)
    explicit = as_explicit(simulation.scenario, layout)
    title = f"# The world of {explicit.name} and seed {seed}, every obstacle written out."
    if any(map(_draws_its_way, [*(mover.motion for mover in layout.movers), layout.target])):
        title += f" What walks by chance goes the same ways with seed {seed} only."
    with replaced_when_done(path) as partial:
        partial.write_text(f"{title}\n{to_yaml(explicit)}", encoding="utf-8")


def _draws_its_way(motion: Motion | None) -> bool:
    """Whether the seed decides on the ways of a motion: on a random walk's, a crowd's and those of an evader that wanders."""
    law = getattr(motion, "law", "")
    return law in ("random_walk", "crowd") or (law == "evade" and getattr(motion, "wander", 0.0) > 0.0)
