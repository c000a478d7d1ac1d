"""Datasets as Minari keeps them: written from demonstrations, and opened with what they must be checked for.

Minari is the extra `data`. Its own collector wraps one env; here whole blocks of episodes go into a file of its layout.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import bug_gym
from bug_gym import kernels
from bug_gym.checks import install_command
from bug_gym.config import Scenario, dump
from bug_gym.evaluation.demonstrations import ENDINGS, Demonstrations
from bug_gym.evaluation.episode_file import Arrays, EpisodeFile
from bug_gym.files import from_json, moved_when_done, released, replaced_when_done
from bug_gym.limits import told_bytes
from bug_gym.observation import Field, as_dict
from bug_gym.observation import fields as observation_fields

NAMESPACE = "bug_gym"
"""First part of the names of our datasets."""
FORMS = ("dict", "flat")
"""How observations lie in a dataset; a flat one has `_flat` in its name."""
VERSION = 0
"""The version at the end of the names."""
MOST_PACKED = 1_032
"""Bytes that HDF5's deflate makes of one at most: a file that promises more does not hold it."""

METADATA, MAIN = "metadata.json", "main_data.hdf5"
NAMESPACE_METADATA = "namespace_metadata.json"
OURS = "bug_gym"
"""Key of a dataset's metadata under which stands what it was collected of."""


@dataclass(frozen=True)
class About:
    """What is said of a dataset."""

    scenario: Scenario
    """The worlds."""
    algorithm: str
    """Who drove."""
    description: str
    """In a sentence or two."""
    identity: Mapping[str, Any]
    """All that the data are a function of, as JSON has it."""
    lowest: float
    """Mean return of the random policy."""
    highest: float
    """Mean return of the expert."""
    scored: int
    """Episodes that each of both was taken of."""
    expert: str
    """Name of the expert."""
    author: str | None = None
    """Who collected it; None: the authors of this package."""
    author_email: str | None = None
    """Where to write to."""
    code_permalink: str | None = None
    """Address of the code, of this very version."""


def require_minari() -> None:
    """Raise an ImportError that names the extra, where Minari or what it needs for its files is not installed."""
    try:
        import h5py  # noqa: F401
        import minari  # noqa: F401
    except ImportError as error:
        raise ImportError(f"datasets need minari and h5py: {install_command('data')}") from error


def in_name(label: str) -> str:
    """A label as part of a dataset's name, which has letters, digits, "_" and "-"."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", label).strip("_-") or "unnamed"


def dataset_id(scenario: str, name: str, form: str) -> str:
    """The name by which Minari knows a dataset, such as `bug_gym/dynamic/bug2-v0`."""
    suffix = "" if form == "dict" else f"_{form}"
    return f"{NAMESPACE}/{in_name(scenario)}/{in_name(name)}{suffix}-v{VERSION}"


# ---------------------------------------------------------------------------------------------------------------------
# Writing
# ---------------------------------------------------------------------------------------------------------------------


def write_dataset(
    root: Path, stage: Path, name: str, form: str, about: About, blocks: Iterable[tuple[str, Demonstrations]]
) -> None:
    """Write a dataset, which is there whole or not at all.

    Args:
        root: Minari's folder of all datasets.
        stage: where it is put together.
        name: see `dataset_id`.
        form: one of FORMS.
        about: what is said of it.
        blocks: who drove, and the episodes.
    """
    import minari
    from minari.dataset.minari_storage import MinariStorage

    # Its code was trusted when episodes were driven in it; whoever makes the env of the dataset says so anew.
    env = gym.make("BugGym/Navigation-v0", scenario=about.scenario, observation=form)
    spec = deepcopy(env.spec)
    assert spec is not None
    spec.kwargs["scenario"] = dump(about.scenario)
    table = observation_fields(about.scenario)
    with moved_when_done(stage, root / name) as folder:
        storage = MinariStorage.new(
            folder / "data",
            env_spec=spec,
            observation_space=env.observation_space,
            action_space=env.action_space,
            data_format="hdf5",
        )
        episodes, steps = 0, 0
        with EpisodeFile(folder / "data" / MAIN) as file:
            for driver, block in blocks:
                _add(file, driver, block, table, form)
                episodes, steps = episodes + len(block.seeds), steps + len(block.actions)
        counts = {"total_episodes": episodes, "total_steps": steps}
        storage.update_metadata({"dataset_id": name, "minari_version": minari.__version__, **_told(about), **counts})
        storage.update_metadata({"dataset_size": storage.get_size()})
    env.close()


def _told(about: About) -> dict[str, Any]:
    told = {
        "algorithm_name": about.algorithm,
        "author": {about.author or _authors()},
        "description": about.description,
        "requirements": [f"bug-gym=={bug_gym.__version__}"],
        "ref_min_score": about.lowest,
        "ref_max_score": about.highest,
        "num_episodes_average_score": about.scored,
        "expert_policy": about.expert,
        "outcomes": list(ENDINGS),
        OURS: dict(about.identity),
    }
    if about.author_email is not None:
        told["author_email"] = {about.author_email}
    if about.code_permalink is not None:
        told["code_permalink"] = about.code_permalink
    return told


def _authors() -> str:
    """The authors of this package."""
    try:
        return metadata("bug-gym")["Author"] or "bug_gym"
    except PackageNotFoundError:  # run from its folder, without being installed
        return "bug_gym"


def _add(file: EpisodeFile, driver: str, block: Demonstrations, table: tuple[Field, ...], form: str) -> None:
    """Add the episodes of a block, cut out of arrays of all their steps (T,) and all that was seen (T + n,)."""
    last = np.cumsum(block.steps)  # one past each episode's last step
    seen_last = last + np.arange(len(last))
    is_terminated = np.isin(block.outcomes, (kernels.SUCCESS, kernels.COLLISION))
    in_steps: Arrays = {
        "actions": block.actions,
        "rewards": block.rewards,
        "terminations": _true_at(last[is_terminated] - 1, len(block.actions)),
        "truncations": _true_at(last[~is_terminated] - 1, len(block.actions)),
    }
    seen: Arrays = {
        "observations": as_dict(block.observations, table) if form == "dict" else block.observations,
        "infos": _infos(block, seen_last),
    }
    for seed, steps, end, seen_end in zip(
        *(a.tolist() for a in (block.seeds, block.steps, last, seen_last)), strict=True
    ):
        told = {"seed": seed, "total_steps": steps, "policy": driver}
        file.add(told, _cut(seen, slice(seen_end - steps, seen_end + 1)) | _cut(in_steps, slice(end - steps, end)))


def _true_at(places: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    values = np.zeros(count, dtype=np.bool_)
    values[places] = True
    return values


def _cut(arrays: Arrays, part: slice) -> dict[str, Any]:
    """A part of each of some arrays."""
    return {
        name: _cut(values, part) if isinstance(values, Mapping) else values[part] for name, values in arrays.items()
    }


def _infos(block: Demonstrations, last: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    """What infos hold (T + n,): after the reset and after each step; mode, hit and leave point are of the next decision.

    Args:
        block: the episodes.
        last: where each one's last observation lies (n,).
    """
    count = len(block.observations)
    codes = np.zeros(count, dtype=np.int8)
    codes[last] = block.outcomes
    infos: dict[str, NDArray[Any]] = {"outcome": codes, "collision": codes == kernels.COLLISION}
    if len(block.shortest):
        infos["shortest_path_length"] = np.repeat(block.shortest, block.steps + 1)
    if len(block.modes):
        ends = np.cumsum(block.steps)
        last_twice = np.insert(np.arange(len(block.modes)), ends, ends - 1)
        infos["mode"] = block.modes[last_twice]
        infos["hit_point"], infos["leave_point"] = block.points[last_twice].swapaxes(0, 1)
    return infos


def write_namespaces(root: Path, scenario: str) -> None:
    """Say of the folders above the datasets what they are."""
    folder = root / NAMESPACE / in_name(scenario)
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        folder.parent: "Robots with a LIDAR among unknown obstacles, driven by scripted and learned policies of bug_gym.",
        folder: f"Worlds of the scenario {scenario}.",
    }
    for place, text in texts.items():
        if not (place / NAMESPACE_METADATA).exists():
            with replaced_when_done(place / NAMESPACE_METADATA) as partial_file:
                partial_file.write_text(json.dumps({"description": text}) + "\n", encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------------
# Reading
# ---------------------------------------------------------------------------------------------------------------------


def read_identity(folder: Path) -> dict[str, Any]:
    """What a dataset in its folder was collected of.

    Raises:
        ValueError: no dataset, a damaged one, or one that `bug-gym collect` has not written.
    """
    return dict(_metadata(folder)[OURS])


def has_said(folder: Path, key: str, value: str) -> bool:
    """Whether a dataset in its folder says that of itself in its metadata.

    Raises:
        ValueError: as of `read_identity`.
    """
    found = _metadata(folder).get(key)
    return value in found if isinstance(found, list) else value == found


def _metadata(folder: Path) -> dict[str, Any]:
    path = folder / "data" / METADATA
    if not path.is_file():
        raise ValueError(f"no dataset in {folder}: {path} is missing")
    try:
        found = from_json(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    if not isinstance(found, dict) or not isinstance(found.get(OURS), dict):
        raise ValueError(f"{path} does not say what it was collected of, as a dataset of `bug-gym collect` does")
    return found


def open_dataset(folder: Path, scenario: Scenario | None = None) -> Any:
    """A dataset that `bug-gym collect` has written, as a `minari.MinariDataset`, checked.

    Args:
        folder: of the dataset, such as FOLDER/bug_gym/dynamic/bug2-v0.
        scenario: what its worlds have to be; None: whatever they are.

    Raises:
        ImportError: no Minari.
        ValueError: no dataset, a damaged one, one of another scenario or of another version of this package.
    """
    require_minari()
    from minari import MinariDataset

    found = read_identity(folder)
    if found.get("version") != (ours := released(bug_gym.__version__)):
        raise ValueError(f"{folder} was collected with bug-gym {found.get('version')}, this is {ours}")
    if scenario is not None and found.get("digest") != scenario.digest:
        label = found.get("scenario")
        came = f"{label} {found.get('digest')}" if isinstance(label, str) else "another scenario"
        raise ValueError(f"{folder} is of the scenario {came}, expected {scenario.name} {scenario.digest}")
    try:
        dataset = MinariDataset(folder / "data")
        _require_whole(folder / "data" / MAIN, dataset.total_episodes, int(found["episodes"]))
    except (OSError, KeyError, AssertionError, TypeError, ValueError) as error:
        raise ValueError(f"{folder} is damaged: {str(error) or type(error).__name__}") from None
    return dataset


def _require_whole(path: Path, told: int, expected: int) -> None:
    """Raise a ValueError where a file has not the episodes that its metadata tell of; one that is cut can't be opened."""
    import h5py

    with h5py.File(path, "r") as file:
        count, declared = len(file), _declared_bytes(file)
    if declared > (most := MOST_PACKED * path.stat().st_size):
        came = f"its arrays would take {told_bytes(declared)}"
        raise ValueError(f"{came}, expected at most {told_bytes(most)} in a file of that size")
    if told != count:
        raise ValueError(f"{path.name} has {count} episodes, its metadata tell of {told}")
    if count != expected:
        raise ValueError(f"{path.name} has {count} episodes, expected {expected}")


def _declared_bytes(group: Any) -> int:
    """What the arrays of an HDF5 group say that they take once they are read [bytes]."""
    sizes: list[int] = []
    group.visititems(lambda name, node: sizes.append(int(getattr(node, "nbytes", 0))))
    return sum(sizes)
