"""Shows of policies, and what somebody drives by hand: without a window, with hands that are written down."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from bug_gym.by_hand import Hands
from bug_gym.config import load
from bug_gym.drawing.clips import Frame
from bug_gym.evaluation.driven import LET_GO, again, read_driven, require_same_end
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.live import SMOOTH, SPEEDS, Hand, Show, endings, run, same_world
from bug_gym.evaluation.rollout import Rollout

SMALL = {"lidar.beams": 32, "time.limit": 6.0}
GAS, ESC = Hands(held=frozenset({"up"})), Hands(pressed=("escape",))


class Watcher:
    """A screen that nobody sees, in front of hands that do one thing a frame, and end the show."""

    def __init__(self, hands: Sequence[Hands]) -> None:
        self.hands = [*hands, ESC]
        self.captions: list[str] = []
        self.frames: list[Frame] = []
        self.rates: list[float] = []

    def look(self) -> Hands:
        return self.hands.pop(0)

    def show(self, frame: Frame, caption: str) -> None:
        self.frames.append(frame)
        self.captions.append(caption)

    def wait(self, fps: float) -> None:
        self.rates.append(fps)


def begin(*policies: str, limit: float = 6.0) -> Callable[[int], list[Rollout]]:
    loaded = load("dynamic", {**SMALL, "time.limit": limit})
    return same_world([PolicyEntry.of(policy) for policy in policies], loaded)


def show_of(*policies: str, first: int = 0) -> Show:
    return Show(begin(*policies), first=first, size=200)


def played(hands: Sequence[Hands], path: Path | None = None, *, scenario: str = "dynamic") -> tuple[Show, Hand]:
    """What is left when somebody has driven like this beside bug2."""
    loaded = load(scenario, SMALL)
    hand = Hand(loaded, path)
    worlds = same_world([PolicyEntry.of(("you", hand)), PolicyEntry.of("bug2")], loaded)
    show = Show(worlds, first=4, size=200)
    run(show, Watcher(hands), lambda line: None, hand)
    return show, hand


# ---------------------------------------------------------------------------------------------- a show


def test_each_policy_drives_in_the_same_world_as_it_drives_alone() -> None:
    show = show_of("bug2", "go_to_goal", first=3)
    while not show.is_over:
        show.step()
    for rollout, policy in zip(show.rollouts, ("bug2", "go_to_goal"), strict=True):
        (alone,) = begin(policy)(3)
        (rows,) = alone.worlds()
        assert endings(rollout) == endings(alone)
        np.testing.assert_array_equal(rollout.simulation.world.pose, alone.simulation.world.pose)
        assert rows[0].seed == show.seed == 3


def test_frames_of_all_lie_side_by_side() -> None:
    show = show_of("bug2", "go_to_goal")
    assert show.frame().shape == (200, 400, 3)


@pytest.mark.parametrize("faster", range(-5, 7))
def test_a_show_goes_as_fast_as_was_asked_for_and_no_faster_than_eyes(faster: int) -> None:
    show = show_of("bug2")
    for _ in range(abs(faster)):
        show.press("+" if faster > 0 else "-")
    steps, fps = show.pace()
    assert show.speed == SPEEDS[min(max(SPEEDS.index(1.0) + faster, 0), len(SPEEDS) - 1)]
    assert steps * fps * show.rollouts[0].scenario.scenario.time.step == pytest.approx(show.speed)
    assert fps <= SMOOTH and steps >= 1


def test_a_pause_takes_no_step_and_a_step_takes_one() -> None:
    show = show_of("bug2")
    screen = Watcher([Hands(), Hands(pressed=("space",)), Hands(), Hands(pressed=(".",)), Hands()])
    run(show, screen, lambda line: None)
    assert show.rollouts[0].simulation.world.steps[0] == 2
    assert "paused" in screen.captions[1] and "paused" in screen.captions[-1]
    np.testing.assert_array_equal(screen.frames[0], screen.frames[2])


def test_keys_lead_to_the_next_world_and_back() -> None:
    show = show_of("bug2", first=1)
    seeds = []
    for key in "r", "r", "b", "b", "b", "b", "x":
        show.press(key)
        seeds.append(show.seed)
    assert seeds == [2, 3, 2, 1, 0, 0, 0]


def test_the_end_of_each_world_is_told_once() -> None:
    told: list[str] = []
    steps = 11
    hands = [*[Hands()] * steps, Hands(), Hands(pressed=("r",)), *[Hands()] * (steps + 3)]
    run(Show(begin("bug2", limit=1.0), size=200), Watcher(hands), told.append)
    assert [line for line in told if line.startswith("seed")] == ["seed 0", "seed 1"]
    assert told[1].startswith("  bug2: timeout after 1.0 s and ") and len(told) == 4


# ---------------------------------------------------------------------------------------------- driven by hand


@pytest.mark.parametrize("scenario", ["dynamic", "static", "moving_target"])
def test_what_was_driven_is_driven_again_bit_for_bit(tmp_path: Path, scenario: str) -> None:
    path = tmp_path / "driven.json"
    turns = [Hands(held=frozenset(keys)) for keys in ("w", "wd", "d", "sd", "wa", "")]
    hands = [turns[number // 4 % len(turns)] for number in range(40)]
    show, hand = played(hands, path, scenario=scenario)
    loaded, (episode,) = read_driven(path)
    assert (loaded, [episode]) == (hand.scenario, hand.episodes)
    replay = again(loaded, episode)
    while not replay.is_over:
        replay.advance()
    ours, theirs = replay.simulation.world, show.rollouts[0].simulation.world
    for array in ("pose", "outcome", "steps", "observation"):
        np.testing.assert_array_equal(getattr(ours, array), getattr(theirs, array))
    assert replay.verdict() in (LET_GO, "")
    require_same_end(loaded, episode)


def test_each_world_is_an_episode_of_the_file_and_one_without_a_step_is_none(tmp_path: Path) -> None:
    path = tmp_path / "driven.json"
    again_key, pause = Hands(pressed=("r",), held=frozenset("w")), Hands(pressed=("p", "r"))
    played([GAS, GAS, again_key, GAS, GAS, pause, Hands(pressed=("r",)), Hands()], path)
    _, episodes = read_driven(path)
    assert [(one.seed, len(one.actions), one.outcome) for one in episodes] == [(4, 2, "running"), (5, 3, "running")]


def test_somebody_who_has_arrived_or_crashed_drives_no_more(tmp_path: Path) -> None:
    path = tmp_path / "driven.json"
    show, _ = played([GAS] * 70, path)
    loaded, (episode,) = read_driven(path)
    assert show.is_over and episode.outcome == "collision" and len(episode.actions) < 60
    require_same_end(loaded, episode)


def test_the_mouse_sends_the_robot_to_its_place_in_the_picture(tmp_path: Path) -> None:
    loaded = load("empty", SMALL)
    hand = Hand(loaded)
    show = Show(same_world([PolicyEntry.of(("you", hand))], loaded), size=200)
    x, y, _ = show.rollouts[0].simulation.world.pose[0, 0].tolist()
    goal = (x + 1.0, y + 1.5)
    pixel = show.canvases[0].view.pixel(*goal)
    run(show, Watcher([Hands(mouse=pixel)] * 50), lambda line: None, hand)
    assert show.rollouts[0].simulation.world.pose[0, 0, :2] == pytest.approx(goal, abs=0.1)


def test_a_mouse_beside_the_picture_says_nothing() -> None:
    show, hand = played([Hands(mouse=(250.0, 50.0), held=frozenset("w"))] * 3)
    driven, _ = played([Hands(held=frozenset("w"))] * 3)
    np.testing.assert_array_equal(show.rollouts[0].simulation.world.pose, driven.rollouts[0].simulation.world.pose)


def test_a_replay_that_ends_elsewhere_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "driven.json"
    played([GAS] * 5, path)
    data = json.loads(path.read_text(encoding="utf-8"))
    data["episodes"][0]["actions"][2] = [0.0, 0.0]
    path.write_text(json.dumps(data), encoding="utf-8")
    loaded, (episode,) = read_driven(path)
    with pytest.raises(ValueError, match="seed 4 was driven to running after 0.5 s"):
        require_same_end(loaded, episode)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is damaged"),
        ("[]", "holds no episodes driven by hand"),
        ('{"holds": "cake"}', "holds no episodes driven by hand"),
        ('{"holds": "episodes driven by hand"}', "version"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "driven.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=said):
        read_driven(path)


@pytest.mark.parametrize("action", [[2.0, 0.0], [0.0], ["a", 0.0], [None, 0.0]])
def test_an_action_that_cannot_be_is_refused(tmp_path: Path, action: object) -> None:
    path = tmp_path / "driven.json"
    played([GAS] * 2, path)
    data = json.loads(path.read_text(encoding="utf-8"))
    data["episodes"][0]["actions"][0] = action
    path.write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(ValueError, match="actions"):
        read_driven(path)


def test_a_world_of_several_robots_is_not_for_one_driver() -> None:
    with pytest.raises(ValueError, match="has 2 robots, expected 1"):
        Hand(load("empty", {"robots.count": 2}))
