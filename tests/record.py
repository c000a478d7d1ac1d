"""Digests of what the package does, to show that a change of its code changes nothing.

    python tests/record.py            # before it: write recorded.json and recorded_errors.txt, beside this file
    python tests/record.py --check    # after it: do it all again, tell each case that differs, is missing or new; 1 if one does

Git does not keep what is written: it is of one machine, one set of libraries and one commit. `--only worlds` (or policies,
yaml, errors; may come several times) leaves the other sections as they are. `errors` runs all tests for what they catch.
Digests are of bits.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import joblib
import numpy as np
import yaml
from numpy.typing import NDArray

import bug_gym
from bug_gym.agents import make_policy, policy_names
from bug_gym.agents.sb3 import make_vec_env
from bug_gym.config import load, scenario_names, to_yaml
from bug_gym.evaluation import evaluate
from bug_gym.scenarios import draw_layout

ROOT = Path(__file__).resolve().parents[1]
RECORDED = Path(__file__).with_name("recorded.json")
ERRORS = Path(__file__).with_name("recorded_errors.txt")
SECTIONS = ("worlds", "policies", "yaml", "errors")

Cases = dict[str, str]
"""A digest, or the text of a refusal, by the name of its case."""
Overrides = dict[str, Any]
Step = tuple[Any, Any, Any]
"""What a face gave: observation; reward and ends; info."""


def shipped_configs() -> Iterator[tuple[str, Any]]:
    """Name and content of each shipped YAML file; suites, trainings and reproductions have no other place here."""
    from bug_gym.agents.learning.settings import load_settings, training_names
    from bug_gym.evaluation.suites import load_suite, suite_names

    for name in scenario_names():
        yield f"scenarios/{name}", (to_yaml(load(name)), load(name).model_dump(mode="json"))
    for name in suite_names():
        yield f"suites/{name}", load_suite(name).model_dump(mode="json")
    for name in training_names():
        yield f"train/{name}", load_settings(name).model_dump(mode="json")
    for path in Path(bug_gym.__file__).parent.glob("configs/reproductions/*.yaml"):
        yield f"reproductions/{path.stem}", yaml.safe_load(path.read_text(encoding="utf-8"))


# ---------------------------------------------------------------------------------------------------------------------
# Digests
# ---------------------------------------------------------------------------------------------------------------------


class Digest:
    """SHA-256 of values in a form of their own: each with its type, numbers by their bytes, mappings in their order."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()

    def add(self, *values: Any) -> None:
        """Take in some values."""
        for value in values:
            self._add(value)

    def _add(self, value: Any) -> None:
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        if isinstance(value, np.ndarray):
            self._head(value, value.dtype.str, value.shape)
            if value.dtype == object:
                self.add(*value.ravel().tolist())
            else:
                self._sha.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, np.generic):
            self._head(value, value.dtype.str)
            self._sha.update(value.tobytes())
        elif isinstance(value, Mapping):
            self._head(value, len(value))
            self.add(*(part for item in value.items() for part in item))
        elif isinstance(value, (list, tuple)):
            self._head(value, len(value))
            self.add(*value)
        elif isinstance(value, float):
            self._head(value, value.hex())
        elif value is None or isinstance(value, (bool, int, str)):
            self._head(value, value)
        else:
            raise TypeError(f"no form for {value!r}")

    def _head(self, value: Any, *what: Any) -> None:
        self._sha.update(f"{type(value).__name__} {what!r}\n".encode())

    def text(self) -> str:
        """The digest, so far; its first 80 bits are enough to tell it from any other."""
        return self._sha.hexdigest()[:20]


def digest_of(*values: Any) -> str:
    """Digest of some values."""
    digest = Digest()
    digest.add(*values)
    return digest.text()


def refusal(error: Exception) -> str:
    """What is recorded where a case cannot be."""
    return f"{type(error).__name__}: {error}"


# ---------------------------------------------------------------------------------------------------------------------
# Worlds
# ---------------------------------------------------------------------------------------------------------------------

SEED = 11
STEPS = 120
HELD = 6
"""Steps that an action is kept for, so that robots get somewhere."""
ROWS = 4

NOISE: Overrides = {
    "lidar.noise": 0.02,
    "lidar.dropout": 0.05,
    "odometry.translation_noise": 0.02,
    "odometry.rotation_noise": 0.01,
    "reward.clearance": -0.1,
    "reward.smoothness": -0.1,
    "time.limit": 5.0,
}
"""All that is drawn while a robot drives, all terms of the reward, and a time that ends a few times."""
KINEMATICS: dict[str, Overrides] = {
    "differential": {"robot.kinematics": "differential"},
    "holonomic": {"robot.kinematics": "holonomic"},
}
LONG_BODY: Overrides = {
    "robot.circles": [[0.25, 0.0, 0.2], [0.0, 0.0, 0.2], [-0.25, 0.0, 0.2]],
    "world.solvable": 0.6,
}
BLIND: Overrides = {"goal.sensing": "odometry", "robot.max_acceleration": 1.0, "lidar.fov": 4.0}


def moves(rows: int, *, discrete: bool = False, steps: int = STEPS) -> Iterator[NDArray[Any]]:
    """The same pseudo-random actions of some rows each time, mostly ahead."""
    rng = np.random.Generator(np.random.PCG64(SEED))
    for _ in range(steps // HELD):
        if discrete:
            actions: NDArray[Any] = rng.integers(128, size=rows)
        else:
            actions = rng.uniform((-0.2, -1.0), (1.0, 1.0), (rows, 2)).astype(np.float32)
        for _ in range(HELD):
            yield actions.copy()


def one_env(env: gym.Env[Any, Any], *, discrete: bool = False, steps: int = STEPS) -> Iterator[Step]:
    """A gymnasium env that is reset at each end."""
    observation, info = env.reset(seed=SEED)
    yield observation, (), info
    for action in moves(1, discrete=discrete, steps=steps):
        observation, reward, terminated, truncated, info = env.step(action[0])
        yield observation, (reward, terminated, truncated), info
        if terminated or truncated:
            observation, info = env.reset()
            yield observation, (), info


def vector_env(scenario: str, overrides: Overrides, *, discrete: bool = False, **settings: Any) -> Iterator[Step]:
    """The native vector env."""
    settings |= {"action": "discrete"} if discrete else {}
    envs = gym.make_vec("BugGym/Navigation-v0", num_envs=ROWS, scenario=scenario, overrides=overrides, **settings)
    observation, infos = envs.reset(seed=SEED)
    yield observation, (), infos
    for actions in moves(ROWS, discrete=discrete):
        observation, reward, terminated, truncated, infos = envs.step(actions)
        yield observation, (reward, terminated, truncated), infos
    envs.close()


def parallel_env(scenario: str, overrides: Overrides, *, discrete: bool = False) -> Iterator[Step]:
    """Two robots in PettingZoo's env."""
    env = bug_gym.parallel_env(scenario, robots=2, overrides=overrides, action="discrete" if discrete else "continuous")
    observations, infos = env.reset(seed=SEED)
    yield (observations, env.state()), (), infos
    for actions in moves(2, discrete=discrete):
        by_agent = dict(zip(env.possible_agents, actions, strict=True))
        observations, *judgement, infos = env.step({agent: by_agent[agent] for agent in env.agents})
        yield (observations, env.state()), (judgement, list(env.agents)), infos
        if not env.agents:
            observations, infos = env.reset()
            yield observations, (), infos
    env.close()


def sb3_env(scenario: str, overrides: Overrides, *, discrete: bool = False) -> Iterator[Step]:
    """The VecEnv of stable-baselines3."""
    action: Any = "discrete" if discrete else "continuous"
    env = make_vec_env(scenario, ROWS, seed=SEED, overrides=overrides, action=action)
    yield env.reset(), (), env.reset_infos
    for actions in moves(ROWS, discrete=discrete):
        observation, reward, done, infos = env.step(actions)
        for info in infos:
            if "episode" in info:
                del info["episode"]["t"]  # by the clock
        yield observation, (reward, done), (infos, env.reset_infos)
    env.close()


def digests_of(steps: Iterator[Step]) -> Cases:
    """Digests of all observations, of all rewards and ends, and of all infos."""
    parts = {"observations": Digest(), "rewards": Digest(), "infos": Digest()}
    for step in steps:
        for digest, value in zip(parts.values(), step, strict=True):
            digest.add(value)
    return {part: digest.text() for part, digest in parts.items()}


def case_of(name: str, make: Callable[[], Cases]) -> Cases:
    """What `make` gives, under names that begin with this one; or why it cannot be."""
    try:
        return {f"{name}/{part}": value for part, value in make().items()}
    except ValueError as error:
        return {name: refusal(error)}


def one_world(scenario: str, overrides: Overrides, **settings: Any) -> gym.Env[Any, Any]:
    """A scenario as a gymnasium env."""
    return gym.make(
        "BugGym/Navigation-v0", scenario=scenario, overrides=overrides, disable_env_checker=True, **settings
    )


def seen_env(scenario: str, overrides: Overrides, *, discrete: bool) -> Cases:
    """Digests of the env with a Dict for its observation, of what it shows at last, and of a shortest path."""
    action = "discrete" if discrete else "continuous"
    env = one_world(scenario, overrides, action=action, render_mode="rgb_array")
    found = digests_of(one_env(env, discrete=discrete)) | {"picture": digest_of(env.render())}
    observation, info = env.reset(seed=SEED, options={"shortest_path": True})
    return found | {"shortest_path": digest_of(observation, info)}


def world_cases(scenario: str, label: str, overrides: Overrides) -> Cases:
    """One scenario in each face."""
    discrete = label == "discrete"
    overrides = NOISE | overrides
    action = "discrete" if discrete else "continuous"
    faces: dict[str, Callable[[], Cases]] = {
        "env": lambda: seen_env(scenario, overrides, discrete=discrete),
        "flat": lambda: digests_of(
            one_env(one_world(scenario, overrides, observation="flat", action=action), discrete=discrete)
        ),
        "vector": lambda: digests_of(vector_env(scenario, overrides, discrete=discrete)),
        "parallel": lambda: digests_of(parallel_env(scenario, overrides, discrete=discrete)),
        "sb3": lambda: digests_of(sb3_env(scenario, overrides, discrete=discrete)),
    }
    cases: Cases = {}
    for face, make in faces.items():
        cases |= case_of(f"{scenario}/{label}/{face}", make)
    return cases


def registered_cases() -> Cases:
    """Each registered id, the vector env's other ways to start anew, and several threads."""
    cases: Cases = {}
    for name in sorted(bug_gym.SCENARIOS_BY_ID):  # their further ids are forms, which the faces above have
        env = gym.make(name, disable_env_checker=True)
        cases |= case_of(name, partial(digests_of, one_env(env, steps=30)))
    cases |= case_of("BugGym/Prediction-v0", partial(digests_of, prediction_env()))
    restarts: dict[str, dict[str, Any]] = {"same_step": {"autoreset_mode": "SameStep"}, "threads": {"threads": 2}}
    for label, settings in restarts.items():
        steps = vector_env("dynamic", NOISE, **settings)
        cases |= case_of(f"dynamic/{label}", partial(digests_of, steps))
    return cases


def prediction_env() -> Iterator[Step]:
    """Answers about tracked movers."""
    env = gym.make("BugGym/Prediction-v0", disable_env_checker=True)
    rng = np.random.Generator(np.random.PCG64(SEED))
    for number in range(40):
        observation, info = env.reset(seed=SEED if number == 0 else None)
        yield observation, (), info
        observation, *judgement, info = env.step(rng.uniform(-1.0, 1.0, 8).astype(np.float32))
        yield observation, judgement, info


ROOMS: dict[str, dict[str, Any]] = {
    "shipped": {},
    "many": {"columns": 5, "rows": 6, "door": 0.8, "loops": 0.0, "unevenness": 0.3},
    "four by three": {"columns": 4, "rows": 3, "door": 1.0, "loops": 1.0},
    "even": {"columns": 4, "rows": 2, "unevenness": 0.0, "wall": 0.1},
    "uneven": {"columns": 4, "rows": 4, "door": 0.5, "unevenness": 0.85, "wall": 0.1},
    "one wall": {"columns": 2, "rows": 1},
    "a row": {"columns": 6, "rows": 1},
    "places": {"start": {"region": [-9.0, -9.0, -5.0, -5.0], "heading": 0.5}, "goal": [8.0, 8.0]},
}
"""What scenarios say of rooms, by name."""


def room_cases(seeds: int = 500) -> Cases:
    """Layouts of `rooms`, which compiled code draws as shapely would."""
    cases: Cases = {}
    for name, world in ROOMS.items():
        scenario = load({"world": {"family": "rooms", **world}})
        cases[f"rooms/layouts/{name}"] = digest_of([draw_layout(scenario, seed, 0) for seed in range(seeds)])
    return cases


# ---------------------------------------------------------------------------------------------------------------------
# Policies
# ---------------------------------------------------------------------------------------------------------------------

DRIVES: dict[str, tuple[int, int]] = {
    "static": (3, 150),
    "dynamic": (3, 150),
    "moving_target": (3, 150),
    "rush": (3, 150),
    "maze": (3, 400),
    "crowd": (3, 150),
    "terrain": (3, 150),
    "u_trap": (1, 400),
    "ring": (1, 600),
}
"""Seeds and most steps of each scenario; one seed where the world and the scan are always the same."""
PREDICTORS = ("none", "constant_velocity", "kalman", "supervised", "rl")
SPECIAL: dict[str, tuple[str, Overrides]] = {
    "discrete": ("dynamic", {}),
    "long_body": ("static", LONG_BODY),
    "blind": ("dynamic", {**NOISE, **BLIND}),
}
"""Scenario and overrides of robots that are driven for one seed only."""


def players() -> dict[str, tuple[str, dict[str, Any]]]:
    """Name and parameters of each policy, by what the case is called."""
    found: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in policy_names()}
    for predictor in PREDICTORS:
        for name in ("hd_bug", "hd_bug_map"):
            found[f"{name}[{predictor}]"] = (name, {"predictor": predictor})
    return found


def drive(env: gym.Env[Any, Any], name: str, parameters: dict[str, Any], seeds: int, steps: int) -> Cases:
    """Digests of what a policy does and decides, and of what it draws at the end of each episode."""
    policy: Any = make_policy(name, env, **parameters)
    driven, drawn = Digest(), Digest()
    for seed in range(seeds):
        observation, info = env.reset(seed=seed)
        state, memory = None, None
        for _ in range(steps):
            action, state = policy.predict(observation, state)
            memory = state[0] if state else None
            verdict = getattr(memory, "verdict", "")
            driven.add(action, getattr(memory, "mode", ""), verdict)
            if verdict:
                break
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
        driven.add(info)
        if hasattr(policy, "draw"):
            drawn.add(policy.draw(memory))
    return {"driven": driven.text()} | ({"drawn": drawn.text()} if hasattr(policy, "draw") else {})


def policy_cases(scenario: str, label: str, overrides: Overrides, seeds: int, steps: int) -> Cases:
    """Each policy with one robot in one scenario."""
    env = one_world(scenario, overrides, action="discrete" if label == "discrete" else "continuous")
    cases: Cases = {}
    for player, (name, parameters) in players().items():
        case = f"{player}/{scenario}/{label}"
        cases |= case_of(case, partial(drive, env, name, parameters, seeds, steps))
    return cases


def drive_batch(form: str, name: str, parameters: dict[str, Any]) -> Cases:
    """Digest of what a policy does in three worlds at once, some of which start anew."""
    envs = gym.make_vec("BugGym/Dynamic-v0", num_envs=3, overrides={"time.limit": 5.0}, observation=form)
    policy: Any = make_policy(name, envs, **parameters)
    digest = Digest()
    observation, _ = envs.reset(seed=SEED)
    state, starts, ended = None, np.ones(3, dtype=bool), np.zeros(3, dtype=bool)
    for _ in range(80):
        actions, state = policy.predict(observation, state, starts)
        digest.add(actions)
        observation, _, terminated, truncated, _ = envs.step(actions)
        starts, ended = ended, terminated | truncated
    return {"batch": digest.text()}


def batch_cases(form: str) -> Cases:
    """Each policy in a vector env."""
    cases: Cases = {}
    for player, (name, parameters) in players().items():
        case = f"{player}/dynamic/{form}"
        cases |= case_of(case, partial(drive_batch, form, name, parameters))
    return cases


def evaluation_cases(scenario: str) -> Cases:
    """Rows of an evaluation, without the times of decisions."""
    rows = evaluate(["go_to_goal", "bug0", "bug2", "tangent_bug"], scenario, episodes=3, progress=False)
    kept = [{key: value for key, value in row.as_dict().items() if "decision_time" not in key} for row in rows]
    return {f"evaluate/{scenario}": digest_of(kept)}


# ---------------------------------------------------------------------------------------------------------------------
# YAML files and errors
# ---------------------------------------------------------------------------------------------------------------------


def yaml_cases() -> Cases:
    """Each shipped YAML file, as it is loaded."""
    return {name: digest_of(content) for name, content in shipped_configs()}


def error_texts(workers: int) -> list[str]:
    """What every exception said that a test caught, sorted; see record_errors.py."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(ROOT), str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
        environment = os.environ | {
            "RECORD_ERRORS": folder,
            "PYTHONHASHSEED": "0",
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        }
        plugin = ["-p", "record_errors", "-n", str(workers), "--dist", "worksteal"]
        command = [sys.executable, "-m", "pytest", "-q", *plugin, "tests"]
        done = subprocess.run(command, cwd=ROOT, env=environment, check=False)
        if done.returncode:
            print("tests failed: what they would have caught is missing", file=sys.stderr)
        return sorted(line for path in Path(folder).iterdir() for line in path.read_text("utf-8").splitlines())


# ---------------------------------------------------------------------------------------------------------------------
# All of it
# ---------------------------------------------------------------------------------------------------------------------


def jobs_of(section: str) -> list[tuple[Callable[..., Cases], tuple[Any, ...]]]:
    """What there is to do for a section, the longest first."""
    if section == "worlds":
        robots = [(name, label, own) for name in scenario_names() for label, own in KINEMATICS.items()]
        robots += [("dynamic", "discrete", {}), ("static", "long_body", LONG_BODY), ("dynamic", "blind", BLIND)]
        return [(registered_cases, ()), (room_cases, ()), *((world_cases, robot) for robot in robots)]
    if section == "policies":
        drives = [(name, label, own, *size) for name, size in DRIVES.items() for label, own in KINEMATICS.items()]
        drives += [(name, label, own, 1, 150) for label, (name, own) in SPECIAL.items()]
        jobs: list[tuple[Callable[..., Cases], tuple[Any, ...]]] = [(policy_cases, one) for one in drives]
        jobs += [(batch_cases, (form,)) for form in ("dict", "flat")]
        return jobs + [(evaluation_cases, (name,)) for name in ("static", "moving_target", "crossing_robots")]
    return [(yaml_cases, ())] if section == "yaml" else []


def compile_kernels() -> None:
    """Compile all there is to compile before several processes would."""
    env = one_world("dynamic", {})
    for name, parameters in (("tangent_bug", {}), ("hd_bug", {"predictor": "rl"}), ("hd_bug_map", {})):
        drive(env, name, parameters, 1, 30)


def cases_of(make: Callable[..., Cases], arguments: tuple[Any, ...]) -> Cases:
    """What one job finds, in a process that may know the functions here but not the envs."""
    bug_gym.register_envs()
    return make(*arguments)


def found_cases(sections: list[str], workers: int) -> dict[str, Cases]:
    """The cases of some sections, in processes side by side."""
    jobs = [(section, *job) for section in sections for job in jobs_of(section)]
    if jobs:
        compile_kernels()
    parts = joblib.Parallel(n_jobs=workers)(joblib.delayed(cases_of)(*job) for _, *job in jobs)
    found: dict[str, Cases] = {section: {} for section in sections}
    for (section, *_), cases in zip(jobs, parts, strict=True):
        found[section] |= cases
    return {section: dict(sorted(cases.items())) for section, cases in found.items()}


def differences(section: str, before: Cases, now: Cases) -> Iterator[str]:
    """A line for each case that is not as it was."""
    for case in sorted(before.keys() | now.keys()):
        if case not in now:
            yield f"{section}: {case} is missing"
        elif case not in before:
            yield f"{section}: {case} is new"
        elif before[case] != now[case]:
            yield f"{section}: {case} differs: {before[case]} before, {now[case]} now"


def text_differences(before: list[str], now: list[str]) -> Iterator[str]:
    """A line for each text of an error that comes more or less often than before."""
    come, gone = Counter(now) - Counter(before), Counter(before) - Counter(now)
    yield from (f"errors: {count} times missing: {text}" for text, count in sorted(gone.items()))
    yield from (f"errors: {count} times new: {text}" for text, count in sorted(come.items()))


def main() -> int:
    """Record, or check what is recorded."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    parser.add_argument("--only", action="append", choices=SECTIONS, metavar="SECTION", help="; ".join(SECTIONS))
    parser.add_argument("--workers", type=int, default=2, help="processes side by side")
    arguments = parser.parse_args()
    sections: list[str] = arguments.only or list(SECTIONS)
    recorded: dict[str, Cases] = json.loads(RECORDED.read_text("utf-8")) if RECORDED.exists() else {}
    if arguments.check and (missing := [section for section in sections if section not in recorded]):
        parser.error(f"nothing is recorded of {', '.join(missing)}: run it without --check, before what you change")
    found = found_cases(sections, arguments.workers)
    lines: list[str] = []
    if "errors" in sections:
        texts = error_texts(arguments.workers)
        found["errors"] = {"texts": digest_of(texts), "count": str(len(texts))}
        before = ERRORS.read_text("utf-8").splitlines() if ERRORS.exists() else []
        lines += text_differences(before, texts)
        if not arguments.check:
            ERRORS.write_text("".join(f"{text}\n" for text in texts), encoding="utf-8")
    for section in sections:
        lines += differences(section, recorded.get(section, {}), found[section])
    if not arguments.check:
        RECORDED.write_text(json.dumps(recorded | found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    print(*lines, f"{sum(map(len, found.values()))} cases, {len(lines)} differences", sep="\n")
    return 1 if arguments.check and lines else 0


if __name__ == "__main__":
    sys.exit(main())
