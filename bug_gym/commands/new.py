"""`bug-gym new policy NAME`, `bug-gym new world NAME`: one's own to begin with: its file, a test, the line that runs it."""

from __future__ import annotations

import argparse
import importlib.util
import keyword
import os
import re
import shlex
from pathlib import Path

from bug_gym.checks import shortened
from bug_gym.commands.arguments import told_path
from bug_gym.files import replaced_when_done

POLICY = '''"""NAME: toward the goal, or as near to that direction as there is room.

Change `act`. What a policy sees of the robot and its scan: bug_gym.view.View; what it knows of the robot itself:
`self.sensors`. Lengths are in metres, angles in radians, ahead is 0, left is positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bug_gym.agents.parameters import Length
from bug_gym.policy import Drawing, Memory, ScriptedPolicy
from bug_gym.view import View

TURNS = np.radians([0, *(sign * angle for angle in range(10, 181, 10) for sign in (1, -1))])
"""Directions to try, counted from the goal's [rad]: the nearest to it first, and of two as near the left one."""


@dataclass(frozen=True)
class CLASSParameters:
    """What can be set: `--policies NAME.py:CLASS:room=0.2`."""

    room: Length = 0.1
    """Room kept about the body [m]."""
    reach: Length = 1.0
    """How far a direction has to be free to be taken [m]."""
    turn: Literal["left", "right"] = "left"
    """Which of two directions as near to the goal's it takes."""


@dataclass
class CLASSMemory(Memory):
    """What it remembers of an episode; `mode` and `verdict` are there already."""

    heading_for: tuple[float, float] | None = None
    """Where it drives to just now, x, y in the odometry frame [m], for the picture."""


class CLASS(ScriptedPolicy):
    """Takes the free direction nearest to the goal's."""

    Parameters = CLASSParameters
    parameters: CLASSParameters

    def start(self) -> CLASSMemory:
        """Memory of a new episode."""
        return CLASSMemory(mode="motion_to_goal")

    def act(self, view: View, memory: CLASSMemory) -> tuple[float, float]:
        """The velocity that it wants [m/s], x ahead, y left."""
        bearings = view.goal_bearing + (TURNS if self.parameters.turn == "left" else -TURNS)
        free = view.free_distances(bearings, self.sensors.radius + self.parameters.room)
        wanted = min(self.parameters.reach, view.goal_distance)
        enough = np.flatnonzero(free >= wanted)
        chosen = int(enough[0]) if len(enough) else int(free.argmax())
        memory.mode = "motion_to_goal" if chosen == 0 else "going_round"
        bearing, drive = float(bearings[chosen]), self.sensors.drive
        ahead = min(float(free[chosen]), wanted)
        memory.heading_for = view.to_odometry(ahead * math.cos(bearing), ahead * math.sin(bearing))
        speed = min(drive.max_speed, ahead / drive.step)  # what is free now is not left in this step
        return speed * math.cos(bearing), speed * math.sin(bearing)

    def draw(self, memory: CLASSMemory) -> Drawing:
        """What a picture shows of its mind."""
        return Drawing(points=[(*memory.heading_for, "candidate")] if memory.heading_for else [])
'''

TEST = '''"""What must hold of NAME."""

from pathlib import Path

from bug_gym.evaluation import evaluate

POLICY = f"{Path(__file__).with_name('NAME.py')}:CLASS"


def test_the_open_way_to_the_goal_is_taken() -> None:
    (row,) = evaluate(POLICY, {"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 3]}}, episodes=1)
    assert row.success and row.spl > 0.99


def test_it_drives_into_nothing_that_stands_still() -> None:
    rows = evaluate(POLICY, "static", episodes=5)
    assert "collision" not in [row.outcome for row in rows]


def test_the_same_world_is_driven_in_the_same_way() -> None:
    first, second = (evaluate(POLICY, "static", episodes=2) for _ in range(2))
    assert [(row.outcome, row.path_length) for row in first] == [(row.outcome, row.path_length) for row in second]
'''

WORLD = '''"""NAME: pillars in rows, each a little off its place.

Change the keys and `layout`. A layout is a function of its arguments: all chance comes from `rng`. Lengths are in metres.
What there is to build with: bug_gym.worlds.layout (circles, polygons, movers), bug_gym.worlds.places and
bug_gym.worlds.clearance (where there is room). Where worlds are read from files, have `data_files(self)` return their
paths, as a tuple: an evaluation that goes on with earlier rows looks whether they are still the same.
"""

from __future__ import annotations

import numpy as np

from bug_gym.config import NotNegative, Positive
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import border_of, draw_both, finish


class CLASS(DrawnPlaces):
    """Pillars in rows, start and goal anywhere between them."""

    spacing: Positive = 3.0
    """From one pillar to the next [m]."""
    radius: Positive = 0.4
    """Of a pillar [m]."""
    jitter: NotNegative = 0.6
    """How far a pillar stands off its place at most, in x and in y [m]."""

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """One world."""
        xmin, ymin, xmax, ymax = self.box
        columns = np.arange(xmin + self.spacing, xmax - self.radius - self.jitter, self.spacing)
        rows = np.arange(ymin + self.spacing, ymax - self.radius - self.jitter, self.spacing)
        places = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        places = places + rng.uniform(-self.jitter, self.jitter, places.shape)
        circles = np.column_stack([places, np.full(len(places), self.radius)])
        free = is_clear(circles, (), border_of(self), crew.robot.reach)
        start, goal = draw_both(crew, self, self.start, self.goal, rng, free, free, self.separation)
        return finish(crew, self, start, goal, circles=circles)
'''

SCENARIO = """# Worlds of NAME.py: whoever loads this file says whether its code may run (--trust, trust=True).
robot: {kinematics: differential}
lidar: {beams: 64, range: 5.0, noise: 0.01}
time: {limit: 60.0}
world: {family: "NAME.py:CLASS", spacing: 3.0}
"""

WORLD_TEST = '''"""What must hold of NAME."""

from pathlib import Path

import numpy as np

from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.simulation import Simulation

SCENARIO = load(Path(__file__).with_name("NAME.yaml"), trust=True)


def test_a_seed_is_a_world() -> None:
    first, same, other = (Simulation(SCENARIO) for _ in range(3))
    for simulation, seed in ((first, 0), (same, 0), (other, 1)):
        simulation.reset(seeds=[seed])
    circles = [simulation.world.layout(0).circles for simulation in (first, same, other)]
    assert np.array_equal(circles[0], circles[1]) and not np.array_equal(circles[0], circles[2])


def test_there_is_a_way_in_most_worlds() -> None:
    rows = evaluate("theta_star", SCENARIO, episodes=5, trust=True)
    assert sum(row.success for row in rows) >= 4
'''


TEMPLATES = {
    "policy": {"NAME.py": POLICY, "test_NAME.py": TEST},
    "world": {"NAME.py": WORLD, "NAME.yaml": SCENARIO, "test_NAME.py": WORLD_TEST},
}
"""Files of each kind of thing, by name."""

TOLD = {
    "policy": (
        "run it:  bug-gym evaluate --scenario static --policies bug2,FOLDERNAME.py:CLASS",
        "see it:  bug-gym render FOLDERNAME.py:CLASS static --out NAME.png",
        "test it: python -m pytest FOLDERtest_NAME.py",
    ),
    "world": (
        "run it:  bug-gym evaluate --scenario FOLDERNAME.yaml --policies bug2,tangent_bug --trust",
        "see it:  bug-gym show FOLDERNAME.yaml --trust --out NAME.png",
        "test it: python -m pytest FOLDERtest_NAME.py",
    ),
}
"""What to do with them."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument("what", choices=sorted(TEMPLATES), help="what to begin")
    parser.add_argument("name", metavar="NAME", help="its name, such as my_bug or my_world")
    parser.add_argument("--folder", type=told_path, default=Path(), help="where its files go (default: here)")


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    name = _checked_name(options.what, options.name)
    class_name = "".join(part.capitalize() for part in name.split("_"))

    def filled(text: str) -> str:
        folder = "" if options.folder == Path() else f"{options.folder.as_posix()}/"
        return text.replace("FOLDER", folder).replace("NAME", name).replace("CLASS", class_name)

    files = {options.folder / filled(path): text for path, text in TEMPLATES[options.what].items()}
    for path in files:
        if os.path.lexists(path):
            raise ValueError(f"{path} exists already: choose another name or --folder")
    if importlib.util.find_spec(name) is not None:
        raise ValueError(
            f"the name {shortened(name)} is that of a module, which the file would hide: choose another one"
        )
    options.folder.mkdir(parents=True, exist_ok=True)
    for path, text in files.items():
        with replaced_when_done(path) as partial:
            partial.write_text(filled(text), encoding="utf-8")
    *first, last = map(str, files)
    print(f"wrote {', '.join(first)} and {last}")
    for line in TOLD[options.what]:
        what, _, command = line.partition(":")
        print(f"{what + ':':8}", *(shlex.quote(filled(word)) for word in command.split()))


def _checked_name(what: str, name: str) -> str:
    from bug_gym.agents import known_agents  # loads the compiler
    from bug_gym.worlds import FAMILIES  # loads pydantic
    from bug_gym.worlds.own import own_families  # loads pydantic

    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise ValueError(f"got {shortened(name)} as a name, expected small letters, digits and _, such as my_bug")
    if what == "policy":
        known = {key: line.entry_point for key, line in known_agents().items()}
    else:
        known = {**{family: f"bug_gym.worlds.{family}" for family in FAMILIES}, **own_families()}
    if name in known:
        raise ValueError(f"the name {shortened(name)} is taken, by {known[name]}: choose another one")
    return name
