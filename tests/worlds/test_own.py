"""Families of worlds from outside: by module, file, class, registered name and entry point; trust, workers, faces, files."""

from __future__ import annotations

import importlib.metadata
import json
import pickle
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import yaml

from bug_gym import worlds
from bug_gym.agents.sb3 import make_vec_env
from bug_gym.cli import main
from bug_gym.config import Count, ScenarioError, dump, load, to_yaml
from bug_gym.evaluation import evaluate
from bug_gym.scenarios import as_explicit
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.schema.values import Box
from bug_gym.simulation import Simulation
from bug_gym.worlds import own
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import finish

CODE = '''
import numpy as np
from pathlib import Path
from bug_gym.config import Count
from bug_gym.worlds.family import DrawnPlaces, Family
from bug_gym.worlds.places import finish

Path(__file__).with_name("imported").touch()

class Pegs(DrawnPlaces):
    pegs: Count = 5
    """How many."""
    def layout(self, crew, rng):
        circles = np.column_stack([rng.uniform(-3, 3, (self.pegs, 2)), np.full(self.pegs, 0.2)])
        return finish(crew, self, (-8.0, 0.0, 0.0), (8.0, 0.0), circles=circles)

class NoLayout(Family):
    pass

class NoFamily:
    pass

number = 3
'''
"""A user's file: a family, and what may be wrong with one."""

MINE: dict[str, Any] = {"name": "mine", "lidar": {"beams": 8}, "world": {"family": "pegs.py:Pegs", "pegs": 3}}


class Rows(DrawnPlaces):
    """A family in this module."""

    pegs: Count = 2
    """How many."""

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        circles = np.column_stack([rng.uniform(-3, 3, (self.pegs, 2)), np.full(self.pegs, 0.2)])
        return finish(crew, self, (-8.0, 0.0, 0.0), (8.0, 0.0), circles=circles)


class Wide(Rows):
    """A family with bounds and ground of its own, whose border is a box."""

    bounds: Box = (-30.0, -20.0, 30.0, 20.0)
    regions: tuple[WeightedRegion, ...] = (WeightedRegion(circle=(0.0, 5.0, 1.0), factor=2.0),)


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a user's file, in which everything runs; and nothing registered."""
    (tmp_path / "pegs.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(own, "REGISTERED", {})
    monkeypatch.setattr(worlds, "REGISTERED", own.REGISTERED)
    yield tmp_path
    own.installed.cache_clear()


def circles_of(scenario: Any, seed: int = 0) -> Any:
    """The circles of a world (n, 3)."""
    simulation = Simulation(scenario)
    simulation.reset(seeds=[seed])
    return simulation.world.layout(0).circles


# ---------------------------------------------------------------------------------------------- ways to name one


def test_file_module_class_and_name_are_the_same_worlds(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = circles_of(load(MINE, trust=True))
    assert expected.shape == (3, 3)
    np.testing.assert_array_equal(
        circles_of(load({**MINE, "world": {"family": "pegs:Pegs", "pegs": 3}}, trust=True)), expected
    )
    np.testing.assert_array_equal(circles_of({**MINE, "world": {"family": Rows, "pegs": 3}}), expected)
    worlds.register("my-pegs", "pegs.py:Pegs")
    worlds.register("my-pegs", "pegs.py:Pegs")  # again changes nothing
    np.testing.assert_array_equal(circles_of({**MINE, "world": {"family": "my-pegs", "pegs": 3}}), expected)
    point = importlib.metadata.EntryPoint("installed_pegs", f"{place / 'pegs.py'}:Pegs", own.GROUP)
    wrong = importlib.metadata.EntryPoint("other", "no reference", own.GROUP)
    taken = importlib.metadata.EntryPoint("maze", f"{place / 'pegs.py'}:Pegs", own.GROUP)
    offered = [point, wrong, taken]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: offered if group == own.GROUP else [])
    own.installed.cache_clear()
    assert [*own.installed()] == ["installed_pegs"]
    np.testing.assert_array_equal(circles_of({**MINE, "world": {"family": "installed_pegs", "pegs": 3}}), expected)


def test_a_file_names_it_from_its_own_folder(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "deep").mkdir()
    (place / "deep" / "mine.yaml").write_text("world: {family: '../pegs.py:Pegs', pegs: 4}\n")
    monkeypatch.chdir(place.parent)
    assert len(circles_of(load(place / "deep" / "mine.yaml", trust=True))) == 4


# ---------------------------------------------------------------------------------------------- trust


def test_without_trust_it_is_data_and_nothing_is_imported(place: Path) -> None:
    untrusted = load(MINE)
    assert dump(untrusted)["world"] == {"family": f"{place / 'pegs.py'}:Pegs", "pegs": 3}
    for make in (lambda: Simulation(untrusted), lambda: evaluate("random", MINE, episodes=1)):
        with pytest.raises(
            ScenarioError, match=r"world\.family is the code .*pegs\.py:Pegs; to import it runs its code: pass"
        ):
            make()
    assert not (place / "imported").exists()
    assert load(untrusted, trust=True) == load(MINE, trust=True)
    assert (place / "imported").exists()


def test_no_override_and_no_suite_grants_trust(place: Path) -> None:
    suite = {"scenarios": [{"scenario": {**MINE, "trust": True}}]}
    with pytest.raises(ScenarioError, match="unknown key"):
        evaluate("random", suite, episodes=1)
    with pytest.raises(ScenarioError, match="trust"):
        Simulation("static", overrides={"world": MINE["world"]})
    assert not (place / "imported").exists()


def test_trust_stays_with_what_is_changed_and_copied() -> None:
    trusted = load(MINE, trust=True)
    changed = load(trusted, {"world.pegs": 6})
    assert len(circles_of(changed)) == 6
    assert len(evaluate("go_to_goal", trusted, episodes=1, overrides={"time.limit": 0.5})) == 1
    copied = pickle.loads(pickle.dumps(trusted))
    assert copied == trusted and copied.digest == trusted.digest
    with pytest.raises(ScenarioError, match="trust"):
        Simulation(load(trusted, {"world.family": "pegs.py:Pegs"}))  # named anew, by who knows whom


# ---------------------------------------------------------------------------------------------- wherever worlds are


def test_it_is_saved_and_loaded_and_written_out(place: Path) -> None:
    trusted = load(MINE, trust=True)
    assert load(dump(trusted), trust=True) == trusted
    (place / "saved.yaml").write_text(to_yaml(trusted))
    assert load(place / "saved.yaml", trust=True) == trusted
    simulation = Simulation(trusted)
    simulation.reset(seeds=[2])
    explicit = as_explicit(trusted, simulation.world.layout(0))
    np.testing.assert_array_equal(circles_of(explicit, 2), circles_of(trusted, 2))


def test_faces_and_workers_have_the_same_worlds(place: Path) -> None:
    env = gym.make("BugGym/Navigation-v0", scenario=MINE, observation="flat", trust=True)
    vector = gym.make_vec("BugGym/Navigation-v0", num_envs=2, scenario=MINE, observation="flat", trust=True)
    sb3 = make_vec_env("BugGym/Navigation-v0", 2, scenario=MINE, trust=True)
    seen = env.reset(seed=5)[0]
    np.testing.assert_array_equal(vector.reset(seed=5)[0][0], seen)
    assert sb3.reset() is not None
    worlds.register("my-pegs", "pegs.py:Pegs")
    named = {**MINE, "world": {"family": "my-pegs"}}
    for scenario, trust in ((MINE, True), (named, False)):
        alone = evaluate("go_to_goal", scenario, episodes=9, trust=trust)
        several = evaluate("go_to_goal", scenario, episodes=9, trust=trust, workers=2, out=place / f"out {trust}")
        assert [(row.seed, row.path_length) for row in alone] == [(row.seed, row.path_length) for row in several]
        (told,) = json.loads((place / f"out {trust}" / "manifest.json").read_text())["scenarios"].values()
        assert len(told["code"]["world.family"]) == 16


# ---------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("world", "message"),
    [
        ({"family": "pegs.py:Pags"}, r"world\.family: .*pegs\.py has no class 'Pags', did you mean 'Pegs'\?"),
        ({"family": "nowhere:Pegs"}, r"world\.family: no module 'nowhere'"),
        ({"family": "nowhere.py:Pegs"}, r"world\.family: no file .*nowhere\.py"),
        ({"family": "pegs.py:NoFamily"}, "is no family of worlds: got class NoFamily, expected a class derived from"),
        ({"family": "pegs.py:number"}, "is no family of worlds: got an object of type int"),
        ({"family": "pegs.py:NoLayout"}, r"is no whole family of worlds: it lacks layout\(crew, rng\)"),
        ({"family": "pegs.py:Pegs", "pigs": 1}, r"world\.pigs: unknown key, did you mean 'pegs'"),
        ({"family": "pegs.py:Pegs", "pegs": -1}, r"world\.pegs: got -1, expected at least 0"),
        ({"family": "pegs.py:Pegs", "separation": 99.0}, r"world\.separation: got 99, expected at most"),
        ({"family": "my-pigs"}, r"world\.family: got 'my-pigs', .*did you mean 'my-pegs'"),
    ],
)
def test_what_is_wrong_is_told_in_a_line(world: dict[str, Any], message: str) -> None:
    worlds.register("my-pegs", "pegs.py:Pegs")
    with pytest.raises(ScenarioError, match=message) as told:
        load({**MINE, "world": world}, trust=True)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("name", "reference", "message"),
    [
        ("maze", "pegs.py:Pegs", "the name 'maze' is taken, by the family 'maze' of this package"),
        ("mine", "pegs.py:NoLayout", r"the name 'mine' is taken, by .*pegs\.py:Pegs"),
        ("a/b", "pegs.py:Pegs", "as the name of a family, expected letters"),
        ("other", "pegs.py", "expected text such as 'my_module:MyWorld'"),
        ("other", Rows, "expected text such as 'my_module:MyWorld'"),
    ],
)
def test_a_name_that_cannot_be_registered_is_refused(name: str, reference: Any, message: str) -> None:
    worlds.register("mine", "pegs.py:Pegs")
    with pytest.raises(ValueError, match=message):
        worlds.register(name, reference)
    assert [*own.REGISTERED] == ["mine"]


@pytest.mark.parametrize(
    "reference",
    ["pegs.py:Pags", "nowhere:Pegs", "nowhere.py:Pegs", "pegs.py:NoFamily", "pegs.py:NoLayout", "needy.py:Pegs"],
)
def test_a_name_that_could_not_be_registered_is_free_for_the_next(reference: str, place: Path) -> None:
    (place / "needy.py").write_text("import nowhere_to_be_found\n")
    with pytest.raises((ValueError, ImportError)):
        worlds.register("mine", reference)
    assert not own.REGISTERED
    worlds.register("mine", "pegs.py:Pegs")
    assert len(circles_of({**MINE, "world": {"family": "mine", "pegs": 2}})) == 2


BUILT = """
import itertools
import sys
import numpy as np
from bug_gym.config import Bounce
from bug_gym.worlds.family import Family
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.places import border_of

NONE = np.zeros((0, 3))
DRAWN = itertools.count()
SQUARE = np.array([[4.0, 4.0], [5.0, 4.0], [5.0, 5.0], [4.0, 5.0]])
MOTION = Bounce(law="bounce", velocity=(0.1, 0.0))


class Built(Family):
    def layout(self, crew, rng):
        places = {"starts": np.array([[0.0, 0.0, 0.0]]), "goals": np.array([[3.0, 1.0]]), "circles": NONE}
        return Layout(**{"border": border_of(self), **places, **dict(WHAT)})


class Answers(Family):
    def layout(self, crew, rng):
        return "a maze"


class Leaves(Family):
    def layout(self, crew, rng):
        sys.exit(0)


class Takes(Family):
    def layout(self, crew):
        return None


class Refuses(Built):
    def check(self, robot):
        raise ValueError("no robot at all")
"""
"""Families that build their layout by hand."""


def built(place: Path, name: str, what: str = "") -> Any:
    """A scenario of a family of BUILT, with what stands for WHAT in it."""
    (place / "built.py").write_text(BUILT.replace("WHAT", what))
    return load({**MINE, "world": {"family": f"built.py:{name}"}}, trust=True)


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ("circles=np.array([[np.nan, 5.0, 1.0]])", r"circles: got \[nan, 5.0, 1.0\], expected \(k, 3\) of finite"),
        ("circles=np.zeros((2, 2))", r"circles: got shape \(2, 2\), expected \(k, 3\) of finite numbers"),
        ("circles='none'", r"circles: got 'none', expected \(k, 3\) of finite numbers"),
        ("circles=np.array([[5.0, 5.0, -1.0]])", "circles: got the radius -1, expected one above 0"),
        ("circles=np.array([[0.0, 0.0, 1.0]])", r"robot 0 cannot start at \[0.0, 0.0, 0.0\]: an obstacle"),
        ("circles=np.array([[3.0, 1.0, 0.5]])", r"the goal \[3.0, 1.0\] lies in an obstacle"),
        (
            "starts=np.array([[50.0, 0.0, 0.0]])",
            r"robot 0 cannot start at \[50.0, 0.0, 0.0\]: an obstacle or the border",
        ),
        (
            "starts=np.array([[np.inf, 0.0, 0.0]])",
            r"starts: got \[inf, 0.0, 0.0\], expected \(1, 3\) of finite numbers",
        ),
        ("starts=NONE", r"starts: got shape \(0, 3\), expected \(1, 3\) of finite numbers"),
        ("goals=np.zeros((2, 2))", r"goals: got shape \(2, 2\), expected \(1, 2\) of finite numbers"),
        ("border=np.zeros((2, 2))", r"border: got shape \(2, 2\), expected \(k, 2\) of finite numbers, k at least 3"),
        ("border=np.array([[-9, -9], [9, 9], [9, -9], [-9, 9]])", r"border: the polygon crosses itself at \(0, 0\)"),
        ("polygons=((SQUARE[[0, 2, 1, 3]],),)", r"polygons\.0: the polygon crosses itself at \(4.5, 4.5\)"),
        ("polygons=((SQUARE[[0, 0, 0]],),)", r"polygons\.0: the polygon "),
        ("polygons=((SQUARE, SQUARE + 9.0),)", r"polygons\.0: the polygon is not simple \(Hole lies outside shell\)"),
        (
            "movers=(Mover(SQUARE[[0, 2, 1, 3]], (0.0, -5.0), MOTION),)",
            r"movers\.0\.outline: the polygon crosses itself",
        ),
        ("polygons=(SQUARE,)", r"polygons\.0: got array\(\[\[4.*, expected a tuple of them"),
        ("polygons=((SQUARE[:2],),)", r"polygons\.0: got shape \(2, 2\), expected \(k, 2\) of finite"),
        ("movers=(3,)", r"movers\.0: got 3, expected a bug_gym\.worlds\.layout\.Mover"),
        ("movers=(Mover(0.3, (5.0, 5.0), 'bounce'),)", r"movers\.0\.motion: got 'bounce', expected a motion law"),
        ("movers=(Mover(-0.3, (5.0, 5.0), MOTION),)", r"movers\.0\.outline: got the radius -0.3, expected one above 0"),
        (
            "movers=(Mover(0.3, (5.0, np.nan), MOTION),)",
            r"movers\.0\.at: got \[5.0, nan\], expected \(1, 2\) of finite",
        ),
        ("target='bounce'", "target: got 'bounce', expected a motion law"),
        ("target=MOTION, goal_room=np.nan", r"goal_room: got \[nan\], expected \(1, 1\) of finite numbers"),
        ("movers=(Mover(0.3, (0.1, 0.0), MOTION),)", r"robot 0 cannot start at \[0.0, 0.0, 0.0\]: an obstacle"),
        ("movers=(Mover(0.3, (15.0, 0.0), MOTION),)", r"movers\.0\.at: got \[15.0, 0.0\], .* over no border"),
        ("movers=(Mover(0.3, (9.8, 0.0), MOTION),)", r"movers\.0\.at: got \[9.8, 0.0\], .* over no border"),
        ("movers=(Mover(SQUARE, (5.5, 0.0), MOTION),)", r"movers\.0\.at: got \[5.5, 0.0\], .* over no border"),
        (
            "movers=(Mover(0.1, (4.5, 4.5), MOTION),), polygons=((SQUARE,),)",
            r"movers\.0\.at: got \[4.5, 4.5\], expected a place outside of polygons\.0",
        ),
        (
            "border=np.array([[-10, -10], [10.5, -10], [10, 10], [-10, 10]])",
            r"border: got the corner \[10.5, -10.0\], expected it within world\.bounds, \[-10.0, ",
        ),
        (
            "circles=np.array([[5.0, 5.0, 1.0 + next(DRAWN)]])",
            "gave two layouts for the same arguments, expected the same: all chance comes from `rng`",
        ),
        (
            "polygons=((SQUARE + np.random.default_rng().uniform(),),)",
            "gave two layouts for the same arguments, expected the same",
        ),
    ],
)
def test_a_layout_that_cannot_be_is_told_with_family_and_world(parts: str, told: str, place: Path) -> None:
    scenario = built(place, "Built", parts)
    with pytest.raises(ValueError, match=rf"built\.py:Built\.layout.*{told}") as error:
        Simulation(scenario).reset(seeds=[4])
    assert error.value.__notes__ == [f"world of {place / 'built.py'}:Built, seed 4, episode 0"]


def test_a_layout_by_hand_is_drawn_as_it_is(place: Path) -> None:
    parts = "circles=[[5.0, -5.0, 1.0]], polygons=((SQUARE,),), movers=(Mover(0.3, (5.0, 0.0), MOTION),)"
    simulation = Simulation(built(place, "Built", parts), 2)
    simulation.reset(seeds=[4, 5])
    for row in range(2):
        layout = simulation.world.layout(row)
        assert layout.circles.tolist() == [[5.0, -5.0, 1.0]] and layout.movers[0].at == (5.0, 0.0)
        np.testing.assert_array_equal(layout.polygons[0][0], [[4, 4], [5, 4], [5, 5], [4, 5]])


def test_lists_of_numbers_are_taken_as_arrays(place: Path) -> None:
    told = "starts=[[0, 0, 0]], goals=[[3, 1]], border=[[-9, -9], [9, -9], [9, 9], [-9, 9]], circles=[]"
    more = "polygons=[[SQUARE.tolist()]], movers=[Mover([[0, 0], [1, 0], [1, 1]], (-5, 5), MOTION)]"
    simulation = Simulation(built(place, "Built", f"{told}, {more}"))
    simulation.reset(seeds=[4])
    layout = simulation.world.layout(0)
    assert layout.starts.tolist() == [[0.0, 0.0, 0.0]] and layout.goals.tolist() == [[3.0, 1.0]]
    assert len(layout.circles) == 0 and len(layout.movers) == 1 and len(layout.polygons[0][0]) == 4


@pytest.mark.parametrize("what", ["movers=(Mover(0.3, (5.0, 5.0), HURRIED),)", "target=HURRIED"])
def test_what_has_a_speed_goes_in_a_direction_that_is_drawn(what: str, place: Path) -> None:
    told = what.replace("HURRIED", "Bounce(law='bounce', speed=0.5)")
    simulation = Simulation(built(place, "Built", told), 3)
    simulation.reset(seeds=[4, 5, 4])
    before = [simulation.world.layout(row) for row in range(3)]
    for _ in range(10):
        simulation.step(np.zeros((3, 1, 2)))
    ways = []
    for row, layout in enumerate(before):
        now = simulation.world.layout(row)
        (at, to) = ((one.movers[0].at if one.movers else one.goals[0]) for one in (layout, now))
        ways.append(np.subtract(to, at))
    assert np.hypot(*np.transpose(ways)) == pytest.approx(0.5)  # in one second
    assert ways[0].tolist() == ways[2].tolist() != ways[1].tolist()


@pytest.mark.parametrize(("apart", "fits"), [(0.0, False), (0.3, False), (0.4, True)])
def test_robots_begin_beside_one_another(apart: float, fits: bool, place: Path) -> None:
    scenario = built(place, "Built", f"starts=np.array([[0.0, 0.0, 0.0], [{apart}, 0.0, 0.0]])")
    simulation = Simulation(load(scenario, {"robots.count": 2, "robot.radius": 0.2}))
    if fits:
        simulation.reset(seeds=[4])
        return
    with pytest.raises(ValueError, match=r"built\.py:Built\.layout: starts: robots 0 and 1 overlap at \[\[0.0, "):
        simulation.reset(seeds=[4])


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ([{"start": [1, 0, 0]}, {"start": [0, 2, 0]}], r"starts\.0: got \[0.0, 0.0, 0.0\], expected \[1.0, 0.0, 0.0\]"),
        (
            [{"start": [0, 0, 0], "goal": [3, 1]}, {"start": [0, 2, 0], "goal": [4, 4]}],
            r"goals\.1: got \[3.0, 3.0\], expected \[4.0, 4.0\], as robots\.places says",
        ),
        ([{"start": [0, 0, 0], "goal": [3, 1]}, {"start": [0, 2, 0], "goal": [3, 3]}], ""),
    ],
)
def test_robots_begin_and_end_where_the_scenario_says(written: Any, told: str, place: Path) -> None:
    starts = "starts=np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])"
    goals = ", goals=np.array([[3.0, 1.0], [3.0, 3.0]])" if "goal" in written[0] else ""
    scenario = load(built(place, "Built", starts + goals), {"robots.count": 2, "robots.places": written})
    if not told:
        Simulation(scenario).reset(seeds=[4])
        return
    with pytest.raises(ValueError, match=rf"built\.py:Built\.layout: {told}"):
        Simulation(scenario).reset(seeds=[4])


def test_a_family_whose_module_cannot_be_imported_is_named(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "broken.py").write_text("1 / 0\n")
    (place / "needy.py").write_text("import nowhere_to_be_found\n")
    offered = [importlib.metadata.EntryPoint("theirs", f"{place / 'needy.py'}:Pegs", own.GROUP)]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: offered if group == own.GROUP else [])
    own.installed.cache_clear()
    with pytest.raises(ModuleNotFoundError) as missing:
        load({**MINE, "world": {"family": "theirs"}})
    assert missing.value.__notes__ == [f"family of worlds theirs ({place / 'needy.py'}:Pegs)"]
    with pytest.raises(ZeroDivisionError) as broken:
        load({**MINE, "world": {"family": f"{place / 'broken.py'}:Pegs"}}, trust=True)
    assert broken.value.__notes__ == [f"family of worlds {place / 'broken.py'}:Pegs"]


def test_what_every_family_has_is_as_the_class_itself_says() -> None:
    world = {"family": Wide, "pegs": 1}
    scenario = load({"world": world})
    assert scenario.world.bounds == Wide().bounds and scenario.world.regions == Wide().regions
    simulation = Simulation(scenario)
    simulation.reset(seeds=[4])
    assert np.abs(simulation.world.layout(0).border).max(axis=0).tolist() == [30.0, 20.0]
    assert load({"world": {**world, "bounds": [-9, -9, 9, 9]}}).world.bounds == (-9.0, -9.0, 9.0, 9.0)
    with pytest.raises(ScenarioError, match=r"world\.bounds: .*expected a box .*: this family has no other border"):
        load({"world": {**world, "bounds": [[-9, -9], [9, -9], [0, 9]]}})


def test_what_a_family_does_otherwise_than_asked_is_told_in_a_line(place: Path) -> None:
    with pytest.raises(ValueError, match=r"Answers\.layout gave 'a maze', expected a bug_gym\.worlds\.layout\.Layout"):
        Simulation(built(place, "Answers")).reset(seeds=[0])
    with pytest.raises(RuntimeError, match=r"its code ends the process \(exit code 0\)"):
        Simulation(built(place, "Leaves")).reset(seeds=[0])
    with pytest.raises(ScenarioError, match=r"built\.py:Takes: layout takes \(self, crew, rng\): too many"):
        built(place, "Takes")
    with pytest.raises(ScenarioError, match="^[^,{]*: no robot at all$"):
        built(place, "Refuses")


def test_an_evaluation_goes_on_until_a_file_changes_that_worlds_are_read_from(place: Path) -> None:
    files = "    plan: str\n    def data_files(self):\n        return (Path(self.plan),)\n"
    (place / "pegs.py").write_text(CODE.replace("    pegs: Count", f"{files}    pegs: Count"))
    (place / "plan.txt").write_text("one")
    scenario = {**MINE, "world": {**MINE["world"], "plan": "plan.txt"}}
    asked: dict[str, Any] = {"episodes": 1, "trust": True, "overrides": {"time.limit": 1.0}}
    for _ in range(2):
        evaluate("go_to_goal", scenario, out=place / "out", **asked)
    (place / "plan.txt").write_text("another one")
    with pytest.raises(ValueError, match=r"holds another run: scenarios\.mine\.data was"):
        evaluate("go_to_goal", scenario, out=place / "out", **asked)


# ---------------------------------------------------------------------------------------------- a new one


def test_a_new_world_is_a_scenario_that_runs_and_a_test_that_passes(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "world", "fine_world"]) == 0
    told = capsys.readouterr().out
    (line,) = (line.strip() for line in told.splitlines() if "bug-gym evaluate" in line)
    assert main([*line.split()[3:], "--episodes", "1"]) == 0
    (seen,) = (line.strip() for line in told.splitlines() if "bug-gym show" in line)
    assert main(seen.split()[3:]) == 0 and (place / "fine_world.png").exists()
    assert yaml.safe_load((place / "fine_world.yaml").read_text())["world"]["family"] == "fine_world.py:FineWorld"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_fine_world.py"]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "`data_files(self)`" in (place / "fine_world.py").read_text()
    assert main(["new", "world", "fine_world"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_a_shell_takes_the_lines_that_run_a_new_world_as_they_are_told(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "world", "fine_world", "--folder", "my worlds"]) == 0
    _, *lines = capsys.readouterr().out.splitlines()
    run, see, test = (shlex.split(line.partition(":")[2]) for line in lines)
    assert main([*run[1:], "--episodes", "1"]) == 0
    assert main(see[1:]) == 0 and (place / "fine_world.png").exists()
    assert test == ["python", "-m", "pytest", "my worlds/test_fine_world.py"] and Path(test[-1]).exists()


@pytest.mark.parametrize(("name", "message"), [("maze", "taken"), ("My-World", "expected"), ("class", "expected")])
def test_a_new_world_needs_a_name_of_its_own(
    place: Path, name: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "world", name]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not list(place.glob("test_*"))
