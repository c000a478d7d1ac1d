"""The workflows of continuous integration are sound as far as it shows without running them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from try_wheel import EXTRAS

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = {path.name: path for path in sorted((ROOT / ".github" / "workflows").glob("*.y*ml"))}
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MINOR = "Programming Language :: Python :: 3."
GIVEN = {"RUNNER_TEMP", "GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_SHA"}
"""Variables that every workflow has."""
PYTHONS = [f"3.{line.removeprefix(MINOR)}" for line in PROJECT["classifiers"] if re.fullmatch(rf"{MINOR}\d+", line)]


def workflow(name: str) -> dict[Any, Any]:
    """What a workflow says."""
    read: dict[Any, Any] = yaml.safe_load(WORKFLOWS[name].read_text(encoding="utf-8"))
    return read


def steps(name: str) -> Iterator[dict[str, Any]]:
    """The steps of all jobs of a workflow."""
    for job in workflow(name)["jobs"].values():
        yield from job["steps"]


def commands(name: str) -> str:
    """All that a workflow runs."""
    return "\n".join(step["run"] for step in steps(name) if "run" in step)


def test_the_workflows_are_there() -> None:
    assert set(WORKFLOWS) == {"test.yml", "nightly.yml", "docs.yml", "release.yml"}


@pytest.mark.parametrize("name", WORKFLOWS)
def test_a_workflow_may_read_only_and_ends(name: str) -> None:
    said = workflow(name)
    assert said["permissions"] == {"contents": "read"}
    assert said[True]  # `on`, which YAML reads as a truth value
    for job in said["jobs"].values():
        assert job["timeout-minutes"] <= 90
        assert all(("run" in step) != ("uses" in step) for step in job["steps"])
        assert job["steps"] and "runs-on" in job


@pytest.mark.parametrize("name", WORKFLOWS)
def test_what_a_matrix_gives_is_used_and_what_is_used_is_given(name: str) -> None:
    for job in workflow(name)["jobs"].values():
        given = set(job.get("strategy", {}).get("matrix", {}))
        assert set(re.findall(r"matrix\.(\w+)", yaml.safe_dump(job))) == given


@pytest.mark.parametrize("job", ["wheel", "dependencies"])
def test_each_python_that_the_package_names_is_tried(job: str) -> None:
    assert workflow("test.yml")["jobs"][job]["strategy"]["matrix"]["python"] == PYTHONS
    assert len(PYTHONS) >= 3


def test_the_wheel_is_tried_on_each_system_from_a_checkout_with_links() -> None:
    job = workflow("test.yml")["jobs"]["wheel"]
    systems = {system.partition("-")[0] for system in job["strategy"]["matrix"]["os"]}
    assert systems == {"ubuntu", "macos", "windows"}
    first, second = job["steps"][:2]
    assert first["run"] == "git config --global core.symlinks true" and second["uses"].startswith("actions/checkout@")


def test_lowest_and_newest_dependencies_are_tried() -> None:
    matrix = workflow("test.yml")["jobs"]["dependencies"]["strategy"]["matrix"]
    assert matrix["resolution"] == ["lowest-direct", "highest"]


@pytest.mark.parametrize("name", WORKFLOWS)
def test_files_extras_and_variables_of_a_workflow_exist(name: str) -> None:
    said, run = workflow(name), commands(name)
    paths = re.findall(r"(?<![\w/])((?:tests|docs|\.ci)/[\w./]+)", f"{run} {said.get('env', {})}")
    assert not [path for path in paths if not (ROOT / path).exists()]
    extras = {extra for some in re.findall(r"\[([a-z,]+)\]", run) for extra in some.split(",")}
    assert extras <= set(PROJECT["optional-dependencies"]) and (extras or "matrix.extra" in run)
    variables = set(re.findall(r"\$([A-Z_]+)\b", run)) - GIVEN
    assert variables == set(said.get("env", {}))


def test_a_release_is_tried_with_each_extra_alone() -> None:
    extras = set(PROJECT["optional-dependencies"]) - {"all", "dev", "docs"}
    assert set(workflow("release.yml")["jobs"]["try"]["strategy"]["matrix"]["extra"]) == {"", *extras}
    assert set(EXTRAS) == {"", *extras}


def test_a_release_is_published_once_all_else_holds_without_a_token() -> None:
    said = workflow("release.yml")
    publish = said["jobs"]["publish"]
    assert set(publish["needs"]) == set(said["jobs"]) - {"publish"}
    assert publish["permissions"] == {"id-token": "write"} and "github.ref_type == 'tag'" in publish["if"]
    assert publish["steps"][-1]["uses"].startswith("pypa/gh-action-pypi-publish@")
    assert "secrets." not in WORKFLOWS["release.yml"].read_text(encoding="utf-8")
    others = [job for name, job in said["jobs"].items() if name != "publish"]
    assert not any("permissions" in job for job in others)
    checkout = said["jobs"]["build"]["steps"][0]
    assert checkout["with"]["fetch-depth"] == 0  # else there is no tag to count from
    assert "python -m build\n" in commands("release.yml") and "twine check --strict" in commands("release.yml")
