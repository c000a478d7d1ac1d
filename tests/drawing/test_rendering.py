"""Pictures: what is where in a frame, that drawing changes nothing, and windows."""

from __future__ import annotations

import math
import os
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym.checks import install_command
from bug_gym.drawing import brush, pixels
from bug_gym.drawing import canvas as rendering
from bug_gym.drawing import parts as painting
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame
from bug_gym.drawing.window import UNSEEN, Window, open_screen
from bug_gym.policy import Drawing
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES

WORLD: dict[str, Any] = {
    "name": "yard",
    "robot": {"kinematics": "holonomic"},
    "lidar": {"beams": 180, "range": 4.0},
    "world": {
        "family": "explicit",
        "bounds": [-10, -5, 10, 5],
        "circles": [[-4.0, 2.0, 1.0]],
        "polygons": [
            [[5, 1], [8, 1], [8, 4], [5, 4]],
            {"shell": [[4, -4], [8, -4], [8, -1], [4, -1]], "holes": [[[5, -3], [7, -3], [7, -2], [5, -2]]]},
        ],
        "movers": [
            {"shape": {"circle": 0.5}, "at": [-8, -3], "motion": {"law": "bounce", "velocity": [1, 0]}},
            {
                "shape": {"polygon": [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]},
                "at": [1, -4],
                "motion": {"law": "bounce", "velocity": [1, 0]},
            },
        ],
        "start": [-7, 2, 0],
        "goal": [2, 3],
    },
}
BEHIND_THE_CIRCLE = (-2.5, 2.0)  # seen from the start
"""Free places: in the scan of the start, and out of its reach."""
IN_SIGHT, OUT_OF_REACH = (-8.0, 4.0), (1.0, 0.0)


def yard(**overrides: Any) -> Simulation:
    simulation = Simulation(WORLD, overrides={key.replace("__", "."): value for key, value in overrides.items()})
    simulation.reset(seeds=[0])
    return simulation


def drive(simulation: Simulation, velocity: tuple[float, float], steps: int, canvas: Canvas | None = None) -> None:
    """The same action for all robots of all rows."""
    actions = np.broadcast_to(velocity, (simulation.count, simulation.robots, 2))
    for _ in range(steps):
        simulation.step(actions)
        if canvas is not None:
            canvas.record()


def color_at(canvas: Canvas, frame: Frame, x: float, y: float) -> tuple[int, int, int]:
    """The pixel of a place, from the rule of the picture: bounds centred, equal scales, y up."""
    xmin, ymin, xmax, ymax = canvas.simulation.scenario.world.box
    height, width, _ = frame.shape
    scale = (max(width, height) - 2.0 * canvas.margin) / max(xmax - xmin, ymax - ymin)
    column = 0.5 * width + scale * (x - 0.5 * (xmin + xmax))
    row = 0.5 * height - scale * (y - 0.5 * (ymin + ymax))
    red, green, blue = frame[int(row), int(column)].tolist()
    return red, green, blue


# ---------------------------------------------------------------------------------------------- what is where


def test_a_frame_is_rgb_with_the_proportions_of_the_bounds() -> None:
    canvas = Canvas(yard(), size=500)
    frame = canvas.draw()
    assert frame.dtype == np.uint8
    assert frame.shape[1:] == (500, 3)
    assert frame.shape[0] - 2.0 * canvas.margin == pytest.approx((500 - 2.0 * canvas.margin) / 2.0, abs=2.0)


def test_a_square_world_fills_a_square_frame() -> None:
    simulation = Simulation("empty")
    simulation.reset(seeds=[0])
    assert Canvas(simulation, size=300).draw().shape == (300, 300, 3)


@pytest.mark.parametrize("size", [200, 600, 1001])
@pytest.mark.parametrize(
    ("place", "color"),
    [
        ((-4.0, 2.0), painting.STILL),
        ((6.5, 2.5), painting.STILL),
        ((4.5, -2.5), painting.STILL),
        ((6.0, -2.5), brush.FLOOR),  # in the hole
        ((-8.0, -3.0), painting.MOVING),
        ((1.0, -4.0), painting.MOVING),
        (OUT_OF_REACH, brush.FLOOR),
        (BEHIND_THE_CIRCLE, brush.FLOOR),
        ((-10.25, 0.0), brush.PAGE),
    ],
)
def test_a_place_has_the_colour_of_what_is_there(
    size: int, place: tuple[float, float], color: tuple[int, int, int]
) -> None:
    canvas = Canvas(yard(), size=size)
    assert color_at(canvas, canvas.draw(), *place) == color


def test_the_view_puts_places_where_they_are_drawn() -> None:
    canvas = Canvas(yard())
    column, row = canvas.view.pixel(-4.0, 2.0)
    assert canvas.draw()[int(row), int(column)].tolist() == list(painting.STILL)


def test_the_scan_tints_what_it_sees() -> None:
    canvas = Canvas(yard())
    assert color_at(canvas, canvas.draw(), *IN_SIGHT) != brush.FLOOR
    assert color_at(canvas, canvas.draw(scan=False), *IN_SIGHT) == brush.FLOOR


def test_a_narrow_scan_begins_at_the_robot() -> None:
    canvas = Canvas(yard(lidar__fov=1.0))
    frame = canvas.draw()
    assert color_at(canvas, frame, -6.0, 2.2) != brush.FLOOR
    assert color_at(canvas, frame, *IN_SIGHT) == brush.FLOOR


def test_a_few_beams_are_drawn_as_rays() -> None:
    canvas = Canvas(yard(lidar__beams=4))
    frame = canvas.draw()
    assert color_at(canvas, frame, -7.0, 4.0) != brush.FLOOR
    assert color_at(canvas, frame, *IN_SIGHT) == brush.FLOOR


def test_the_robot_stands_at_its_pose() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    assert color_at(canvas, canvas.draw(), -7.0, 2.0) == brush.ROBOTS[0]
    drive(simulation, (0.0, -1.0), steps=20)
    x, y, _ = simulation.world.pose[0, 0]
    assert color_at(canvas, canvas.draw(), x, y) == brush.ROBOTS[0]


def test_each_circle_of_a_body_is_drawn() -> None:
    canvas = Canvas(yard(robot__circles=[[0.0, 0.0, 0.3], [-0.8, 0.0, 0.3]]))
    frame = canvas.draw()
    assert color_at(canvas, frame, -7.0, 2.0) == brush.ROBOTS[0]
    assert color_at(canvas, frame, -7.8, 2.0) == brush.ROBOTS[0]


def test_robots_have_different_colours() -> None:
    simulation = Simulation("crossing_robots", overrides={"robots.count": 4})
    simulation.reset(seeds=[0])
    canvas = Canvas(simulation)
    frame = canvas.draw()
    assert len({color_at(canvas, frame, x, y) for x, y, _ in simulation.world.pose[0]}) == 4


def test_nothing_sticks_out_of_the_border() -> None:
    simulation = Simulation("maze")
    for seed in range(5):
        simulation.reset(seeds=[seed])
        canvas = Canvas(simulation)
        assert (canvas.draw()[:, : int(canvas.margin) - 4] == brush.PAGE).all()


def test_a_goal_that_moves_looks_different_from_one_that_stands() -> None:
    motion = {"law": "bounce", "velocity": [0.4, 0.0]}
    still, moving = Canvas(yard()), Canvas(yard(world__target={"at": [2, 3], "motion": motion}, world__goal=None))
    # The flag hangs beside the upper end of its pole.
    column, row = still.view.pixel(2.0, 3.0)
    flag = (int(row) - 11, int(column) + 4)
    assert still.draw()[flag].tolist() == list(brush.GOAL)
    assert moving.draw()[flag].tolist() != list(brush.GOAL)


@pytest.mark.parametrize(
    ("velocity", "outcome", "strongest"), [((1.0, 0.0), "collision", 0), ((0.0, 1.0), "success", 1)]
)
def test_the_outcome_tints_the_floor(velocity: tuple[float, float], outcome: str, strongest: int) -> None:
    simulation = yard(world__goal=[-7.0, 3.5])
    canvas = Canvas(simulation)
    drive(simulation, velocity, steps=25)
    assert simulation.info()["outcome"].tolist() == [[outcome]]
    floor = color_at(canvas, canvas.draw(), *OUT_OF_REACH)
    assert floor[strongest] > max(value for index, value in enumerate(floor) if index != strongest)


# ---------------------------------------------------------------------------------------------- laws of drawing


@pytest.mark.parametrize("scenario", ["dynamic", "moving_target", "maze", "crossing_robots"])
def test_drawing_changes_no_bit_of_the_world(scenario: str) -> None:
    drawn, plain = Simulation(scenario, 2), Simulation(scenario, 2)
    for simulation in (drawn, plain):
        simulation.reset(seeds=[3, 4])
    canvas = Canvas(drawn, row=1, size=200)
    for _ in range(10):
        canvas.draw()
        for simulation in (drawn, plain):
            drive(simulation, (0.5, 0.2), steps=1)
    for simulation in (drawn, plain):
        assert simulation.world.array("body_x").shape  # whoever reads where bodies are has them brought to now
    for ours, theirs in zip(drawn.save()[0], plain.save()[0], strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_row_of_a_batch_looks_like_the_single_world_of_its_seed() -> None:
    batch, single = Simulation("dynamic", 3), Simulation("dynamic")
    batch.reset(seeds=[5, 6, 7])
    single.reset(seeds=[7])
    of_row, alone = Canvas(batch, row=2), Canvas(single)
    for canvas in (of_row, alone):
        drive(canvas.simulation, (0.4, 0.4), steps=10, canvas=canvas)
    np.testing.assert_array_equal(of_row.draw(), alone.draw())


def test_a_frame_changes_with_a_step_and_only_then() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    first, again = canvas.draw(), canvas.draw()
    drive(simulation, (0.0, 0.0), steps=1)
    np.testing.assert_array_equal(first, again)
    assert (canvas.draw() != first).any()


def test_a_frame_is_not_painted_over_by_the_next() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    frame = canvas.draw()
    kept = frame.copy()
    drive(simulation, (0.0, 1.0), steps=10)
    canvas.draw()[:] = 0
    np.testing.assert_array_equal(frame, kept)


@pytest.mark.parametrize("mover", [0, 1])
def test_movers_are_where_they_have_gone(mover: int) -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    canvas.draw(scan=False)
    before = simulation.world.layout(0).movers[mover].at
    drive(simulation, (0.0, 0.0), steps=15)  # 1.5 m to the right
    frame = canvas.draw(scan=False)
    assert color_at(canvas, frame, before[0] + 1.5, before[1]) == painting.MOVING
    assert color_at(canvas, frame, *before) == brush.FLOOR


def test_movers_of_the_next_episode_have_their_own_shapes() -> None:
    simulation = Simulation({"world": {"family": "field", "moving": 1.0, "sizes": [0.2, 1.5], "obstacles": 8}})
    simulation.reset(seeds=[1])
    canvas = Canvas(simulation)
    canvas.draw()
    simulation.reset()
    np.testing.assert_array_equal(canvas.draw(), Canvas(simulation).draw())


@pytest.mark.parametrize(
    "other",
    [
        {"circles": [[-4.0, -2.0, 1.0]]},
        {"circles": [[-4.0, 2.0, 0.5]]},
        {"polygons": [[[5, 1], [8, 1], [8, 3], [5, 3]], WORLD["world"]["polygons"][1]]},
        {"movers": [{**mover, "at": [-1, 0]} for mover in reversed(WORLD["world"]["movers"])]},
        {"movers": [{**WORLD["world"]["movers"][0], "shape": {"circle": 0.9}}, WORLD["world"]["movers"][1]]},
        {"start": [-7, -1, 0]},
    ],
)
def test_a_world_that_is_put_in_the_place_of_another_is_drawn(other: dict[str, Any]) -> None:
    simulation, source = yard(), yard(**{f"world__{key}": value for key, value in other.items()})
    canvas = Canvas(simulation)
    canvas.draw()
    simulation.place([source.world.layout(0)])
    fresh = Canvas(simulation)
    for _ in range(3):
        np.testing.assert_array_equal(canvas.draw(), fresh.draw())
        drive(simulation, (0.0, -1.0), steps=1)


def test_a_dart_points_where_its_mover_goes() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    ahead, behind = -8.0 + 0.5 + 1.3, -8.0 - 0.5 - 0.2  # the mover of radius 0.5 m goes to the right at 1 m/s
    frame = canvas.draw(scan=False)
    assert color_at(canvas, frame, ahead, -3.0) == painting.MOVING_RIM
    assert color_at(canvas, frame, behind, -3.0) == brush.FLOOR


def test_a_canvas_follows_its_row_into_the_next_episode() -> None:
    simulation = Simulation("static")
    simulation.reset(seeds=[1])
    canvas = Canvas(simulation)
    canvas.draw()
    drive(simulation, (0.5, 0.0), steps=5, canvas=canvas)
    simulation.reset()
    np.testing.assert_array_equal(canvas.draw(), Canvas(simulation).draw())


def test_a_pickled_canvas_draws_the_same() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    drive(simulation, (0.0, 1.0), steps=5, canvas=canvas)
    frame = canvas.draw()
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(canvas)).draw(), frame)


def test_drawing_survives_that_somebody_shuts_pygame_down() -> None:
    pygame = brush.load_pygame()
    canvas = Canvas(yard())
    frame = canvas.draw()
    pygame.quit()
    np.testing.assert_array_equal(canvas.draw(), frame)


# ---------------------------------------------------------------------------------------------- the path


ON_THE_WAY = (-7.0, 1.0)


def test_the_path_so_far_is_drawn_unless_switched_off() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    canvas.draw()
    drive(simulation, (0.0, -1.0), steps=30)
    assert color_at(canvas, canvas.draw(), *ON_THE_WAY) == brush.ROBOTS[0]
    assert color_at(canvas, canvas.draw(trail=False), *ON_THE_WAY) != brush.ROBOTS[0]


def test_the_path_goes_through_every_recorded_pose() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    drive(simulation, (0.0, -1.0), steps=20, canvas=canvas)
    drive(simulation, (1.0, 0.0), steps=20, canvas=canvas)
    frame = canvas.draw()
    assert color_at(canvas, frame, *ON_THE_WAY) == brush.ROBOTS[0]
    assert color_at(canvas, frame, -6.0, 0.0) == brush.ROBOTS[0]


def test_a_new_episode_begins_a_new_path() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    drive(simulation, (0.0, -1.0), steps=30, canvas=canvas)
    canvas.draw()
    simulation.reset(seeds=[0])
    np.testing.assert_array_equal(canvas.draw(), Canvas(simulation).draw())


def test_a_world_that_goes_back_in_time_begins_a_new_path() -> None:
    simulation = yard()
    canvas = Canvas(simulation)
    drive(simulation, (0.0, -1.0), steps=2)
    state = simulation.save()
    drive(simulation, (0.0, -1.0), steps=30, canvas=canvas)
    canvas.draw()
    simulation.restore(state)
    np.testing.assert_array_equal(canvas.draw(), Canvas(simulation).draw())


# ---------------------------------------------------------------------------------------------- a policy's drawing


@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi, -2.0])
def test_a_policy_draws_in_the_frame_of_its_start(heading: float) -> None:
    simulation = yard(world__start=[-6.0, -1.0, heading])
    canvas = Canvas(simulation)
    drive(simulation, (0.0, 0.5), steps=3)
    frame = canvas.draw(Drawing(points=[(1.5, 0.5, "hit")]))
    x = -6.0 + 1.5 * math.cos(heading) - 0.5 * math.sin(heading)
    y = -1.0 + 1.5 * math.sin(heading) + 0.5 * math.cos(heading)
    assert color_at(canvas, frame, x, y) == brush.LABEL_COLORS["hit"]


def test_segments_and_areas_of_a_policy_are_drawn() -> None:
    canvas = Canvas(yard())
    ring = np.array([[7.5, -1.5], [8.5, -1.5], [8.5, -2.5], [7.5, -2.5]])
    frame = canvas.draw(Drawing(segments=[(6.0, -3.0, 9.0, -3.0, "path")], areas=[(ring, "light")]))
    assert color_at(canvas, frame, 0.0, -1.0) == brush.LABEL_COLORS["path"]
    assert color_at(canvas, frame, 1.0, 0.0) not in (brush.FLOOR, brush.LABEL_COLORS["light"])


def test_a_dashed_segment_has_gaps() -> None:
    canvas = Canvas(yard())
    frame = canvas.draw(Drawing(segments=[(6.0, -3.0, 9.0, -3.0, "m_line")]))
    brightness = np.array([sum(color_at(canvas, frame, x, -1.0)) for x in np.linspace(-0.9, 1.9, 200)])
    on_floor = brightness == sum(brush.FLOOR)
    assert 0.2 < on_floor.mean() < 0.8


def test_a_drawing_may_reach_beyond_the_picture() -> None:
    canvas = Canvas(yard())
    ring = np.array([[-1e4, -1e4], [1e4, -1e4], [1e4, 1e4], [-1e4, 1e4]])
    far = Drawing(points=[(1e4, 0.0, "hit")], segments=[(-1e4, -3.0, 1e4, -3.0, "path")], areas=[(ring, "light")])
    frame = canvas.draw(far)
    assert color_at(canvas, frame, 0.0, -1.0) == brush.LABEL_COLORS["path"]
    assert color_at(canvas, frame, *OUT_OF_REACH) != brush.FLOOR


def test_the_labels_of_a_drawing_are_listed_below_the_world() -> None:
    canvas = Canvas(yard())
    edge = int(canvas.height - canvas.margin) + 4
    plain, listed = canvas.draw()[edge:], canvas.draw(Drawing(points=[(1.0, 0.0, "hit")]))[edge:]
    assert (plain == brush.LABEL_COLORS["hit"]).all(axis=2).sum() == 0
    assert (listed == brush.LABEL_COLORS["hit"]).all(axis=2).sum() > 0


def test_a_note_without_room_beside_the_policy_s_name_is_left_out() -> None:
    canvas = Canvas(yard(), size=240, title="swarm_bug2")
    plain = canvas.draw()
    assert not np.array_equal(canvas.draw(note="go"), plain)
    np.testing.assert_array_equal(canvas.draw(note="motion to goal / boundary following"), plain)


def test_areas_of_a_label_are_as_light_where_they_overlap_as_alone_and_so_is_the_legend() -> None:
    canvas = Canvas(yard())
    ring = np.array([[7.5, -1.5], [8.5, -1.5], [8.5, -2.5], [7.5, -2.5]])
    one, many = (canvas.draw(Drawing(areas=[(ring, "shadow")] * count), scan=False) for count in (1, 9))
    np.testing.assert_array_equal(one, many)
    tint = brush.mixed(brush.LABEL_COLORS["shadow"], brush.PAGE, brush.AREA_SHARE)
    legend = one[int(canvas.height - canvas.margin) + 4 :]
    assert (legend == tint).all(axis=2).sum() > 20
    on_floor = np.array(tint) * np.array(brush.FLOOR) / 255.0  # glass upon the floor
    np.testing.assert_allclose(color_at(canvas, one, 1.0, 0.0), on_floor, atol=2.0)


def test_the_legend_shows_a_dashed_line_for_a_dashed_line_and_the_mark_of_a_point() -> None:
    canvas = Canvas(yard())
    edge = int(canvas.height - canvas.margin) + 4

    def painted(drawing: Drawing, label: str) -> np.ndarray:
        return np.asarray((canvas.draw(drawing)[edge:] == brush.LABEL_COLORS[label]).all(axis=2))

    line = painted(Drawing(segments=[(6.0, -3.0, 9.0, -3.0, "path")]), "path")
    dashes = painted(Drawing(segments=[(6.0, -3.0, 9.0, -3.0, "m_line")]), "m_line")
    columns = np.flatnonzero(line.any(axis=0))
    assert np.diff(columns).max() == 1 and len(columns) >= 0.7 * canvas.margin  # without a gap
    assert np.diff(np.flatnonzero(dashes.any(axis=0))).max() > 1
    marks = [painted(Drawing(points=[(1.0, 0.0, label)]), label) for label in ("hit", "leave", "chosen")]
    heights = [mark.sum(axis=1)[mark.any(axis=1)] for mark in marks]
    assert heights[0].min() == heights[0].max()  # a square
    assert heights[1][-1] > heights[1][0] and heights[2][len(heights[2]) // 2] > heights[2][-1]  # a triangle, a diamond


def test_the_legend_tells_all_labels_however_many_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, float, float]] = []
    paint = painting.paint_sample

    def painted(pen: Any, sample: Any, x: float, y: float, *size: float) -> None:
        told.append((sample.label, x, y))
        paint(pen, sample, x, y, *size)

    monkeypatch.setattr(rendering, "paint_sample", painted)
    labels = list(brush.LABEL_COLORS)
    canvas = Canvas(yard(), size=300)
    canvas.draw(Drawing(points=[(1.0, 0.0, label) for label in labels]))
    assert [label for label, *_ in told] == labels
    assert len({(x, y) for _, x, y in told}) == len(labels)
    assert all(0.0 <= x < canvas.width and 0.0 <= y < canvas.height for _, x, y in told)


def test_no_two_labels_of_a_policy_look_the_same() -> None:
    """Hit and leave, cheap and dear, chosen and way: told apart by mark or kind as well as by colour."""
    for one, other in (("hit", "leave"), ("cheap", "dear"), ("candidate", "chosen"), ("closed", "candidate")):
        assert brush.MARKS.get(one) != brush.MARKS.get(other)
        assert brush.LABEL_COLORS[one] != brush.LABEL_COLORS[other]
    assert brush.LABEL_COLORS["chosen"] != brush.LABEL_COLORS["way"] != brush.ROBOTS[0]


def test_each_robot_may_have_a_drawing() -> None:
    simulation = Simulation("crossing_robots")
    simulation.reset(seeds=[0])
    canvas = Canvas(simulation)
    frame = canvas.draw([None, Drawing(points=[(2.0, 0.0, "leave")])])
    assert color_at(canvas, frame, 0.0, -3.0) == brush.LABEL_COLORS["leave"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_drawing_with_a_place_that_is_not_finite_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="finite places"):
        Canvas(yard()).draw(Drawing(points=[(value, 0.0, "hit")]))


def test_more_drawings_than_robots_are_refused() -> None:
    with pytest.raises(ValueError, match="2 drawings for 1 robots"):
        Canvas(yard()).draw([None, Drawing()])


def test_title_and_note_stand_above_the_world() -> None:
    simulation = yard()
    plain, titled = Canvas(simulation).draw(), Canvas(simulation, title="bug2").draw(note="stuck")
    rows, columns = np.nonzero((plain != titled).any(axis=2))
    assert rows.max() < Canvas(simulation).margin
    assert columns.min() < 100 < 500 < columns.max()


# ---------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize("size", [200, 600, 1600])
def test_a_flag_in_a_world_that_is_long_and_flat_stays_below_the_caption(size: int) -> None:
    frames = []
    for at in (-80.0, 90.0):
        world = {"family": "explicit", "bounds": [-100, -1, 100, 1], "start": [0, 0, 0], "goal": [at, 0.5]}
        simulation = Simulation({**WORLD, "world": world})
        simulation.reset(seeds=[0])
        frames.append(Canvas(simulation, size=size).draw())
    first, other = (frame[: round(18.0 * max(size / 600.0, 0.8))] for frame in frames)
    assert np.array_equal(first, other) and not np.array_equal(frames[0], frames[1])


def test_a_world_that_was_never_reset_is_refused() -> None:
    with pytest.raises(ValueError, match="reset the simulation"):
        Canvas(Simulation(WORLD)).draw()


@pytest.mark.parametrize("row", [-1, 2])
def test_a_row_that_is_not_there_is_refused(row: int) -> None:
    with pytest.raises(ValueError, match="row must be from 0 to 1"):
        Canvas(Simulation(WORLD, 2), row=row)


def test_a_size_that_shows_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 100"):
        Canvas(yard(), size=50)


def test_without_pygame_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=re.escape(install_command("render"))):
        Canvas(yard())


@pytest.mark.parametrize("length", [0.013, 0.2, 0.99, 1.0, 1.7, 4.9, 7.0, 350.0])
def test_the_bar_for_scale_is_a_round_length_that_fits(length: float) -> None:
    bar = rendering.round_length(length)
    assert bar <= length < 2.5 * bar
    assert f"{bar:e}"[0] in "125"


# ---------------------------------------------------------------------------------------------- window


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Pygame on the driver that shows nothing."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = brush.load_pygame()
    pygame.display.quit()
    yield pygame
    pygame.display.quit()


def test_a_window_shows_the_frame(screen: Any) -> None:
    canvas = Canvas(yard())
    window = Window(canvas, fps=1000.0)
    window.update()
    shown = screen.surfarray.array3d(screen.display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, canvas.draw())
    window.close()
    assert not screen.display.get_init()


def test_a_window_that_somebody_closes_stays_closed(screen: Any) -> None:
    window = Window(Canvas(yard()), fps=1000.0)
    window.update()
    screen.event.post(screen.event.Event(screen.QUIT))
    window.update()
    assert not window.is_open
    window.update()
    assert not screen.display.get_init()


def test_a_window_opens_again_when_another_part_shuts_the_display_down(screen: Any) -> None:
    window = Window(Canvas(yard()), fps=1000.0)
    window.update()
    screen.quit()
    window.update()
    assert window.is_open
    assert screen.display.get_surface() is not None


def test_a_window_keeps_real_time(screen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    ticks: list[float] = []

    class Clock:
        def tick(self, fps: float) -> None:
            ticks.append(fps)

    monkeypatch.setattr(screen.time, "Clock", Clock)
    window = Window(Canvas(yard()), fps=12.5)
    for _ in range(3):
        window.update()
    assert ticks == [12.5] * 3


def test_a_window_without_a_screen_shows_nothing_and_goes_on(screen: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no_such_driver")
    window = Window(Canvas(yard()), fps=1000.0)
    window.update()
    assert window.is_open
    assert screen.display.get_driver() == "dummy"


@pytest.mark.parametrize("fps", [0.0, -1.0, math.nan])
def test_a_window_needs_a_positive_rate(fps: float) -> None:
    with pytest.raises(ValueError, match="fps must be positive"):
        Window(Canvas(yard()), fps)


def test_frames_need_no_display() -> None:
    code = (
        "import pygame\n"
        "from bug_gym.drawing.canvas import Canvas\n"
        "from bug_gym.simulation import Simulation\n"
        "simulation = Simulation('static')\n"
        "simulation.reset(seeds=[0])\n"
        "assert Canvas(simulation).draw().std() > 0.0\n"
        "assert not pygame.display.get_init()\n"
    )
    environment = {name: value for name, value in os.environ.items() if not name.endswith("DISPLAY")}
    environment["SDL_VIDEODRIVER"] = "no_such_driver"
    root = Path(__file__).resolve().parents[2]
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


# ---------------------------------------------------------------------------------------------- pixels


def test_pictures_are_averaged_down_and_read_colour_by_colour() -> None:
    colors = np.random.default_rng(0).integers(0, 256, (14, 22, 3))
    large = (colors @ [1 << 16, 1 << 8, 1]).astype(np.uint32)
    small, rgb = np.zeros((7, 11), dtype=np.uint32), np.zeros((7, 11, 3), dtype=np.uint8)
    pixels.halve(large, small)
    pixels.unpack(small, rgb)
    means = colors.reshape(7, 2, 11, 2, 3).mean(axis=(1, 3))
    assert (rgb == np.floor(means + 0.5)).all()


def test_states_stand_beside_robots_that_are_under_way_and_not_upon_one_another() -> None:
    """At one place two texts stand on either side of it; of a robot that has arrived there is none."""
    places = [{"start": [0.0, 0.0, 0.0]}, {"start": [0.0, 3.0, 0.0]}]
    world = {"family": "empty", "bounds": [-10, -10, 10, 10], "start": [0, 0, 0], "goal": [8, 0]}
    simulation = Simulation({"world": world, "robots": places})
    simulation.reset(seeds=[0])
    canvas = Canvas(simulation)

    def changed(*states: str) -> set[tuple[int, int]]:
        differs = (canvas.draw(states=states) != canvas.draw()).any(axis=2)
        return {(int(y), int(x)) for y, x in np.argwhere(differs)}

    first, second, both = changed("hold", ""), changed("", "hold"), changed("hold", "hold")
    assert first and second and not first & second and both == first | second
    simulation.world.pose[0, 1] = simulation.world.pose[0, 0]
    assert len(changed("hold", "hold")) > 1.7 * len(changed("hold", ""))
    simulation.world.outcome[0, 0] = OUTCOMES.index("success")
    assert not changed("hold", "")


def test_who_opens_a_window_where_nobody_sees_it_is_told(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """SDL takes a driver without a screen by itself, and says nothing; who asks for one knows."""
    display = brush.load_pygame().display
    for asked in (None, "dummy"):
        display.quit()
        monkeypatch.delenv("SDL_VIDEODRIVER", raising=False) if asked is None else monkeypatch.setenv(
            "SDL_VIDEODRIVER", asked
        )
        caplog.clear()
        open_screen((64, 48))
        is_unseen = asked is None and display.get_driver() in UNSEEN
        assert ("the window stays invisible" in caplog.text) == is_unseen
    display.quit()
