"""Imports go down the layers only: read from the source, nothing is imported."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "bug_gym"

# Row n is layer n. A module imports from its own layer and from those above it in this table, without a cycle.
LAYERS = (
    ("dispatchers", "compiling", "kernels", "kinematics", "config", "recordings", "ros_map"),
    ("world", "scenarios", "floor_plans", "maps", "shortest_path"),
    ("observation", "task"),
    ("simulation", "policy", "collisions"),
    ("navigation_env", "vector_env", "robots_env", "clips", "pixels", "painting", "rendering", "metrics", "intervals"),
    ("__init__", "agents", "suites", "rollout", "held_out", "evaluation", "report", "benchmark", "gallery"),
    ("reproductions",),
    ("cli", "__main__"),
)
LAYER = {name: layer for layer, names in enumerate(LAYERS) for name in names}
CORE_LAYERS = range(4)  # their runs are functions of (seed, episode, time)

COMPILED = {
    "dispatchers",
    "compiling",
    "kernels",
}  # numba's cache misses a change in a compiled callee of another file, so there is one file
COMPOSED = {"agents.rev1", "agents.rev2"}  # their paper defines them as a change of another algorithm
# `evaluate` takes policies by name
KNOWS_AGENTS = {
    "suites",
    "evaluation",
    "benchmark",
    "reproductions.bug_bounds",
    "reproductions.bug_no_way",
    "cli",
    "reproductions.learned",
    "reproductions.ppo_curve",
    "reproductions.predictors",
    "reproductions.scripted_and_learned",
}
# the only files that know torch and stable-baselines3
LEARNING = {
    "agents.sb3",
    "agents.vec_envs",
    "agents.networks",
    "agents.models",
    "agents.training",
    "agents.prediction_training",
}

TORCH = {"torch", "stable_baselines3", "sb3_contrib"}
DRAWING = {"PIL", "cv2", "matplotlib", "moviepy", "pygame"}
EXTRAS = TORCH | DRAWING | {"minari", "onnx", "onnxruntime", "ray", "safetensors"}
OWN_GENERATORS = {"BitGenerator", "Generator", "PCG64", "Philox", "SeedSequence", "default_rng"}


class Import(NamedTuple):
    """One imported name: `from a.b import c` gives a.b.c."""

    name: str
    line: int
    is_relative: bool
    is_lazy: bool
    is_for_types: bool


def source_files() -> dict[str, Path]:
    """Module name below bug_gym (`world`, `agents`, `agents.bug0`) -> its file."""
    paths = [path for folder in (".", "agents", "reproductions") for path in (PACKAGE / folder).glob("*.py")]
    names = (".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__") for path in paths)
    return dict(zip(names, paths, strict=True))


FILES = source_files()
CORE = sorted(name for name in FILES if not name.startswith("agents"))
AGENTS = sorted(name for name in FILES if name.startswith("agents"))


def layer_of(module: str) -> int:
    """The layer of a module; a ValueError where the table lacks it."""
    name = module.split(".")[0]
    if name not in LAYER:
        raise ValueError(f"bug_gym/{name}.py has no layer: add it to LAYERS in tests/test_layers.py")
    return LAYER[name]


def imports_of(source: str, package: str = "bug_gym") -> Iterator[Import]:
    """Each name imported anywhere in a module of `package`."""
    return _imports_below(ast.parse(source), package, is_lazy=False, is_for_types=False)


def _imports_below(node: ast.AST, package: str, *, is_lazy: bool, is_for_types: bool) -> Iterator[Import]:
    if isinstance(node, ast.Import):
        for alias in node.names:
            yield Import(alias.name, node.lineno, False, is_lazy, is_for_types)
    elif isinstance(node, ast.ImportFrom):
        parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
        start = ".".join([*parents, *filter(None, [node.module])])
        for alias in node.names:
            yield Import(f"{start}.{alias.name}", node.lineno, node.level > 0, is_lazy, is_for_types)
    is_lazy = is_lazy or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
    is_for_types = is_for_types or (isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"))
    for child in ast.iter_child_nodes(node):
        yield from _imports_below(child, package, is_lazy=is_lazy, is_for_types=is_for_types)


def imports_in(module: str) -> list[Import]:
    """The imports of one of our modules."""
    package = ".".join(FILES[module].relative_to(ROOT).parent.parts)
    return list(imports_of(FILES[module].read_text(encoding="utf-8"), package))


def project_module(name: str) -> str | None:
    """The module of ours that a dotted name lies in, None for others' names."""
    parts = name.split(".")
    if parts[0] != "bug_gym":
        return None
    for end in range(len(parts), 1, -1):
        if (module := ".".join(parts[1:end])) in FILES:
            return module
    return "__init__"


def algorithms() -> set[str]:
    """The modules that the table in agents/__init__.py names as "module:Class"."""
    found = set()
    for node in ast.walk(ast.parse(FILES["agents"].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            match = re.fullmatch(r"(?:bug_gym\.agents)?\.?(\w+):\w+", node.value)
            if match and f"agents.{match[1]}" in FILES:
                found.add(f"agents.{match[1]}")
    return found


def global_generators(source: str) -> list[str]:
    """Uses of a random generator that belongs to the process: `np.random.rand`, `random.random` and their like."""
    used = [item.name for item in imports_of(source) if item.name.split(".")[0] == "random"]
    used += [item.name for item in imports_of(source) if re.match(r"numpy\.random\.\w", item.name)]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and re.fullmatch(r"(np|numpy)\.random\.\w+", ast.unparse(node)):
            used.append(ast.unparse(node))
    return [name for name in used if name.split(".")[-1] not in OWN_GENERATORS]


@pytest.mark.parametrize("module", CORE)
def test_every_core_module_has_a_layer(module: str) -> None:
    assert layer_of(module) in range(len(LAYERS))


def test_a_module_without_a_layer_is_told_where_to_add_it() -> None:
    with pytest.raises(ValueError, match="add it to LAYERS"):
        layer_of("no_such_module")


@pytest.mark.parametrize("module", CORE + AGENTS)
def test_imports_go_down_the_layers(module: str) -> None:
    upward = [
        f"line {item.line}: {item.name}"
        for item in imports_in(module)
        if (target := project_module(item.name)) and layer_of(target) > layer_of(module)
    ]
    assert not upward


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = {
        module: {target for item in imports_in(module) if (target := project_module(item.name)) and target != module}
        for module in FILES
    }
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("module", CORE)
def test_only_what_looks_policies_up_by_name_knows_agents_and_imports_them_when_called(module: str) -> None:
    agents = [item for item in imports_in(module) if (project_module(item.name) or "").startswith("agents")]
    assert all(module in KNOWS_AGENTS and item.is_lazy for item in agents), agents


@pytest.mark.parametrize("module", AGENTS)
def test_agents_import_one_another_relatively(module: str) -> None:
    absolute = [item.name for item in imports_in(module) if not item.is_relative]
    assert not [name for name in absolute if re.match(r"(bug_gym\.)?agents\b", name)]


@pytest.mark.parametrize("module", AGENTS)
def test_no_agent_imports_an_algorithm(module: str) -> None:
    imported = {project_module(item.name) for item in imports_in(module)}
    assert module in COMPOSED or not imported & algorithms()


def test_the_table_of_agents_names_algorithms_and_not_toolboxes() -> None:
    assert algorithms() >= {"agents.bug0", "agents.bug2", "agents.go_to_goal"}
    assert "agents.boundary_following" not in algorithms()


@pytest.mark.parametrize("module", CORE + AGENTS)
def test_compiled_code_stays_in_the_kernels(module: str) -> None:
    uses_numba = any(item.name.split(".")[0] == "numba" for item in imports_in(module))
    assert module in COMPILED or not uses_numba


@pytest.mark.parametrize("module", CORE + AGENTS)
def test_extras_are_imported_where_they_are_needed(module: str) -> None:
    early = {item.name.split(".")[0] for item in imports_in(module) if not item.is_lazy and not item.is_for_types}
    assert not early & (EXTRAS - TORCH - {"safetensors"} if module in LEARNING else EXTRAS)


@pytest.mark.parametrize("module", CORE + AGENTS)
def test_only_the_learning_files_know_torch(module: str) -> None:
    imported = {item.name.split(".")[0] for item in imports_in(module)}
    assert module in LEARNING or not imported & TORCH


@pytest.mark.parametrize("module", CORE + AGENTS)
def test_no_module_draws_from_a_global_generator(module: str) -> None:
    assert not global_generators(FILES[module].read_text(encoding="utf-8"))


@pytest.mark.parametrize("module", [module for module in CORE if LAYER.get(module) in CORE_LAYERS])
def test_the_core_reads_no_clock(module: str) -> None:
    assert not [item for item in imports_in(module) if item.name.split(".")[0] in {"time", "datetime"}]


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("import bug_gym.world", ["bug_gym.world"]),
        ("from bug_gym import world, config", ["bug_gym.world", "bug_gym.config"]),
        ("from . import bug0", ["bug_gym.agents.bug0"]),
        ("from .bug0 import Bug0", ["bug_gym.agents.bug0.Bug0"]),
        ("from ..world import World", ["bug_gym.world.World"]),
    ],
)
def test_each_form_of_import_is_read(source: str, names: list[str]) -> None:
    assert [item.name for item in imports_of(source, "bug_gym.agents")] == names


def test_imports_inside_functions_and_for_types_are_told_apart() -> None:
    source = "import a\nif TYPE_CHECKING:\n    import b\ndef f():\n    if x:\n        import c\n"
    assert [(item.name, item.is_lazy, item.is_for_types) for item in imports_of(source)] == [
        ("a", False, False),
        ("b", False, True),
        ("c", True, False),
    ]


@pytest.mark.parametrize(
    "source", ["np.random.rand()", "import random", "from random import gauss", "from numpy.random import normal"]
)
def test_global_generators_are_seen(source: str) -> None:
    assert global_generators(source)


def test_generators_of_ones_own_are_let_through() -> None:
    source = "from numpy.random import Generator\nrng: np.random.Generator = np.random.default_rng(np.random.PCG64(7))"
    assert not global_generators(source)
