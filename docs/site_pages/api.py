"""The pages of the API: what autodoc makes of the modules that are meant to be called."""

from __future__ import annotations

import importlib

from site_pages import Pages
from site_pages.markup import one_line, paragraphs, table, toctree

MODULES: dict[str, tuple[str, ...]] = {
    "Environments": (
        "bug_gym",
        "bug_gym.navigation_env",
        "bug_gym.vector_env",
        "bug_gym.robots_env",
        "bug_gym.agents.sb3",
    ),
    "Scenarios": ("bug_gym.config", "bug_gym.schema.robot", "bug_gym.schema.task", "bug_gym.schema.motions"),
    "Policies": (
        "bug_gym.agents",
        "bug_gym.policy",
        "bug_gym.team_policy",
        "bug_gym.view",
        "bug_gym.agents.parameters",
    ),
    "Evaluation": (
        "bug_gym.evaluation",
        "bug_gym.evaluation.entries",
        "bug_gym.evaluation.rows",
        "bug_gym.evaluation.summary",
        "bug_gym.evaluation.two_folders",
        "bug_gym.evaluation.collection",
        "bug_gym.intervals",
    ),
    "The core": (
        "bug_gym.simulation",
        "bug_gym.observation",
        "bug_gym.task",
        "bug_gym.spaces",
        "bug_gym.shortest_path",
    ),
    "Pictures": ("bug_gym.drawing.canvas", "bug_gym.drawing.clips", "bug_gym.evaluation.pictures"),
}
"""The public modules, by what they are for."""


FEW: dict[str, tuple[str, ...]] = {
    "bug_gym": ("register_envs",),
    "bug_gym.config": ("load", "dump", "to_yaml", "expanded", "scenario_names", "Scenario", "ScenarioError"),
    "bug_gym.evaluation": ("evaluate",),
}
"""Modules that pass on what others hold -> what is shown of them."""


def pages() -> Pages:
    """A page a module, and the list of them."""
    made = {f"api/{name}.md": page(name) for names in MODULES.values() for name in names}
    return {"api/index.md": index(), **made}


def said_of(name: str) -> str:
    """The first sentence of a module's docstring."""
    return one_line(str(importlib.import_module(name).__doc__).partition("\n\n")[0])


def index() -> str:
    """The modules by what they are for."""
    parts = ["# API", "From the docstrings. What is not listed here may change without a word."]
    for title, names in MODULES.items():
        rows = [[f"[`{name}`]({name}.md)", said_of(name)] for name in names]
        parts.append(f"## {title}\n\n{table(['module', 'what it does'], rows)}")
    return paragraphs(*parts, toctree(name for names in MODULES.values() for name in names))


def page(name: str) -> str:
    """The page of a module."""
    members = ", ".join(FEW.get(name, ()))
    directive = f".. automodule:: {name}\n   :members: {members}\n   :show-inheritance:\n"
    return f"# `{name}`\n\n```{{eval-rst}}\n{directive}```\n"
