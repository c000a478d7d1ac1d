"""Fields of cylinders grown by a cellular automaton: the rules, the promised ways, and what is refused."""

from typing import Any

import numpy as np
import pytest

from bug_gym.config import ScenarioError, load
from bug_gym.scenarios import draw_layout
from bug_gym.shortest_path import reachable
from bug_gym.worlds.cellular_automaton import CellularAutomatonWorld, full_neighbours, grown, has_way_through
from bug_gym.worlds.layout import Layout


def scenario_of(**world: Any) -> dict[str, Any]:
    return {"world": {"family": "cellular_automaton", **world}}


def layouts_of(seeds: int, **world: Any) -> list[Layout]:
    scenario = load(scenario_of(**world))
    return [draw_layout(scenario, seed, 0) for seed in range(seeds)]


def is_solved(layout: Layout, radius: float) -> bool:
    start, goal = layout.starts[0, :2], layout.goals[0]
    return reachable(layout.circles, layout.polygons, layout.border, start, goal, radius=radius)


def test_neighbours_are_counted_as_cell_by_cell() -> None:
    full = np.random.default_rng(0).random((7, 9)) < 0.4
    for row, column in np.ndindex(full.shape):
        about = [
            full[y, x]
            for y in range(max(row - 1, 0), min(row + 2, 7))
            for x in range(max(column - 1, 0), min(column + 2, 9))
            if (y, x) != (row, column)
        ]
        assert full_neighbours(full)[row, column] == sum(about)


def test_a_round_of_smoothing_fills_and_clears_as_the_rule_says() -> None:
    """A block of 3 x 3 less its middle (8 neighbours) is filled up; a cell by itself (0) and a pair (1 each) are cleared."""
    picture = ["..........", "..###.....", "..#.#.....", "..###.....", "..........", "..#....##.", ".........."]
    after = ["..........", "..###.....", "..###.....", "..###.....", "..........", "..........", ".........."]

    class Given:
        """In place of a generator: this picture, and one round."""

        def uniform(self, low: float, high: float) -> float:
            return 0.5

        def integers(self, low: int, high: int) -> int:
            return 1

        def random(self, shape: tuple[int, int]) -> np.ndarray:
            return np.array([[0.0 if cell == "#" else 1.0 for cell in line] for line in picture])

    world = load(scenario_of(columns=10, rows=7, start=[-3.75, 3, 0])).world
    assert isinstance(world, CellularAutomatonWorld)
    field = grown(world, Given())  # type: ignore[arg-type]
    assert ["".join(".#"[int(cell)] for cell in line) for line in field[:, 1:-1]] == [line[1:-1] for line in after]
    assert field[:, 0].all() and field[:, -1].all()


def test_without_smoothing_a_field_is_as_full_as_stated() -> None:
    world = load(scenario_of(fill=[0.3, 0.3], rounds=[0, 0])).world
    assert isinstance(world, CellularAutomatonWorld)
    share = np.mean([grown(world, np.random.default_rng(seed))[:, 1:-1].mean() for seed in range(100)])
    assert share == pytest.approx(0.3, abs=3.0 * np.sqrt(0.21 / (100 * 30 * 28)))


def test_cylinders_stand_in_the_middle_of_cells_as_in_the_benchmark() -> None:
    for layout in layouts_of(5):
        x, y, radius = layout.circles.T
        assert (radius == 0.075).all()
        assert (x.min(), x.max(), y.min()) == pytest.approx((-4.425, -0.075, 0.075))
        columns, rows = (x + 4.425) / 0.15, (y - 0.075) / 0.15
        assert np.allclose(columns, np.round(columns)) and np.allclose(rows, np.round(rows))
        assert len({(round(u), round(v)) for u, v in zip(columns, rows, strict=True)}) == len(x)
        assert {0, 29} == set(np.round(columns[np.round(rows) == 20]).astype(int).tolist()), "the alley has sides only"


def test_a_chain_of_cylinders_stops_a_disc_exactly_where_the_shortest_path_is_stopped() -> None:
    """Seen by another way: the free space cut into triangles. Half of all fields are of each kind."""
    checked = [0, 0]
    for layout in layouts_of(60, solvable=None):
        field = layout.circles[layout.circles[:, 1] > 5.1, :2]
        for radius in (0.2, 0.295, 0.345):
            way = has_way_through(field, 0.075, radius)
            assert way == is_solved(layout, radius)
            checked[way] += 1
    assert min(checked) > 30


def test_a_gap_of_just_twice_the_clearance_is_open() -> None:
    gate = np.array([[-2.0, 0.0], [-0.5, 0.0], [0.5, 0.0], [2.0, 0.0]])
    wide = np.array([[-2.0, 0.0], [-1.25, 0.0], [-0.5, 0.0], [0.5, 0.0], [1.25, 0.0], [2.0, 0.0]])
    assert has_way_through(gate, 0.1, 0.6)
    assert has_way_through(wide, 0.1, 0.4)
    assert not has_way_through(wide, 0.1, 0.4 + 1e-6)


def test_a_shut_field_has_no_way_even_for_the_body() -> None:
    assert not any(is_solved(layout, 0.2) for layout in layouts_of(30, is_shut=True))


@pytest.mark.parametrize(
    ("robot", "least"),
    [
        ({"radius": {"uniform": [0.05, 0.3]}}, 0.05),
        ({"circles": [[0.2, 0.0, 0.05], [0.0, 0.0, 0.1], [-0.2, 0.0, 0.05]]}, 0.1),
    ],
)
def test_a_shut_field_has_no_way_for_any_body_that_may_come(robot: dict[str, Any], least: float) -> None:
    """None for a disc that lies in the body: that stops the body, however it turns."""
    scenario = load({"robot": robot, **scenario_of(is_shut=True, cell=0.12, solvable=None)})
    assert not any(is_solved(draw_layout(scenario, seed, 0), least) for seed in range(20))


@pytest.mark.parametrize(
    ("world", "says"),
    [
        ({"radius": 0.05}, "world.radius: got 0.05, expected at least half a cell (0.075)"),
        ({"solvable": 0.1}, "world.solvable: got 0.1, expected at least the robot's reach (0.2)"),
        ({"start": [-2, 5.0, 0]}, "world.start: got [-2.0, 5.0, 0.0], expected a place in the alley, 0.35 m from its"),
        ({"goal": [-2, 9.0]}, "world.goal: got [-2.0, 9.0], expected one beyond the field, y at least 10.1"),
        ({"columns": 80}, "world.bounds: got [-6.0, -1.0, 2.0, 15.0], expected bounds that hold the field"),
        ({"fill": [0.3, 0.2]}, "world.fill: got [0.3, 0.2], expected"),
        ({"rounds": [0, 101]}, "world.rounds.1: got 101, expected"),
        ({"fill_from": 10}, "world.fill_from: got 10, expected"),
    ],
)
def test_what_makes_no_field_is_refused_in_one_line(world: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(scenario_of(**world))
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_a_field_that_cannot_be_found_says_so() -> None:
    scenario = load(scenario_of(fill=[1.0, 1.0], columns=10, rows=3, start=[-3.75, 3, 0], rounds=[0, 0]))
    with pytest.raises(
        ValueError, match="none of 10000 fields of cylinders is one with a way at a clearance of 0.35 m"
    ):
        draw_layout(scenario, 0, 0)
