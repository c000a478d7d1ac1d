"""Where learned models lie, and what a model's folder holds.

policy.onnx is what is played, policy.safetensors the weights to train on, config.json what made them and for which
robot, card.md the same for people.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from bug_gym.agents.learning.history import Lags
from bug_gym.agents.learning.hub import HUB, fetched
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.checks import install_command
from bug_gym.config import checked
from bug_gym.files import from_json
from bug_gym.naming import nearest_hint
from bug_gym.schema.errors import wrong
from bug_gym.schema.values import Count, NotNegative, Number, Part, Share

TRAINED_FOLDER = Path(__file__).parents[1] / "trained"
GRAPH, WEIGHTS, CONFIG = "policy.onnx", "policy.safetensors", "config.json"
"""Files of a model: what is played, what can be trained on, and what made it."""


# ---------------------------------------------------------------------------------------------------------------------
# What config.json says
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Point:
    """One validation of a training."""

    steps: Count
    """Environment steps so far."""
    seconds: NotNegative
    """Time spent on training [s]; validations and checkpoints do not count."""
    cpu_seconds: NotNegative
    """The same in time of processors [s]: what it would take one core that nobody else uses."""
    success: Share
    """Share of successes, mean over the scenarios."""
    collision: Share
    """Share of collisions."""
    timeout: Share
    """Share of timeouts."""
    time: NotNegative | None
    """Mean time of a success [s]; None where there was none."""


class Entered(Part):
    """The beginning of a stage, as a record keeps it."""

    stage: Count
    """Its number, from 0 on."""
    steps: Count
    """Environment steps of the training when it began."""
    success: Share
    """Share of successes in the stage before, for which it began."""


class RunRecord(Part):
    """The training of one seed."""

    curve: tuple[Point, ...] = Field(min_length=1)
    """Its validations."""
    best: Point
    """The one in which it did best."""
    held_out: dict[str, dict[str, Number | None]]
    """How the best model did in held-out worlds, by scenario."""
    entered: tuple[Entered, ...] = ()
    """Stages of its curriculum that began, after the first."""


Checksum = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
"""SHA-256 of a file, in hexadecimal."""


def checksums_of(*names: str) -> AfterValidator:
    """Checks that a mapping has the checksums of these files and no others."""

    def check(value: dict[str, str]) -> dict[str, str]:
        if value.keys() != set(names):
            raise wrong(f"got checksums of {', '.join(sorted(value)) or 'nothing'}, expected {', '.join(names)}")
        return value

    return AfterValidator(check)


class ModelRecord(Part):
    """What config.json says of a model."""

    name: str
    """Of its training."""
    robot: RobotModel
    """What it was trained for."""
    action: Literal["continuous", "discrete"]
    """Which actions it takes."""
    history: Lags
    """How many steps ago its History looks; empty: it has no memory."""
    settings: dict[str, Any]
    """Of its training: see settings.Settings."""
    scenarios: tuple[dict[str, Any], ...]
    """What it was trained in, as data."""
    made_of: dict[str, str] = {}
    """Digests of what the settings only name, as they were when its training began: see settings.Settings."""
    seed: Count
    """Of the model that is played."""
    machine: dict[str, Any]
    """What it was trained on."""
    sha256: Annotated[dict[str, Checksum], checksums_of(GRAPH, WEIGHTS)]
    """Checksums of its files, by name."""
    data: dict[str, Any] | None = None
    """Of an offline training: what its episodes were collected of, as their dataset says."""
    dataset: str | None = None
    """Of one that was given its episodes: the dataset's folder or name."""
    runs: dict[str, RunRecord]
    """Its trainings, by seed."""

    @model_validator(mode="after")
    def _has_its_own_run(self) -> ModelRecord:
        if str(self.seed) not in self.runs:
            raise wrong(f"got those of the seeds {', '.join(self.runs) or 'none'}, not of {self.seed}", "runs")
        return self


def model_folder(model: str | Path) -> Path:
    """The folder of a model: a name of `trained_names()`, its path, or `hf://user/name`, which is fetched.

    Raises:
        ValueError: no such name; the message offers the nearest ones.
    """
    if isinstance(model, str) and model.startswith(HUB):
        return fetched(model, (GRAPH, WEIGHTS, CONFIG))
    if isinstance(model, Path) or "/" in model or os.sep in model:
        return Path(model).expanduser()
    known = trained_names()
    if model not in known:
        hint = nearest_hint(model, known, count=3, cutoff=0.4, separator=";")
        raise ValueError(
            f"no model {model!r}{hint} (known: {', '.join(known)}; or the path of a folder, such as ./{model})"
        )
    return TRAINED_FOLDER / model


def trained_names() -> list[str]:
    """Names of the shipped models, sorted."""
    return sorted(path.parent.name for path in TRAINED_FOLDER.glob(f"*/{CONFIG}"))


def lone_names() -> list[str]:
    """Names of the shipped models for a robot that is alone in its world, sorted."""
    return [name for name in trained_names() if not read_config(TRAINED_FOLDER / name)["robot"]["peers"]]


def read_config(folder: Path) -> dict[str, Any]:
    """What a model's config.json says.

    Raises:
        ValueError: it is missing or damaged.
    """
    return read_record(folder / CONFIG, "policy", ModelRecord)


def read_record(path: Path, kind: str, schema: type[Part]) -> dict[str, Any]:
    """What the JSON file of something trained says.

    Args:
        path: of the file.
        kind: "policy" or "predictor".
        schema: what it may say.

    Raises:
        ValueError: it is missing or damaged.
    """
    if not path.is_file():
        best = best_so_far(path.parent)
        hint = "" if best is None else f"; its training has not ended, its best model so far is {best}/"
        raise ValueError(f"no trained {kind} in {path.parent}: it has no {path.name}{hint}")
    try:
        record = from_json(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    checked(schema, record, f"{path} is damaged")
    return dict(record)


def best_so_far(folder: Path) -> Path | None:
    """The folder of the best model of a training that has not ended, if there is one: of two the better, else the later."""
    return max(models_so_far(folder), key=place_of, default=None)


def models_so_far(folder: Path) -> list[Path]:
    """The folders of models that a training has left which has not ended: one, of a kill perhaps two."""
    return [path for path in folder.glob("best-*") if path.name[5:].isdecimal() and (path / CONFIG).is_file()]


def place_of(path: Path) -> tuple[float, int]:
    """Where such a model stands among others: success in its validation, then steps; a damaged one is the last."""
    try:
        config = read_config(path)
    except ValueError:
        return -1.0, int(path.name[5:])
    best = config["runs"][str(config["seed"])]["best"]
    return best["success"], best["steps"]


# ---------------------------------------------------------------------------------------------------------------------
# The other files
# ---------------------------------------------------------------------------------------------------------------------


def sha256(data: bytes) -> str:
    """Checksum of a file's bytes."""
    return hashlib.sha256(data).hexdigest()


def checksums(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Checksums of a folder's files, by name."""
    return {name: sha256((folder / name).read_bytes()) for name in names}


def read_checked(path: Path, checksum: str) -> bytes:
    """What a file holds.

    Raises:
        ValueError: no such file, or one with another checksum.
    """
    if not path.is_file():
        raise ValueError(f"no file {path}")
    data = path.read_bytes()
    if sha256(data) != checksum:
        raise ValueError(f"{path} is damaged: its checksum is not the one kept with it")
    return data


def open_graph(path: Path, checksum: str) -> Any:
    """A graph of ONNX, ready to run on one thread.

    Raises:
        ValueError: no such file, one with another checksum, or no graph in it.
        ImportError: onnxruntime is not installed.
    """
    try:
        import onnxruntime
    except ModuleNotFoundError as error:
        raise ImportError(f"learned agents need onnxruntime, of the extra `play`: {install_command('play')}") from error
    graph = read_checked(path, checksum)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
    except _graph_faults() as error:
        raise ValueError(f"{path} holds no graph of ONNX that can be run: {error}") from None


def require_answers(graph: Any, path: Path, width: int, expected: Sequence[tuple[int, ...]]) -> None:
    """Ask a graph once, about nothing: one that was made for something else shows it here, not in a run.

    Args:
        graph: from `open_graph`.
        path: it came from.
        width: how many numbers it is told of each of n rows.
        expected: shapes of one row's answer that it may have: real numbers, or a whole one for ().

    Raises:
        ValueError: it takes or gives something else.
    """
    rows = 3
    try:
        answers = graph.run(None, {"observation": np.zeros((rows, width), dtype=np.float32)})
    except _graph_faults() as error:
        raise ValueError(f"{path} is not a graph for observations of {width} numbers: {error}") from None
    if len(answers) != 1 or not _is_answer(answers[0], rows, expected):
        shapes = ", ".join(f"{answer.dtype} {answer.shape}" for answer in map(np.asarray, answers))
        wanted = " or ".join(str((rows, *shape)) for shape in expected)
        raise ValueError(f"{path} answers {rows} observations with {shapes}, expected finite numbers {wanted}")


def _is_answer(answer: Any, rows: int, expected: Sequence[tuple[int, ...]]) -> bool:
    if not isinstance(answer, np.ndarray) or answer.ndim < 1 or len(answer) != rows:
        return False
    shape, kind = answer.shape[1:], answer.dtype.kind
    return shape in expected and kind in ("f" if shape else "iu") and bool(np.isfinite(answer).all())


def _graph_faults() -> tuple[type[Exception], ...]:
    """What onnxruntime raises, most of which has no common ancestor."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    names = ("EPFail", "EngineError", "Fail", "InvalidArgument", "InvalidGraph", "InvalidProtobuf", "NoModel")
    own = (getattr(state, name) for name in (*names, "NoSuchFile", "NotImplemented", "RuntimeException"))
    return (ValueError, *own)
