"""What lands in the wheel, what an import loads, and which names the package takes."""

import json
import os
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
import yaml

import bug_gym
from bug_gym.files import released

ROOT = Path(__file__).resolve().parents[1]
WHO = ("-c", "user.name=nobody", "-c", "user.email=nobody@example.org")
HEAVY = ["torch", "stable_baselines3", "pygame", "matplotlib", "onnxruntime", "ray"]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the wheel and the sdist, built from a copy: a stale build/ beside it would hide a lost file.

    The copy is a checkout with the tag of a release, whose sdist holds what git knows.
    """
    checkout = tmp_path_factory.mktemp("checkout")
    for path in ROOT.iterdir():
        if path.is_file() and path.name != ".git":  # a file in a second work tree
            shutil.copy(path, checkout)
    for name in ("bug_gym", "agents", "configs"):
        shutil.copytree(ROOT / name, checkout / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("docs", "notebooks", "ros", "tests", ".ci", ".github"):
        (checkout / name).mkdir()
        (checkout / name / "file.txt").touch()
    for arguments in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "All"], ["tag", "v3.1.4"]):
        subprocess.run(["git", *WHO, *arguments], cwd=checkout, check=True)
    command = [sys.executable, "-m", "build", "--wheel", "--sdist", "--no-isolation", str(checkout)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    (checkout / "dist" / "log.txt").write_text(run.stdout + run.stderr, encoding="utf-8")
    return checkout / "dist"


@pytest.fixture(scope="module")
def wheel(built: Path) -> zipfile.ZipFile:
    return zipfile.ZipFile(next(built.glob("*.whl")))


def shipped_files() -> set[str]:
    """The files of the checkout that belong into a wheel."""
    own = (ROOT / "bug_gym").rglob("*.py")  # agents and configs are links, which it leaves out
    files = {path.relative_to(ROOT).as_posix() for path in own} | {"bug_gym/py.typed"}
    files |= {"bug_gym/evaluation/reference_returns.json"}
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


def test_the_sdist_holds_what_the_wheel_holds_and_no_second_copy(built: Path) -> None:
    with tarfile.open(next(built.glob("*.tar.gz"))) as sdist:
        names = {member.name.split("/", 1)[1] for member in sdist if member.isfile()}
    assert shipped_files() <= names
    assert {name.split("/")[0] for name in names if "/" in name} == {"bug_gym", "bug_gym.egg-info"}
    assert {name for name in names if name.startswith("bug_gym/")} == shipped_files()


def test_nothing_is_warned_of_while_it_is_built(built: Path) -> None:
    told = (built / "log.txt").read_text(encoding="utf-8")
    told = re.sub(r"(?m)^warning: .*byte-compiling is disabled, skipping.*$", "", told)  # PYTHONDONTWRITEBYTECODE
    assert not re.findall(
        r"(?im)^.*(?:warning|deprecat|is absent from).*$", re.sub(r"(?m)^(?:adding|copying) .*$", "", told)
    )


def test_a_tag_is_the_version(built: Path) -> None:
    assert {path.name for path in built.iterdir() if path.suffix != ".txt"} == {
        "bug_gym-3.1.4-py3-none-any.whl",
        "bug_gym-3.1.4.tar.gz",
    }


def test_the_page_on_the_index_leads_to_the_commit_that_was_built_and_keeps_the_version_of_its_tag(
    tmp_path: Path,
) -> None:
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path)
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("_build", "results", "worlds"))
    for arguments in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "All"], ["tag", "v3.1.4"]):
        subprocess.run(["git", *WHO, *arguments], cwd=tmp_path, check=True)
    release = yaml.safe_load((ROOT / ".github" / "workflows" / "release.yml").read_text(encoding="utf-8"))
    (step,) = [one["run"] for one in release["jobs"]["build"]["steps"] if "absolute_links.py" in one.get("run", "")]
    told = {"GITHUB_SERVER_URL": "https://example.org", "GITHUB_REPOSITORY": "who/what", "GITHUB_SHA": "0" * 40}
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    subprocess.run(["bash", "-e", "-c", step], cwd=tmp_path, env={**os.environ, **told, "PATH": path}, check=True)
    text, before = ((where / "README.md").read_text(encoding="utf-8") for where in (tmp_path, ROOT))
    assert f"](https://example.org/who/what/raw/{'0' * 40}/docs/gallery.gif)" in text
    assert f"](https://example.org/who/what/blob/{'0' * 40}/docs/README.md#guide)" in text
    assert "](LICENSE)" not in text and not re.findall(r"\]\(docs/[^)]*(?:png|gif)\)", text)
    assert re.sub(r"https://example.org/who/what/(?:raw|blob)/0{40}/", "", text) == before
    said = subprocess.run(
        [sys.executable, "-m", "setuptools_scm"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert said.stdout.strip() == "3.1.4"


@pytest.mark.parametrize(
    ("server", "opens"),
    [("https://github.com", "https://colab.research.google.com/github"), ("https://example.org",) * 2],
)
def test_the_button_of_colab_opens_the_notebook_of_the_commit_where_colab_can(
    server: str, opens: str, tmp_path: Path
) -> None:
    for name in ("README.md", "LICENSE", "notebooks/colab.ipynb"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    page = tmp_path / "README.md"
    script = ROOT / "docs" / "absolute_links.py"
    subprocess.run([sys.executable, str(script), str(page), f"{server}/who/what", "abc"], check=True)
    text = page.read_text(encoding="utf-8")
    assert f"colab-badge.svg)]({opens}/who/what/blob/abc/notebooks/colab.ipynb)" in text
    assert f"[Colab]({server}/who/what/blob/abc/notebooks/colab.ipynb)" in text
    assert f"license-MIT-blue)]({server}/who/what/blob/abc/LICENSE)" in text


@pytest.mark.parametrize("has_git", [True, False])
def test_without_tags_it_is_a_version_before_the_first(has_git: bool, tmp_path: Path) -> None:
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    if has_git:
        for arguments in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "All"]):
            subprocess.run(["git", *WHO, *arguments], cwd=tmp_path, check=True)
    said = subprocess.run(
        [sys.executable, "-m", "setuptools_scm"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    found = said.stdout.strip()
    assert re.fullmatch(r"0\.1\.0\.dev1\+g[0-9a-f]+(?:\.d\d+)?" if has_git else r"0\.1\.0\.dev0", found)
    assert released(found) == "0.1.0"


def test_the_package_knows_its_version_by_its_metadata(tmp_path: Path) -> None:
    assert version_of(tmp_path, "4.0.0.dev3+gabc") == "4.0.0.dev3+gabc"


def test_what_was_never_installed_says_the_version_of_sources_without_git(tmp_path: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert version_of(tmp_path, None) == project["tool"]["setuptools_scm"]["fallback_version"]


def version_of(folder: Path, metadata: str | None) -> str:
    """What the package says that it is, where its metadata say this, or are not there."""
    script = "import importlib.metadata as m, sys\n"
    script += "def version(name, tell=m.version):\n"
    script += "    if name != 'bug-gym': return tell(name)\n"
    script += f"    if {metadata!r}: return {metadata!r}\n"
    script += "    raise m.PackageNotFoundError(name)\n"
    script += f"m.version = version; sys.path.insert(0, {str(ROOT)!r}); import bug_gym; print(bug_gym.__version__)"
    run = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=True)
    return run.stdout.strip()


@pytest.mark.parametrize(
    ("version", "compared"),
    [
        ("0.1.0", "0.1.0"),
        ("0.1.0.dev0", "0.1.0"),
        ("0.1.0.dev618+g011db4d.d20260101", "0.1.0"),
        ("0.2.0+local", "0.2.0"),
        ("0.2.0rc1", "0.2.0rc1"),
        ("0.2.0rc2.dev1+gabc", "0.2.0rc2"),
    ],
)
def test_results_of_a_release_and_of_the_commits_before_it_are_compared(version: str, compared: str) -> None:
    assert released(version) == compared


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


def test_the_source_has_one_digest_wherever_it_lies_and_another_once_it_is_edited(
    built: Path, wheel: zipfile.ZipFile, tmp_path: Path
) -> None:
    def digest(folder: Path) -> str:
        script = "from bug_gym.references import source_digest; print(source_digest())"
        run = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stderr
        return run.stdout

    wheel.extractall(tmp_path)
    expected, package = digest(built.parent), tmp_path / "bug_gym"  # there with two links, here without
    assert digest(tmp_path) == expected
    for path in [*package.rglob("*.py"), *package.rglob("*.yaml"), *package.rglob("*.json")]:
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))  # as git checks out on Windows
    for name in ("bugs/notes.md", "bugs/.#bug2.py", "bugs/.ipynb_checkpoints/bug2.py", "__pycache__/x.py"):
        (package / "agents" / name).parent.mkdir(exist_ok=True)
        (package / "agents" / name).write_text("x = 1")
    assert digest(tmp_path) == expected
    for name in ("agents/bugs/bug2.py", "configs/scenarios/static.yaml", "agents/trained/ppo_static/config.json"):
        with (package / name).open("a", encoding="utf-8") as file:
            file.write("\n")
        before, expected = expected, digest(tmp_path)
        assert expected != before, name


def test_importing_the_package_loads_nothing_heavy() -> None:
    script = f"import json, sys, bug_gym; print(json.dumps([name for name in {HEAVY} if name in sys.modules]))"
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == []


def test_no_module_bears_the_name_of_a_public_function() -> None:
    modules = {module.name for module in pkgutil.iter_modules(bug_gym.__path__)}
    assert not modules & set(bug_gym.__all__)


def test_names_that_are_imported_on_first_use_are_listed_before() -> None:
    script = "import json, bug_gym; print(json.dumps(dir(bug_gym)))"
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    names = json.loads(run.stdout)
    assert {*bug_gym.__all__, "register_envs", "__doc__"} <= {*names}
    assert len(names) == len({*names})


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
