"""`bug-gym play` and `bug-gym watch` in a window on SDL's driver that shows nothing, with keys that are posted."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bug_gym.cli import main
from bug_gym.drawing.brush import load_pygame
from bug_gym.drawing.screen import Screen
from bug_gym.evaluation.driven import read_driven

Press = Callable[[dict[int, str]], None]
SMALL = ["--set", "lidar.beams=32", "--size", "200"]


@pytest.fixture
def press(monkeypatch: pytest.MonkeyPatch) -> Iterator[Press]:
    """Plans which key goes down at which frame; "quit" closes the window."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = load_pygame()
    pygame.display.quit()

    def plan(keys: dict[int, str]) -> None:
        frames = iter(range(1, 10_000))

        def wait(self: Screen, fps: float) -> None:
            key = keys.get(next(frames))
            if key == "quit":
                pygame.event.post(pygame.event.Event(pygame.QUIT))
            elif key:
                pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))

        monkeypatch.setattr(Screen, "wait", wait)

    yield plan
    pygame.display.quit()


def test_somebody_plays_records_and_watches_it(
    press: Press, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "driven.json"
    press({3: "up", 9: "r", 12: "escape"})
    arguments = ["static", "--seed", "2", *SMALL, "--against", "bug2", "--record", str(path)]
    assert main(["play", *arguments]) == 0
    assert f"{path}: 2 driven" in capsys.readouterr().out
    _, episodes = read_driven(path)
    assert [(one.seed, len(one.actions)) for one in episodes] == [(2, 9), (3, 3)]
    press({12: "r", 20: "quit"})
    assert main(["watch", str(path), "--size", "200"]) == 0
    told = capsys.readouterr().out
    assert "seed 2" in told and "seed 3" in told and told.count("by hand: let go") == 2


def test_somebody_watches_policies(press: Press, capsys: pytest.CaptureFixture[str]) -> None:
    press({2: "+", 30: "escape"})
    assert main(["watch", "go_to_goal", "bug2", "static", *SMALL, "--set", "time.limit=2.0"]) == 0
    assert "bug2: timeout after 2.0 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["watch", "static"], "no policy to watch in static"),
        (["watch", "none.json"], "no file none.json"),
        (["watch", "bug3", "static"], "bug3"),
        (["play", "static", "--record", "driven.txt"], "expected a name that ends in .json"),
        (["play", "two_robots"], "two_robots"),
        (["play", "static", "--size", "20"], "size must be at least 100"),
        (["play", "static", "--seed", "-1"], "seed"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    press: Press, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    press({1: "escape"})
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_without_a_screen_the_command_says_so(
    press: Press, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no_such_driver")
    assert main(["watch", "bug2", "static", *SMALL]) == 2
    assert "there is no screen to open a window on" in capsys.readouterr().err
