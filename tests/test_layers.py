"""Imports go down the layers only: read from the source, nothing is imported."""

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "bug_gym"

# Row n is layer n; a name is a module of bug_gym or a folder with all that is in it. A module imports from its own layer
# and from those above it in this table, at the top of the file or in a function, by import or by "module:Class".
LAYERS = (
    (
        "log",
        "shortcuts",
        "dispatchers",
        "kept_code",
        "compiling",
        "kernels",
        "geometry",
        "limits",
        "naming",
        "field_texts",
        "references",
        "files",
        "checks",
        "workers",
    ),
    ("schema", "assignments", "shortest_path", "kinematics", "intervals", "by_hand"),
    ("worlds",),
    ("config",),
    ("draws", "standing", "world", "scenarios", "scenario_code"),
    ("observation", "task", "own_parts", "view", "inertia", "foresight", "steering", "manoeuvring", "swaying"),
    ("simulation", "policy", "team_policy"),
    ("drawing", "replay", "spaces", "navigation_env", "vector_env", "robots_env", "episodes", "held_out"),
    ("agents", "__init__"),  # the package registers the environments, an agents' one too, by name
    ("evaluation", "cluster"),
    ("reproductions", "benchmark"),
    ("commands", "cli", "__main__"),
)
LAYER = {name: layer for layer, names in enumerate(LAYERS) for name in names}
CORE_LAYERS = range(LAYER["agents"])  # their runs are functions of (seed, episode, time)

NUMBA = {
    "compiling",
    "dispatchers",
    "shortcuts",
    "kept_code",
    "kernels.addresses",
    "kernels.vectors",
}  # how kernels are compiled, and the LLVM code that is written by hand
COMPILED = {"kernel", "called", "inlined", "apart"}
"""Decorators of compiled code. numba's cache sees a change in a callee of the same folder, and in the kernels."""
COMPOSED = {
    *(f"agents.bugs.{name}" for name in ("rev1", "rev2", "modified_critical_point_bug")),
    *("agents.teams.bug1_pair", "agents.teams.com1_rev3", "agents.teams.swarm", "agents.reciprocal.orca"),
    *("agents.hd_bug.circumnavigate", "agents.navigator.policy"),
}
"""Defined by another algorithm: as a change of it, as what drives a team's robots, or with it as a fall-back."""
LEARNING = ("agents.sb3", "agents.learning") + tuple(
    f"agents.prediction.{name}" for name in ("training", "card", "descent", "network", "ppo")
)
"""The only modules and folders that know torch and stable-baselines3."""
PLAYING = {"agents.learning"} | {
    f"agents.learning.{name}"
    for name in ("beside", "curriculum", "folder", "history", "hub", "play", "recorded", "robot_model", "settings")
}
"""What plays a learned policy, and what is learnt from as arrays, without torch."""

TORCH = {"torch", "stable_baselines3", "sb3_contrib"}
DRAWING = {"PIL", "cv2", "matplotlib", "moviepy", "pygame"}
EXTRAS = TORCH | DRAWING | {"huggingface_hub", "minari", "onnx", "onnxruntime", "optuna", "ray", "safetensors"}
OWN_GENERATORS = {"BitGenerator", "Generator", "PCG64", "Philox", "SeedSequence", "default_rng"}


class Import(NamedTuple):
    """One imported name: `from a.b import c` gives a.b.c."""

    name: str
    line: int
    is_relative: bool
    is_lazy: bool
    is_for_types: bool


def source_files() -> dict[str, Path]:
    """Module name below bug_gym (`world`, `agents`, `agents.bugs.bug0`) -> its file."""
    paths = {*PACKAGE.rglob("*.py"), *(PACKAGE / "agents").rglob("*.py")}  # agents is a link
    return {".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


FILES = source_files()
MODULES = sorted(FILES)
AGENTS = [name for name in MODULES if name.split(".")[0] == "agents"]
CORE = [name for name in MODULES if name not in AGENTS]


def layer_of(module: str) -> int:
    """The layer of a module; a ValueError where the table lacks it."""
    name = module.split(".")[0]
    if name not in LAYER:
        raise ValueError(f"bug_gym/{name} has no layer: add it to LAYERS in tests/test_layers.py")
    return LAYER[name]


def is_learning(module: str) -> bool:
    """Whether a module may know torch."""
    return module not in PLAYING and any(f"{module}.".startswith(f"{name}.") for name in LEARNING)


BELOW_THE_AGENTS = [name for name in CORE if layer_of(name) in CORE_LAYERS]
NOT_LEARNING = [name for name in MODULES if not is_learning(name)]


@cache
def source_of(module: str) -> str:
    """The text of one of our modules."""
    return FILES[module].read_text(encoding="utf-8")


def package_of(module: str) -> str:
    """The dotted name of the folder that a module of ours lies in."""
    return ".".join(("bug_gym", *FILES[module].relative_to(PACKAGE).parent.parts))


@cache
def parsed(source: str) -> ast.Module:
    """A module's text as a tree that nobody changes."""
    return ast.parse(source)


def imports_of(source: str, package: str = "bug_gym") -> Iterator[Import]:
    """Each name imported anywhere in a module of `package`."""
    return _imports_below(parsed(source), package, is_lazy=False, is_for_types=False)


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


@cache
def imports_in(module: str) -> list[Import]:
    """The imports of one of our modules."""
    return list(imports_of(source_of(module), package_of(module)))


def early_imports_in(module: str) -> list[Import]:
    """The imports of one of our modules, but for those in functions or for types only."""
    return [item for item in imports_in(module) if not (item.is_lazy or item.is_for_types)]


def packages_in(module: str, *, early: bool = False) -> set[str]:
    """The packages that a module of ours imports, early or ever."""
    return {item.name.split(".")[0] for item in (early_imports_in if early else imports_in)(module)}


def project_module(name: str) -> str | None:
    """The module of ours that a dotted name lies in, None for others' names."""
    parts = name.split(".")
    if parts[0] != "bug_gym":
        return None
    for end in range(len(parts), 1, -1):
        if (module := ".".join(parts[1:end])) in FILES:
            return module
    return "__init__"


def named_modules(source: str, package: str) -> set[str]:
    """The modules of ours that strings name: as "module:Class", below `package` or in full, or alone in full.

    In a table of modules (the source of a folder's __init__.py) a name of the folder's is enough.
    """
    found = set()
    for node in ast.walk(parsed(source)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            match = re.fullmatch(r"\.?([A-Za-z_][\w.]*)(:\w+)?", node.value)
            name = match[1] if match else ""
            full = name if name.startswith("bug_gym.") else f"{package}.{name}"
            if match and full.removeprefix("bug_gym.") in FILES:
                found.add(full.removeprefix("bug_gym."))
    return found


@cache
def modules_named_in(module: str) -> set[str]:
    """The modules that a module of ours names in strings: what it imports by name, now or later."""
    is_table = FILES[module].name == "__init__.py"
    return named_modules(source_of(module), package_of(module) if is_table else "(in full only)") - {module}


def modules_imported_by(module: str, *, early: bool = False) -> set[str]:
    """The modules of ours that a module imports; but for bug_gym itself, which every one of them imports.

    Args:
        module: which one.
        early: whether to leave out those imported in functions or for types only.
    """
    items = early_imports_in(module) if early else imports_in(module)
    return {target for item in items if (target := project_module(item.name))} - {module, "__init__"}


@cache
def algorithms() -> set[str]:
    """The modules that the table in agents/__init__.py names as "module:Class"."""
    return modules_named_in("agents")


def global_generators(source: str) -> list[str]:
    """Uses of a random generator that belongs to the process: `np.random.rand`, `random.random` and their like."""
    used = [item.name for item in imports_of(source) if re.match(r"random\b|numpy\.random\.\w", item.name)]
    for node in ast.walk(parsed(source)):
        match node:
            case ast.Attribute(ast.Attribute(ast.Name("np" | "numpy"), "random"), name):
                used.append(name)
    return [name for name in used if name.split(".")[-1] not in OWN_GENERATORS]


def foreign_names(source: str, package: str) -> list[str]:
    """What compiled functions use that is neither of their folder nor of the kernels, nor of math or numpy."""
    tree = parsed(source)
    imported: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            start = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            imported |= {alias.asname or alias.name.split(".")[0]: f"{start}{alias.name}" for alias in node.names}
    used = {
        name: imported[name]
        for function in compiled_functions(tree)
        for name in names_in(function.body)
        if name in imported
    }
    near = (f"{package}.", "bug_gym.kernels.", "math.", "numpy.")
    return sorted(f"{name} of {origin}" for name, origin in used.items() if not f"{origin}.".startswith(near))


def compiled_functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """The functions of a module that numba compiles."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            words = {word for decorator in node.decorator_list for word in re.findall(r"\w+", ast.unparse(decorator))}
            if words & COMPILED:
                yield node


def names_in(statements: list[ast.stmt]) -> Iterator[str]:
    """The names that some statements read, but for those of annotations."""
    for statement in statements:
        annotations = {
            id(part)
            for node in ast.walk(statement)
            if isinstance(node, ast.AnnAssign)
            for part in ast.walk(node.annotation)
        }
        for node in ast.walk(statement):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and id(node) not in annotations:
                yield node.id


def functions_in(source: str) -> Iterator[tuple[str, str]]:
    """Name and text of the functions of a module, the text without docstring and comments."""
    for node in parsed(source).body:
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            yield node.name, "\n".join([ast.unparse(node.args), *map(ast.unparse, body)])


def uncommented_lazy_imports(source: str, package: str = "bug_gym") -> list[str]:
    """Imports of our own in functions without a comment on the line that says why."""
    lines = source.splitlines()
    lazy = [item for item in imports_of(source, package) if item.is_lazy and project_module(item.name)]
    return sorted({f"line {item.line}: {item.name}" for item in lazy if " # " not in lines[item.line - 1]})


def faults(modules: Iterable[str], found_in: Callable[[str], Iterable[object]]) -> dict[str, list[object]]:
    """What is found in each of some modules, but for those in which there is nothing."""
    return {module: found for module in modules if (found := list(found_in(module)))}


def test_every_core_module_has_a_layer() -> None:
    assert {layer_of(module) for module in CORE} <= set(range(len(LAYERS)))


def test_every_name_in_the_layers_is_that_of_a_module_or_folder() -> None:
    there = {module.split(".")[0] for module in MODULES}
    assert [name for names in LAYERS for name in names if name not in there] == []


def test_a_module_without_a_layer_is_told_where_to_add_it() -> None:
    with pytest.raises(ValueError, match="add it to LAYERS"):
        layer_of("no_such_module")


def test_imports_go_down_the_layers() -> None:
    def upward(module: str) -> Iterator[str]:
        for item in imports_in(module):
            target = project_module(item.name)
            if target not in (None, "__init__") and layer_of(target) > layer_of(module):
                yield f"line {item.line}: {item.name}"
        yield from (name for name in modules_named_in(module) if layer_of(name) > layer_of(module))

    assert not faults(MODULES, upward)


def test_the_table_of_the_architecture_is_this_one() -> None:
    page = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    lines = [line for line in page.split("## Layers")[1].split("\n## ")[0].splitlines() if line.startswith("| ")][1:]
    told = [
        [place.rstrip("/").removesuffix(".py").split("/")[-1] for place in re.findall("`([^`]+)`", line)]
        for line in lines
    ]
    assert [*reversed(told)] == [[*names] for names in LAYERS]


def test_no_modules_import_each_other_in_a_circle() -> None:
    TopologicalSorter({module: modules_imported_by(module) for module in FILES}).prepare()


def test_no_modules_import_or_name_each_other_in_a_circle() -> None:
    graph = {module: modules_imported_by(module) | modules_named_in(module) for module in FILES}
    TopologicalSorter(graph).prepare()


def test_nothing_below_the_agents_knows_them() -> None:
    def known(module: str) -> set[str]:
        return {name for name in modules_imported_by(module) | modules_named_in(module) if name.startswith("agents")}

    assert not faults(BELOW_THE_AGENTS, known)


def test_imports_are_absolute() -> None:
    assert not faults(MODULES, lambda module: [item.name for item in imports_in(module) if item.is_relative])


def test_an_import_of_our_own_in_a_function_says_why() -> None:
    assert not faults(MODULES, lambda module: uncommented_lazy_imports(source_of(module), package_of(module)))


def test_no_agent_imports_an_algorithm() -> None:
    assert not faults(set(AGENTS) - COMPOSED, lambda module: modules_imported_by(module) & algorithms())


def test_the_table_of_agents_names_algorithms_and_not_toolboxes() -> None:
    assert algorithms() >= {"agents.bugs.bug0", "agents.bugs.bug2", "agents.floors.go_to_goal"}
    assert not [name for name in algorithms() if name.split(".")[1] in ("walls", "scan", "mapping", "tracking")]


def test_every_bug_is_in_the_table_of_agents() -> None:
    assert {name for name in AGENTS if name.startswith("agents.bugs.")} <= algorithms()


def test_modules_that_tables_name_are_seen() -> None:
    assert modules_named_in("commands") == {name for name in MODULES if name.startswith("commands.")} - {
        "commands.arguments"
    }
    assert modules_named_in("reproductions") >= {"reproductions.barn", "reproductions.learned"}
    assert modules_named_in("agents.prediction") == {"agents.prediction.plain", "agents.prediction.learned"}
    assert modules_named_in("__init__") >= {"agents.prediction.env", "navigation_env"}


def test_compiled_code_stays_in_the_kernels() -> None:
    assert not faults(set(MODULES) - NUMBA, lambda module: packages_in(module) & {"numba"})


def test_compiled_code_calls_its_own_folder_and_the_kernels_only() -> None:
    assert not faults(MODULES, lambda module: foreign_names(source_of(module), package_of(module)))


def test_no_two_modules_define_the_same_function() -> None:
    where: dict[tuple[str, str], list[str]] = {}
    for module in MODULES:
        for function in functions_in(source_of(module)):
            where.setdefault(function, []).append(module)
    assert not {name: modules for (name, _), modules in where.items() if len(modules) > 1}


def test_extras_are_imported_where_they_are_needed() -> None:
    def early(module: str) -> set[str]:
        return packages_in(module, early=True) & (EXTRAS - TORCH - {"safetensors"} if is_learning(module) else EXTRAS)

    assert not faults(MODULES, early)


def test_only_the_learning_files_know_torch() -> None:
    assert not faults(NOT_LEARNING, lambda module: packages_in(module) & TORCH)


def test_what_does_not_learn_is_imported_without_the_learning_files() -> None:
    assert not faults(NOT_LEARNING, lambda module: filter(is_learning, modules_imported_by(module, early=True)))


def test_no_module_draws_from_a_global_generator() -> None:
    assert not faults(MODULES, lambda module: global_generators(source_of(module)))


def test_the_core_reads_no_clock() -> None:
    assert not faults(BELOW_THE_AGENTS, lambda module: packages_in(module) & {"time", "datetime"})


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


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ('TABLE = {"bug0": Agent("bugs.bug0:Bug0", "bug")}', {"agents.bugs.bug0"}),
        ('NAMES = ["bug_gym.world", "bug_gym.agents.bugs.bug2:Bug2"]', {"world", "agents.bugs.bug2"}),
        ('PLACE = "bugs.no_such_bug:Bug"\nTEXT = "world: of bugs"', set()),
    ],
)
def test_modules_in_strings_are_seen(source: str, names: set[str]) -> None:
    assert named_modules(source, "bug_gym.agents") == names


def test_what_compiled_code_takes_from_elsewhere_is_seen() -> None:
    source = """
import math
from bug_gym.agents.scan.joined import join
from bug_gym.geometry import F64, wrap
from bug_gym.kernels.rays import cast
from bug_gym.agents.mapping.cells import find

@inlined
def near(x: F64) -> float:
    y: F64 = cast(x) + math.pi
    return find(y) + wrap(join(y))

def plain(x):
    return wrap(x)
"""
    found = foreign_names(source, "bug_gym.agents.mapping")
    assert found == ["join of bug_gym.agents.scan.joined.join", "wrap of bug_gym.geometry.wrap"]


def test_lazy_imports_of_our_own_need_a_comment() -> None:
    source = (
        "def f():\n    from bug_gym.world import World\n    import bug_gym.task  # needs an extra\n    import json\n"
    )
    assert uncommented_lazy_imports(source) == ["line 2: bug_gym.world.World"]
