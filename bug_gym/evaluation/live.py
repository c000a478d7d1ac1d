"""Policies that drive while somebody watches or drives along: the same world for each, side by side, at a pace of one's own."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bug_gym.by_hand import Hands, hand_action
from bug_gym.config import Scenario
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame, grid
from bug_gym.evaluation.driven import DrivenEpisode, as_driven, write_driven
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.view import Sensors

SPEEDS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""How much faster than time a show may go."""
SMOOTH = 30.0
"""Frames a second at most: a faster show takes several steps a frame."""
IDLE = 20.0
"""Frames a second while nothing moves."""
FASTER, SLOWER = {"+", "=", "[+]"}, {"-", "[-]"}
PAUSE, STEP, NEXT, LAST, END = {"space", "p"}, {".", "n"}, {"r", "return"}, {"b", "backspace"}, {"escape", "q"}
"""Keys, by the names that pygame gives them."""
KEYS = "space pauses, . steps, +/- speed, r next world, b the one before, esc ends"
"""What they do."""


class Screen(Protocol):
    """What shows a show: `drawing.screen.Screen`."""

    def look(self) -> Hands:
        """What keyboard, mouse and pad say."""
        ...

    def show(self, frame: Frame, caption: str) -> None:
        """Show a frame and a line of text."""
        ...

    def wait(self, fps: float) -> None:
        """Wait for the next frame, of so many a second."""
        ...


class Show:
    """Rollouts of the same world side by side, one world after the other.

    Args:
        make: gives the rollouts of a world by its number: its seed, or its place among some.
        first: number of the first world.
        count: how many worlds there are, 0, 1 and so on, after the last of which the first comes again; None: no end.
        size: longer side of each picture [pixels].

    Raises:
        ValueError: a number, a policy or a size that cannot be.
    """

    def __init__(
        self, make: Callable[[int], Sequence[Rollout]], *, first: int = 0, count: int | None = None, size: int = 600
    ) -> None:
        self._make, self._count, self._size = make, count, size
        self.is_paused = False
        self._single_step = False
        self._speed = SPEEDS.index(1.0)
        self.rollouts: list[Rollout] = []
        self.canvases: list[Canvas] = []
        self.begin(first)

    def begin(self, number: int) -> None:
        """Begin a world."""
        self.number = number if self._count is None else number % self._count
        self.rollouts = list(self._make(self.number))
        self.canvases = [Canvas(one.simulation, size=self._size, title=one.entry.label) for one in self.rollouts]

    @property
    def seed(self) -> int:
        """Of the world."""
        return int(self.rollouts[0].simulation.world.seed[0])

    @property
    def speed(self) -> float:
        """How much faster than time it goes."""
        return SPEEDS[self._speed]

    @property
    def is_over(self) -> bool:
        """Whether all have ended."""
        return all(one.is_over for one in self.rollouts)

    def press(self, key: str) -> None:
        """Do what a key stands for; others do nothing."""
        if key in PAUSE:
            self.is_paused = not self.is_paused
        elif key in STEP:
            self.is_paused = self._single_step = True
        elif key in FASTER:
            self._speed = min(self._speed + 1, len(SPEEDS) - 1)
        elif key in SLOWER:
            self._speed = max(self._speed - 1, 0)
        elif key in NEXT:
            self.begin(self.number + 1)
        elif key in LAST:
            self.begin(max(self.number - 1, 0))

    def pace(self) -> tuple[int, float]:
        """Steps to take for the next frame, and frames a second."""
        if self.is_over or self.is_paused:
            return int(self._single_step and not self.is_over), IDLE
        rate = self.speed / self.rollouts[0].scenario.scenario.time.step
        steps = math.ceil(rate / SMOOTH)
        return steps, rate / steps

    def step(self) -> None:
        """One step of each that has not ended."""
        self._single_step = False
        for rollout, canvas in zip(self.rollouts, self.canvases, strict=True):
            if not rollout.is_over:
                rollout.advance()
                canvas.record()

    def frame(self) -> Frame:
        """What is to be seen now, RGB pixels (H, W, 3) uint8."""
        scenes = zip(self.rollouts, self.canvases, strict=True)
        return grid(
            [
                canvas.draw(rollout.drawings(), note=rollout.verdict(), states=rollout.states())
                for rollout, canvas in scenes
            ]
        )

    def caption(self) -> str:
        """A line that says where it is."""
        state = "ended" if self.is_over else "paused" if self.is_paused else f"{self.speed:g}x"
        return f"{self.rollouts[0].scenario.label} · seed {self.seed} · {state} · {KEYS}"


def endings(rollout: Rollout) -> list[str]:
    """How each robot of a rollout's first world fared, a line each."""
    info = rollout.simulation.info()
    lines = []
    for robot in range(rollout.simulation.robots):
        outcome, length, time = info["outcome"][0, robot], info["path_length"][0, robot], rollout.driven_time(robot)
        verdict = getattr(rollout.memory(robot), "verdict", "")
        label = rollout.entry.label if rollout.simulation.robots == 1 else f"{rollout.entry.label}, robot_{robot}"
        lines.append(f"{label}: {verdict or outcome} after {time:.1f} s and {length:.2f} m")
    return lines


def run(show: Show, screen: Screen, tell: Callable[[str], None], hand: Hand | None = None) -> None:
    """Show it until somebody ends it.

    Args:
        show: what to show.
        screen: where, and what keyboard, mouse and pad say.
        tell: is told how each world ended.
        hand: who drives the first rollout, where somebody does.
    """
    told: list[Rollout] = []
    while True:
        hands = screen.look()
        if hands.is_closed or END & set(hands.pressed):
            break
        for key in hands.pressed:
            before = show.rollouts
            show.press(key)
            if hand is not None and show.rollouts is not before:
                hand.keep(before[0])
        steps, fps = show.pace()
        for _ in range(steps):
            if hand is not None:
                hand.take(hands, show)
            show.step()
        if show.is_over and show.rollouts is not told:
            told = show.rollouts
            _tell(show, tell)
        screen.show(show.frame(), show.caption())
        screen.wait(fps)
    if hand is not None:
        hand.keep(show.rollouts[0])


def _tell(show: Show, tell: Callable[[str], None]) -> None:
    tell(f"seed {show.seed}")
    for rollout in show.rollouts:
        for line in endings(rollout):
            tell(f"  {line}")


# ---------------------------------------------------------------------------------------------------------------------
# Driven by hand
# ---------------------------------------------------------------------------------------------------------------------


class Hand:
    """Somebody who drives: a policy that does what it was told last, and what is kept of that.

    Args:
        scenario: what is driven in.
        path: file of the episodes; None: they are not kept.

    Raises:
        ValueError: the scenario has several robots.
    """

    def __init__(self, scenario: Scenario, path: Path | None = None) -> None:
        if scenario.robots.count != 1:
            raise ValueError(
                f"{scenario.name} has {scenario.robots.count} robots, expected 1: two hands drive one robot"
            )
        self.scenario, self.path = scenario, path
        self.drive = Sensors.of(scenario).drive
        self.action = hand_action(Hands(), self.drive, (0.0, 0.0, 0.0))
        self.episodes: list[DrivenEpisode] = []
        """Those driven so far."""
        self._actions: list[NDArray[np.float32]] = []

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Any, ...] | None]:
        """What it was told last (1, 2)."""
        return self.action[None], state

    def take(self, hands: Hands, show: Show) -> None:
        """Take what keyboard, mouse and pad say as the next step's action."""
        rollout, canvas = show.rollouts[0], show.canvases[0]
        if rollout.is_over:
            return
        column, row = hands.mouse or (-1.0, -1.0)
        is_inside = 0.0 <= column < canvas.width and 0.0 <= row < canvas.height
        x, y, heading = rollout.simulation.world.pose[0, 0].tolist()
        place = canvas.view.place(column, row) if is_inside else None
        self.action = hand_action(hands, self.drive, (x, y, heading), place)
        self._actions.append(self.action)

    def keep(self, rollout: Rollout) -> None:
        """Keep the episode that ends here; one without a step is none."""
        if self._actions:
            self.episodes.append(as_driven(rollout, self._actions))
            if self.path is not None:
                write_driven(self.path, self.scenario, self.episodes)
        self._actions = []


def same_world(entries: Sequence[PolicyEntry], scenario: Scenario) -> Callable[[int], list[Rollout]]:
    """What begins the world of a seed for each of some policies."""

    def begin(seed: int) -> list[Rollout]:
        seeds = range(seed, seed + 1)
        return [Rollout(entry, ScenarioEntry(scenario.name, scenario, seeds), seeds) for entry in entries]

    return begin
