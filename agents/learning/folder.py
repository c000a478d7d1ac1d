"""Where learned models lie, and what a model's folder holds.

policy.onnx is what is played, policy.safetensors the weights to train on, config.json what made them and for which
robot, card.md the same for people.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Set
from pathlib import Path
from typing import Any

from bug_gym.naming import nearest_hint

TRAINED_FOLDER = Path(__file__).parents[1] / "trained"
GRAPH, WEIGHTS, CONFIG = "policy.onnx", "policy.safetensors", "config.json"
"""Files of a model: what is played, what can be trained on, and what made it."""


def model_folder(model: str | Path) -> Path:
    """The folder of a model: a name of `trained_names()`, or its path.

    Raises:
        ValueError: no such name; the message offers the nearest ones.
    """
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


def read_config(folder: Path) -> dict[str, Any]:
    """What a model's config.json says.

    Raises:
        ValueError: it is missing or damaged.
    """
    return read_record(folder / CONFIG, "policy", {"name", "robot", "history", "sha256"})


def read_record(path: Path, kind: str, required: Set[str]) -> dict[str, Any]:
    """What the JSON file of something trained says.

    Args:
        path: of the file.
        kind: "policy" or "predictor".
        required: keys that it has to have.

    Raises:
        ValueError: it is missing or damaged.
    """
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise ValueError(f"no trained {kind} in {path.parent}: it has no {path.name}") from None
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    if missing := required - record.keys():
        raise ValueError(f"{path} is damaged: it lacks {', '.join(sorted(missing))}")
    return record


def sha256(data: bytes) -> str:
    """Checksum of a file's bytes."""
    return hashlib.sha256(data).hexdigest()


def checksums(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Checksums of a folder's files, by name."""
    return {name: sha256((folder / name).read_bytes()) for name in names}


def open_graph(path: Path, checksum: str) -> Any:
    """A graph of ONNX, ready to run on one thread.

    Raises:
        ValueError: no such file, or one with another checksum.
        ImportError: onnxruntime is not installed.
    """
    try:
        import onnxruntime
    except ModuleNotFoundError as error:
        raise ImportError(
            "learned agents need onnxruntime, of the extra `play`: pip install 'bug-gym[play]'"
        ) from error
    if not path.is_file():
        raise ValueError(f"no file {path}")
    graph = path.read_bytes()
    if sha256(graph) != checksum:
        raise ValueError(f"{path} is damaged: its checksum is not the one kept with it")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
