"""What holds for any scenario and for any file, tried on many that nobody would write.

`FUZZ_EXAMPLES=10000 pytest tests/test_fuzz.py` tries as many of each; without it 120, always the same ones.
"""

from __future__ import annotations

import json
import math
import os
import struct
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from bug_gym.agents import make_policy
from bug_gym.agents.learning.folder import CONFIG, GRAPH, WEIGHTS, checksums, model_folder, read_config
from bug_gym.agents.learning.settings import load_settings
from bug_gym.agents.learning.sweep_settings import load_sweep
from bug_gym.config import Scenario, ScenarioError, load, read_yaml, scenario_names
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.demonstrations import Demonstrations, demonstrate
from bug_gym.evaluation.driven import read_driven
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.plan import Plan, make_plan
from bug_gym.evaluation.results_folder import LENGTHS, MANIFEST, ROWS, opened
from bug_gym.evaluation.suites import load_suite
from bug_gym.navigation_env import NavigationEnv
from bug_gym.robots_env import parallel_env
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv
from bug_gym.worlds.barn_files import load_barn, load_gazebo
from bug_gym.worlds.dynabarn_files import load_dynabarn
from bug_gym.worlds.recordings import load_recording
from bug_gym.worlds.ros_files import load_ros_map

pytestmark = pytest.mark.fuzz

EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "120"))
many = settings(
    max_examples=EXAMPLES,
    derandomize="FUZZ_EXAMPLES" not in os.environ,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
STEPS = 50
MEMORY = 500_000_000
"""What a file may take beyond what this process took before [bytes]."""

# -- Scenarios ---------------------------------------------------------------------------------------------------------

Place = tuple[str | int, ...]

FLOATS = st.one_of(
    st.sampled_from([0.0, -0.0, 1e-6, 1e-5, 1e-3, 0.1, 1.0, 2.0, math.pi, 1e2, 1e3, 1e4, 99_999.0, 1e5, 1e6, 1e7, 1e9]),
    st.floats(0.0, 10.0),
    st.floats(-100.0, 100.0),
    st.sampled_from([-1e-6, -1.0, -1e2, -1e5, -1e6, -1e9, 1e-9, 1e10, 1e300, -1e300, math.inf, math.nan, 5e-324]),
    st.floats(),
)
DRAWN = st.one_of(
    st.builds(lambda law, ends: {law: ends}, st.sampled_from(["uniform", "log_uniform"]), st.lists(FLOATS, max_size=3)),
    st.builds(lambda numbers: {"choice": numbers}, st.lists(FLOATS, max_size=3)),
    st.sampled_from([{"uniform": [0.5, 1.5]}, {"log_uniform": [1e-3, 1e3]}, {"choice": [0.3]}, {"gauss": [0, 1]}, {}]),
)
COUNTS = st.one_of(
    st.integers(0, 12), st.sampled_from([-1, 30, 200, 40_000, 10**6, 10**9, 10**21, 10**400, 0.5, True, None, "x"])
)
"""Few, or more than there may be: what lies between takes its time and is tried in tests of its own."""


EVERY_LAW = {
    "robot": {"kinematics": "differential", "circles": [[0.1, 0, 0.2], [-0.2, 0, 0.2]]},
    "lidar": {"beams": 20, "noise": 0.01, "dropout": 0.1},
    "odometry": {"translation_noise": 0.1, "rotation_noise": 0.1, "translation_bias": 0.1, "rotation_bias": 0.1},
    "goal": {"sensing": "odometry"},
    "robots": [{"start": [0, 0, 0.1]}, {"start": [0, 2, 0.1]}],
    "world": {
        "family": "explicit",
        "circles": [[2.0, 0.0, 0.5], [-3, 3, 1e-3]],
        "polygons": [[[4, -2], [5, -2], [5, 2]]],
        "regions": [{"circle": [1, 1, 0.5], "factor": 3}],
        "movers": [
            {"shape": {"circle": 0.3}, "at": [0, 4], "motion": {"law": "bounce", "velocity": [0.5, 0]}},
            {"shape": {"polygon": [[-1, 0], [1, 0], [0, 1]]}, "at": [0, 6], "motion": {"law": "bounce", "speed": 0.1}},
            {"shape": {"circle": 0.2}, "at": [7, 7], "motion": {"law": "random_walk", "speed": 0.2, "min_leg": 0.5}},
            {
                "shape": {"circle": 0.2},
                "at": [-7, 7],
                "motion": {"law": "crowd", "speed": 1.1, "goals": [[7, -7], [0, 7]]},
            },
            {"shape": {"circle": 0.2}, "at": [-7, 6], "motion": {"law": "crowd", "speed": 1.1, "horizon": 1.5}},
            {
                "shape": {"circle": 0.2},
                "at": [-7, 5],
                "motion": {"law": "evade", "speed": 0.9, "sight": 9, "wander": 0.1},
            },
            {
                "shape": {"circle": 0.2},
                "at": [7, 5],
                "motion": {"law": "waypoints", "points": [[3, 5], [0, 5]], "speed": 1},
            },
            {"shape": {"circle": 0.2}, "motion": {"law": "replay", "points": [[-0.5, -7, 3], [1.5, -6.5, 4]]}},
        ],
        "start": [0, 0, 0.1],
        "target": {"at": [8, 0], "motion": {"law": "waypoints", "points": [[8, 3]], "speed": 0.5}},
    },
}


@cache
def whole(name: str) -> dict[str, Any]:
    """A scenario with its defaults written out."""
    source: Any = {"every law": EVERY_LAW, "one robot": {**EVERY_LAW, "robots": {"count": 1}}}.get(name, name)
    return load(source).model_dump(mode="json")


BASES = ["every law", "one robot", *(name for name in scenario_names() if name != "replay")]


def number_places(data: Any, place: Place = ()) -> Iterator[Place]:
    """Where the numbers of plain data are, and the nothings that may be numbers."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from number_places(value, (*place, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from number_places(value, (*place, index))
    elif data is None or (isinstance(data, (int, float)) and not isinstance(data, bool)):
        yield place


class Tried(NamedTuple):
    """A scenario, and what is tried in the place of some of its numbers."""

    base: str
    changes: dict[str, Any]


@st.composite
def tries(draw: st.DrawFn) -> Tried:
    """A scenario that ships or one with every law, and changes of its numbers, by dotted key."""
    base = draw(st.sampled_from(BASES))
    changes = {}
    for place in draw(st.lists(st.sampled_from(list(number_places(whole(base)))), max_size=6, unique=True)):
        old: Any = whole(base)
        for key in place:
            old = old[key]
        changes[".".join(map(str, place))] = draw(
            COUNTS if isinstance(old, int) else st.one_of(FLOATS, FLOATS, FLOATS, DRAWN)
        )
    return Tried(base, changes)


def accepted(tried: Tried) -> Scenario:
    """The scenario with all changes that are not refused; those that are must be in a line a fault, by name."""
    kept: dict[str, Any] = {}
    for key, value in tried.changes.items():
        try:
            load(whole(tried.base), {**kept, key: value})
            kept[key] = value
        except ScenarioError as error:
            event("refused")
            for line in str(error).split("\n"):
                assert line.startswith("scenario with overrides: ") and line.count(": ") >= 2, line
                assert len(line) < 1000
    event(f"changes: {len(kept)}")
    return load(whole(tried.base), kept)


def check_finite(value: Any, where: str) -> None:
    """All numbers of what a face returns are finite."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            check_finite(item, f"{where}.{key}")
    elif isinstance(value, (list, tuple)):
        for index, item in enumerate(value):
            check_finite(item, f"{where}.{index}")
    elif isinstance(value, np.ndarray) and value.dtype == object:
        check_finite(value.tolist(), where)
    elif isinstance(value, (int, float, np.number)) or (isinstance(value, np.ndarray) and value.dtype.kind in "fiub"):
        assert np.isfinite(value).all(), f"{where} is {value}"


def actions_of(space: Any, rng: np.random.Generator) -> Any:
    """An action at the edges of its space, or at its middle."""
    share = rng.choice([0.0, 0.0, 0.5, 1.0, 1.0], space.shape)
    return (space.low + share * (space.high - space.low)).astype(space.dtype)


def run_gym(scenario: Scenario, rng: np.random.Generator) -> None:
    env = NavigationEnv(scenario)
    observation, info = env.reset(seed=3)
    check_finite((observation, info), "reset")
    for number in range(STEPS):
        observation, reward, terminated, truncated, info = env.step(actions_of(env.action_space, rng))
        check_finite((observation, reward, info), f"step {number}")
        if terminated or truncated:
            env.reset()


def run_vector(scenario: Scenario, rng: np.random.Generator) -> None:
    env = NavigationVectorEnv(2, scenario=scenario)
    check_finite(env.reset(seed=3), "reset")
    for number in range(STEPS):
        observation, reward, _, _, info = env.step(actions_of(env.action_space, rng))
        check_finite((observation, reward, info), f"step {number}")


def run_parallel(scenario: Scenario, rng: np.random.Generator) -> None:
    env = parallel_env(scenario)
    check_finite(env.reset(seed=3), "reset")
    for number in range(STEPS):
        actions = {agent: actions_of(env.action_space(agent), rng) for agent in env.agents}
        observation, reward, _, _, info = env.step(actions)
        check_finite((observation, reward, info, env.state()), f"step {number}")
        if not env.agents:
            env.reset()


def run_sb3(scenario: Scenario, rng: np.random.Generator) -> None:
    from bug_gym.agents.sb3 import make_vec_env  # stable-baselines3, of the extra `train`

    env = make_vec_env(scenario, n_envs=2, seed=3)
    check_finite(env.reset(), "reset")
    for number in range(STEPS):
        action = np.stack([actions_of(env.action_space, rng) for _ in range(2)])
        observation, reward, _, info = env.step(action)
        check_finite((observation, reward, info), f"step {number}")


FACES: dict[str, Callable[[Scenario, np.random.Generator], None]] = {
    "gym": run_gym,
    "vector": run_vector,
    "parallel": run_parallel,
}
if find_spec("stable_baselines3"):
    FACES["sb3"] = run_sb3


@pytest.mark.slow
@pytest.mark.parametrize("face", FACES)
@many
@given(tried=tries(), seed=st.integers(0, 2**32 - 1))
def test_a_scenario_is_refused_by_name_or_stays_finite(face: str, tried: Tried, seed: int) -> None:
    scenario = accepted(tried)
    if scenario.robots.count > 1 and face != "parallel":
        return
    try:
        Simulation(scenario).reset(seeds=[3])
    except ValueError as error:  # no room for what is drawn: a matter of the seed
        event("no room")
        assert "\n" not in str(error)
        return
    event("driven")
    try:
        FACES[face](scenario, np.random.default_rng(seed))
    except ValueError as error:
        assert any(word in str(error) for word in ("free place", "no start and goal", "cannot start", "tries")), error


# -- Files -------------------------------------------------------------------------------------------------------------

YAML = b"""name: &n yard
robot: {kinematics: differential, radius: 2e-1}
world:
  family: explicit
  bounds: [-9, -9, 9, 9]
  polygons: [[[4, -2], [5, -2], [5, 2]], {shell: [[-8, -8], [0, -8], [0, -4]], holes: []}]
  movers: [{shape: {circle: 0.3}, at: [0, 3], motion: {law: bounce, velocity: [0.5, 0]}}]
  start: [0, 0, 0]
  goal: [8, 0]
"""
MAP = b"image: plan.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
PGM = b"P5\n# made by hand\n6 4\n255\n" + bytes(range(0, 240, 10))
PLAIN_PGM = b"P2\n# made by hand\n3 2\n15\n1 2 3 # row\n4 5 15\n"
PICTURE = b"\x89PNG\r\n\x1a\n" + b"".join(
    struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    for kind, body in (
        (b"IHDR", struct.pack(">IIBBBBB", 4, 2, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0\x10\x20\xf0\xff\0\x10\x20\xf0\xff")),
        (b"IEND", b""),
    )
)
BARN = (
    b'{"world": 0, "start": [-2, 3, 1.57], "goal": [-2, 13], "cylinder_radius": 0.075, "cylinders": [[0, 5], [1, 6]]}\n'
    b'{"world": 1, "start": [-2, 3, 1.57], "goal": [-2, 13], "cylinder_radius": 0.075, "cylinders": []}\n'
)
DYNABARN = (
    b'{"world": 0, "start": [1, 1, 0], "goal": [8, 1], "walls": [{"polygon": [[0, 0], [9, 0], [9, 1]]}], '
    b'"movers": [{"radius": 0.3, "keyframes": [[0, 1, 2], [9, 4, 5], [12, 1, 2]]}]}\n'
)
SUITE = b"""name: mine
scenarios: [{scenario: empty, label: a, overrides: {lidar.beams: 9}, seeds: {first: 0, count: 3}}, {scenario: static}]
policies: [bug2, {name: bug2, label: left, parameters: {turn: left}}]
seeds: {first: 0, count: 5}
"""
TRAINING = b"""algo: ppo
scenarios: [empty, static]
overrides: {lidar.beams: 9, reward: {progress: 0.1}}
n_timesteps: 4_000_000
gamma: 0.995
history: [4]
curriculum: [{overrides: {world.goal: [3, 0]}, success: 0.9}, {share: 0.8}]
"""
SWEEP = b"""training: ppo_dynamic
overrides: {n_timesteps: 1_000_000}
seeds: 2
space: {learning_rate: [3.0e-4, 1.0e-3], gamma: [0.98, 0.995]}
"""
DRIVEN = (
    b'{"holds": "episodes driven by hand", "version": "0.1.0", "scenario": {"world": {"family": "empty"}}, "episodes": '
    b'[{"seed": 3, "actions": [[0.5, -1.0], [1, 0]], "outcome": "running", "time": 0.2, "pose": [0.1, 0.2, 0.3]}]}\n'
)
GAZEBO = (
    b'<?xml version="1.0"?><sdf><world><model name="a"><pose>1 2 0 0 0 0</pose><collision><geometry><cylinder>'
    b"<radius>0.1</radius></cylinder></geometry></collision></model></world></sdf>"
)
RECORDING = b"time_s,pedestrian,x_m,y_m\n0,1,0,0\n1,1,2,3\n0.5,2,1,1\n1.5,2,2,1\n"

PIECES = st.one_of(
    st.binary(max_size=20),
    st.sampled_from(
        [
            b"[",
            b"]",
            b"{",
            b"}",
            b"&n ",
            b"*n",
            b"!!int ",
            b"!!bool ",
            b"!!set ",
            b"<<: ",
            b"? ",
            b"- ",
            b"\n",
            b"\t",
            b'"',
        ]
        + [
            b"1e999",
            b"-1",
            b"0",
            b"1e300",
            b"9" * 5000,
            b"[" * 300,
            b"\0",
            b"\xff",
            b"nan",
            b"null",
            b"%",
            b"---\n",
            b"|",
        ]
        + [b"99999999", b"# ", b"'", b",", b": ", b"0x_", b"12:30:45", b"2001-99-99", b"=", b"<!ENTITY a 'b'>", b"&a;"]
    ),
)


def broken(good: bytes) -> st.SearchStrategy[bytes]:
    """Any bytes, or good ones with pieces put in, left out or repeated."""

    @st.composite
    def splice(draw: st.DrawFn) -> bytes:
        data = good
        for _ in range(draw(st.integers(0, 4))):
            begin = draw(st.integers(0, len(data)))
            end = min(begin + draw(st.integers(0, 12)), len(data))
            data = data[:begin] + draw(PIECES) * draw(st.sampled_from([1, 1, 1, 2, 60])) + data[end:]
        return data

    return st.one_of(st.binary(max_size=200), splice())


def load_yaml(path: Path) -> None:
    read_yaml(path)
    load(path)


def read_map(path: Path) -> None:
    (path.parent / "plan.pgm").write_bytes(PGM)
    load_ros_map(str(path))
    load({"world": {"family": "ros_map", "path": str(path), "separation": 0.0}})


def read_pgm(path: Path) -> None:
    target = path.parent / "map.yaml"
    target.write_bytes(MAP.replace(b"plan.pgm", path.name.encode()))
    load_ros_map(str(target))


def read_recording(path: Path) -> None:
    load_recording(str(path))
    load({"world": {"family": "replay", "path": str(path)}})


READERS: dict[str, tuple[str, bytes, Callable[[Path], Any]]] = {
    "scenario": ("yard.yaml", YAML, load_yaml),
    "map": ("plan.yaml", MAP, read_map),
    "raw picture": ("broken.pgm", PGM, read_pgm),
    "plain picture": ("broken.pgm", PLAIN_PGM, read_pgm),
    "worlds": ("worlds.jsonl", BARN, lambda path: load_barn(str(path))),
    "worlds of DynaBARN": ("worlds.jsonl", DYNABARN, lambda path: load_dynabarn(str(path))),
    "suite": ("mine.yaml", SUITE, load_suite),
    "training": ("mine.yaml", TRAINING, load_settings),
    "sweep": ("mine.yaml", SWEEP, load_sweep),
    "driven by hand": ("driven.json", DRIVEN, read_driven),
    "world of Gazebo": ("world_0.world", GAZEBO, load_gazebo),
    "recording": ("walk.csv", RECORDING, read_recording),
}
if find_spec("PIL"):
    READERS["picture"] = ("broken.png", PICTURE, read_pgm)


@cache
def finished_run() -> tuple[Plan, dict[str, bytes]]:
    """What was asked in a small run, and the files that it left."""
    policies, worlds = ["go_to_goal", "bug2"], ["empty", {"name": "pair", **PAIR}]
    with tempfile.TemporaryDirectory() as folder:
        evaluate(policies, worlds, episodes=2, out=folder)
        files = {name: Path(folder, name).read_bytes() for name in (MANIFEST, ROWS, LENGTHS)}
    return make_plan(policies, worlds, episodes=2), files


def read_run(path: Path) -> None:
    """A results folder of which one file was damaged."""
    plan, files = finished_run()
    for name, data in files.items():
        if name != path.name:
            (path.parent / name).write_bytes(data)
    with opened(path.parent, plan) as results:
        assert all(row.policy in ("go_to_goal", "bug2") and row.seed in (0, 1) for row in results.rows)


def read_model(path: Path) -> None:
    """A model's folder of which one file was damaged, and the checksums written anew."""
    for name in (CONFIG, GRAPH, WEIGHTS):
        if name != path.name:
            (path.parent / name).write_bytes((MODEL / name).read_bytes())
    if path.name != CONFIG:
        record = read_config(MODEL)
        record["sha256"] = checksums(path.parent, (GRAPH, WEIGHTS))
        (path.parent / CONFIG).write_text(json.dumps(record), encoding="utf-8")
    policy = make_policy(str(path.parent), ROBOT)
    actions, _ = policy.predict(seen())
    assert np.isfinite(actions).all()


PAIR = {
    "world": {"family": "empty"},
    "robots": [{"start": [-5, 0, 0], "goal": [5, 0]}, {"start": [-5, 3, 0], "goal": [3, 3]}],
}
MODEL = model_folder("ppo_static")
ROBOT = load("static")
READERS |= {name: (name, b"", read_run) for name in (MANIFEST, ROWS, LENGTHS)}
READERS["block"] = ("000000.npz", b"", lambda path: Demonstrations.read(path, range(2)))
if find_spec("onnxruntime"):
    READERS |= {name: (name, (MODEL / name).read_bytes(), read_model) for name in (CONFIG, GRAPH)}


@cache
def seen() -> Any:
    return NavigationEnv(ROBOT, observation="flat").reset(seed=0)[0]


def bytes_of(kind: str) -> bytes:
    """The bytes of a kind before anything is broken; those of a run are made when they are asked for."""
    _, good, read = READERS[kind]
    if kind == "block":
        return driven_block()
    return finished_run()[1][kind] if read is read_run else good


@cache
def driven_block() -> bytes:
    """Two short episodes, as `collect` keeps them."""
    scenario = ScenarioEntry("empty", load("empty", {"lidar.beams": 1, "time.limit": 0.5}), range(2))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "000000.npz"
        demonstrate(PolicyEntry.of("go_to_goal"), scenario, range(2)).write(path)
        return path.read_bytes()


def peak() -> int:
    """The most memory that this process has taken so far [bytes]; 0 where nobody tells."""
    if sys.platform != "linux":
        return 0
    import resource  # not on Windows

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@pytest.mark.parametrize("kind", READERS)
@many
@given(data=st.data())
def test_any_bytes_are_a_value_or_an_error_of_ours(kind: str, data: st.DataObject) -> None:
    name, _, read = READERS[kind]
    raw = data.draw(broken(bytes_of(kind)))
    before = peak()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(raw)
        try:
            read(path)
        except ValueError as error:
            event("refused")
            told = str(error)
            known = (path.name, "scenario: ", "no such picture", f"{folder} holds another run: ")
            assert any(words in told for words in known), told
            assert all(len(line) < 1500 for line in told.split("\n")), told
        else:
            event("read")
    assert peak() - before < MEMORY


@pytest.mark.parametrize("kind", READERS)
def test_what_is_broken_was_whole(tmp_path: Path, kind: str) -> None:
    name, _, read = READERS[kind]
    (tmp_path / name).write_bytes(bytes_of(kind))
    read(tmp_path / name)
