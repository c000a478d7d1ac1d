"""The command line: what each command leaves and prints, bad input, and how little `--help` loads."""

import argparse
import json
import operator
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym import benchmark
from bug_gym.agents import AGENTS, policy_names
from bug_gym.cli import main, make_parser
from bug_gym.commands import show
from bug_gym.config import load, scenario_names
from bug_gym.evaluation import evaluate, gallery
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.suites import suite_names
from bug_gym.simulation import Simulation

OPEN = ["--set", "world.goal=[2, 0]", "--set", "lidar.beams=8"]
"""Makes `empty` a matter of some twenty steps."""


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    (table,) = (action for action in make_parser()._actions if isinstance(action, argparse._SubParsersAction))
    return dict(table.choices)


@pytest.fixture
def image() -> Callable[[Path], np.ndarray]:
    """Reads a picture as pixels (H, W, 3)."""
    pillow = pytest.importorskip("PIL.Image")

    def read(path: Path) -> np.ndarray:
        return np.asarray(pillow.open(path).convert("RGB"))

    return read


# ---------------------------------------------------------------------------------------------- help


@pytest.mark.parametrize("name", commands())
def test_the_example_of_each_command_can_be_run(name: str) -> None:
    title, example = str(commands()[name].epilog).split("\n")
    program, *arguments = shlex.split(example)
    assert (title, program, arguments[0]) == ("example:", "bug-gym", name)
    make_parser().parse_args(arguments)


@pytest.mark.parametrize("arguments", [[], *([name] for name in commands())])
def test_help_is_done_with_exit_code_0(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main([*arguments, "--help"])
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith("usage: bug-gym")


def test_help_loads_no_compiler_and_no_agent() -> None:
    code = "import sys, bug_gym.cli as cli; cli.make_parser().format_help(); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2], capture_output=True, check=True)
    loaded = set(run.stdout.decode().split())
    assert not {"numba", "pydantic", "rich", "bug_gym.agents", "bug_gym.evaluation"} & loaded


# ---------------------------------------------------------------------------------------------- commands


def test_the_process_of_a_command_ends_without_a_look_through_its_memory() -> None:
    # What was registered last is called first: by the time of the print nothing is left for the collector to look at.
    code = """
import atexit, gc
atexit.register(lambda: print(gc.get_freeze_count() > 10_000, len(gc.get_objects()) < 100))
from bug_gym.cli import main
main(["list", "suites"]), main(["list", "suites"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-2:] == ["True", "True"]


def test_list_names_all_scenarios_policies_and_suites(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    words = capsys.readouterr().out.split()
    assert {*scenario_names(), *policy_names(), *suite_names()} <= set(words)


@pytest.mark.parametrize("kind", ["scenarios", "suites", "trainings", "sweeps"])
def test_each_file_is_listed_by_a_whole_sentence(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    main(["list", kind])
    assert all(line.endswith(".") for line in capsys.readouterr().out.splitlines()[1:])


def test_list_of_one_kind_names_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "suites"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["suites", *suite_names()]


def test_show_draws_the_world_of_a_seed(tmp_path: Path, image: Callable[[Path], np.ndarray]) -> None:
    for seed in (3, 4):
        assert main(["show", "static", "--seed", str(seed), "--size", "200", "--out", f"{tmp_path}/{seed}.png"]) == 0
    first, second = (image(tmp_path / f"{seed}.png") for seed in (3, 4))
    assert max(first.shape) == 200
    assert (first != second).any()


def test_show_saves_the_world_of_a_seed_as_a_scenario(tmp_path: Path) -> None:
    saved = tmp_path / "saved.yaml"
    assert main(["show", "dynamic", "--seed", "3", "--set", "lidar.beams=8", "--save", str(saved)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["saved.yaml"]
    drawn, loaded = Simulation("dynamic", overrides={"lidar.beams": 8}), Simulation(saved)
    assert (drawn.reset(seeds=[3]) == loaded.reset(seeds=[3])).all()
    assert loaded.scenario.world.family == "explicit"


@pytest.mark.parametrize(
    ("motion", "is_drawn"),
    [
        ({"law": "random_walk", "speed": 1.0}, True),
        ({"law": "crowd", "speed": 1.0}, True),
        ({"law": "crowd", "speed": 1.0, "goals": [[3, 3], [-3, 3]]}, True),
        ({"law": "evade", "speed": 1.0, "wander": 0.5, "sight": 0.1}, True),
        ({"law": "evade", "speed": 1.0}, False),
        ({"law": "bounce", "velocity": [1.0, 0.5]}, False),
    ],
)
def test_a_saved_world_says_whether_what_moves_in_it_goes_by_the_seed(
    motion: dict[str, Any], is_drawn: bool, tmp_path: Path
) -> None:
    mover = {"shape": {"circle": 0.3}, "at": [0, 3], "motion": motion}
    places = {"start": [-4, -4, 0], "goal": [4, -4], "movers": [mover]}
    world = {"family": "explicit", "bounds": [-5, -5, 5, 5], **places}
    (tmp_path / "world.yaml").write_text(json.dumps({"world": world}), encoding="utf-8")
    saved = tmp_path / "saved.yaml"
    assert main(["show", str(tmp_path / "world.yaml"), "--seed", "3", "--save", str(saved)]) == 0
    first = saved.read_text(encoding="utf-8").splitlines()[0]
    told = "# The world of world and seed 3, every obstacle written out."
    assert first == told + " What walks by chance goes the same ways with seed 3 only." * is_drawn
    ways = {(path, seed): way(path, seed) for path in (tmp_path / "world.yaml", saved) for seed in (3, 4)}
    assert ways[saved, 3] == ways[tmp_path / "world.yaml", 3]
    assert (ways[saved, 4] != ways[saved, 3]) == is_drawn


def way(path: Path, seed: int) -> list[Any]:
    """Where the only mover of a world is after each of 50 steps, while the robot stands [m]."""
    simulation = Simulation(path)
    simulation.reset(seeds=[seed])
    places = []
    for _ in range(50):
        simulation.step([[[0.0, 0.0]]])
        places.append(tuple(simulation.world.layout(0).movers[0].at))
    return places


def test_evaluate_prints_a_table_and_fills_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    policies = "go_to_goal,bug0:turn=right:clearance=0.4"
    arguments = ["--scenario", "empty", *OPEN, "--policies", policies, "--episodes", "2", "--out", str(out)]
    assert main(["evaluate", *arguments]) == 0
    printed = capsys.readouterr().out
    assert "go_to_goal" in printed and "100 [" in printed
    rows = [json.loads(line) for line in (out / "rows.jsonl").read_text().splitlines()]
    assert {(row["policy"], row["seed"]) for row in rows} == {
        (policy, seed) for policy in policies.split(",") for seed in (0, 1)
    }
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["policies"]["bug0:turn=right:clearance=0.4"]["parameters"] == {"turn": "right", "clearance": 0.4}


def test_evaluate_marks_who_reads_the_map_and_leaves_them_out_where_asked(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["evaluate", "--scenario", "empty", *OPEN, "--episodes", "1", "--policies"]
    assert main([*arguments, "go_to_goal,a_star"]) == 0
    assert "a_star (privileged)" in capsys.readouterr().out
    assert main([*arguments, "go_to_goal,a_star", "--no-privileged"]) == 0
    printed = capsys.readouterr().out
    assert "go_to_goal" in printed and "a_star" not in printed
    assert main([*arguments, "a_star", "--no-privileged"]) == 2
    said = capsys.readouterr().err
    assert said == "bug-gym: error: expected a policy that does not read the map, got a_star\n"


def test_the_smoke_suite_runs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "--suite", "smoke"]) == 0
    assert "all scenarios" in capsys.readouterr().out


def test_evaluate_prints_the_matrix_and_the_files_first_and_the_rest_when_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    # Who turns on the spot at random gets nowhere in 30 steps; the other drives straight to the goal.
    arguments = ["--scenario", "empty", *OPEN, "--set", "time.limit=3.0", "--policies", "random,go_to_goal"]
    arguments += ["--episodes", "2", "--out", str(out)]
    assert main(["evaluate", *arguments]) == 0
    short = capsys.readouterr().out
    assert short.index("success [%]") < short.index("go_to_goal") < short.index("random") < short.index("report.html")
    assert "difference to" not in short and "--details" in short
    assert len(short.splitlines()) <= 10
    assert main(["evaluate", *arguments, "--details"]) == 0
    long = capsys.readouterr().out
    assert long.startswith(short.partition("all tables")[0]) and "difference to go_to_goal in the same worlds" in long
    assert "difference to go_to_goal" in (out / "summary.md").read_text(encoding="utf-8")


def test_render_films_an_episode(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pillow = pytest.importorskip("PIL.Image")
    out = tmp_path / "film.gif"
    assert main(["render", "go_to_goal", "empty", *OPEN, "--every", "5", "--size", "150", "--out", str(out)]) == 0
    # 1.7 m at 0.1 m a step are 17 steps: a frame of the start, after 5, 10, 15 steps, and of the end.
    assert pillow.open(out).n_frames == 5
    assert "success after 1.7 s and 1.70 m" in capsys.readouterr().out


def test_render_draws_the_whole_path(tmp_path: Path, image: Callable[[Path], np.ndarray]) -> None:
    for policy in ("bug0", "bug0:turn=right"):
        assert main(["render", policy, "disc", "--out", f"{tmp_path}/{policy.split('=')[-1]}.png"]) == 0
    left, right = image(tmp_path / "bug0.png"), image(tmp_path / "right.png")
    assert left.shape == right.shape and (left != right).any()


def test_render_shows_several_policies_side_by_side_until_the_last_has_arrived(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pillow = pytest.importorskip("PIL.Image")
    alone, both, picture = (tmp_path / name for name in ("alone.gif", "both.gif", "both.png"))
    common = ["disc", "--every", "10", "--size", "150"]
    assert main(["render", "bug2", *common, "--out", str(alone)]) == 0
    assert main(["render", "go_to_goal", "bug2", *common, "--set", "time.limit=60", "--out", str(both)]) == 0
    assert main(["render", "go_to_goal", "bug2", "disc", "--size", "150", "--out", str(picture)]) == 0
    width, height = pillow.open(alone).size
    assert pillow.open(both).size == pillow.open(picture).size == (2 * width, height)
    assert pillow.open(both).n_frames >= pillow.open(alone).n_frames
    said = capsys.readouterr().out
    assert "go_to_goal: timeout" in said and "bug2: success" in said


def test_render_writes_mp4(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    out = tmp_path / "film.mp4"
    assert main(["render", "go_to_goal", "empty", *OPEN, "--every", "5", "--size", "150", "--out", str(out)]) == 0
    assert out.read_bytes()[4:8] == b"ftyp"


def test_benchmark_measures_something_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(benchmark, "CASES", ((5, 8),))
    # Two seconds of an episode are enough to decide in.
    short = {"time.limit": 2.0}
    monkeypatch.setattr(
        benchmark, "evaluate", lambda names, where, episodes: evaluate(names, load(where, short), episodes=1)
    )
    # The first start is measured where kernels are kept: compiling them takes as long as all else here.
    monkeypatch.setattr(benchmark, "TemporaryDirectory", lambda: nullcontext(os.environ.get("NUMBA_CACHE_DIR", "")))
    out = tmp_path / "benchmark.json"
    assert main(["benchmark", "--repeats", "1", "--seconds", "0.01", "--worlds", "4", "--out", str(out)]) == 0
    data = json.loads(out.read_text())
    assert data["settings"]["worlds"] == 4
    assert all(0.0 < line["least"] <= line["median"] <= line["greatest"] for line in data["measurements"])
    names = " ".join(line["name"] for line in data["measurements"])
    for part in ("VectorEnv", "gym.make", "new world", "import bug_gym", *policy_names()):
        assert part in names
    assert "VectorEnv: 5 circles, 8 beams" in capsys.readouterr().out


# ---------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("evaluate --scenario statik", "did you mean 'static'"),
        ("evaluate --suite smok", "did you mean 'smoke'"),
        ("list policies extra", "unrecognized arguments: extra (see bug-gym list --help)"),
        ("sweep ppo_dynamic --sett x=1", "unrecognized arguments: --sett x=1 (see bug-gym sweep --help)"),
        ("evaluate --scenario static --policies bug_2", "'bug2'"),
        ("evaluate --scenario static --policies bug2:trun=left", "did you mean 'turn'"),
        ("evaluate --scenario static --policies bug2:turn=up", "'up'"),
        ("evaluate --scenario static --set lidar.beams=0", "expected at least 1"),
        ("evaluate --scenario static --set lidar.beems=9", "did you mean 'beams'"),
        ("evaluate --scenario static --set lidar.beams", "expected KEY=VALUE"),
        ("evaluate --scenario static --set lidar.beams=[", "expected a value as YAML has it"),
        ("evaluate --scenario static --set lidar.beams=9 --set lidar.beams=8", "got 'lidar.beams' twice"),
        ("evaluate --scenario static --out=~nobody-of-that-name/out", "argument --out: ~nobody-of-that-name/out: "),
        ("evaluate --scenario static --episodes many", "invalid int value"),
        ("evaluate --scenario static --workers 0", "workers must be at least 1"),
        ("evaluate --scenario missing.yaml", "missing.yaml: No such file"),
        ("evaluate --scenario static --out notes.txt", "holds something else"),
        ("evaluate", "--suite --scenario is required"),
        ("evaluate --suite smoke --scenario static", "not allowed with"),
        ("show static --seed -1", "a seed is an integer from 0"),
        ("show static --size 5", "at least 100 pixels"),
        ("show static --out nowhere/world.png", "no folder nowhere"),
        ("show static --out a.xyz", "got a.xyz to write to, expected a name that ends in .png"),
        ("show static --out .", "expected a name that ends in .png"),
        ("show static --save .", "got . to write to, expected a name that ends in .yaml or .yml"),
        ("show static --save rows.jsonl", "expected a name that ends in .yaml or .yml"),
        ("evaluate --scenario static --replays 3", "got --replays and no folder"),
        ("gallery --out a.xyz", "expected a name that ends in .png"),
        ("gallery --gif a.png", "expected a name that ends in .gif"),
        ("reproduce oni-wang-table-1 --out a.txt", "expected a name that ends in .json"),
        ("benchmark --out ..", ".. is a folder"),
        ("evaluate --scenario static --repair", "got repair and no folder"),
        ("render bug2 static --out film.avi", "ends in .html, .gif, .mp4 or .png"),
        ("render bug2 static --out nowhere/film.gif", "no folder nowhere"),
        ("render bug2 static --every 0 --out film.gif", "got '0', expected a whole number from 1 to"),
        ("train ppo_static --minutes nan", "got 'nan', expected a number above 0"),
        ("evaluate --scenario static --policies=", "got an empty argument after 'static', expected a value"),
        (
            "evaluate --scenario static --policies ,",
            "got an empty name in ',', expected names of policies with a comma",
        ),
        ("evaluate --scenario static --policies bug2,,bug0", "got an empty name in 'bug2,,bug0'"),
        ("render static --policies bug2, --out film.gif", "got an empty name in 'bug2,'"),
        ("gallery --policies ,bug2", "got an empty name in ',bug2'"),
        ("reproduce dynabarn --policies ,", "got an empty name in ','"),
        ("evaluate --scenario static --workers 1000000", "workers must be at most 1,000"),
        ("evaluate --scenario static --policies bug2:turn=left:turn=right", "expected a single turn"),
        ("new policy my_bug --folder notes.txt", "notes.txt: File exists"),
        ("train ppo_static --seeds 1000000000", "the number of seeds must be at most 10,000"),
        ("reproduce bug-bounds --seeds 1000000000", "seeds must be at most 1,000,000"),
        ("reproduce bug-bounds --seeds 1000000000000000000000", "expected a whole number from 1 to"),
        ("reproduce oni-wang-table-1 --seeds 3", "oni-wang-table-1 takes no --seeds (those that do: "),
        ("reproduce com1-rev3 --policies bug2", "com1-rev3 takes no --policies (those that do: "),
        ("reproduce bug-bounds --data .", "bug-bounds takes no --data (those that do: "),
        ("render bug3 static --out film.gif", "'bug2'"),
        ("render bug2 bug3 static --out film.gif", "'bug2'"),
        ("evaluate --suite barn --policies bug2", "suite 'barn' needs data"),
        ("evaluate --scenario static --policies bug2 --baseline bug1", "baseline must be one of bug2, came 'bug1'"),
        ("benchmark --repeats 0", "repeats"),
        ("lst", "invalid choice"),
        ("", "required"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2_and_leaves_no_file(
    arguments: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    try:
        code: Any = main(arguments.split())
    except SystemExit as left:
        code = left.code
    said = capsys.readouterr()
    assert code == 2 and said.out == ""
    assert said.err.startswith("bug-gym: error: ") and said.err.count("\n") == 1
    assert message in said.err
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("name", ["../../evil", "/evil", "..", "a/b", "~/evil", ".hidden"])
def test_a_name_in_a_file_does_not_choose_where_is_written(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = tmp_path / "some" / "where"
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    world = {"name": name, "world": {"family": "empty"}}
    suite = {"scenarios": [{"scenario": world, "label": name}], "policies": [{"name": "go_to_goal", "label": name}]}
    for file, data in (("world.yaml", world), ("suite.yaml", {**suite, "seeds": {"first": 0, "count": 1}})):
        Path(file).write_text(json.dumps(data), encoding="utf-8")
    assert main(["show", "world.yaml"]) == 0
    assert main(["evaluate", "--suite", "suite.yaml", "--out", "rows", "--pictures"]) == 0
    folders = {path.parent.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.png")}
    assert folders == {"some/where", "some/where/rows/pictures"}
    assert all(not path.name.startswith(".") for path in tmp_path.rglob("*.png"))


@pytest.mark.parametrize("name", ["a\nrobot: {radius: 0.4}", "\x1b[31mred", "a\u2028b", "\x00", "\x9b2J"])
def test_a_name_in_a_file_writes_no_other_line_and_tells_no_terminal_anything(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    world = {"name": name, "world": {"family": "empty"}}
    files: list[tuple[str, Any]] = [
        ("world.yaml", world),
        ("suite.yaml", {"name": name, "scenarios": ["empty"]}),
        ("suite.yaml", {"scenarios": [{"scenario": "empty", "label": name}]}),
        ("suite.yaml", {"scenarios": ["empty"], "policies": [{"name": "bug2", "label": name}]}),
        ("world.yaml", {"world": {"family": "empty", name: 1}}),
    ]
    for file, data in files:
        Path(file).write_text(json.dumps(data), encoding="utf-8")
        words = ["show", file, "--save", "saved.yaml"] if file == "world.yaml" else ["evaluate", "--suite", file]
        assert main(words) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and said.strip().isprintable(), said
    assert not Path("saved.yaml").exists()


def test_a_baseline_that_reads_the_map_is_named_without_its_mark(capsys: pytest.CaptureFixture[str]) -> None:
    command = "evaluate --scenario empty --episodes 2 --policies bug2,a_star,go_to_goal --details --set time.limit=2"
    for baseline in ("a_star", "bug2"):
        assert main([*command.split(), "--baseline", baseline]) == 0
        shown = capsys.readouterr().out
        assert f"difference to {baseline}" in " ".join(shown.split())


@pytest.mark.parametrize("option", ["--policies", "--out", "--suite", "--baseline", "--set"])
def test_an_empty_argument_is_not_taken_for_none(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    """As "$NAME" is where a shell has no NAME: with `--policies ''` all of them would be driven."""
    assert main(["evaluate", "--scenario", "static", option, ""]) == 2
    assert capsys.readouterr().err == f"bug-gym: error: got an empty argument after {option!r}, expected a value\n"


def test_blanks_about_commas_are_no_part_of_a_policy(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["evaluate", "--scenario", "empty", "--episodes", "1", "--policies", "bug0, bug2 ,go_to_goal", *OPEN]
    assert main(command) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in ("bug0", "bug2", "go_to_goal"))


@pytest.mark.parametrize("words", [["--out", "~/out"], ["--out=~/out"]])
def test_results_go_home(words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert main(["evaluate", "--scenario", "empty", "--episodes", "1", "--policies", "bug0", *words, *OPEN]) == 0
    evaluate("bug0", "empty", episodes=1, out="~/other")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other", "out"]


def test_several_faults_are_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "static", "--set", "lidar.beams=0", "--set", "robot.radius=-1"]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "beams" in line and "radius" in line


def test_an_interrupted_evaluation_says_that_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(rollout: Rollout) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(Rollout, "worlds", interrupted)
    out = tmp_path / "out"
    assert main(["evaluate", "--scenario", "empty", "--policies", "bug0", "--episodes", "2", "--out", str(out)]) == 130
    assert f"{out} keeps what is done, the same command goes on" in capsys.readouterr().err


def test_one_that_is_interrupted_before_its_folder_is_there_keeps_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr("bug_gym.evaluation.make_plan", interrupted)
    out = tmp_path / "out"
    assert main(["evaluate", "--scenario", "empty", "--policies", "bug0", "--episodes", "2", "--out", str(out)]) == 130
    assert not out.exists() and "; nothing was done so far" in capsys.readouterr().err


def test_an_error_of_our_own_is_not_taken_for_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    # Of a function written here it would be a caller's code that has failed, which is told in a line.
    monkeypatch.setattr(show, "run", operator.attrgetter("no_such_option"))
    with pytest.raises(AttributeError, match="no_such_option"):
        main(["show", "static"])


def test_a_reader_that_has_seen_enough_ends_the_command_quietly() -> None:
    command = f"{shlex.quote(sys.executable)} -m bug_gym list | head -n 1"
    root = Path(__file__).parents[2]
    run = subprocess.run(command, shell=True, cwd=root, capture_output=True, text=True, check=True)
    assert (run.stdout, run.stderr) == ("scenarios\n", "")


def test_a_gallery_draws_every_bug_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    drawn: list[str] = []

    def draw(scenario: Any, entries: Any, **_: Any) -> None:
        drawn.extend(entry.label for entry in entries)

    monkeypatch.setattr(gallery, "draw_gallery", draw)
    assert main(["gallery", "--out", str(tmp_path / "gallery.png")]) == 0
    bugs = {line.entry_point for line in AGENTS.values() if line.family == "bug"}
    assert len(drawn) == len({*drawn}) == len(bugs) and {AGENTS[name].entry_point for name in drawn} == bugs
    assert "bug0" in drawn and "com" not in drawn
