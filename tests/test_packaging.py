"""What lands in the wheel, what an import loads, and which names the package takes."""

import json
import pkgutil
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import bug_gym

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ["torch", "stable_baselines3", "pygame", "matplotlib", "onnxruntime", "ray"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the wheel and the sdist, built from a copy: a stale build/ beside it would hide a lost file."""
    checkout = tmp_path_factory.mktemp("checkout")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, checkout)
    for name in ("bug_gym", "agents", "configs"):
        shutil.copytree(ROOT / name, checkout / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-m", "build", "--wheel", "--sdist", "--no-isolation", str(checkout)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return checkout / "dist"


@pytest.fixture(scope="module")
def wheel(built: Path) -> zipfile.ZipFile:
    return zipfile.ZipFile(next(built.glob("*.whl")))


def shipped_files() -> set[str]:
    """The files of the checkout that belong into a wheel."""
    own = (ROOT / "bug_gym").rglob("*.py")  # agents and configs are links, which it leaves out
    files = {path.relative_to(ROOT).as_posix() for path in own} | {"bug_gym/py.typed"}
    linked = [*ROOT.glob("agents/**/*.py"), *ROOT.glob("configs/**/*.yaml"), *ROOT.glob("agents/trained/**/*.*")]
    parts = [*(ROOT / "bug_gym" / "evaluation" / "page").glob("page.*"), *(ROOT / "bug_gym" / "replay").glob("*.*")]
    files |= {path.relative_to(ROOT).as_posix() for path in parts if path.suffix in (".css", ".html", ".js")}
    return files | {f"bug_gym/{path.relative_to(ROOT).as_posix()}" for path in linked}


def test_the_checkout_has_its_two_links() -> None:
    for name in ("agents", "configs"):
        link = ROOT / "bug_gym" / name
        assert link.resolve() == ROOT / name, f"{link} is no link: switch symlinks on in git, then check out again"


def test_the_wheel_holds_all_modules_and_settings_and_nothing_else(wheel: zipfile.ZipFile) -> None:
    assert {name for name in wheel.namelist() if ".dist-info/" not in name} == shipped_files()


def test_the_sdist_holds_what_the_wheel_holds(built: Path) -> None:
    with tarfile.open(next(built.glob("*.tar.gz"))) as sdist:
        names = {member.name.split("/", 1)[1] for member in sdist if member.isfile()}
    assert shipped_files() <= names


def test_the_wheel_bears_the_version_of_the_package(built: Path) -> None:
    assert next(built.glob("*.whl")).name.startswith(f"bug_gym-{bug_gym.__version__}-py3")


def test_the_wheel_installs_the_command(wheel: zipfile.ZipFile) -> None:
    entry_points = next(name for name in wheel.namelist() if name.endswith(".dist-info/entry_points.txt"))
    assert "bug-gym = bug_gym.cli:main" in wheel.read(entry_points).decode()


def test_the_unpacked_wheel_works_without_the_checkout(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    wheel.extractall(tmp_path)
    script = (
        "import bug_gym, gymnasium; from bug_gym.agents import policy_names;"
        "gymnasium.spec('BugGym/Navigation-v0'); assert policy_names(); print(bug_gym.__file__)"
    )
    run = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert Path(run.stdout.strip()).is_relative_to(tmp_path)


def test_importing_the_package_loads_nothing_heavy() -> None:
    script = f"import json, sys, bug_gym; print(json.dumps([name for name in {HEAVY} if name in sys.modules]))"
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == []


def test_no_module_bears_the_name_of_a_public_function() -> None:
    modules = {module.name for module in pkgutil.iter_modules(bug_gym.__path__)}
    assert not modules & set(bug_gym.__all__)


def test_every_dependency_has_its_locked_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    unlocked = {"all"}
    lines = [*project["dependencies"], *(line for name in extras.keys() - unlocked for line in extras[name])]
    locked = distributions((ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines())
    assert distributions(lines) <= locked


def distributions(lines: list[str]) -> set[str]:
    """The names that requirements begin with, in the one spelling that registries compare."""
    names = (re.match(r"[A-Za-z0-9][\w.-]*", line) for line in lines)
    return {re.sub(r"[-_.]+", "-", name[0]).lower() for name in names if name}
