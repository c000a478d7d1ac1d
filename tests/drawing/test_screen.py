"""The window of programs that are driven by hand, on SDL's driver that shows nothing, with events that are posted."""

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from bug_gym.by_hand import Hands
from bug_gym.drawing.brush import load_pygame
from bug_gym.drawing.screen import Screen


@pytest.fixture
def pygame(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    module = load_pygame()
    module.display.quit()
    yield module
    module.display.quit()


@pytest.fixture
def screen(pygame: Any) -> Screen:
    shown = Screen()
    shown.look()  # what a window says of itself when it opens
    return shown


def post(pygame: Any, kind: int, **what: Any) -> None:
    pygame.event.post(pygame.event.Event(kind, **what))


def test_a_frame_is_shown_as_it_is_and_the_window_has_its_size(pygame: Any, screen: Screen) -> None:
    for shape in ((120, 200, 3), (90, 90, 3)):
        frame = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
        screen.show(frame, "seed 3")
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
        np.testing.assert_array_equal(shown, frame)
        assert pygame.display.get_caption()[0] == "seed 3"


def test_keys_are_held_until_they_go_up_and_pressed_once(pygame: Any, screen: Screen) -> None:
    post(pygame, pygame.KEYDOWN, key=pygame.K_UP)
    post(pygame, pygame.KEYDOWN, key=pygame.K_r)
    post(pygame, pygame.KEYUP, key=pygame.K_r)
    assert screen.look() == Hands(pressed=("up", "r"), held=frozenset({"up"}))
    assert screen.look() == Hands(held=frozenset({"up"}))
    post(pygame, pygame.KEYUP, key=pygame.K_UP)
    assert screen.look() == Hands()


def test_keys_that_go_up_in_another_window_are_let_go(pygame: Any, screen: Screen) -> None:
    post(pygame, pygame.KEYDOWN, key=pygame.K_w)
    post(pygame, pygame.MOUSEBUTTONDOWN, button=1, pos=(3, 4))
    post(pygame, pygame.WINDOWFOCUSLOST)
    assert screen.look() == Hands(pressed=("w",))


def test_the_mouse_counts_while_its_left_button_is_down(pygame: Any, screen: Screen) -> None:
    post(pygame, pygame.MOUSEMOTION, pos=(1, 1), rel=(0, 0), buttons=(0, 0, 0))
    post(pygame, pygame.MOUSEBUTTONDOWN, button=3, pos=(2, 2))
    assert screen.look().mouse is None
    post(pygame, pygame.MOUSEBUTTONDOWN, button=1, pos=(3, 4))
    post(pygame, pygame.MOUSEMOTION, pos=(5, 6), rel=(2, 2), buttons=(1, 0, 0))
    assert screen.look().mouse == (5, 6)
    post(pygame, pygame.MOUSEBUTTONUP, button=1, pos=(5, 6))
    assert screen.look().mouse is None


def test_a_pads_left_stick_points_up_where_it_is_pushed_up(pygame: Any, screen: Screen) -> None:
    for axis, value in ((0, 0.5), (1, -1.0), (3, 0.9)):
        post(pygame, pygame.JOYAXISMOTION, instance_id=0, axis=axis, value=value)
    assert screen.look().stick == (0.5, 1.0)


def test_a_closed_window_says_so(pygame: Any, screen: Screen) -> None:
    post(pygame, pygame.QUIT)
    assert screen.look().is_closed
    screen.close()
    assert not pygame.display.get_init()


def test_without_a_screen_there_is_no_window_and_the_environment_stays_as_it_is(
    pygame: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no_such_driver")
    with pytest.raises(ValueError, match="there is no screen"):
        Screen()
    assert os.environ["SDL_VIDEODRIVER"] == "no_such_driver"
    assert not pygame.display.get_init()
