"""The table of agents, and `make_policy`.

To add a scripted policy: one file in the folder of its kind with a ScriptedPolicy and its `Parameters`, one line in
AGENTS; the tests that run over the table cover it then.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
from pathlib import Path
from typing import Any, NamedTuple

from bug_gym.agents.parameters import Parameter, checked_parameters, parameter_names, parameters_of
from bug_gym.naming import nearest_hint
from bug_gym.policy import Policy, is_discrete, source_scenario
from bug_gym.view import Sensors


class Agent(NamedTuple):
    """One line of the table."""

    entry_point: str
    """ "module:Class", the module in this folder."""
    family: str
    """What kind of algorithm it is."""
    reference: str
    """Where it comes from."""
    privileged: bool = False
    """Whether it reads the world's map."""
    model: str = ""
    """Folder of agents/trained that it plays, of a learned one."""


AGENTS: dict[str, Agent] = {
    "random": Agent("floors.random:Random", "floor", "-"),
    "go_to_goal": Agent("floors.go_to_goal:GoToGoal", "floor", "-"),
    "bug0": Agent("bugs.bug0:Bug0", "bug", "Lumelsky and Stepanov 1986"),
    "com": Agent("bugs.bug0:Bug0", "bug", "Lumelsky and Stepanov 1986; Sankaranarayanan and Vidyasagar 1990"),
    "bug0_plus": Agent("bugs.bug0_plus:Bug0Plus", "bug", "Oni and Wang"),
    "bug1": Agent("bugs.bug1:Bug1", "bug", "Lumelsky and Stepanov 1987"),
    "bug2": Agent("bugs.bug2:Bug2", "bug", "Lumelsky and Stepanov 1987"),
    "com1": Agent("bugs.com1:Com1", "bug", "Sankaranarayanan and Vidyasagar 1990"),
    "class1": Agent("bugs.class1:Class1", "bug", "Noborio 1992"),
    "alg1": Agent("bugs.alg1:Alg1", "bug", "Sankaranarayanan and Vidyasagar 1990"),
    "alg2": Agent("bugs.alg2:Alg2", "bug", "Sankaranarayanan and Vidyasagar 1990"),
    "rev1": Agent("bugs.rev1:Rev1", "bug", "Horiuchi and Noborio 2001"),
    "rev2": Agent("bugs.rev2:Rev2", "bug", "McGuire et al. 2019; Horiuchi and Noborio 2001"),
    "rev3": Agent("bugs.rev3:Rev3", "bug", "Oni and Wang"),
    "vis_bug_21": Agent("bugs.vis_bug_21:VisBug21", "bug", "Lumelsky and Skewis 1990"),
    "vis_bug_22": Agent("bugs.vis_bug_22:VisBug22", "bug", "Lumelsky and Skewis 1990"),
    "dist_bug": Agent("bugs.dist_bug:DistBug", "bug", "Kamon and Rivlin 1997"),
    "tangent_bug": Agent("bugs.tangent_bug:TangentBug", "bug", "Kamon, Rimon and Rivlin 1998"),
    "point_bug": Agent("bugs.point_bug:PointBug", "bug", "Buniyamin et al. 2011"),
    "k_bug": Agent("bugs.k_bug:KBug", "bug", "Langer et al. 2007"),
    "e_bug": Agent("bugs.e_bug:EBug", "bug", "Meddah and Dib 2015"),
    "hd_bug": Agent("hd_bug.policy:HDBug", "bug", "Hasibuzzaman, Jan and Wu"),
    "critical_point_bug": Agent("bugs.critical_point_bug:CriticalPointBug", "bug", "Dutta et al. 2016"),
    "modified_critical_point_bug": Agent(
        "bugs.modified_critical_point_bug:ModifiedCriticalPointBug", "bug", "Das, Dutta and Debnath 2020"
    ),
    "operative_critical_point_bug": Agent(
        "bugs.operative_critical_point_bug:OperativeCriticalPointBug", "bug", "Das, Dutta and Debnath 2020"
    ),
    "ocpb": Agent("bugs.operative_critical_point_bug:OperativeCriticalPointBug", "bug", "Das, Dutta and Debnath 2020"),
}
LEARNED = {
    "ppo_static": "Schulman et al. 2017",
    "ppo_dynamic": "Schulman et al. 2017",
    "ppo_moving_target": "Schulman et al. 2017",
    "ppo_rush": "Schulman et al. 2017",
    "ppo_mixed": "Schulman et al. 2017",
    "sac_dynamic": "Haarnoja et al. 2018",
    "dqn_candidates": "Mnih et al. 2015",
}
"""Reference of each shipped model of agents/trained."""
AGENTS |= {
    name: Agent("learning.play:LearnedPolicy", "learned", source, model=name) for name, source in LEARNED.items()
}


def policy_names() -> list[str]:
    """Names that `make_policy` takes."""
    return list(AGENTS)


def playable_names() -> list[str]:
    """Names of `policy_names()` whose packages are installed: learned ones need onnxruntime, of the extra `play`."""
    can_play = importlib.util.find_spec("onnxruntime") is not None
    return [name for name, line in AGENTS.items() if can_play or not line.model]


def agent(name: str) -> Agent:
    """The line of the table under a name.

    Raises:
        ValueError: no such policy; the message offers the nearest names.
    """
    if name not in AGENTS:
        hint = nearest_hint(name, AGENTS, count=3, cutoff=0.4, separator=";")
        raise ValueError(f"unknown policy {name!r}{hint} (known: {', '.join(AGENTS)})")
    return AGENTS[name]


def make_policy(name: str, source: Any, /, **parameters: Any) -> Policy:
    """Make a policy for a robot.

    Args:
        name: one of `policy_names()`; or the path of a folder that `bug-gym train` wrote, or of a zip that
            stable-baselines3 wrote, which takes `trust=True`: it is a pickle and can run any code.
        source: an env of any face, a Simulation, or a Scenario (or its name, path or dict). The policy learns what a
            driver of that robot would know (kinematics, body, limits, beams, range, step), never the world.
        **parameters: the algorithm's own, see its class.

    Raises:
        ValueError: an unknown policy or parameter, a parameter's value that cannot be, or a learned policy that was
            made for another robot.
        ImportError: a learned policy, and onnxruntime (for a zip stable-baselines3) is not installed.
    """
    policy_class, fixed = _entry(name)
    known = [key for key in parameter_names(policy_class) if key not in fixed]
    for key in parameters:
        if key not in known:
            hint = nearest_hint(key, known, cutoff=0.6)
            raise ValueError(f"policy {name!r} has no parameter {key!r}{hint} (it has: {', '.join(known) or 'none'})")
    sensors = Sensors.of(source_scenario(source))
    own = checked_parameters(policy_class, parameters, f"policy {name!r}: ")
    policy: Policy = policy_class(sensors, discrete=is_discrete(source), **fixed, **own)
    return policy


def parameters_table() -> list[tuple[str, Parameter]]:
    """The parameters of all policies of the table that can be set: policy and parameter, one row each."""
    rows = []
    for name in AGENTS:
        policy_class, fixed = _entry(name)
        rows += [(name, own) for own in parameters_of(policy_class) if own.name not in fixed]
    return rows


def _entry(name: str) -> tuple[type[Any], dict[str, Any]]:
    """The class behind a name or path, and the parameters that are fixed by it."""
    if not isinstance(name, str):
        raise ValueError(f"a policy is named by text such as 'bug2', got {name!r} (known: {', '.join(AGENTS)})")
    if name.endswith(".zip"):
        return _imported("learning.play:ZipPolicy"), {"path": Path(name).expanduser()}
    if "/" in name or os.sep in name:
        return _imported("learning.play:LearnedPolicy"), {"model": Path(name).expanduser()}
    line = agent(name)
    return _imported(line.entry_point), {"model": line.model} if line.model else {}


def _imported(entry_point: str) -> type[Any]:
    """The class of a "module:Class"."""
    module, class_name = entry_point.split(":")
    policy_class: type[Any] = getattr(importlib.import_module(f".{module}", __name__), class_name)
    return policy_class
