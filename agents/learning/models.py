"""Models of stable-baselines3 on disk: as a folder that `make_policy` plays without torch, and as SB3's own zip."""

from __future__ import annotations

import json
import shlex
import warnings
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from stable_baselines3 import A2C, DQN, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.dqn.policies import DQNPolicy
from stable_baselines3.sac.policies import SACPolicy

from bug_gym.agents.learning.folder import CONFIG, GRAPH, WEIGHTS, checksums, read_checked, read_config
from bug_gym.agents.learning.recorded import parts_of, worlds_of
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import (
    ALGORITHMS,
    AnySettings,
    OfflineSettings,
    load_settings,
    policies_of_code,
    training_names,
)
from bug_gym.assignments import name_and_options
from bug_gym.config import ScenarioError, dump
from bug_gym.config import load as load_scenario
from bug_gym.files import machine, replaced_when_done
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS
from bug_gym.references import is_reference
from bug_gym.schema.own import OWN_PARTS

PACKAGES = ("stable_baselines3", "torch", "onnx", "safetensors")
"""Packages beside those of `machine()` whose versions are kept with a model."""

TELLING: dict[str, type[BaseAlgorithm]] = {
    "clip_range": PPO,
    "target_entropy": SAC,
    "exploration_final_eps": DQN,
    "policy_delay": TD3,
    "gae_lambda": A2C,
}
"""Algorithm by a setting that only it has, looked for in this order; SB3's zip does not name it. TRPO of sb3-contrib, whose
policy is that of A2C, is read as one, and decides as it did."""

CONTRIB = {
    "sb3_contrib.ars.policies": "ARS",
    "sb3_contrib.common.maskable.policies": "MaskablePPO",
    "sb3_contrib.common.recurrent.policies": "RecurrentPPO",
    "sb3_contrib.crossq.policies": "CrossQ",
    "sb3_contrib.qrdqn.policies": "QRDQN",
    "sb3_contrib.tqc.policies": "TQC",
}
"""Algorithm of sb3-contrib by the module of its policy's class, which the zip does name: its settings are those of the
algorithm of SB3 that it came from."""


class Decision(torch.nn.Module):
    """What a model does, without chance: observations (n, D) to actions (n, 2), or to numbers (n,) of actions."""

    def __init__(self, policy: BasePolicy) -> None:
        super().__init__()
        self.policy = policy

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """The actions."""
        if isinstance(self.policy, (SACPolicy, DQNPolicy)):
            action: torch.Tensor = self.policy._predict(observation, deterministic=True)
            return action
        assert isinstance(self.policy, ActorCriticPolicy)
        features = self.policy.extract_features(observation, self.policy.pi_features_extractor)
        assert isinstance(features, torch.Tensor)
        answer: torch.Tensor = self.policy.action_net(self.policy.mlp_extractor.forward_actor(features))
        if isinstance(self.policy.action_space, gym.spaces.Discrete):
            return answer.argmax(dim=1)
        return torch.clamp(answer, -1.0, 1.0)


def write_onnx(path: Path, policy: BasePolicy) -> None:
    """Write a model's decisions as an ONNX graph, encoding of the observation included."""
    shape = policy.observation_space.shape
    assert shape is not None
    write_graph(path, Decision(policy).eval(), shape)


def write_graph(path: Path, decision: torch.nn.Module, shape: Sequence[int]) -> None:
    """Write what takes observations (n, *shape) to actions as an ONNX graph."""
    example = torch.ones(2, *shape)
    with warnings.catch_warnings(), replaced_when_done(path) as partial:
        warnings.simplefilter("ignore")  # the exporter's own notes on its future
        torch.onnx.export(
            decision,
            (example,),
            str(partial),
            input_names=["observation"],
            output_names=["action"],
            dynamic_axes={"observation": {0: "n"}, "action": {0: "n"}},
            dynamo=find_spec("onnxscript") is not None,
        )


def write_weights(path: Path, network: torch.nn.Module) -> None:
    """Write what `load_weights` reads."""
    with replaced_when_done(path) as partial:
        partial.write_bytes(save({name: value.contiguous() for name, value in network.state_dict().items()}))


def training_machine() -> dict[str, Any]:
    """What is kept with a model of where it was trained: the machine, torch's threads, and versions."""
    return machine() | {"threads": torch.get_num_threads()} | {name: version(name) for name in PACKAGES}


def write_agent(
    folder: Path,
    policy: BasePolicy,
    settings: AnySettings,
    robot: RobotModel,
    runs: Mapping[str, Any],
    data: Mapping[str, Any] | None = None,
    dataset: str | None = None,
) -> None:
    """Write a model and all that made it into a folder.

    Args:
        folder: where to.
        policy: the model's network, with the weights that did best.
        settings: of its training.
        robot: what it was trained for.
        runs: by seed: curve, best point of it, and held-out results.
        data: of an offline training: what its episodes were collected of.
        dataset: of one that was given its episodes: where they came from.
    """
    write_onnx(folder / GRAPH, policy)
    write_weights(folder / WEIGHTS, policy)
    record = {
        "name": settings.name,
        "robot": robot.as_dict(),
        "action": settings.action,
        "history": list(settings.history),
        "settings": json.loads(settings.model_dump_json()),
        "scenarios": [dump(scenario) for scenario in settings.loaded],
        "made_of": dict(settings.made_of),
        "seed": int(next(iter(runs))),
        "machine": training_machine(),
        "sha256": checksums(folder, (GRAPH, WEIGHTS)),
        "runs": dict(runs),
    }
    if data is not None:
        record["data"] = dict(data)
    if dataset is not None:
        record["dataset"] = dataset
    _write_record(folder, record)


def _write_record(folder: Path, record: Mapping[str, Any]) -> None:
    with replaced_when_done(folder / CONFIG) as partial:
        Path(partial).write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    with replaced_when_done(folder / "card.md") as partial:
        Path(partial).write_text(card(record), encoding="utf-8")


def gather(folders: Sequence[Path], out: Path) -> Path:
    """Copy the model that did best in its validation to `out`, with the curves and results of all of them."""
    records = [read_config(folder) for folder in folders]
    scores = [record["runs"][str(record["seed"])]["best"]["success"] for record in records]
    best = scores.index(max(scores))
    out.mkdir(exist_ok=True)
    for name in (GRAPH, WEIGHTS):
        with replaced_when_done(out / name) as partial:
            partial.write_bytes(read_checked(folders[best] / name, records[best]["sha256"][name]))
    runs = {seed: run for record in records for seed, run in record["runs"].items()}
    _write_record(out, {**records[best], "runs": runs})
    return out


def command(record: Mapping[str, Any]) -> str:
    """What to type to train a model again; what a YAML of one's own said is kept in its config.json."""
    name = record["name"]
    words = ["bug-gym", "train", f"{name}.yaml"]
    if name in training_names():
        shipped = json.loads(load_settings(name).model_dump_json())
        changed = {key: value for key, value in record["settings"].items() if value != shipped.get(key)}
        sets = [("--set", f"{key}={json.dumps(value)}") for key, value in changed.items()]
        words = ["bug-gym", "train", name, *(word for pair in sets for word in pair)]
    has_code = any(map(_names_code, _worlds(record))) or policies_of_code(record["settings"])
    words += ["--trust"] if has_code else []
    if dataset := _dataset_of(record):
        words += ["--dataset", dataset]
    seeds = sorted(map(int, record["runs"]))
    if seeds != list(range(seeds[0], seeds[0] + len(seeds))):
        seeds = [record["seed"]]  # no command trains those alone; this one makes the model that is played
    words += ["--seed", str(seeds[0])] if seeds[0] else []
    words += ["--seeds", str(len(seeds))] if len(seeds) > 1 else []
    threads = record.get("machine", {}).get("threads")  # the last bits depend on them
    return shlex.join([*words, "--threads", str(threads)] if threads else words)


def _dataset_of(record: Mapping[str, Any]) -> str | None:
    """Where the episodes came from that a training was given; None: it has them collected itself, or takes none."""
    asked = record["settings"].get("data")
    if asked is None or "dataset" in record:
        return record.get("dataset")
    told, keys = record.get("data") or {}, ("policy", "parameters", "episodes", "first_seed")
    came = [tuple(part.get(key) for key in keys) for part in parts_of(told)]
    with suppress(ValueError):  # names that nobody could have collected of
        named = map(name_and_options, asked["policies"])
        expected = [(name, options, asked["episodes"], TRAINING_SEEDS) for name, options in named]
        if sorted(map(str, came)) == sorted(map(str, expected)):
            return None
    return "DATASET"


def _worlds(record: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The scenarios of a training as data, those of its stages too as far as they can still be read."""
    yield from record.get("scenarios", ())
    settings = record["settings"]
    for stage in settings.get("curriculum", ()):
        for source in stage["scenarios"] or settings["scenarios"]:
            with suppress(ScenarioError):  # a file that is gone
                yield dump(load_scenario(load_scenario(source, settings["overrides"]), stage["overrides"]))


def _names_code(scenario: Mapping[str, Any]) -> bool:
    """Whether a scenario names functions, or a family of worlds by where its class is."""
    family = scenario.get("world", {}).get("family", "")
    return any(scenario.get(key) for key in OWN_PARTS) or is_reference(family)


def card(record: Mapping[str, Any]) -> str:
    """What people want to know of a model before they use it, as Markdown."""
    settings, runs, made_on = record["settings"], record["runs"], record["machine"]
    scenarios = ", ".join(str(scenario) for scenario in settings["scenarios"])
    memory = f"a history of {record['history']} steps ago" if record["history"] else "none"
    robot = record["robot"]
    is_own = record["name"] not in training_names()
    said = f"; what {record['name']}.yaml and `--set` said is `settings` in {CONFIG}" if is_own else ""
    lines = [
        f"# {record['name']}",
        "",
        f"- Task: the scenario{'s' * (len(settings['scenarios']) > 1)} {scenarios}",
        f"- Robot: {robot['kinematics']}, radius {robot['radius']} m, up to {robot['max_speed']} m/s; "
        f"{robot['beams']} beams of {robot['range']} m; a step of {robot['step']} s. Any other robot is refused.",
        f"- Algorithm: {_algorithm(record)}, "
        f"layers {settings['policy_kwargs']['net_arch']}, ranges encoded as {settings['encoding']}, memory: {memory}, "
        f"begun from {settings['start_from'] or 'scratch'}",
        f"- Made again by `{command(record)}`; the model here is of seed {record['seed']}, which did best in its validation"
        f"{said}",
        f"- Machine: {made_on['cpu']}, {made_on['threads']} thread(s), torch {made_on['torch']}",
        *_own_lines(record),
        *_learnt_from(record),
        *_unjudged(record),
        *_cut_short(record),
        *_stages(record),
        "",
        _worlds_of_results(record),
        "",
        "| seed | steps | minutes | CPU minutes | scenario | n | success | 95 % | collision | timeout | time [s] |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for seed, run in runs.items():
        last = run["curve"][-1]
        for name, held in run["held_out"].items():
            spent = f"{last['steps']:,} | {last['seconds'] / 60:.1f} | {last['cpu_seconds'] / 60:.1f}"
            interval = f"{100 * held['low']:.1f} - {100 * held['high']:.1f}"
            shares = f"{100 * held['collision']:.1f} | {100 * held['timeout']:.1f} | {held['time'] or '-'}"
            lines.append(
                f"| {seed} | {spent} | {name} | {held['n']} | {100 * held['success']:.1f} | {interval} | {shares} |"
            )
    lines += ["", "Success in validation [%] by environment steps, one column a seed:", "", *_curve_lines(runs), ""]
    return "\n".join(lines)


def _own_lines(record: Mapping[str, Any]) -> list[str]:
    """What the scenarios have of their own."""
    lines = []
    for key, told in (("reward_terms", "Reward terms"), ("observation_fields", "Observation fields")):
        found = {name: own for scenario in record["scenarios"] for name, own in scenario.get(key, {}).items()}
        if found:
            each = ", ".join(
                f"{name} = {own.get('weight', '')}{' x ' * ('weight' in own)}`{own['function']}`"
                for name, own in found.items()
            )
            lines.append(f"- {told} of its own: {each}")
    return lines


def _unjudged(record: Mapping[str, Any]) -> list[str]:
    """That it is the best of a training that had not ended, where it is."""
    if all(run["held_out"] for run in record["runs"].values()):
        return []
    return ["- Best in validation of a training that had not ended: not yet judged in held-out worlds"]


def _cut_short(record: Mapping[str, Any]) -> list[str]:
    """That --minutes have ended it, where they have: the command that is told takes all steps."""
    run, steps = record["runs"][str(record["seed"])], record["settings"]["n_timesteps"]
    done = run["curve"][-1]["steps"]
    return [f"- Ended by --minutes after {done:,} of {steps:,} steps"] if run["held_out"] and done < steps else []


def _is_offline(record: Mapping[str, Any]) -> bool:
    return issubclass(ALGORITHMS[record["settings"]["algo"]], OfflineSettings)


def _algorithm(record: Mapping[str, Any]) -> str:
    name = record["settings"]["algo"].upper()
    if _is_offline(record):
        return f"{name} of bug_gym {record['machine']['bug_gym']}, its steps those of the gradient"
    return f"{name} of stable-baselines3 {record['machine']['stable_baselines3']}"


def _learnt_from(record: Mapping[str, Any]) -> list[str]:
    """What an offline training learnt from, as a line."""
    if not _is_offline(record):
        return []
    settings, data = record["settings"], record.get("data")
    if settings["algo"] == "dagger":
        return [f"- Learnt from: the answers of {settings['expert']} along the learner's own ways"]
    if not data or not {"policy", "scenario", "first_seed", "episodes"} <= data.keys():
        return ["- Learnt from: episodes that were handed in"]
    drivers = ", ".join(map(_driver, parts_of(data)))
    worlds = f"{data['scenario']}, seeds from {data['first_seed']}"
    return [f"- Learnt from: {data['episodes']} episodes of {drivers} in worlds of {worlds}"]


def _driver(part: Mapping[str, Any]) -> str:
    """Who drove episodes, with parameters."""
    options = part.get("parameters") or {}
    return ":".join([str(part["policy"]), *(f"{key}={value}" for key, value in options.items())])


def _worlds_of_results(record: Mapping[str, Any]) -> str:
    """Which worlds the results are of; those that the episodes of an offline training come from are not held out."""
    tests = range(TEST_SEEDS, TEST_SEEDS + record["settings"]["test_episodes"])
    if known := worlds_of(record.get("data") or {}, tests):
        told = f"of which {known:,} of {len(tests):,} are not held out: its episodes were collected there"
        return f"Results in worlds of `bug-gym evaluate`, {told}; with Wilson intervals:"
    return (
        "Results in worlds held out from training and validation (those of `bug-gym evaluate`), with Wilson intervals:"
    )


def _stages(record: Mapping[str, Any]) -> list[str]:
    """The stages of a curriculum and when they began, a line each."""
    lines = []
    for number, stage in enumerate(record["settings"].get("curriculum", ())):
        worlds = ", ".join(map(str, stage["scenarios"] or record["settings"]["scenarios"]))
        changed = f" with {json.dumps(stage['overrides'])}" if stage["overrides"] else ""
        until = "the last" if stage["success"] is None else f"until {100.0 * stage['success']:g} % of them are solved"
        begun = [
            f"{entered['steps']:,} steps (seed {seed})"
            for seed, run in record["runs"].items()
            for entered in run.get("entered", ())
            if entered["stage"] == number
        ]
        when = "from the start" if number == 0 else f"begun at {', '.join(begun)}" if begun else "never reached"
        lines.append(f"- Stage {number + 1}: worlds of {worlds}{changed}, {until}; {when}")
    return lines


def _curve_lines(runs: Mapping[str, Any]) -> list[str]:
    by_steps: dict[int, dict[str, float]] = {}
    for seed, run in runs.items():
        for point in run["curve"]:
            by_steps.setdefault(point["steps"], {})[seed] = 100.0 * point["success"]
    lines = [f"| steps | {' | '.join(runs)} |", "|---" * (len(runs) + 1) + "|"]
    for steps, found in sorted(by_steps.items()):
        cells = (f"{found[seed]:.1f}" if seed in found else "-" for seed in runs)
        lines.append(f"| {steps:,} | {' | '.join(cells)} |")
    return lines


def load_weights(path: Path, network: torch.nn.Module, checksum: str) -> None:
    """Give a network the weights of a trained one of the same layers.

    Raises:
        ValueError: the file is missing or damaged, or of another network.
    """
    data, told = read_checked(path, checksum), f"{path} cannot be read into this network"
    try:
        found = load(data)
    except (SafetensorError, RuntimeError, KeyError, ValueError) as error:
        raise ValueError(f"{told}: {error}") from None
    came, expected = (
        {name: tuple(value.shape) for name, value in some.items()} for some in (found, network.state_dict())
    )
    for name in dict.fromkeys([*expected, *came]):  # of which torch would tell all that differ
        if came.get(name) != expected.get(name):
            was, now = (shape.get(name, "none") for shape in (came, expected))
            raise ValueError(f"{told}: {name} has the shape {was}, expected {now}")
    network.load_state_dict(found)


def load_zip(path: str | Path) -> BaseAlgorithm:
    """A model that SB3 has saved. It is a pickle: reading it can run any code that its author put there.

    Raises:
        ValueError: no such file, or none of SB3's or sb3-contrib's; or that package is not installed.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            keys = json.loads(archive.read("data"))
    except (OSError, zipfile.BadZipFile, KeyError, ValueError) as error:
        raise ValueError(f"{path} is no model of stable-baselines3: {error}") from None
    kind = _algorithm_of(path, keys)
    try:
        return kind.load(path, device="cpu")
    except Exception as error:  # whatever a pickle raises, or a policy that is not this algorithm's
        told = f"{type(error).__name__}: {error}"
        raise ValueError(f"{path} cannot be read as a model of {kind.__name__}: {told}") from error


def _algorithm_of(path: str | Path, keys: Any) -> type[BaseAlgorithm]:
    """The algorithm of a model, by what its zip says as plain data.

    Raises:
        ValueError: it is none that is known, or not installed.
    """
    keys = keys if isinstance(keys, dict) else {}
    told = keys.get("policy_class")
    module = told.get("__module__") if isinstance(told, dict) else None
    by_hand = "load it and hand the model in as an object"
    if isinstance(module, str) and module.split(".")[0] == "sb3_contrib":
        name = CONTRIB.get(module, module)
        try:
            import sb3_contrib
        except ModuleNotFoundError:
            needs = f"of the package sb3-contrib, which is not installed: pip install sb3-contrib, or {by_hand}"
            raise ValueError(f"{path} is a model of {name}, {needs}") from None
        found: type[BaseAlgorithm] | None = getattr(sb3_contrib, name, None)
        if found is None:
            raise ValueError(f"{path} is a model of {name}, which is not known here: {by_hand}")
        return found
    kind = next((kind for key, kind in TELLING.items() if key in keys), None)
    if kind is None:
        known = ", ".join([*(kind.__name__ for kind in TELLING.values()), *CONTRIB.values()])
        raise ValueError(f"{path}: known are models of {known}; of another one {by_hand}")
    return kind
