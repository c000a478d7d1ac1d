"""The command line, `bug-gym`: list, show, evaluate, train, render, reproduce, benchmark.

Exit codes: 0 done, 2 bad input (one line on stderr says what), 130 interrupted. What a command needs is imported when
it runs, so that `--help` is quick.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from bug_gym.evaluation.suites import PolicyEntry
    from bug_gym.simulation import Simulation

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and leave with exit code 2."""
        self.exit(BAD_INPUT, f"bug-gym: error: {message} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    options = make_parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], None] = options.command
    try:
        command(options)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough, as `head` has
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (ValueError, OSError, ImportError) as error:
        return _complain(BAD_INPUT, f"error: {error}")
    except KeyboardInterrupt:
        out = getattr(options, "out", None)
        hint = f"; {out} keeps what is done, the same command goes on" if out and command in (evaluate, train) else ""
        return _complain(INTERRUPTED, f"interrupted{hint}")
    return DONE


def _complain(code: int, message: str) -> int:
    print("bug-gym:", "; ".join(message.splitlines()), file=sys.stderr)
    return code


# ---------------------------------------------------------------------------------------------------------------------
# Arguments
# ---------------------------------------------------------------------------------------------------------------------


def make_parser() -> Parser:
    """The parser of all commands."""
    parser = Parser(prog="bug-gym", description="2D navigation among unknown obstacles: worlds, policies, evaluations.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", parser_class=Parser)

    def add(name: str, command: Callable[[argparse.Namespace], None], example: str) -> argparse.ArgumentParser:
        summary = str(command.__doc__).splitlines()[0]
        form = argparse.RawDescriptionHelpFormatter
        added = commands.add_parser(
            name, help=summary, description=summary, epilog=f"example:\n  {example}", formatter_class=form
        )
        added.set_defaults(command=command)
        return added

    listing = add("list", list_, "bug-gym list policies")
    listing.add_argument("what", nargs="?", choices=[*LISTS], help="which names (default: all)")

    showing = add("show", show, "bug-gym show static --seed 3 --set lidar.beams=180 --out world.png")
    _add_scenario(showing)
    showing.add_argument("--out", type=Path, help="PNG to write (default without --save: SCENARIO-SEED.png)")
    showing.add_argument("--save", type=Path, help="YAML to write: the same world with every obstacle written out")

    evaluating = add(
        "evaluate", evaluate, "bug-gym evaluate --suite quick --policies bug0,bug2:turn=right --out results"
    )
    task = evaluating.add_mutually_exclusive_group(required=True)
    task.add_argument("--suite", help="name or path of a suite")
    task.add_argument("--scenario", action="append", help="name or path of a scenario; may come several times")
    evaluating.add_argument("--policies", help="NAME[:PARAMETER=VALUE...],... (default: the suite's, or all)")
    evaluating.add_argument("--episodes", type=int, help="worlds of each scenario (default: the suite's, or 50)")
    evaluating.add_argument("--seed", type=int, help="seed of the first world (default: the suite's, or 0)")
    evaluating.add_argument("--workers", type=int, default=1, help="processes (default: 1)")
    evaluating.add_argument("--baseline", help="policy that the others are compared with (default: the first)")
    evaluating.add_argument("--data", type=Path, help="somebody else's data that a suite needs")
    evaluating.add_argument(
        "--out", type=Path, help="folder for rows, summary and pictures; goes on with a run cut off"
    )
    _add_overrides(evaluating)

    training = add("train", train, "bug-gym train ppo_dynamic --out results/ppo_dynamic")
    training.add_argument(
        "name", metavar="NAME", help="a training (bug-gym list trainings), or the path of a YAML file"
    )
    training.add_argument("--out", type=Path, help="folder of the model (default: results/train/NAME)")
    training.add_argument("--seed", type=int, default=0, help="seed of the first model (default: 0)")
    training.add_argument("--seeds", type=at_least_one, default=1, help="how many models, a seed each (default: 1)")
    training.add_argument("--steps", type=at_least_one, help="environment steps (default: the training's)")
    training.add_argument("--minutes", type=float, help="end after so many minutes of training (default: all steps)")
    training.add_argument("--threads", type=at_least_one, help="threads of torch (default: one for each core)")
    training.add_argument("--start-from", metavar="MODEL", help="name or folder of a model of ours to begin with")
    training.add_argument(
        "--set",
        dest="overrides",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the training, such as gamma=0.98; may come several times",
    )

    rendering = add("render", render, "bug-gym render bug2 tangent_bug dynamic --seed 3 --out both.gif")
    rendering.add_argument(
        "policies", metavar="POLICY", nargs="+", help="NAME[:PARAMETER=VALUE...]; several: side by side"
    )
    _add_scenario(rendering)
    rendering.add_argument("--out", type=Path, required=True, help="a .gif, a .mp4, or a .png of the whole path")
    rendering.add_argument(
        "--every", type=at_least_one, default=1, help="steps from one frame to the next (default: 1)"
    )

    showing_all = add("gallery", gallery, "bug-gym gallery --scenario oni_wang --out gallery.png --gif gallery.gif")
    showing_all.add_argument("--scenario", default="oni_wang", help="name or path of a scenario (default: oni_wang)")
    showing_all.add_argument("--seed", type=int, default=0, help="seed of the world (default: 0)")
    showing_all.add_argument("--policies", help="NAME[:PARAMETER=VALUE...],... (default: every bug)")
    showing_all.add_argument("--size", type=at_least_one, default=240, help="pixels of each picture (default: 240)")
    showing_all.add_argument("--out", type=Path, default=Path("gallery.png"), help="PNG to write")
    showing_all.add_argument("--gif", type=Path, help="GIF to write as well")
    _add_overrides(showing_all)

    reproducing = add("reproduce", reproduce, "bug-gym reproduce oni-wang-table-1 --workers 2")
    reproducing.add_argument("name", metavar="NAME", help="what to run again (bug-gym list reproductions)")
    reproducing.add_argument("--seeds", type=at_least_one, help="seeds of each claim (default: all of them)")
    reproducing.add_argument("--policies", help="NAME,... where a reproduction leaves the choice")
    reproducing.add_argument("--data", type=Path, help="somebody else's data that a reproduction needs")
    reproducing.add_argument("--workers", type=at_least_one, default=1, help="processes (default: 1)")
    reproducing.add_argument("--out", type=Path, help="JSON to write, with the commit that made it")

    measuring = add("benchmark", benchmark, "bug-gym benchmark --out benchmark.json")
    measuring.add_argument("--repeats", type=int, default=5, help="times that each speed is measured (default: 5)")
    measuring.add_argument("--seconds", type=float, default=0.5, help="how long each time (default: 0.5)")
    measuring.add_argument("--worlds", type=int, default=1024, help="worlds side by side (default: 1024)")
    measuring.add_argument("--out", type=Path, help="JSON to write")
    return parser


def at_least_one(text: str) -> int:
    """A whole number from 1 on."""
    number = int(text)
    if number < 1:
        raise ValueError(text)
    return number


def _add_scenario(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenario", metavar="SCENARIO", help="name or path of a scenario")
    parser.add_argument("--seed", type=int, default=0, help="seed of the world (default: 0)")
    parser.add_argument("--size", type=int, default=600, help="longer side of the picture in pixels (default: 600)")
    _add_overrides(parser)


def _add_overrides(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        dest="overrides",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the scenario, such as lidar.beams=180; may come several times",
    )


def _assignments(pairs: Sequence[str]) -> dict[str, Any]:
    """Values by key from KEY=VALUE, the values read as YAML.

    Raises:
        ValueError: no `=`, or a value that is no YAML.
    """
    import yaml

    from bug_gym.config import YamlLoader

    found = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not key or not equals:
            raise ValueError(f"got {pair!r}, expected KEY=VALUE, such as lidar.beams=180")
        try:
            found[key] = yaml.load(value, Loader=YamlLoader)
        except yaml.YAMLError:
            raise ValueError(f"got {pair!r}, expected a value as YAML has it, such as 180, true or [0, 1]") from None
    return found


def _policy(text: str) -> PolicyEntry:
    """A policy from NAME[:PARAMETER=VALUE...], which is also what tables call it."""
    from bug_gym.evaluation.suites import PolicyEntry

    name, *pairs = re.split(r":(?=\w+=)", text)
    return PolicyEntry(text, name, _assignments(pairs))


# ---------------------------------------------------------------------------------------------------------------------
# Commands
# ---------------------------------------------------------------------------------------------------------------------


def list_(options: argparse.Namespace) -> None:
    """Names of scenarios, policies and suites, each with what it is."""
    for number, what in enumerate([options.what] if options.what else LISTS):
        lines = LISTS[what]()
        width = max(len(name) for name, _ in lines)
        print("\n" * (number > 0) + what)
        for name, summary in lines:
            print(f"  {name:<{width}}  {summary}")


def _scenarios() -> list[tuple[str, str]]:
    from bug_gym.config import SCENARIO_FOLDER, scenario_names

    return [(name, _first_comment(SCENARIO_FOLDER / f"{name}.yaml")) for name in scenario_names()]


def _policies() -> list[tuple[str, str]]:
    from bug_gym.agents import AGENTS

    marks = {name: " (privileged: reads the map)" if agent.privileged else "" for name, agent in AGENTS.items()}
    return [(name, f"{agent.family}; {agent.reference}{marks[name]}") for name, agent in AGENTS.items()]


def _suites() -> list[tuple[str, str]]:
    from bug_gym.evaluation.suites import SUITE_FOLDER, suite_names

    return [(name, _first_comment(SUITE_FOLDER / f"{name}.yaml")) for name in suite_names()]


def _reproductions() -> list[tuple[str, str]]:
    from importlib import import_module

    from bug_gym.reproductions import REPRODUCTIONS

    modules = {name: import_module(f"bug_gym.reproductions.{module}") for name, module in REPRODUCTIONS.items()}
    return [(name, str(module.__doc__).partition("\n")[0]) for name, module in modules.items()]


def _trainings() -> list[tuple[str, str]]:
    from bug_gym.agents.learning.settings import TRAIN_FOLDER, training_names

    return [(name, _first_comment(TRAIN_FOLDER / f"{name}.yaml")) for name in training_names()]


LISTS = {
    "scenarios": _scenarios,
    "policies": _policies,
    "suites": _suites,
    "trainings": _trainings,
    "reproductions": _reproductions,
}


def _first_comment(path: Path) -> str:
    """What a YAML file says about itself in its first line."""
    return path.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")


def show(options: argparse.Namespace) -> None:
    """Draw the world of a scenario and a seed, or save it as a scenario of its own."""
    from bug_gym.simulation import Simulation

    simulation = Simulation(options.scenario, overrides=_assignments(options.overrides))
    simulation.reset(seeds=[options.seed])
    name, out, save = simulation.scenario.name, options.out, options.save
    if out is None and save is None:
        out = Path(f"{name}-{options.seed}.png")
    for path in filter(None, (out, save)):
        _writable(path)
    if save:
        _save_world(save, simulation)
        print(f"{save}: {name}, seed {options.seed}, as an explicit world")
    if out:
        from bug_gym.drawing.canvas import Canvas
        from bug_gym.drawing.clips import save_png

        save_png(out, Canvas(simulation, size=options.size).draw(scan=False))
        length = simulation.shortest_path().length
        print(f"{out}: {name}, seed {options.seed}, shortest path {length:.2f} m")


def _save_world(path: Path, simulation: Simulation) -> None:
    from bug_gym.config import to_yaml
    from bug_gym.files import replaced_when_done
    from bug_gym.scenarios import as_explicit

    explicit = as_explicit(simulation.scenario, simulation.world.layout(0))
    title = f"# The world of {explicit.name} and seed {simulation.world.seed[0]}, every obstacle written out."
    with replaced_when_done(path) as partial:
        partial.write_text(f"{title}\n{to_yaml(explicit)}", encoding="utf-8")


def evaluate(options: argparse.Namespace) -> None:
    """Drive policies through the same worlds; tables, and with --out a folder of rows, summary and pictures."""
    from rich.console import Console

    from bug_gym.evaluation import evaluate
    from bug_gym.evaluation.intervals import compare, summarise
    from bug_gym.evaluation.report import print_differences, print_table
    from bug_gym.evaluation.suites import load_suite

    rows = evaluate(
        [_policy(text) for text in options.policies.split(",")] if options.policies else None,
        load_suite(options.suite) if options.suite else options.scenario,
        episodes=options.episodes,
        seed=options.seed,
        workers=options.workers,
        out=options.out,
        overrides=_assignments(options.overrides),
        progress=True,
        data=options.data,
        baseline=options.baseline,
    )
    console = Console()
    print_table(summarise(rows), console)
    print_differences(compare(rows, options.baseline or rows[0].policy), console)
    if options.out:
        print(f"rows, summary and pictures: {options.out}")


def train(options: argparse.Namespace) -> None:
    """Train a policy, or go on with a training that was cut off; the folder it writes is a policy for `evaluate`."""
    try:
        from bug_gym.agents.learning.training import train_seeds
    except ModuleNotFoundError as error:
        raise ImportError(
            "training needs stable-baselines3, of the extra `train`: pip install 'bug-gym[train]'"
        ) from error
    from bug_gym.agents.learning.settings import load_settings

    overrides = _assignments(options.overrides) | ({"n_timesteps": options.steps} if options.steps else {})
    overrides |= {"start_from": options.start_from} if options.start_from else {}
    settings = load_settings(options.name, overrides)
    options.out = options.out or Path("results", "train", settings.name)
    best = train_seeds(
        settings,
        options.out,
        seeds=range(options.seed, options.seed + options.seeds),
        minutes=options.minutes,
        threads=options.threads,
        progress=True,
    )
    print(f"{best}: play it with --policies {best}/")


def render(options: argparse.Namespace) -> None:
    """Draw an episode of a policy, or of several side by side: a film, or one picture of the whole path."""
    from bug_gym.config import load
    from bug_gym.drawing.canvas import Canvas
    from bug_gym.drawing.clips import grid, save_gif, save_mp4, save_png, together
    from bug_gym.evaluation import progress_bar
    from bug_gym.evaluation.rollout import Rollout, film, portrait
    from bug_gym.evaluation.suites import ScenarioEntry

    out = _writable(options.out)
    save = {".gif": save_gif, ".mp4": save_mp4}.get(out.suffix)
    if save is None and out.suffix != ".png":
        raise ValueError(f"got {out} to write to, expected a name that ends in .gif, .mp4 or .png")
    scenario, entries = load(options.scenario, _assignments(options.overrides)), map(_policy, options.policies)
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
        outcome, time, length = (info[name][0, 0] for name in ("outcome", "time", "path_length"))
        print(f"  {one.entry.label}: {one.verdict() or outcome} after {time:.1f} s and {length:.2f} m")


def gallery(options: argparse.Namespace) -> None:
    """Draw every bug on one map: their ways in one picture, and as a film."""
    from bug_gym.agents import AGENTS
    from bug_gym.config import load
    from bug_gym.evaluation.gallery import draw_gallery
    from bug_gym.evaluation.suites import PolicyEntry

    bugs = [name for name, line in AGENTS.items() if line.family == "bug" and name != "com"]
    entries = [_policy(text) for text in options.policies.split(",")] if options.policies else map(PolicyEntry.of, bugs)
    scenario = load(options.scenario, {"lidar.beams": 360, "time.limit": 600.0, **_assignments(options.overrides)})
    png, gif = _writable(options.out), options.gif and _writable(options.gif)
    draw_gallery(scenario, list(entries), seed=options.seed, size=options.size, png=png, gif=gif)
    print(f"{png}{f' and {gif}' if gif else ''}")


def reproduce(options: argparse.Namespace) -> None:
    """Run again what a paper reports, and print both side by side."""
    import subprocess

    from rich.console import Console

    from bug_gym.evaluation.report import draw_curves, print_text_table
    from bug_gym.files import replaced_when_done
    from bug_gym.reproductions import reproduction
    from bug_gym.reproductions.result import Settings

    out = options.out and _writable(options.out)
    run = reproduction(options.name)
    policies = tuple(options.policies.split(",")) if options.policies else ()
    result = run(Settings(options.seeds, options.workers, options.data, progress=True, policies=policies))
    console = Console()
    for table in result.tables:
        print_text_table(table.title, table.header, table.rows, console)
    for note in result.notes:
        console.print(note, highlight=False)
    if result.holds is not None:
        console.print("every claim holds" if result.holds else "NOT every claim holds", style="bold")
    if out and result.curves:
        draw_curves(out.with_suffix(".png"), result.curves)
    if out:
        told = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"], capture_output=True, text=True, check=False
        )
        commit = told.stdout.strip() if told.returncode == 0 else "unknown"
        with replaced_when_done(out) as partial:
            Path(partial).write_text(result.as_json(commit), encoding="utf-8")
        print(f"numbers: {out}")


def _writable(path: Path) -> Path:
    """The path of a file to write; a missing folder is found out before the work, not after it."""
    if not path.parent.is_dir():
        raise ValueError(f"no folder {path.parent} to write {path.name} into")
    return path


def benchmark(options: argparse.Namespace) -> None:
    """Measure speeds on this machine: environments, new worlds, imports, decisions of policies."""
    from bug_gym.benchmark import run_benchmark

    out = options.out and _writable(options.out)
    run_benchmark(repeats=options.repeats, seconds=options.seconds, worlds=options.worlds, out=out)
