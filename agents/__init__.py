"""The table of agents, and `make_policy`.

To add a scripted policy: one file in the folder of its kind with a ScriptedPolicy and its `Parameters`, one line in
AGENTS; the tests that run over the table cover it then. Policies from outside need neither: see bug_gym.agents.outside.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
import inspect
import logging
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from bug_gym.agents.model_places import model_digest
from bug_gym.agents.outside import (
    GROUP,
    Spec,
    imported_class,
    is_object,
    known_by,
    offered_class,
    require_constructor,
    require_memory,
    required_policy,
)
from bug_gym.agents.parameters import Parameter, checked_parameters, parameter_names, parameters_of
from bug_gym.agents.sight import require_sight
from bug_gym.checks import shortened
from bug_gym.naming import nearest_hint
from bug_gym.policy import (
    MisfitError,
    Policy,
    ScriptedPolicy,
    is_discrete,
    require_own_spaces,
    source_scenario,
    space_of,
)
from bug_gym.references import from_anywhere, is_reference, reference_of
from bug_gym.team_policy import EachAlone, PeersAsMovers, TeamPolicy, agents_of, without_peers
from bug_gym.view import Sensors

__all__ = [
    "AGENTS",
    "TEAMS",
    "Agent",
    "Spec",
    "agent",
    "is_scripted",
    "known_agents",
    "make_policy",
    "model_digest",
    "outside_reference",
    "parameter_names",
    "parameters_table",
    "playable_names",
    "policy_names",
    "reads_map",
    "register",
    "team_names",
]

logger = logging.getLogger("bug_gym")

NAME = re.compile(r"[A-Za-z_][\w-]*")
"""Names that policies can have."""


class Agent(NamedTuple):
    """One line of the table."""

    entry_point: str
    """ "module:Class", the module in this folder; of one from outside, as `register` takes it."""
    family: str
    """What kind of algorithm it is."""
    reference: str
    """Where it comes from."""
    privileged: bool = False
    """Whether it reads the world's map."""
    model: str = ""
    """Folder of agents/trained that it plays, of one that does."""


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
    "hd_bug_map": Agent("hd_bug_map.policy:HDBugMap", "mapper", "this package"),
    "navigator": Agent("navigator.policy:Navigator", "mapper", "this package", model="ppo_mixed"),
    "bfs": Agent("planning.bfs:BFS", "planner", "Moore 1959", privileged=True),
    "dijkstra": Agent("planning.dijkstra:Dijkstra", "planner", "Dijkstra 1959", privileged=True),
    "a_star": Agent("planning.a_star:AStar", "planner", "Hart, Nilsson and Raphael 1968", privileged=True),
    "bidirectional_a_star": Agent(
        "planning.bidirectional_a_star:BidirectionalAStar", "planner", "Pijls and Post 2009", privileged=True
    ),
    "d_star": Agent("planning.d_star:DStarPlanner", "planner", "Stentz 1994", privileged=True),
    "d_star_lite": Agent(
        "planning.d_star_lite:DStarLitePlanner", "planner", "Koenig and Likhachev 2005", privileged=True
    ),
    "theta_star": Agent(
        "planning.theta_star:ThetaStar", "planner", "Nash, Daniel, Koenig and Felner 2007", privileged=True
    ),
    "rrt_star": Agent(
        "planning.rrt_star:RRTStar", "planner", "Karaman and Frazzoli 2011; Gammell et al. 2014", privileged=True
    ),
    "visibility_graph": Agent(
        "planning.visibility_graph:VisibilityGraph", "planner", "Lozano-Perez and Wesley 1979", privileged=True
    ),
    "velocity_obstacle": Agent("local.velocity_obstacle:VelocityObstacle", "local", "Fiorini and Shiller 1998"),
    "dwa": Agent("local.dwa:DWA", "local", "Fox, Burgard and Thrun 1997"),
    "mppi": Agent("local.mppi:MPPI", "local", "Williams et al. 2017"),
    "d2t_eaco": Agent("planning.d2t_eaco:D2TEaco", "planner", "Sellers et al. 2026", privileged=True),
    "d2t_dijkstra": Agent("planning.d2t_dijkstra:D2TDijkstra", "planner", "Sellers et al. 2026", privileged=True),
    "orca": Agent("reciprocal.orca:Orca", "reciprocal", "van den Berg et al. 2011"),
    "critical_point_bug": Agent("bugs.critical_point_bug:CriticalPointBug", "bug", "Dutta et al. 2016"),
    "modified_critical_point_bug": Agent(
        "bugs.modified_critical_point_bug:ModifiedCriticalPointBug", "bug", "Das, Dutta and Debnath 2020"
    ),
    "operative_critical_point_bug": Agent(
        "bugs.operative_critical_point_bug:OperativeCriticalPointBug", "bug", "Das, Dutta and Debnath 2020"
    ),
    "ocpb": Agent("bugs.operative_critical_point_bug:OperativeCriticalPointBug", "bug", "Das, Dutta and Debnath 2020"),
    "apf": Agent("potential_field.apf:Apf", "field", "Ge and Cui 2002"),
    "apf_wall_following": Agent("potential_field.apf_wall_following:ApfWallFollowing", "bug", "after Ge and Cui 2002"),
    "minimum_risk": Agent("potential_field.minimum_risk:MinimumRisk", "field", "Wang and Liu 2008"),
}
LEARNED = {
    "ppo_static": "Schulman et al. 2017",
    "ppo_dynamic": "Schulman et al. 2017",
    "ppo_moving_target": "Schulman et al. 2017",
    "ppo_rush": "Schulman et al. 2017",
    "ppo_mixed": "Schulman et al. 2017",
    "ppo_crossing_robots": "Schulman et al. 2017",
    "sac_dynamic": "Haarnoja et al. 2018",
    "dqn_candidates": "Mnih et al. 2015",
}
"""Reference of each shipped model of agents/trained."""
AGENTS |= {
    name: Agent("learning.play:LearnedPolicy", "learned", source, model=name) for name, source in LEARNED.items()
}

TEAMS: dict[str, Agent] = {
    "com1_rev3": Agent("teams.com1_rev3:Com1Rev3", "team", "Oni and Wang"),
    "bug1_pair": Agent("teams.bug1_pair:Bug1Pair", "team", "Kandathil et al. 2020"),
    "swarm_com": Agent("teams.swarm:SwarmCom", "team", "Johansson and Markdahl 2023"),
    "swarm_bug1": Agent("teams.swarm:SwarmBug1", "team", "Johansson and Markdahl 2023"),
    "swarm_bug2": Agent("teams.swarm:SwarmBug2", "team", "Johansson and Markdahl 2023"),
}
"""Teams, which drive several robots of one world."""


CARELESS = ("floor", "learned")
"""Families of the table of which nobody asks whether they see enough to keep clear of things."""

REGISTERED: dict[str, Agent] = {}
"""Policies from outside that this process has registered."""


def register(name: str, reference: str, *, family: str = "from outside") -> None:
    """Give a policy from outside a name that `make_policy`, evaluations and the lists know.

    It holds for this process, and for the workers of its evaluations. A package that is installed offers its policies to
    all by entry points of the group `bug_gym.policies`. Registering the same again changes nothing, and what is refused
    leaves the name free.

    Args:
        name: letters, digits, `_` and `-`.
        reference: "module:Class", or "file.py:Class", which is imported now.
        family: what kind of algorithm lists call it.

    Raises:
        ValueError: the name cannot be one or is taken, or the reference is none, or leads to no policy's class.
        ImportError: its module imports another one that is missing.
    """
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ValueError(
            f"got {shortened(name)} as the name of a policy, expected letters, digits, _ and -, such as 'my_bug'"
        )
    if not isinstance(reference, str) or not is_reference(reference):
        raise ValueError(
            f"policy {shortened(name)}: got {shortened(reference)}, expected text such as 'my_module:MyBug'"
        )
    if not isinstance(family, str):
        raise ValueError(f"policy {shortened(name)}: got {shortened(family)} as its family, expected text")
    line = Agent(from_anywhere(reference), family, "-")
    taken = known_agents().get(name)
    if taken is not None and REGISTERED.get(name) != line:
        raise ValueError(f"the name {shortened(name)} is taken, by {taken.entry_point}: choose another one")
    require_constructor(imported_class(line.entry_point), f"policy {name!r}", ["discrete"], whole=False)
    REGISTERED[name] = line


@functools.cache
def _installed() -> dict[str, Agent]:
    """Policies of installed packages, by their entry points; one is left out with a word whose name is taken or is none."""
    found: dict[str, Agent] = {}
    for point in importlib.metadata.entry_points(group=GROUP):
        package = point.dist.name if point.dist else "?"
        if not is_reference(point.value):
            reason = "names no module:Class"
        elif not NAME.fullmatch(point.name):
            reason = "has a name that cannot be one, expected letters, digits, _ and -"
        elif point.name in AGENTS | TEAMS | found:
            reason = "has a name that is taken"
        else:
            found[point.name] = Agent(point.value, "from outside", f"package {package}")
            continue
        logger.warning("policy %r of package %s is left out: %r %s", point.name, package, point.value, reason)
    return found


def known_agents() -> dict[str, Agent]:
    """All lines by name: the package's, its teams, those of installed packages and those that are registered."""
    return AGENTS | TEAMS | _installed() | REGISTERED


def policy_names() -> list[str]:
    """Names of single robots' policies that `make_policy` takes; those of teams are `team_names()`."""
    return [name for name in known_agents() if name not in TEAMS]


def team_names() -> list[str]:
    """Names of teams that `make_policy` takes for several robots."""
    return list(TEAMS)


def playable_names() -> list[str]:
    """Names of `policy_names()` that can be made here: learned ones need onnxruntime, of the extra `play`.

    One of an installed package that cannot be imported, or not be made of sensors alone, is left out with a word.
    """
    can_play = importlib.util.find_spec("onnxruntime") is not None
    return [name for name in policy_names() if (can_play or not agent(name).model) and not _is_broken(name)]


def _is_broken(name: str) -> bool:
    """Whether an installed package offers a policy that cannot be imported or made; tells which and why."""
    line = _installed().get(name)
    if line is None:
        return False
    try:
        offered = offered_class(name, line.reference, line.entry_point)
        require_constructor(offered, f"policy {name!r} of {line.reference}", ["discrete"])
    except (ValueError, ImportError) as error:
        logger.warning("%s; it is left out", error)
        return True
    return False


def agent(name: str) -> Agent:
    """The line of the table under a name.

    Raises:
        ValueError: no such policy; the message offers the nearest names.
    """
    known = known_agents()
    if name not in known:
        hint = nearest_hint(name, known, count=3, cutoff=0.4, separator=";")
        raise ValueError(f"unknown policy {shortened(name)}{hint} (known: {', '.join(known)})")
    return known[name]


def outside_reference(name: str) -> str:
    """Where the class of a policy from outside is found, as any process can; "" for the package's own."""
    if is_reference(name):
        return from_anywhere(name)
    lines = _installed() | REGISTERED
    return lines[name].entry_point if name in lines else ""


known_by[:] = [outside_reference]


def make_policy(name: Any, source: Any, /, **parameters: Any) -> Policy:
    """Make a policy for a robot, or for several robots of one world.

    Args:
        name: one of `policy_names()`, or of `team_names()` for several robots, each also with its parameters as the
            command line has them (`bug2:turn=right`); a class of policies, or "module:Class" or "file.py:Class", which is
            imported; a policy that is made already; or the path of a folder that `bug-gym train` wrote, or
            `hf://user/name` for one on the Hugging Face Hub; or of a zip that stable-baselines3 wrote, which takes
            `trust=True`: it is a pickle and can run any code. A Spec holds any of them with its parameters.
        source: an env of any face, a Simulation, or a Scenario (or its name, path or dict). The policy learns what a
            driver of that robot would know (kinematics, body, limits, beams, range, step), never the world. For
            PettingZoo's envs, and Scenarios, of several robots it takes and gives what is by agent, too; a single
            robot's policy then drives each of them by itself. Privileged ones read the world's map as an episode
            begins: they take an env or a Simulation only.
        **parameters: the algorithm's own, see its class.

    Raises:
        ValueError: an unknown policy or parameter, a parameter's value that cannot be, a learned policy (or an object)
            that was made for another robot, a robot that a scripted policy is shown too little to drive
            (bug_gym.agents.sight), or a privileged one and no live env; what is named from outside is not there, or no policy.
        ImportError: a learned policy, and onnxruntime (for a zip stable-baselines3) is not installed.
    """
    spec = Spec.of(name)
    parameters = spec.options | parameters
    if is_object(spec.name):
        return _made_already(spec.name, source, parameters)
    policy_class, fixed = _entry(spec.name)
    told = f"policy {_told(spec.name)!r}"
    _require_known(parameters, [key for key in parameter_names(policy_class) if key not in fixed], told)
    scenario = source_scenario(source)
    require_own_spaces(source, told)
    sensors, agents = Sensors.of(scenario), agents_of(source)
    _require_turning(policy_class, sensors, told)
    own = checked_parameters(policy_class, parameters, f"{told}: ")
    is_team = issubclass(policy_class, TeamPolicy)
    require_constructor(policy_class, told, ["discrete", *fixed, *own, *(["agents"] if is_team else [])])
    if is_team:
        _require_one_start(source, told)
        robots = agents or tuple(f"robot_{number}" for number in range(scenario.robots.count))
        policy: Policy = policy_class(sensors, agents=robots, discrete=is_discrete(source), **own)
    else:
        if _takes_maps(policy_class, spec.name, own):
            from bug_gym.agents.planning.live import Maps  # SciPy and shapely, slow to load

            fixed = {**fixed, "maps": Maps.of(source, _told(spec.name))}
        policy = _for_robot(policy_class, sensors, discrete=is_discrete(source), **fixed, **own)
        if isinstance(spec.name, type) or outside_reference(str(spec.name)):
            require_memory(policy, told)
    if _must_see(spec.name, policy):
        require_sight(scenario, told)  # after what the algorithm itself refuses, which knows more
    return EachAlone(policy, agents) if agents and not is_team else policy


def _require_turning(policy_class: type[Any], sensors: Sensors, told: str) -> None:
    """Refuse a robot that cannot turn on the spot to who needs that."""
    if sensors.drive.kinematics == "ackermann" and getattr(policy_class, "turns_on_the_spot", False):
        expected = "expected a holonomic or differential one"
        raise MisfitError(f"{told} turns on the spot, which an ackermann robot cannot: {expected}")


def _require_one_start(source: Any, told: str) -> None:
    """Refuse rows that begin anew one by one to a team, whose robots remember one another from a common start on."""
    if getattr(source, "restart", None) == "robot":
        raise MisfitError(f"{told} drives robots that start together: got restart='robot', expected restart='world'")


def _must_see(name: Any, policy: Policy) -> bool:
    """Whether a policy keeps clear of things by its scanner alone: one of the table that takes care and follows no map."""
    line = (AGENTS | TEAMS).get(name) if isinstance(name, str) else None
    return line is not None and line.family not in CARELESS and not getattr(policy, "keeps_to_map", False)


def _made_already(policy: Any, source: Any, parameters: Mapping[str, Any]) -> Policy:
    """A policy that somebody has made, for each robot of a source."""
    if parameters:
        raise ValueError(f"a policy that is made already takes no parameters, got {', '.join(parameters)}")
    single = policy.policy if isinstance(policy, EachAlone) else policy
    normalised = getattr(single, "get_vec_normalize_env", None)
    if callable(normalised) and (layer := normalised()) is not None and layer.norm_obs:
        raise ValueError(
            f"{type(single).__name__} was trained on observations that VecNormalize normalises, and would be asked about the "
            "env's own: expected an object whose predict normalises them first (`normalize_obs` of that VecNormalize)"
        )
    _require_own_robot(single, source)
    agents = agents_of(source)
    if _is_of_sb3(single) and (fitting := _fitting_model(single, source)) is not single:
        policy = EachAlone(fitting, policy.agents) if isinstance(policy, EachAlone) else fitting
    made: Policy = EachAlone(policy, agents) if agents and not isinstance(policy, (EachAlone, TeamPolicy)) else policy
    return made


def _require_own_robot(policy: Any, source: Any) -> None:
    """Refuse a policy that was made for another robot: what it desires would mean something else, or come too late."""
    sensors, told = getattr(policy, "sensors", None), type(policy).__name__
    if not isinstance(sensors, Sensors):
        return
    if differs := list(sensors.differences(Sensors.of(source_scenario(source)))):
        raise MisfitError(f"{told} was made for another robot: {'; '.join(differs)}")
    takes, gives = space_of(source, "action"), getattr(policy, "discrete", None)
    if takes is not None and gives is not None and gives is not is_discrete(source):
        kinds = {True: "numbers of discrete actions", False: "velocities"}
        raise MisfitError(f"{told} was made to answer with {kinds[gives]}, the env takes {kinds[not gives]}")


def _is_of_sb3(policy: Any) -> bool:
    """Whether an object is a model of stable-baselines3, or the policy of one, told without importing that."""
    return any(str(base.__module__).partition(".")[0] == "stable_baselines3" for base in type(policy).__mro__)


def _fitting_model(model: Any, source: Any) -> Policy:
    """A model of stable-baselines3 as it drives a robot of a source; refused in other spaces, as its zip would be.

    One trained alone drives among several robots as its zip does. Where wrappers change the spaces of an env it may have
    been trained in just these.
    """
    from bug_gym.agents.learning.robot_model import require_spaces  # loads pydantic models

    told, spaces = type(model).__name__, (model.observation_space, model.action_space)
    if spaces == (space_of(source, "observation"), space_of(source, "action")):
        return cast(Policy, model)
    require_own_spaces(source, told)

    def fitting(sensors: Sensors) -> Policy:
        require_spaces(told, *spaces, sensors)
        return cast(Policy, model)

    return _for_robot(fitting, Sensors.of(source_scenario(source)))


def _require_known(parameters: Mapping[str, Any], known: Sequence[str], told: str) -> None:
    """Refuse parameters that a policy does not have."""
    for key in parameters:
        if key not in known:
            hint = nearest_hint(key, known, cutoff=0.6)
            raise ValueError(f"{told} has no parameter {shortened(key)}{hint} (it has: {', '.join(known) or 'none'})")


def _told(name: Any) -> str:
    """What an error calls a policy."""
    return reference_of(name) if isinstance(name, type) else str(name)


def _for_robot(policy_class: Callable[..., Policy], sensors: Sensors, **parameters: Any) -> Policy:
    """A single robot's policy; a learned one that knows no peers sees those of several robots as movers only."""
    try:
        policy = policy_class(sensors, **parameters)
    except MisfitError as among_peers:
        alone = without_peers(sensors)
        if alone is sensors:
            raise
        try:
            return PeersAsMovers(policy_class(alone, **parameters), sensors)
        except MisfitError as by_itself:
            # Of two refusals the one with less to say: what it names has to change in any case.
            raise min(among_peers, by_itself, key=lambda error: len(str(error))) from None
    return policy


def reads_map(name: Any, parameters: Mapping[str, Any]) -> bool:
    """Whether a policy reads the world's map.

    With `known=False` one that can do without does not; with `privileged` one does that else would not.
    """
    if isinstance(name, str) and name in AGENTS:
        is_told = AGENTS[name].privileged or bool(parameters.get("privileged", False))
        return is_told and bool(parameters.get("known", True))
    if isinstance(name, type) or (isinstance(name, str) and outside_reference(name)):
        return bool(getattr(_entry(name)[0], "privileged", False)) and bool(parameters.get("known", True))
    return False


def is_scripted(name: Any) -> bool:
    """Whether a policy is a rule that decides for each robot by itself, from a name, a path or a class."""
    return issubclass(_entry(name)[0], ScriptedPolicy)


def _takes_maps(policy_class: type[Any], name: Any, parameters: Mapping[str, Any]) -> bool:
    """Whether a policy is given the maps of its env: map planners are, others that read a world find their own way."""
    return reads_map(name, parameters) and "maps" in inspect.signature(policy_class).parameters


def parameters_table() -> list[tuple[str, Parameter]]:
    """The parameters of all policies of the table that can be set: policy and parameter, one row each."""
    rows = []
    for name in AGENTS:
        policy_class, fixed = _entry(name)
        rows += [(name, own) for own in parameters_of(policy_class) if own.name not in fixed]
    return rows


def _entry(name: Any) -> tuple[type[Any], dict[str, Any]]:
    """The class behind a name, a path or a class, and the parameters that are fixed by it."""
    if isinstance(name, type):
        return required_policy(name, reference_of(name)), {}
    if not isinstance(name, (str, Path)):
        raise ValueError(
            f"a policy is named by text such as 'bug2', got {shortened(name)} (known: {', '.join(AGENTS)})"
        )
    text = str(name)
    if text.endswith(".zip"):
        return _imported("learning.play:ZipPolicy"), {"path": Path(name).expanduser()}
    if reference := outside_reference(text):
        place, colon, option = text.partition(":")
        if colon and place in known_agents():
            raise ValueError(f"policy {place!r}: got the parameter {option!r} without a value, expected {option}=VALUE")
        return _class_from_outside(text, reference), {}
    if text.endswith(".py"):
        raise ValueError(f"got {shortened(text)} as a policy, expected its class, too, such as {text}:MyBug")
    if text.startswith("hf://"):
        return _imported("learning.play:LearnedPolicy"), {"model": text}
    if isinstance(name, Path) or "/" in text or os.sep in text:
        return _imported("learning.play:LearnedPolicy"), {"model": Path(name).expanduser()}
    line = agent(text)
    return _imported(line.entry_point), {"model": line.model} if line.model else {}


def _class_from_outside(name: str, reference: str) -> type[Any]:
    """The class behind a name or reference from outside; an error names the package that offers it, where one does."""
    for offered, line in _installed().items():
        if name == offered or reference == line.entry_point:
            return offered_class(offered, line.reference, reference)
    return imported_class(reference)


def _imported(entry_point: str) -> type[Any]:
    """The class of a "module:Class"."""
    module, class_name = entry_point.split(":")
    policy_class: type[Any] = getattr(importlib.import_module(f".{module}", __name__), class_name)
    return policy_class
