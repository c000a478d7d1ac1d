"""Where to cross the edges of a sleeve: an ant colony with Levy flights, and what it is compared with.

Source: Sellers et al. 2026, section 4, equations 4 to 9, Algorithm 3 and Table 1 (eACO). What the paper leaves open is
settled so:

- each share gamma is one of 21 values; pheromone lies on them, at first 1 / length of the way through the middles;
- what draws an ant to a value is 1 / (way to it from where the ant is + straight way from it to the goal);
- the weights of a choice are scaled so that the largest is 1 before lambda times a Levy step is added; each value has a
  step of its own, |L| and at most 10: a common one would only level the weights, a negative one is no chance;
- steps are Mantegna's: u from N(0, sigma^2), v from N(0, 1), where the paper prints sigma^2 for both;
- pheromone changes on the best way alone, evaporation too, as in the ant colony system ("all": it evaporates on all).

The length is convex in the shares: there is no other minimum for Levy flights to escape from. `aco` is the same
colony without them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.sleeve import Sleeve, path_length
from bug_gym.checks import shortened
from bug_gym.compiling import called, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import Floats

Evaporate = Literal["best", "all"]

LEVY_CAP = 10.0
"""Longest Levy step; one draw in eighty is longer."""
SWEEPS = 30
"""Golden-section sweeps of `eaco_refined`."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
NARROW = 1e-7
"""A golden section ends at this width of gamma."""
LESS = 1e-12
"""A way counts as shorter from this share on."""


@dataclass(frozen=True)
class Colony:
    """Parameters of an ant colony (Table 1)."""

    alpha: float = 1.0
    """Exponent of the pheromone."""
    beta: float = 2.0
    """Exponent of the heuristic."""
    rho: float = 0.1
    """Share of the pheromone that evaporates."""
    q0: float = 0.7
    """Chance that an ant takes the best value."""
    levy_rate: float = 0.2
    """p_l: chance that a choice by lot is changed by Levy steps."""
    levy_exponent: float = 1.5
    """beta_L, above 0 and at most 2."""
    levy_scale: float = 0.1
    """lambda: weight of a Levy step, beside 1 for the best value."""
    ants: int = 20
    """Ants of an iteration."""
    iterations: int = 50
    """Iterations at most."""
    patience: int = 15
    """Iterations without a shorter way that end it."""
    values: int = 21
    """Values that gamma may take."""
    evaporate: Evaporate = "best"
    """Where pheromone evaporates: on the best way, or on all."""

    def __post_init__(self) -> None:
        for name in ("ants", "iterations", "patience"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, got {shortened(getattr(self, name))}")
        if self.values < 2:
            raise ValueError(f"values must be at least 2, got {shortened(self.values)}")
        for name in ("rho", "q0", "levy_rate"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be from 0 to 1, got {shortened(getattr(self, name))}")
        if not 0.0 < self.levy_exponent <= 2.0:
            raise ValueError(f"levy_exponent must be above 0 and at most 2, got {shortened(self.levy_exponent)}")
        for name in ("alpha", "beta", "levy_scale"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must not be negative, got {shortened(getattr(self, name))}")
        if self.evaporate not in get_args(Evaporate):
            raise ValueError(f"evaporate must be one of {list(get_args(Evaporate))}, got {shortened(self.evaporate)}")


class Found(NamedTuple):
    """What a search over a sleeve found."""

    gamma: F64
    """Shares at which the edges are crossed (n,)."""
    length: float
    """Length of that way [m]."""
    curve: F64
    """Length of the best way after each iteration [m]."""


def levy_sigma(exponent: float) -> float:
    """Mantegna's standard deviation of u (equation 9); 0.69657 for 1.5."""
    above = math.gamma(1.0 + exponent) * math.sin(0.5 * math.pi * exponent)
    below = exponent * math.gamma(0.5 * (1.0 + exponent)) * 2.0 ** (0.5 * (exponent - 1.0))
    return float((above / below) ** (1.0 / exponent))


def levy_steps(generator: np.random.Generator, exponent: float, shape: tuple[int, ...]) -> F64:
    """Lengths of Levy steps, at most LEVY_CAP (equation 8)."""
    u = generator.normal(0.0, levy_sigma(exponent), shape)
    v = generator.normal(0.0, 1.0, shape)
    return np.asarray(np.minimum(np.abs(u) / np.abs(v) ** (1.0 / exponent), LEVY_CAP))


def eaco(sleeve: Sleeve, colony: Colony = Colony(), *, seed: int = 0) -> Found:  # noqa: B008 (it is frozen)
    """Algorithm 3: ants choose a share on one edge after the other, the best way so far keeps its pheromone."""
    generator = np.random.default_rng(seed)
    edges, values = len(sleeve.left), np.linspace(0.0, 1.0, colony.values)
    options = sleeve.left[:, None] + values[:, None] * (sleeve.right - sleeve.left)[:, None]
    to_goal = np.hypot(*np.moveaxis(options - sleeve.goal, -1, 0))
    best = Found(sleeve.middles, path_length(sleeve.crossings(sleeve.middles)), np.empty(0))
    if best.length == 0.0:
        return best
    pheromone = np.full((edges, colony.values), 1.0 / best.length)
    curve: list[float] = []
    last_gain = 0
    while edges and len(curve) < colony.iterations and len(curve) - last_gain < colony.patience:
        chosen, lengths = _walks(sleeve, colony, options, to_goal, pheromone, generator)
        first = int(lengths.argmin())
        if lengths[first] < (1.0 - LESS) * best.length:
            best = best._replace(gamma=values[chosen[first]], length=float(lengths[first]))
            last_gain = len(curve) + 1
        curve.append(best.length)
        _update(pheromone, colony, np.rint(best.gamma * (colony.values - 1)).astype(int), best.length)
    return best._replace(curve=np.array(curve))


def _walks(
    sleeve: Sleeve,
    colony: Colony,
    options: F64,
    to_goal: F64,
    pheromone: F64,
    generator: np.random.Generator,
) -> tuple[NDArray[np.int64], F64]:
    """The values (ants, n) that the ants of one iteration choose, and the lengths of their ways (ants,) [m]."""
    ants, edges = colony.ants, len(options)
    at = np.broadcast_to(sleeve.start, (ants, 2))
    lengths = np.zeros(ants)
    chosen = np.empty((ants, edges), dtype=np.int64)
    greedy = generator.random((edges, ants)) <= colony.q0
    flies = generator.random((edges, ants)) < colony.levy_rate
    lots = generator.random((edges, ants))
    trail = pheromone**colony.alpha
    for edge in range(edges):
        way = np.hypot(*np.moveaxis(options[edge] - at[:, None], -1, 0))
        weight = trail[edge] / np.maximum(way + to_goal[edge], 1e-12) ** colony.beta
        weight = weight / weight.max(axis=1, keepdims=True)
        best = weight.argmax(axis=1)
        by_levy = ~greedy[edge] & flies[edge]
        if by_levy.any():
            steps = levy_steps(generator, colony.levy_exponent, (int(by_levy.sum()), colony.values))
            weight[by_levy] += colony.levy_scale * steps
        sums = np.cumsum(weight, axis=1)
        drawn = (sums < (lots[edge] * sums[:, -1])[:, None]).sum(axis=1)
        chosen[:, edge] = np.where(greedy[edge], best, np.minimum(drawn, colony.values - 1))
        lengths += way[np.arange(ants), chosen[:, edge]]
        at = options[edge, chosen[:, edge]]
    return chosen, lengths + np.hypot(*(at - sleeve.goal).T)


def _update(pheromone: F64, colony: Colony, tour: NDArray[np.int64], best: float) -> None:
    """Evaporate, and lay pheromone on the best way so far (equation 6)."""
    edges = np.arange(len(tour))
    if colony.evaporate == "all":
        pheromone *= 1.0 - colony.rho
    else:
        pheromone[edges, tour] *= 1.0 - colony.rho
    pheromone[edges, tour] += colony.rho / best


def aco(sleeve: Sleeve, colony: Colony = Colony(), *, seed: int = 0) -> Found:  # noqa: B008 (it is frozen)
    """The plain ant colony system: no Levy flights."""
    return eaco(sleeve, replace(colony, levy_rate=0.0), seed=seed)


def eaco_refined(sleeve: Sleeve, colony: Colony = Colony(), *, seed: int = 0) -> Found:  # noqa: B008 (it is frozen)
    """The best ant's way, then its shares one after the other by golden section, SWEEPS times over all."""
    return refined(sleeve, eaco(sleeve, colony, seed=seed))


def refined(sleeve: Sleeve, found: Found) -> Found:
    """A way with each share in turn at its best between its neighbours; never longer."""
    gamma = found.gamma.copy()
    sweep_shares(sleeve.left, sleeve.right, sleeve.start, sleeve.goal, gamma, SWEEPS, np.empty_like(gamma))
    total = path_length(sleeve.crossings(gamma))
    if total > found.length:
        return found
    return Found(gamma, total, np.append(found.curve, total))


@called
def through(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Length of the way from a over b to c [m]."""
    return length(bx - ax, by - ay) + length(cx - bx, cy - by)


@called
def crossing(left: Floats, right: Floats, gamma: Floats, start: Floats, goal: Floats, i: int) -> tuple[float, float]:
    """Where edge i is crossed; -1 is the start, n the goal [m]."""
    if i < 0:
        return start[0], start[1]
    if i == gamma.shape[0]:
        return goal[0], goal[1]
    return (
        left[i, 0] + gamma[i] * (right[i, 0] - left[i, 0]),
        left[i, 1] + gamma[i] * (right[i, 1] - left[i, 1]),
    )


@called
def improve_share(left: Floats, right: Floats, gamma: Floats, start: Floats, goal: Floats, i: int) -> None:
    """Golden section over one share, the others held."""
    ax, ay = crossing(left, right, gamma, start, goal, i - 1)
    cx, cy = crossing(left, right, gamma, start, goal, i + 1)
    px, py, dx, dy = left[i, 0], left[i, 1], right[i, 0] - left[i, 0], right[i, 1] - left[i, 1]
    low, high = 0.0, 1.0
    while high - low > NARROW:
        one = high - GOLDEN * (high - low)
        other = low + GOLDEN * (high - low)
        if through(ax, ay, px + one * dx, py + one * dy, cx, cy) <= through(
            ax, ay, px + other * dx, py + other * dy, cx, cy
        ):
            high = other
        else:
            low = one
    # The ends of the edge are often the best, and no golden section comes to them.
    best, share = np.inf, gamma[i]
    for option in (gamma[i], 0.0, 0.5 * (low + high), 1.0):
        way = through(ax, ay, px + option * dx, py + option * dy, cx, cy)
        if way < best:
            best, share = way, option
    gamma[i] = share


@called
def straighten(
    left: Floats, right: Floats, gamma: Floats, start: Floats, goal: Floats, first: int, last: int, spare: Floats
) -> None:
    """Cross the edges first ... last where the straight way past them does, or at their nearer ends, if it is shorter."""
    ax, ay = crossing(left, right, gamma, start, goal, first - 1)
    bx, by = crossing(left, right, gamma, start, goal, last + 1)
    before, after = 0.0, 0.0
    ox, oy, qx, qy = ax, ay, ax, ay
    for i in range(first, last + 2):
        px, py = crossing(left, right, gamma, start, goal, i)
        before += length(px - ox, py - oy)
        ox, oy = px, py
        if i <= last:
            dx, dy = right[i, 0] - left[i, 0], right[i, 1] - left[i, 1]
            across = (bx - ax) * dy - (by - ay) * dx
            share = gamma[i]
            if abs(across) > 1e-15:
                share = ((by - ay) * (left[i, 0] - ax) - (bx - ax) * (left[i, 1] - ay)) / across
            spare[i] = min(max(share, 0.0), 1.0)
            px, py = left[i, 0] + spare[i] * dx, left[i, 1] + spare[i] * dy
        after += length(px - qx, py - qy)
        qx, qy = px, py
    if after < before:
        for i in range(first, last + 1):
            gamma[i] = spare[i]


@kernel
def sweep_shares(
    left: Floats, right: Floats, start: Floats, goal: Floats, gamma: Floats, sweeps: int, spare: Floats
) -> None:
    """Golden sections over each share in turn, the others held, back and forth; and over edges that meet in a corner.

    Where a way goes through a corner that several edges share, moving one crossing alone makes it longer though moving
    all makes it shorter, as the length has a kink there; so these are also tried together, on the straight way.

    Args:
        left: left ends of the edges (n, 2) [m].
        right: right ends (n, 2) [m].
        start: (2,) [m].
        goal: (2,) [m].
        gamma: shares (n,), changed.
        sweeps: how often over all.
        spare: room for n numbers.
    """
    n = gamma.shape[0]
    for sweep in range(sweeps):
        for number in range(n):
            improve_share(left, right, gamma, start, goal, number if sweep % 2 == 0 else n - 1 - number)
        for ends in (left, right):
            first = 0
            for i in range(1, n + 1):
                if i == n or ends[i, 0] != ends[first, 0] or ends[i, 1] != ends[first, 1]:
                    if i - first > 1:
                        straighten(left, right, gamma, start, goal, first, i - 1, spare)
                    first = i
