"""DynaBARN's worlds: the spline of its movers, their jumps, and what is said of a file that can't be read."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym.config import load
from bug_gym.scenarios import draw_layout
from bug_gym.simulation import Simulation
from bug_gym.worlds.dynabarn_files import load_dynabarn
from bug_gym.worlds.keyframes import ERROR, Keyframes

OPEN = [[0.0, -8.0, -9.0], [1.5, -5.0, 2.0], [1.56, -4.0, 3.0], [7.0, 6.0, 1.0], [9.0, 7.0, 8.0]]
CLOSED = [[0.0, 2.0, 0.0], [2.0, 4.0, 3.0], [3.5, 6.0, -1.0], [8.0, 2.0, 0.0]]


def track(keys: list[list[float]]) -> Keyframes:
    """A track of these keys: time, x, y."""
    numbers = np.array(keys)
    return Keyframes(numbers[:, 0], numbers[:, 1:])


def plain_place(keys: list[list[float]], time: float) -> tuple[float, float]:
    """Gazebo's spline as dynabarn's notes write it, one number after the other."""
    n, last = len(keys), len(keys) - 1
    closed = math.dist(keys[0][1:], keys[-1][1:]) < 1e-3
    time = math.fmod(time, keys[-1][0])
    i = max(j for j in range(last) if keys[j][0] <= time)
    f = (time - keys[i][0]) / (keys[i + 1][0] - keys[i][0])
    place = []
    for axis in (1, 2):
        p = [key[axis] for key in keys]
        m = [0.5 * (p[min(j + 1, last)] - p[max(j - 1, 0)]) for j in range(n)]
        if closed:
            m[0] = m[last] = 0.5 * (p[1] - p[last - 1])
        place.append(
            (2 * f**3 - 3 * f**2 + 1) * p[i]
            + (-2 * f**3 + 3 * f**2) * p[i + 1]
            + (f**3 - 2 * f**2 + f) * m[i]
            + (f**3 - f**2) * m[i + 1]
        )
    return place[0], place[1]


# ------------------------------------------------------------------------------------------------ the spline


@pytest.mark.parametrize("keys", [OPEN, CLOSED])
def test_the_spline_is_gazebos(keys: list[list[float]]) -> None:
    times = np.random.default_rng(0).uniform(0.0, 30.0, 300)
    expected = [plain_place(keys, time) for time in times]
    np.testing.assert_allclose(track(keys).places(times), expected, atol=1e-9)


def test_the_spline_goes_through_its_keys_and_begins_anew_at_the_period() -> None:
    one = track(OPEN)
    np.testing.assert_allclose(one.places(one.times[:-1]), one.points[:-1], atol=1e-12)
    np.testing.assert_allclose(one.places(np.array([9.0 - 1e-9]))[0], [7.0, 8.0], atol=1e-6)
    assert one.places(np.array([9.0, 18.0])).tolist() == [[-8.0, -9.0]] * 2


def test_between_two_keys_the_share_of_the_way_is_that_of_half_chord_tangents() -> None:
    """With m = (p1 - p0)/2 at both ends the share is -f^3 + 1.5 f^2 + 0.5 f."""
    f = np.linspace(0.0, 0.999, 40)
    places = track([[0.0, 1.0, 2.0], [4.0, 3.0, -2.0]]).places(4.0 * f)
    share = -(f**3) + 1.5 * f**2 + 0.5 * f
    np.testing.assert_allclose(places, np.column_stack([1.0 + 2.0 * share, 2.0 - 4.0 * share]), atol=1e-12)


@pytest.mark.parametrize("keys", [OPEN, CLOSED])
@pytest.mark.parametrize("since", [0.0, 3.3, 26.9])
def test_the_records_keep_to_the_spline_and_one_body_is_there_at_each_time(
    keys: list[list[float]], since: float
) -> None:
    replays = track(keys).replays(since, 40.0)
    assert (len(replays) == 1) == (keys is CLOSED)
    period = keys[-1][0]
    jumps = np.arange(1, 5) * period - math.fmod(since, period)
    for time in (*np.linspace(0.0, 40.0, 997), *(jump for jump in jumps if 0.0 <= jump <= 40.0)):
        there = [replay for replay in replays if replay.is_there(time)]
        assert len(there) == 1
        wrapped = math.fmod(since + time, period)
        if min(wrapped, period - wrapped) > 1e-5:
            assert math.dist(there[0].place(time), plain_place(keys, wrapped)) <= ERROR
    if keys is OPEN:  # at the very jump it is at the first key
        assert all(
            replay.place(jump) == pytest.approx((-8.0, -9.0), abs=1e-3)
            for jump in jumps[jumps <= 40.0]
            for replay in replays
            if replay.is_there(jump)
        )


# ------------------------------------------------------------------------------------------------ worlds


def line(world: Any = 300, **changes: Any) -> str:
    """One world as a line of a .jsonl; a change to ... leaves the key out."""
    data: dict[str, Any] = {
        "world": world,
        "start": [11, 0, 3.14159],
        "goal": [-9, 0],
        "walls": [{"polygon": [[-10.25, -10.0], [-9.75, -10.0], [-9.75, 10.0], [-10.25, 10.0]]}],
        "movers": [{"radius": 0.5, "keyframes": OPEN}, {"radius": 0.4, "keyframes": CLOSED}],
    }
    return json.dumps({key: value for key, value in (data | changes).items() if value is not ...})


def jsonl(folder: Path, *lines: str) -> str:
    """A file of these lines."""
    path = folder / "worlds.jsonl"
    path.write_text("".join(f"{text}\n" for text in lines), encoding="utf-8")
    return str(path)


def scenario(path: str, **world: Any) -> dict[str, Any]:
    """A scenario in the worlds of a file."""
    return {
        "robot": {"kinematics": "differential", "radius": 0.25},
        "lidar": {"beams": 32},
        "time": {"step": 0.05, "limit": 30.0},
        "world": {"family": "dynabarn", "path": path, **world},
    }


def discs_there(simulation: Simulation) -> dict[float, list[list[float]]]:
    """Places of the discs that are in the world, by radius."""
    places, radii = simulation.world.disc_position[0], simulation.world.disc_radius[0]
    return {radius: places[(radii == radius) & (places[:, 0] < 1e5)].tolist() for radius in set(radii.tolist())}


def test_at_each_step_the_movers_are_where_the_spline_has_them(tmp_path: Path) -> None:
    simulation = Simulation(load(scenario(jsonl(tmp_path, line()), since=4.0)))
    simulation.reset(seeds=[0])
    for number in range(1, 401):
        simulation.step(np.zeros((1, 1, 2), dtype=np.float32))
        time, there = 4.0 + 0.05 * number, discs_there(simulation)
        assert len(there[0.5]) == len(there[0.4]) == 1
        assert math.dist(there[0.4][0], plain_place(CLOSED, time)) <= ERROR + 1e-4
        if abs(time / 9.0 - round(time / 9.0)) > 1e-9:  # at the jump itself rounding says which
            assert math.dist(there[0.5][0], plain_place(OPEN, time)) <= ERROR


JUMPER = [{"radius": 0.5, "keyframes": [[0.0, -5.0, 0.0], [2.0, -4.5, 0.0], [4.0, 5.0, 0.0]]}]


def drive_to_the_jump(tmp_path: Path, x: float) -> tuple[str, float]:
    """Outcome and time of a robot that stands at (x, 0) while a mover passes and jumps back over it."""
    path = jsonl(tmp_path, line(movers=JUMPER, start=[x, 0.0, 0.0]))
    simulation = Simulation(load(scenario(path, since=3.98)))
    simulation.reset(seeds=[0])
    still = 2.0 * 0.3 / 1.3 - 1.0  # the action of speed 0: -max_reverse to max_speed is -1 to 1
    for number in range(1, 20):
        simulation.step(np.array([[[still, 0.0]]], dtype=np.float32))
        if simulation.info()["collision"][0, 0]:
            return "collision", 0.05 * number
    return "nothing", 0.95


def test_a_jump_touches_nothing_on_its_way(tmp_path: Path) -> None:
    assert drive_to_the_jump(tmp_path, 0.0)[0] == "nothing"


def test_who_stands_where_a_mover_jumps_to_is_hit_then(tmp_path: Path) -> None:
    assert drive_to_the_jump(tmp_path, -4.8) == ("collision", 0.05)


def test_the_seed_draws_the_phase(tmp_path: Path) -> None:
    drawn = load(scenario(jsonl(tmp_path, line())))
    places = [[mover.at for mover in draw_layout(drawn, seed, 0).movers if mover.is_there] for seed in (1, 1, 2)]
    assert places[0] == places[1] != places[2]
    fixed = load(scenario(jsonl(tmp_path, line()), since=3.0))
    for seed in (1, 2):
        there = [mover.at for mover in draw_layout(fixed, seed, 0).movers if mover.is_there]
        assert [math.dist(a, plain_place(keys, 3.0)) < ERROR for a, keys in zip(there, (OPEN, CLOSED), strict=True)]


def test_walls_start_and_goal_are_the_files(tmp_path: Path) -> None:
    layout = draw_layout(load(scenario(jsonl(tmp_path, line(7)), world=7)), 0, 0)
    assert layout.starts.tolist() == [[11.0, 0.0, 3.14159]] and layout.goals.tolist() == [[-9.0, 0.0]]
    assert layout.polygons[0][0].tolist() == [[-10.25, -10.0], [-9.75, -10.0], [-9.75, 10.0], [-10.25, 10.0]]


def test_a_number_that_is_not_there_is_an_error_that_says_which_are(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no world 4 in .*worlds.jsonl; it holds \[300\]"):
        draw_layout(load(scenario(jsonl(tmp_path, line()), world=4)), 0, 0)


def test_the_worlds_of_the_shared_data_move_as_their_keyframes_say(shared_data: Path) -> None:
    path = shared_data / "dynabarn_worlds.jsonl"
    raw = {world["world"]: world for world in map(json.loads, path.read_text().splitlines())}
    assert len(load_dynabarn(str(path))) == len(raw) == 20
    for number, world in raw.items():
        layout = draw_layout(load(scenario(str(path), world=number, since=12.5)), 0, 0)
        there = [mover.at for mover in layout.movers if mover.is_there]
        expected = [plain_place(mover["keyframes"], 12.5) for mover in world["movers"]]
        assert [math.dist(*pair) <= ERROR for pair in zip(there, expected, strict=True)]


# ------------------------------------------------------------------------------------------------ what can't be read


def one_mover(keys: Any, radius: Any = 0.5) -> str:
    """A world with this mover."""
    return line(movers=[{"radius": radius, "keyframes": keys}])


CORRUPT: dict[str, tuple[str, str]] = {
    "cut off": (line()[:-20], "not JSON"),
    "no movers": (line(movers=...), "lacks the key 'movers'"),
    "no radius": (line(movers=[{"keyframes": OPEN}]), "lacks the key 'radius'"),
    "radius 0": (one_mover(OPEN, 0.0), "got the radius 0"),
    "one key": (one_mover(OPEN[:1]), "got 1 keyframes"),
    "no key": (one_mover([]), "the keyframes has shape"),
    "times that fall": (one_mover([OPEN[0], OPEN[2], OPEN[1]]), "expected times that rise from 0"),
    "times from 1": (one_mover([[1.0, 0.0, 0.0], [3.0, 1.0, 1.0]]), "expected times that rise from 0"),
    "too short": (one_mover([[0.0, 0.0, 0.0], [0.5, 1.0, 1.0]]), "expected times that rise from 0"),
    "NaN key": (one_mover([OPEN[0], [1.0, math.nan, 0.0]]), "not finite"),
    "place beyond all": (one_mover([OPEN[0], [1.0, 1e5, 0.0]]), "beyond 1000"),
    "wall of two corners": (line(walls=[{"polygon": [[0, 0], [1, 1]]}]), "fewer than 3 corners"),
    "short start": (line(start=[0.0, 1.0]), "the start has shape"),
}


@pytest.mark.parametrize("name", CORRUPT)
def test_a_corrupt_line_is_an_error_with_file_and_line_number(name: str, tmp_path: Path) -> None:
    bad, what = CORRUPT[name]
    with pytest.raises(ValueError, match=rf"worlds.jsonl, line 2: .*{what}"):
        load_dynabarn(jsonl(tmp_path, line(1), bad))


def test_a_limit_that_makes_too_many_laps_is_said(tmp_path: Path) -> None:
    described = load({**scenario(jsonl(tmp_path, line())), "time": {"step": 0.05, "limit": 1e6}})
    with pytest.raises(ValueError, match="a time limit of 1e\\+06 s makes .* laps of the movers, expected at most"):
        draw_layout(described, 0, 0)
