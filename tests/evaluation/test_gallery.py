"""What a gallery shows of a world."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bug_gym.config import load
from bug_gym.drawing.brush import FLOOR
from bug_gym.drawing.canvas import Canvas
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.gallery import Box, box_around, way_of
from bug_gym.evaluation.rollout import Rollout
from bug_gym.policy import Drawing
from bug_gym.simulation import Simulation

PLACES = st.lists(st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)), min_size=2, max_size=9)


@given(PLACES)
def test_a_box_holds_all_places_and_nothing_beyond_the_world(places: list[tuple[float, float]]) -> None:
    whole: Box = (-10.0, -10.0, 10.0, 10.0)
    found = np.array(places)
    left, bottom, right, top = box_around(found, whole)
    assert (found >= (left, bottom)).all() and (found <= (right, top)).all()
    assert left >= -10.0 and bottom >= -10.0 and right <= 10.0 and top <= 10.0


def test_a_small_scene_in_a_large_world_is_shown_large_and_one_that_fills_it_whole() -> None:
    whole: Box = (-50.0, -50.0, 50.0, 50.0)
    assert box_around(np.array([[0.0, 0.0], [10.0, 5.0]]), whole) == (-0.6, -0.6, 10.6, 5.6)
    assert box_around(np.array([[-45.0, -46.0], [45.0, 49.0]]), whole) == whole


def test_a_way_holds_the_episode_and_what_stands_beside_it() -> None:
    scenario = load("disc")
    entry = ScenarioEntry(scenario.name, scenario, range(1))
    way = way_of(PolicyEntry.of("bug2"), entry, 0)
    low, high = way.places.min(axis=0), way.places.max(axis=0)
    (rows,) = Rollout(PolicyEntry.of("bug2"), entry, [0]).worlds()
    assert way.steps == rows[0].steps
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    layout = simulation.world.layout(0)
    rims = [layout.circles[:, :2] + sign * layout.circles[:, 2:] for sign in (-1.0, 1.0)]
    for x, y in np.concatenate([layout.starts[:, :2], layout.goals, *rims]):
        assert low[0] <= x <= high[0] and low[1] <= y <= high[1]


def test_a_canvas_shows_a_part_of_the_world_and_page_around_it() -> None:
    simulation = Simulation("disc")
    simulation.reset(seeds=[0])
    whole = Canvas(simulation, size=200)
    part = Canvas(simulation, size=200, box=(0.0, -1.0, 4.0, 1.0))
    assert part.view.scale > whole.view.scale and part.height < part.width
    frame = part.draw(scan=False)
    left, top = part.view.pixel(0.0, 1.0)
    right, bottom = part.view.pixel(4.0, -1.0)
    strips = (frame[:, : int(left) - 8], frame[:, int(right) + 8 :], frame[int(bottom) + 2 :, -5:], frame[:2])
    for strip in strips:
        assert strip.size and (strip == 255).all()
    assert (frame[int(top) + 3, int(left) + 5] == FLOOR).all()


def test_nothing_that_a_policy_draws_sticks_out_of_the_part() -> None:
    simulation = Simulation("disc")  # the robot starts at (0, 0) and looks along x
    simulation.reset(seeds=[0])
    part = Canvas(simulation, size=200, box=(0.0, -1.0, 4.0, 1.0))
    frame = part.draw(Drawing(points=[(-0.2, 0.0, "hit")], segments=[(3.0, 0.5, 5.0, 0.5, "plan")]), scan=False)
    for place in ((-0.2, 0.0), (4.2, 0.5)):
        column, row = part.view.pixel(*place)
        assert (frame[int(row), int(column)] == 255).all()
    column, row = part.view.pixel(3.5, 0.5)
    assert (frame[int(row) - 2 : int(row) + 3, int(column)] != FLOOR).any()
