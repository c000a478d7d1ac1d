"""The commands of `bug-gym`: what `--help` says of each, and the module that does it.

Each is a module with `add_arguments(parser)` and `run(options)`; to add one, write the module and a line here. All of
them are imported for `--help`, so that what a command needs is imported when it runs.
"""

from __future__ import annotations

from typing import NamedTuple


class Command(NamedTuple):
    """One line of the table."""

    module: str
    """The module that does it."""
    summary: str
    """What it does, in one line."""
    example: str
    """A command line of it."""
    goes_on: bool = False
    """Whether the same command goes on with what its folder `--out` holds after an interruption."""


COMMANDS: dict[str, Command] = {
    "list": Command(
        "bug_gym.commands.list",
        "Names of scenarios, policies, suites, trainings, sweeps and reproductions, each with what it is.",
        "bug-gym list policies",
    ),
    "show": Command(
        "bug_gym.commands.show",
        "Draw the world of a scenario and a seed, or save it as a scenario of its own.",
        "bug-gym show static --seed 3 --set lidar.beams=180 --out world.png",
    ),
    "evaluate": Command(
        "bug_gym.commands.evaluate",
        "Drive policies through the same worlds; tables, and with --out a folder of rows, summary and pictures.",
        "bug-gym evaluate --suite quick --policies bug0,bug2:turn=right --out results",
        goes_on=True,
    ),
    "compare": Command(
        "bug_gym.commands.compare",
        "What has changed from one results folder to another, as by an edit: the same policies in the same worlds.",
        "bug-gym compare results/before results/after",
    ),
    "collect": Command(
        "bug_gym.commands.collect",
        "Write Minari datasets of what policies do in worlds of a scenario, for learning without the env.",
        "bug-gym collect dynamic --policies hd_bug_map,bug2,ppo_dynamic,random --episodes 1000 --out datasets",
        goes_on=True,
    ),
    "train": Command(
        "bug_gym.commands.train",
        "Train a policy, or go on with a training that was cut off; the folder it writes is a policy for `evaluate`.",
        "bug-gym train ppo_dynamic --out results/ppo_dynamic",
        goes_on=True,
    ),
    "sweep": Command(
        "bug_gym.commands.sweep",
        "Train with other values each, every combination or by a search, and tell which did best.",
        "bug-gym sweep ppo_dynamic --workers 2 --out results/sweep",
        goes_on=True,
    ),
    "push": Command(
        "bug_gym.commands.push",
        "Put a trained model onto the Hugging Face Hub; `hf://user/name` then is a policy anywhere.",
        "bug-gym push results/ppo_dynamic/ hf://user/ppo_dynamic",
    ),
    "new": Command(
        "bug_gym.commands.new",
        "Begin a policy or a world of one's own: its file, a test of it, and the line that runs it.",
        "bug-gym new policy my_bug",
    ),
    "render": Command(
        "bug_gym.commands.render",
        "Draw an episode of a policy, or of several side by side: a film, or one picture of the whole path.",
        "bug-gym render bug2 tangent_bug dynamic --seed 3 --out both.gif",
    ),
    "play": Command(
        "bug_gym.commands.play",
        "Drive a robot by hand in a window, against policies in the same world; what you drive can be kept.",
        "bug-gym play dynamic --against bug2 --record driven.json",
    ),
    "watch": Command(
        "bug_gym.commands.watch",
        "Watch policies live in a window, or what was driven by hand.",
        "bug-gym watch bug2 tangent_bug dynamic --seed 3",
    ),
    "gallery": Command(
        "bug_gym.commands.gallery",
        "Draw every bug on one map: their ways in one picture, and as a film.",
        "bug-gym gallery --scenario oni_wang --out gallery.png --gif gallery.gif",
    ),
    "reproduce": Command(
        "bug_gym.commands.reproduce",
        "Run again what a paper reports, and print both side by side.",
        "bug-gym reproduce oni-wang-table-1 --workers 2",
    ),
    "warm-up": Command(
        "bug_gym.commands.warm_up",
        "Compile everything that is compiled when it is first used, and keep it: for images and clusters.",
        "bug-gym warm-up",
    ),
    "benchmark": Command(
        "bug_gym.commands.benchmark",
        "Measure speeds on this machine: environments, new worlds, imports, plans, decisions of policies.",
        "bug-gym benchmark --out benchmark.json",
    ),
}
"""Name on the command line -> what it is."""
