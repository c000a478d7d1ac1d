"""What the file of a training names by its place lies beside that file: scenarios, models, and who drives or is asked."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from bug_gym.agents.model_places import is_place
from bug_gym.assignments import name_and_options
from bug_gym.config import expanded, from_folder
from bug_gym.references import is_reference


def beside(folder: Path, data: dict[str, Any]) -> dict[str, Any]:
    """Values of a training, or of a stage of its curriculum: what they name is looked for in the folder of their file.

    Raises:
        ScenarioError: a place in nobody's home, or a text that is no path.
    """
    if isinstance(scenarios := data.get("scenarios"), list):
        data = data | {"scenarios": [from_folder(source, folder) for source in scenarios]}
    if isinstance(stages := data.get("curriculum"), list):
        data = data | {"curriculum": [beside(folder, stage) if isinstance(stage, dict) else stage for stage in stages]}
    if isinstance(episodes := data.get("data"), dict) and isinstance(policies := episodes.get("policies"), list):
        data = data | {"data": {**episodes, "policies": [_policy_from(folder, policy) for policy in policies]}}
    if "start_from" in data:
        data = data | {"start_from": _model_from(folder, data["start_from"])}
    if "expert" in data:
        data = data | {"expert": _policy_from(folder, data["expert"])}
    return data


def _model_from(folder: Path, model: Any) -> Any:
    """A model as a file in a folder names it: a place starts from there, a name is a name, `hf://user/name` the hub's."""
    return os.path.join(folder, expanded(model)) if is_place(model) else model  # noqa: PTH118 - "./model" stays a place


def _policy_from(folder: Path, policy: Any) -> Any:
    """A policy as a file in a folder names it, NAME[:PARAMETER=VALUE...]: what it names by place starts from there.

    These are the files of classes (`file.py:Class`), models, and models among the parameters.
    """
    if not isinstance(policy, str):
        return policy
    try:
        name, options = name_and_options(policy)
    except ValueError:
        return policy  # who reads its parameters tells what is wrong
    is_file = is_reference(name) and name.rpartition(":")[0].endswith(".py")
    placed = str(folder / expanded(name)) if is_file else _model_from(folder, name)
    if not any(map(is_place, options.values())):
        return f"{placed}{policy.removeprefix(name)}"
    told = {key: json.dumps(_model_from(folder, value)) for key, value in options.items()}
    return ":".join([placed, *(f"{key}={value}" for key, value in told.items())])
