"""Models put on the Hugging Face Hub, by `bug-gym push`: the files of a model's folder, and its card as the hub reads it."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bug_gym.agents.learning.folder import CONFIG, GRAPH, WEIGHTS, read_checked, read_config
from bug_gym.agents.learning.hub import HUB, HUB_CARD, HubModel, talking
from bug_gym.files import replaced_when_done

CARD = "card.md"
"""The card of a model in its folder here."""


def push(folder: Path, model: str, *, private: bool = False) -> str:
    """Put a model's folder on the hub, as whoever is logged in there (`hf auth login`, or the variable HF_TOKEN).

    Args:
        folder: of a model that a training has written.
        model: `hf://user/name`; the repository is made where there is none. `@branch` puts it on that branch.
        private: whether a repository that is made now is seen by its owner only.

    Returns:
        The address of the commit.

    Raises:
        ImportError: huggingface_hub is not installed; the message names the extra.
        ValueError: a damaged or missing model, no such name, or the hub refuses.
    """
    place = HubModel.of(model)
    record = read_config(folder)
    contents = {name: read_checked(folder / name, record["sha256"][name]) for name in (GRAPH, WEIGHTS)}
    contents[CONFIG] = (folder / CONFIG).read_bytes()
    contents[HUB_CARD] = hub_card(record, (folder / CARD).read_text(encoding="utf-8"), place.repository).encode()
    with talking(f"{model} cannot be written"), tempfile.TemporaryDirectory() as stage:
        from huggingface_hub import HfApi

        for name, data in contents.items():
            with replaced_when_done(Path(stage, name)) as partial:
                partial.write_bytes(data)
        api = HfApi()
        api.create_repo(place.repository, private=private, exist_ok=True)
        if place.revision is not None:
            api.create_branch(place.repository, branch=place.revision, exist_ok=True)
        commit = api.upload_folder(
            repo_id=place.repository,
            folder_path=stage,
            revision=place.revision,
            commit_message=f"{record['name']}, seed {record['seed']}",
        )
    return str(commit.commit_url)


def hub_card(record: Mapping[str, Any], card: str, repository: str) -> str:
    """A card as the hub reads it: what is known of the model as YAML on top, its results among it, then for people.

    Args:
        record: config.json of the model.
        card: its card.md.
        repository: user/name.
    """
    import yaml

    held_out = record["runs"][str(record["seed"])]["held_out"]
    results = [
        {
            "task": {"type": "reinforcement-learning", "name": "reinforcement-learning"},
            "dataset": {"name": f"bug_gym {scenario}", "type": scenario},
            "metrics": [
                {"type": "success_rate", "value": found["success"], "name": f"success in {found['n']:.0f} worlds"}
            ],
        }
        for scenario, found in held_out.items()
    ]
    about = {
        "library_name": "bug_gym",
        "tags": ["reinforcement-learning", "robotics", "navigation", "bug_gym", *held_out],
        "model-index": [{"name": record["name"], "results": results}],
    }
    use = f'bug_gym.agents.make_policy("{HUB}{repository}", env)'
    return f"---\n{yaml.safe_dump(about, sort_keys=False)}---\n{card}\nPlayed without torch:\n\n```python\n{use}\n```\n"
