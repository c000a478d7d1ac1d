"""Layouts in which nothing moves, written into rows at once: the same rows as one after the other."""

from dataclasses import replace

import numpy as np
import pytest

from bug_gym.scenarios import draw_layout
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout, Rings

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def turned_round(rings: Rings) -> Rings:
    """The same rings, run along the other way."""
    return tuple(ring[::-1].copy() for ring in rings)


def odd_layouts(layout: Layout) -> list[Layout]:
    """Layouts with what rows have to take."""
    twice = np.repeat(SQUARE, 2, axis=0) + 1e-12 * np.arange(16.0).reshape(8, 2)  # corners that are one
    hole = (4.0 * SQUARE, 2.0 * SQUARE[::-1])
    same = (4.0 * SQUARE, 2.0 * SQUARE)  # both run to the left: no side is inner everywhere
    point = (np.zeros((3, 2)),)
    circles = np.array([[1.0, 2.0, 0.5], [-3.0, 2.0, 0.1]])
    return [
        layout,
        replace(layout, circles=circles, polygons=()),
        replace(layout, polygons=(hole, same, turned_round(hole), (twice,))),
        replace(layout, polygons=((SQUARE + 1e6,), point, (1e-7 * SQUARE + 8.0,)), circles=circles[:1], goal_room=0.7),
        replace(layout, border=2.0 * np.concatenate([SQUARE, [[-2.0, 0.0]]]), polygons=((SQUARE,),)),
    ]


@pytest.mark.parametrize("name", ["rooms", "u_trap", "ring", "hook", "hexagon", "crossing", "warehouse_team"])
def test_rows_are_those_that_are_written_one_by_one(name: str) -> None:
    together, single = Simulation(name, count=6), Simulation(name, count=6)
    layouts = [draw_layout(together.scenario, seed, 0) for seed in range(5)]
    layouts += odd_layouts(layouts[0]) if not layouts[0].movers else []
    for begin in range(0, len(layouts), 5):
        rows, some = np.array([4, 1, 5, 0, 2]), layouts[begin : begin + 5]
        together.world.load_all(rows, some)
        for row, layout in zip(rows.tolist(), some, strict=True):
            single.world.load(row, layout)
        assert together.world.capacity == single.world.capacity
        for simulation in (together, single):
            simulation.begin(rows)
        assert (together.world.ints == single.world.ints).all()
        assert together.world.floats.tobytes() == single.world.floats.tobytes()
        assert together.world.observation.tobytes() == single.world.observation.tobytes()


def test_rows_of_what_moves_and_what_stands_do_not_mix() -> None:
    simulation, kept = Simulation("crossing", count=2), Simulation("crossing", count=2)
    moving = draw_layout(simulation.scenario, 0, 0)
    layouts = [moving, replace(moving, movers=(), polygons=((SQUARE,),))]
    simulation.world.load_all(simulation.all_rows, layouts)
    for row in (0, 1):
        kept.world.load(row, layouts[row])
    for either in (simulation, kept):
        either.begin(either.all_rows)
    assert len(simulation.world.layout(0).movers) == len(moving.movers) > 0
    assert simulation.world.floats.tobytes() == kept.world.floats.tobytes()


def test_seeds_and_episodes_stay() -> None:
    simulation = Simulation("rooms", count=3)
    simulation.reset(seeds=[5, 6, 7])
    simulation.reset(np.array([1]))
    simulation.place([draw_layout(simulation.scenario, 9, 0)] * 2, np.array([1, 2]))
    assert simulation.world.seed.tolist() == [5, 6, 7]
    assert simulation.world.episode.tolist() == [0, 1, 0]
