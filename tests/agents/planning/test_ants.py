"""The ant colony over crossings of edges: its steps, its bounds, and how near it comes to the funnel."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.planning import ants
from bug_gym.agents.planning.ants import (
    LEVY_CAP,
    Colony,
    aco,
    eaco,
    eaco_refined,
    levy_sigma,
    levy_steps,
)
from bug_gym.agents.planning.funnel import funnel_length
from bug_gym.agents.planning.sleeve import Sleeve, path_length
from bug_gym.agents.planning.triangulated import Manner, find_way
from bug_gym.geometry import F64
from bug_gym.reproductions import d2t_worlds

ONE = Sleeve(np.zeros(2), np.array([10.0, 0.0]), np.array([[5.0, 6.0]]), np.array([[5.0, 2.0]]), np.array([0, 1]))
TWO = Sleeve(
    np.zeros(2),
    np.array([10.0, 0.0]),
    np.array([[3.0, 5.0], [7.0, -1.0]]),
    np.array([[3.0, 1.0], [7.0, -5.0]]),
    np.array([0, 1, 2]),
)


@cache
def sleeves(count: int = 16) -> tuple[Sleeve, ...]:
    """Sleeves of up to 20 edges: ways of 5 to 26 m through fields."""
    found: list[Sleeve] = []
    seed = 0
    while len(found) < count:
        goal = (6.0 + 3.0 * (seed % 8), 12.0 + seed % 5 - 2.0)
        way = find_way(d2t_worlds.field(100 + seed, 12 + seed % 30, goal=goal), Manner("funnel", facets=1))
        seed += 1
        if way is not None and way.sleeve is not None and 1 <= len(way.sleeve.left) <= 20:
            found.append(way.sleeve)
    return tuple(found)


def test_mantegnas_sigma() -> None:
    assert levy_sigma(1.5) == pytest.approx(0.69657, abs=5e-6)
    assert levy_sigma(1.0) == pytest.approx(1.0)


def test_levy_steps_have_a_heavy_tail() -> None:
    steps = levy_steps(np.random.default_rng(0), 1.5, (200_000,))
    assert steps.min() >= 0.0 and steps.max() == LEVY_CAP
    # P(|L| > x) falls as x^-1.5: from 2 to 8 by a factor of 8.
    assert (steps > 2.0).mean() / (steps > 8.0).mean() == pytest.approx(4.0**1.5, rel=0.35)
    assert (steps >= LEVY_CAP).mean() == pytest.approx(0.012, abs=0.003)


def grid_optimum(sleeve: Sleeve, values: int = 21) -> float:
    """The shortest length on the grid of shares [m], by dynamic programming: what no ant can beat."""
    shares = np.linspace(0.0, 1.0, values)
    at, cost = sleeve.start[None], np.zeros(1)
    for a, b in zip(sleeve.left, sleeve.right, strict=True):
        options = a + shares[:, None] * (b - a)
        cost = (cost[:, None] + np.hypot(*np.moveaxis(at[:, None] - options[None], -1, 0))).min(axis=0)
        at = options
    return float((cost + np.hypot(*(at - sleeve.goal).T)).min())


def test_the_worked_examples_are_solved_on_the_grid() -> None:
    assert eaco(ONE).length == pytest.approx(2.0 * math.sqrt(29.0), abs=1e-12)
    assert eaco(TWO).length == pytest.approx(2.0 * math.sqrt(10.0) + math.sqrt(20.0), abs=1e-12)
    assert grid_optimum(TWO) == pytest.approx(10.7967, abs=1e-4)


@pytest.mark.parametrize("search", [eaco, aco, eaco_refined])
def test_a_seed_gives_the_same_way_and_none_is_shorter_than_the_funnel(search: object) -> None:
    assert callable(search)
    for sleeve in sleeves()[:6]:
        first, again = search(sleeve, seed=3), search(sleeve, seed=3)
        np.testing.assert_array_equal(first.gamma, again.gamma)
        assert ((first.gamma >= 0.0) & (first.gamma <= 1.0)).all()
        assert first.length == pytest.approx(path_length(sleeve.crossings(first.gamma)), abs=1e-9)
        assert first.length >= funnel_length(sleeve) - 1e-9
        assert (np.diff(first.curve) <= 0.0).all()


def test_no_ant_beats_the_grid_and_the_grid_is_near_the_funnel() -> None:
    for sleeve in sleeves():
        best, shortest = grid_optimum(sleeve), funnel_length(sleeve)
        assert eaco(sleeve, seed=1).length >= best - 1e-9
        spacing = np.hypot(*(sleeve.left - sleeve.right).T).sum() / 20.0
        assert shortest - 1e-9 <= best <= shortest + spacing
        assert grid_optimum(sleeve, values=41) <= best + 1e-12


def test_the_ants_come_as_near_to_the_funnel_as_is_fair() -> None:
    gaps, few, refined = [], [], []
    for sleeve in sleeves(32):
        shortest = funnel_length(sleeve)
        lengths = [eaco(sleeve, seed=seed).length for seed in range(4)]
        gap = float(np.mean(lengths)) / shortest - 1.0
        gaps.append(gap)
        if len(sleeve.left) <= 8:
            few.append(gap)
        refined.append(eaco_refined(sleeve).length / shortest - 1.0)
    assert len(few) >= 8 and max(few) <= 0.01
    assert np.median(gaps) <= 0.015 and np.quantile(gaps, 0.9) <= 0.035 and max(gaps) <= 0.06
    assert max(refined) <= 0.01


def test_refining_brings_long_sleeves_within_one_per_cent() -> None:
    for seed in range(4):
        way = find_way(d2t_worlds.field(seed, 20 + 8 * seed), Manner("funnel", facets=1))
        assert way is not None and way.sleeve is not None and len(way.sleeve.left) > 20
        assert eaco_refined(way.sleeve).length <= 1.01 * funnel_length(way.sleeve)


def test_each_rule_of_the_colony_works() -> None:
    sleeve = max(sleeves(), key=lambda one: len(one.left))
    plain = eaco(sleeve, seed=5)
    for change in ({"alpha": 3.0}, {"beta": 0.0}, {"q0": 0.0}, {"levy_rate": 1.0, "levy_scale": 5.0}, {"ants": 3}):
        assert not np.array_equal(eaco(sleeve, replace(Colony(), **change), seed=5).gamma, plain.gamma), change
    # The same numbers are drawn; what the flights add to the weights is what differs.
    still, flying = (Colony(levy_rate=1.0, levy_scale=scale) for scale in (0.0, 5.0))
    assert not np.array_equal(eaco(sleeve, still, seed=5).gamma, eaco(sleeve, flying, seed=5).gamma)
    # Pheromone is what is learnt: without it, and without greed, the best of as many ways is longer.
    by_lot = Colony(alpha=0.0, beta=0.0, q0=0.0, levy_rate=0.0, patience=50)
    assert eaco(sleeve, by_lot, seed=5).length > eaco(sleeve, Colony(patience=50), seed=5).length
    assert aco(sleeve, seed=5).length == eaco(sleeve, Colony(levy_rate=0.0), seed=5).length
    assert len(eaco(sleeve, Colony(iterations=7), seed=5).curve) <= 7
    curve = eaco(sleeve, seed=5).curve
    assert len(curve) == 50 or (curve[-15:] == curve[-1]).all()


@pytest.mark.parametrize(("evaporate", "kept"), [("best", 1.0), ("all", 0.75)])
def test_pheromone_evaporates_by_rho_and_the_best_way_is_given_rho_over_its_length(
    evaporate: ants.Evaporate, kept: float
) -> None:
    """Equation 6: tau <- (1 - rho) tau + rho / L."""
    before = np.random.default_rng(0).uniform(0.1, 1.0, (3, 21))
    after, tour = before.copy(), np.array([20, 0, 7])
    ants._update(after, Colony(rho=0.25, evaporate=evaporate), tour, 8.0)
    expected = kept * before
    expected[[0, 1, 2], tour] = 0.75 * before[[0, 1, 2], tour] + 0.25 / 8.0
    np.testing.assert_allclose(after, expected, rtol=1e-12)


def test_pheromone_is_laid_on_the_best_way_so_far_and_not_on_that_of_the_iteration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    laid: list[tuple[list[int], float]] = []

    def noted(pheromone: F64, colony: Colony, tour: NDArray[np.int64], best: float) -> None:
        laid.append((tour.tolist(), best))

    monkeypatch.setattr(ants, "_update", noted)
    found = eaco(max(sleeves(), key=lambda one: len(one.left)), Colony(ants=2), seed=5)
    assert [best for _, best in laid] == found.curve.tolist()
    assert laid[-1][0] == np.rint(20.0 * found.gamma).astype(int).tolist()


def test_a_greedy_ant_goes_where_the_way_there_and_straight_on_to_the_goal_is_shortest() -> None:
    is_shorter = 0
    for sleeve in sleeves():
        at, way, shares = sleeve.start, [sleeve.start], np.linspace(0.0, 1.0, 21)
        for a, b in zip(sleeve.left, sleeve.right, strict=True):
            options = a + shares[:, None] * (b - a)
            at = options[(np.hypot(*(options - at).T) + np.hypot(*(options - sleeve.goal).T)).argmin()]
            way.append(at)
        greedy, middles = path_length(np.array([*way, sleeve.goal])), path_length(sleeve.crossings(sleeve.middles))
        found = eaco(sleeve, Colony(q0=1.0, ants=1, iterations=1))
        assert found.length == pytest.approx(min(greedy, middles), abs=1e-9)
        is_shorter += greedy < middles
    assert is_shorter > 8


def test_the_unit_of_length_chooses_nothing() -> None:
    """Weights are scaled before a Levy step is added, and pheromone begins and is laid by lengths alike."""
    colony = Colony(q0=0.2, levy_rate=0.8)
    for number, sleeve in enumerate(sleeves()[:6]):
        larger = sleeve._replace(
            **{name: 1024.0 * getattr(sleeve, name) for name in ("start", "goal", "left", "right")}
        )
        found, scaled = (eaco(one, colony, seed=number) for one in (sleeve, larger))
        np.testing.assert_array_equal(scaled.gamma, found.gamma)
        np.testing.assert_array_equal(scaled.curve, 1024.0 * found.curve)


def test_it_ends_after_so_many_iterations_without_a_shorter_way() -> None:
    ended = 0
    for number, sleeve in enumerate(sleeves()):
        curve = eaco(sleeve, Colony(patience=4), seed=number).curve
        gains = np.flatnonzero(np.diff([path_length(sleeve.crossings(sleeve.middles)), *curve]) < 0.0)
        last = int(gains[-1]) + 1 if len(gains) else 0
        assert len(curve) == min(last + 4, 50)
        ended += len(curve) < 50
    assert ended > 8


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ants": 0}, "ants must be at least 1, got 0"),
        ({"values": 1}, "values must be at least 2"),
        ({"rho": 1.5}, "rho must be from 0 to 1"),
        ({"levy_exponent": 0.0}, "levy_exponent must be above 0"),
        ({"beta": -1.0}, "beta must not be negative"),
        ({"evaporate": "none"}, "evaporate must be one of"),
    ],
)
def test_a_colony_that_cannot_be_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Colony(**change)  # type: ignore[arg-type]
