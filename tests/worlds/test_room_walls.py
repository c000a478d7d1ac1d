"""Rooms in compiled code are those of the plain way, bit for bit: walls, start, goal, and what is drawn after them."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import shapely

from bug_gym.config import RoomsWorld, Scenario, load
from bug_gym.worlds import places
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.room_walls import numbered_faces, stand_ins, whole_rings
from bug_gym.worlds.rooms import plain_walls

CASES: dict[str, tuple[dict[str, Any], int]] = {
    "shipped": ({}, 500),
    "many": ({"columns": 5, "rows": 6, "door": 0.8, "loops": 0.0, "unevenness": 0.3}, 30),
    "doors everywhere": ({"columns": 4, "rows": 3, "door": 1.0, "loops": 1.0}, 30),
    "even": ({"columns": 4, "rows": 2, "unevenness": 0.0, "wall": 0.1}, 20),
    "uneven": ({"columns": 4, "rows": 4, "door": 0.5, "unevenness": 0.85, "wall": 0.1}, 60),
    "a row": ({"columns": 6, "rows": 1}, 10),
    "a column": ({"columns": 1, "rows": 5}, 10),
    "four": ({"columns": 2, "rows": 2}, 20),
    "odd bounds": ({"columns": 5, "rows": 7, "door": 0.6, "wall": 0.05, "bounds": [-7.3, -20.1, 33.7, 14.9]}, 10),
    "more walls than sort keeps in order": ({"columns": 12, "rows": 10, "door": 0.6, "unevenness": 0.4}, 3),
    "wide doors": ({"door": 3.13}, 30),
}
"""What a scenario says of rooms, and seeds, by name."""
PLACES: dict[str, dict[str, Any]] = {
    "anywhere": {"world": {"family": "rooms"}},
    "far apart": {"world": {"family": "rooms", "separation": 20.0}},
    "fixed": {"world": {"family": "rooms", "start": [-8.0, -8.0, 0.3], "goal": [8.0, 8.0]}},
    "fixed where walls may be": {"world": {"family": "rooms", "start": [-8.0, -3.3, 0.3], "goal": [8.0, 8.0]}},
    "regions": {
        "world": {"family": "rooms", "start": {"region": [-9, -9, -5, -5]}, "goal": {"region": [5, 5, 9, 9]}},
    },
    "a heading": {"world": {"family": "rooms", "start": {"region": [-9, -9, 0, 0], "heading": 0.5}}},
    "a row of robots": {"robots": {"count": 3}, "world": {"family": "rooms"}},
    "a large robot": {"robot": {"radius": 0.55}, "world": {"family": "rooms"}},
}
"""Scenarios that say different things of start and goal."""


def world_of(settings: dict[str, Any]) -> RoomsWorld:
    world = load({"world": {"family": "rooms", **settings}}).world
    assert isinstance(world, RoomsWorld)
    return world


def generator(seed: int) -> np.random.Generator:
    return np.random.default_rng([1, seed, 0])


def numbers(layout: Layout) -> tuple[bytes, ...]:
    """All that a world of rooms holds, to compare bit for bit."""
    rings = [ring for polygon in layout.polygons for ring in polygon]
    return tuple(array.tobytes() for array in (layout.border, layout.starts, layout.goals, *rings))


@pytest.mark.parametrize("name", CASES)
def test_walls_are_those_of_the_plain_way(name: str) -> None:
    settings, seeds = CASES[name]
    world = world_of(settings)
    for seed in range(seeds):
        rng, plain_rng = generator(seed), generator(seed)
        walls, plain = world.compiled_walls(rng), plain_walls(world, plain_rng)
        assert walls is not None
        assert [[ring.tobytes() for ring in rings] for rings in walls.polygons] == [
            [ring.tobytes() for ring in rings] for rings in plain
        ]
        assert rng.bit_generator.state == plain_rng.bit_generator.state


def drawn(scenario: Scenario, seed: int) -> tuple[tuple[bytes, ...], Any]:
    """The world of a seed, to compare bit for bit, and the state in which it leaves its generator."""
    rng = generator(seed)
    return numbers(scenario.world.layout(scenario.crew, rng)), rng.bit_generator.state


@contextmanager
def plainly() -> Iterator[None]:
    """Nothing is drawn by compiled code, which looks for places among its own walls only."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(RoomsWorld, "compiled_walls", lambda world, rng: None)
        yield


@pytest.mark.parametrize("name", PLACES)
def test_start_and_goal_are_those_of_the_plain_way(name: str) -> None:
    scenario = load(PLACES[name])
    compiled = [drawn(scenario, seed) for seed in range(60)]
    with plainly():
        assert compiled == [drawn(scenario, seed) for seed in range(60)]


def test_a_world_without_room_says_the_same_as_the_plain_way(monkeypatch: pytest.MonkeyPatch) -> None:
    in_a_corner = {"region": [-9.99, -9.99, -9.9, -9.9]}
    scenario = load({"world": {"family": "rooms", "start": in_a_corner}})
    monkeypatch.setattr(places, "TRIES", 20)
    with pytest.raises(ValueError, match="no free place for the start") as compiled:
        drawn(scenario, 0)
    with plainly(), pytest.raises(ValueError, match="no free place for the start") as plain:
        drawn(scenario, 0)
    assert str(compiled.value) == str(plain.value)


def test_what_is_free_among_compiled_walls_is_what_is_free() -> None:
    rng, found = np.random.default_rng(5), set()
    world = world_of({})
    walls = world.compiled_walls(generator(3))
    assert walls is not None and walls.outlines is not None
    border = np.array(world.corners)
    corners = np.concatenate([rings[0] for rings in walls.polygons])
    near = corners[rng.integers(len(corners), size=400)] + rng.normal(0.0, 0.3, (400, 2))
    for room in (0.0, 0.2, 0.5):
        compiled, plain = walls.outlines.clear(room), is_clear(np.zeros((0, 3)), walls.polygons, border, room)
        # so far from the border that the last bit decides
        touching = [(-9.0, y) for y in (-10.0 + room, *np.nextafter(-10.0 + room, [-11.0, 0.0]).tolist())]
        for x, y in [*near.tolist(), *rng.uniform(-11.0, 11.0, (400, 2)).tolist(), *touching]:
            assert compiled(x, y) == plain(x, y)
            found.add(compiled(x, y))
    assert found == {True, False}


@pytest.mark.parametrize(
    ("settings", "rng"),
    [
        ({}, np.random.Generator(np.random.Philox(3))),
        ({"columns": 2, "rows": 1}, generator(0)),  # one wall
        ({"columns": 4, "rows": 4, "door": 4.8, "unevenness": 0.0}, generator(0)),  # doors as wide as their rooms
    ],
)
def test_what_compiled_code_cannot_draw_is_drawn_plainly(settings: dict[str, Any], rng: np.random.Generator) -> None:
    world = world_of(settings)
    before = str(rng.bit_generator.state)
    assert world.compiled_walls(rng) is None
    assert str(rng.bit_generator.state) == before
    layout = world.layout(load({"world": {"family": "rooms"}}).crew, rng)
    cut = shapely.union_all([shapely.Polygon(rings[0], rings[1:]) for rings in layout.polygons])
    free = shapely.box(*world.bounds).difference(cut)
    assert len(shapely.get_parts(free)) == 1, "each room can be reached from each"


@pytest.mark.parametrize("count", range(1, 7))
def test_stand_ins_lie_about_the_middle_as_told(count: int) -> None:
    for before in range(count):
        for within in range(count - before):
            places_of = stand_ins(count, before + count * within)
            assert (places_of is None) == (within > 1)
            if places_of is not None:
                inner = places_of[1:-1]
                assert ((inner < 0.0).sum(), (inner == 0.0).sum()) == (before, within)
                assert len(places_of) == count + 1 and (np.diff(places_of) >= 1.0).all()
                assert places_of[0] == -places_of[-1]


def test_whole_walls_have_each_crossing_and_each_end_once() -> None:
    whole = whole_rings(4, 3, 1 * 16 + 1)
    assert whole is not None
    assert len(whole.faces) == len(set(map(tuple, whole.faces.tolist()))) == 4 * 3 * 2 + 4 * (3 + 2)
    assert len(whole.firsts) - 1 == 1 + 2 * 1, "the shell, and a hole for each room that is not at the border"
    assert len(numbered_faces(np.arange(5.0), 0.1)) == 8


def test_worlds_of_others_compile_nothing() -> None:
    code = (
        "from bug_gym.compiling import KERNELS; from bug_gym.config import load; "
        "from bug_gym.scenarios import draw_layout\n"
        "for name in ('rooms', 'maze', 'urban'): load(name)\n"
        "for name in ('maze', 'urban', 'u_trap'): draw_layout(load(name), 0, 0)\n"
        "print([kernel.py_func.__name__ for kernel in KERNELS if kernel.signatures])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
