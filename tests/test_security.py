"""Nothing that is read can run code, but a zip that is trusted: what SECURITY.md says, looked for in the sources."""

from __future__ import annotations

import ast
import importlib
import os
import pickle
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from yaml.constructor import FullConstructor, SafeConstructor

from bug_gym.config import ScenarioError, load
from bug_gym.evaluation.suites import load_suite

ROOT = Path(__file__).resolve().parents[1]
SOURCES = {
    path.relative_to(ROOT).as_posix(): path
    for folder in ("bug_gym", "agents", "docs")  # bug_gym/agents is a link, which is not followed
    for path in sorted((ROOT / folder).rglob("*.py"))
    if "_build" not in path.parts
}

READERS = {"load", "loads", "load_all", "Unpickler", "PackageImporter"}
"""What functions are called that read a value from a file or from bytes; most of those that can run code."""
PLAIN = {"json.load", "json.loads", "tomllib.load", "tomllib.loads", "bug_gym.config.load", "safetensors.torch.load"}
"""Those that give plain values, whatever they read. `numpy.load`, `torch.load` and `yaml.load` depend on arguments."""
NEVER = {
    *("eval", "exec", "builtins.eval", "builtins.exec"),
    *("yaml.unsafe_load", "yaml.unsafe_load_all", "yaml.full_load", "yaml.full_load_all"),
    *("os.system", "os.popen", "shelve.open", "pandas.read_pickle", "runpy.run_path", "runpy.run_module"),
}
"""Functions under other names that run code which they are given."""

ALLOWED: Mapping[str, set[str]] = {
    # What SB3 has saved, once somebody has said trust=True: agents/learning/play.py.
    "agents/learning/models.py": {"kind.load"},
    # No readers of files: a layout becomes a row of the world, LLVM's instruction.
    "bug_gym/simulation.py": {"self.world.load_all"},
    "bug_gym/world.py": {"self.load"},
    "bug_gym/kernels/vectors.py": {"builder.load"},
    "bug_gym/kernels/addresses.py": {"builder.load"},
    # numba's cache of compiled code: what it holds is code, behind a checksum, in a folder of the user's own.
    "bug_gym/kept_code.py": {"pickle.loads"},
    # A node of a cluster reads the jobs of the process that asks, which Ray itself sends as pickles.
    "bug_gym/cluster.py": {"pickle.loads"},
}
"""File -> what would be found there, and is in order."""


def full_names(tree: ast.AST) -> dict[str, str]:
    """Name in a module -> what was imported under it."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                first = alias.name.split(".")[0]
                names |= {alias.asname: alias.name} if alias.asname else {first: first}
        elif isinstance(node, ast.ImportFrom):
            names |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    return names


def dotted(node: ast.expr, names: Mapping[str, str]) -> str:
    """A dotted name with its beginning as imported; `?` for what is no name."""
    if isinstance(node, ast.Name):
        return names.get(node.id, node.id)
    return f"{dotted(node.value, names)}.{node.attr}" if isinstance(node, ast.Attribute) else "?"


def is_true(node: ast.expr | None) -> bool:
    return isinstance(node, ast.Constant) and node.value is True


def is_false(node: ast.expr | None) -> bool:
    return isinstance(node, ast.Constant) and node.value is False


def unsafe_calls(source: str, module: str = "") -> Iterator[str]:
    """Calls in a module that can run code which they read, each by its full name."""
    tree = ast.parse(source)
    names = full_names(tree)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = dotted(node.func, names)
        given = {keyword.arg: keyword.value for keyword in node.keywords}
        if name == "numpy.load":
            is_safe = "allow_pickle" not in given or is_false(given["allow_pickle"])
        elif name == "torch.load":
            is_safe = is_true(given.get("weights_only"))
        elif name in ("yaml.load", "yaml.load_all"):
            loader = given.get("Loader") or (node.args[1] if len(node.args) > 1 else None)
            is_safe = loader is not None and makes_plain_values(dotted(loader, names), module)
        else:
            is_safe = name in PLAIN or not (name in NEVER or name.rpartition(".")[2] in READERS)
        if not is_safe or (None in given and name in ("numpy.load", "torch.load")):  # **settings may say anything
            yield name


def makes_plain_values(name: str, module: str) -> bool:
    """Whether a loader of YAML gives plain values only."""
    home, _, last = name.rpartition(".")
    loader: Any = getattr(importlib.import_module(home or module), last)
    return issubclass(loader, SafeConstructor) and not issubclass(loader, FullConstructor)


def module_of(name: str) -> str:
    """The module that a file of ours is; empty for a script."""
    path = Path("bug_gym", name) if name.startswith("agents/") else Path(name)
    return "" if name.startswith("docs/") else ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def test_no_module_runs_code_that_it_reads() -> None:
    found = {
        name: set(unsafe_calls(path.read_text(encoding="utf-8"), module_of(name))) for name, path in SOURCES.items()
    }
    assert {name: calls for name, calls in found.items() if calls} == ALLOWED


@pytest.mark.parametrize(
    "source",
    [
        "import pickle\npickle.load(file)",
        "import pickle as p\np.loads(data)",
        "from pickle import loads as read\nread(data)",
        "import pickle\npickle.Unpickler(file)",
        "def f():\n    import joblib\n    return joblib.load(path)",
        "import marshal\nmarshal.loads(data)",
        "import torch\ntorch.load(path)",
        "import torch\ntorch.load(path, weights_only=False)",
        "import torch\ntorch.load(path, weights_only=told)",
        "import torch\ntorch.load(path, weights_only=True, **more)",
        "import torch\ntorch.jit.load(path)",
        "import numpy as np\nnp.load(path, allow_pickle=True)",
        "import numpy as np\nnp.load(path, allow_pickle=told)",
        "from numpy import load\nload(path, allow_pickle=True)",
        "from stable_baselines3 import PPO\nPPO.load(path)",
        "import yaml\nyaml.load(text, Loader=yaml.FullLoader)",
        "import yaml\nyaml.load(text, yaml.UnsafeLoader)",
        "from yaml import load, Loader\nload(text, Loader)",
        "import yaml\nyaml.load(text)",
        "import yaml\nyaml.unsafe_load(text)",
        "eval(text)",
        "exec(code, {})",
        "import builtins\nbuiltins.eval(text)",
        "import os\nos.system(text)",
    ],
)
def test_each_way_to_run_code_is_seen(source: str) -> None:
    assert list(unsafe_calls(source))


@pytest.mark.parametrize(
    "source",
    [
        "import json\njson.loads(text)",
        "import torch\ntorch.load(path, weights_only=True)",
        "import numpy as np\nnp.load(path)\nnp.load(path, allow_pickle=False)",
        "import yaml\nyaml.safe_load(text)\nyaml.load(text, Loader=yaml.SafeLoader)\nyaml.load(text, yaml.CSafeLoader)",
        "from bug_gym.schema.yaml_text import YamlLoader\nimport yaml\nyaml.load(text, Loader=YamlLoader)",
        "model.eval()\nevaluate(policy)",
    ],
)
def test_what_gives_plain_values_is_let_through(source: str) -> None:
    assert not list(unsafe_calls(source))


# ------------------------------------------------------------------------------------------------------------- tried


class Code:
    """What makes a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.folder),)


def test_the_code_of_these_tests_would_run(tmp_path: Path) -> None:
    pickle.loads(pickle.dumps(Code(tmp_path / "ran")))
    yaml.unsafe_load(f"!!python/object/apply:os.mkdir ['{tmp_path}/too']")
    assert (tmp_path / "ran").exists() and (tmp_path / "too").exists()


@pytest.mark.parametrize("read", [load, load_suite])
def test_code_in_yaml_does_not_run(read: Any, tmp_path: Path) -> None:
    path = tmp_path / "code.yaml"
    path.write_text(f"name: !!python/object/apply:os.mkdir ['{tmp_path.as_posix()}/ran']\n", encoding="utf-8")
    with pytest.raises(ScenarioError):
        read(str(path))
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("form", ["torch", "pickle"])
def test_code_in_a_checkpoint_does_not_run(form: str, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch", reason="torch comes with the extra `train`")
    from bug_gym.agents.learning.checkpoints import load_checkpoint

    path = tmp_path / "checkpoint.pt"
    state = {"identity": {}, "policy": Code(tmp_path / "ran")}
    if form == "torch":
        torch.save(state, path)
    else:
        path.write_bytes(pickle.dumps(state, protocol=2))  # torch warns of others
    with pytest.raises(ValueError, match=r"checkpoint\.pt"):
        load_checkpoint(path, {})
    assert not (tmp_path / "ran").exists()
