"""Models that are named by where they lie: which texts do so, and whether what lies there is still the same."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def is_place(text: Any) -> bool:
    """Whether something is a text that says where a model lies here, as policies and their parameters name one."""
    if not isinstance(text, str) or text.startswith("hf://"):
        return False
    return text.endswith(".zip") or "/" in text or os.sep in text


def model_digest(place: str) -> str:
    """Digest of the model, or other file, that lies at a place now, to tell whether it is still the same.

    Of a folder it is that of its record, which has the checksums of a model's other files.

    Args:
        place: a path, or `hf://user/name`, as policies and their parameters name models.

    Returns:
        Hexadecimal digits; "" where the text is no place, or nothing lies there that could be read.
    """
    if not (is_place(place) or place.startswith("hf://")):
        return ""
    from bug_gym.agents.learning.folder import CONFIG, model_folder  # loads pydantic
    from bug_gym.agents.prediction.learned import CONFIG as PREDICTOR_CONFIG  # loads the compiler

    try:
        found = model_folder(place) if place.startswith("hf://") else Path(place).expanduser()
        files = [found / CONFIG, found / PREDICTOR_CONFIG] if found.is_dir() else [found]
        written = [file.read_bytes() for file in files if file.is_file()]
    except (OSError, ValueError, ImportError, RuntimeError):
        return ""  # who makes the policy tells what is wrong
    return hashlib.sha256(b"".join(written)).hexdigest()[:16] if written else ""


def policy_digest(own: str, parameters: Mapping[str, Any]) -> str:
    """What a policy is made of that does not belong to the package: its own digest, and those of models that parameters name.

    Args:
        own: of its code, or its model; "" where these are the package's.
        parameters: of the policy; the digest of a model stands behind the name of its parameter, as in
            "predictor=0123456789abcdef".

    Returns:
        "" where all is the package's.
    """
    texts = {key: value for key, value in sorted(parameters.items()) if isinstance(value, str)}
    of_parameters = [f"{key}={digest}" for key, value in texts.items() if (digest := model_digest(value))]
    return ", ".join(filter(None, [own, *of_parameters]))
