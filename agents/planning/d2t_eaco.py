"""D2T with eACO: cluster obstacles, triangulate the space between, ants pull the way taut, velocity obstacles follow it.

Source: Sellers, Lei, Luo, Bi and Jan (2026), the whole method; what was settled of each part stands in its file:
clustering, mesh, sleeve, ants, vo_follower. Sensing assumed: the map, what moves, own place; with `known=False` scan,
own place, goal, and then movers are avoided as what stands. Memory kept: the way; with `known=False` all scan points
seen. States: planning, following, waiting, and with `known=False` looking. Guarantee: reaches the goal in still
worlds or says that there is no way at all; with a horizon none, and none in a maze that is not known, where a way
that is rebuilt twice a second may change its mind again and again. Length: with "funnel" a few per mille over the
shortest; with ants some per cent more the longer the way is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from bug_gym.agents.parameters import AtMost
from bug_gym.agents.planning.ants import Colony, Evaporate
from bug_gym.agents.planning.d2t_planner import Count, D2TParameters, D2TPlanner
from bug_gym.agents.planning.triangulated import Optimiser


@dataclass(frozen=True)
class D2TEacoParameters(D2TParameters):
    """Parameters of d2t_eaco; those of the ants are the paper's."""

    optimiser: Literal["eaco", "eaco_refined", "aco", "funnel"] = "eaco"
    """What pulls the way taut: the paper's ants, these and golden sections, ants without Levy flights, or exactly."""
    alpha: Annotated[float, AtMost(100.0)] = 1.0
    """Exponent of the pheromone [-]."""
    beta: Annotated[float, AtMost(100.0)] = 2.0
    """Exponent of the heuristic [-]."""
    rho: Annotated[float, AtMost(1.0)] = 0.1
    """Share of the pheromone that evaporates [-]."""
    q0: Annotated[float, AtMost(1.0)] = 0.7
    """Chance that an ant takes the best value [-]."""
    levy_rate: Annotated[float, AtMost(1.0)] = 0.2
    """p_l: chance that a choice by lot is changed by Levy steps [-]."""
    levy_exponent: Annotated[float, AtMost(2.0)] = 1.5
    """beta_L, above 0 and at most 2 [-]."""
    levy_scale: Annotated[float, AtMost(1e6)] = 0.1
    """lambda: weight of a Levy step, beside 1 for the best value [-]."""
    ants: Count = 20
    """Ants of an iteration."""
    iterations: Count = 50
    """Iterations at most."""
    patience: Count = 15
    """Iterations without a shorter way that end it."""
    values: Annotated[int, AtMost(1001)] = 21
    """Values that a crossing may take."""
    evaporate: Evaporate = "best"
    """Where pheromone evaporates: on the best way, or on all."""
    seed: Annotated[int, AtMost(2**63 - 1)] = 0
    """What is drawn is a function of it."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed!r}")
        colony_of(self)


def colony_of(parameters: D2TEacoParameters) -> Colony:
    """The ants of some parameters."""
    return Colony(**{name: getattr(parameters, name) for name in Colony.__dataclass_fields__})


class D2TEaco(D2TPlanner):
    """The whole method."""

    Parameters = D2TEacoParameters
    parameters: D2TEacoParameters

    def _optimiser(self) -> Optimiser:
        return self.parameters.optimiser

    def _colony(self) -> Colony:
        return colony_of(self.parameters)

    def _seed(self) -> int:
        return self.parameters.seed
