"""A window for programs that are driven by hand: it shows frames, and tells what keyboard, mouse and pad say."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from bug_gym.by_hand import Hands
from bug_gym.drawing.brush import load_pygame
from bug_gym.drawing.clips import Frame
from bug_gym.drawing.window import UNSEEN, open_screen

if TYPE_CHECKING:
    import pygame


class Screen:
    """A window that is shown frames; open from its first frame on.

    Raises:
        ImportError: pygame-ce is not installed.
        ValueError: there is no screen, so that nobody could end what runs. (One of SDL's drivers without a screen may be asked
            for by SDL_VIDEODRIVER.)
    """

    def __init__(self) -> None:
        self._pygame = load_pygame()
        self._size = (640, 640)
        self._held: set[str] = set()
        self._mouse: tuple[float, float] | None = None
        self._tilt = {0: 0.0, 1: 0.0}
        self._pads: list[Any] = []
        self._is_closed = False
        asked = os.environ.get("SDL_VIDEODRIVER")
        self._window: pygame.Surface = open_screen(self._size)
        driver = self._pygame.display.get_driver()
        if driver in UNSEEN and asked != driver:
            self._forget(asked)
            raise ValueError("there is no screen to open a window on; `bug-gym render` draws into files")
        self._clock = self._pygame.time.Clock()
        self._pygame.joystick.init()

    def _forget(self, asked: str | None) -> None:
        """Shut the display down, and leave the environment as it was."""
        self._pygame.display.quit()
        if asked is None:
            os.environ.pop("SDL_VIDEODRIVER", None)
        else:
            os.environ["SDL_VIDEODRIVER"] = asked

    def look(self) -> Hands:
        """What keyboard, mouse and pad say now."""
        pressed: list[str] = []
        for event in self._pygame.event.get():
            self._take(event, pressed)
        # Stick up is below zero.
        stick = (self._tilt[0], -self._tilt[1])
        return Hands(tuple(pressed), frozenset(self._held), self._mouse, stick, self._is_closed)

    def _take(self, event: pygame.event.Event, pressed: list[str]) -> None:
        pygame = self._pygame
        if event.type == pygame.QUIT:
            self._is_closed = True
        elif event.type == pygame.KEYDOWN:
            name = pygame.key.name(event.key)
            pressed.append(name)
            self._held.add(name)
        elif event.type == pygame.KEYUP:
            self._held.discard(pygame.key.name(event.key))
        elif event.type == pygame.WINDOWFOCUSLOST:  # keys that go up elsewhere are not told of
            self._held.clear()
            self._mouse = None
        elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
            self._mouse = event.pos
        elif event.type == pygame.MOUSEBUTTONUP and event.button == 1:
            self._mouse = None
        elif event.type == pygame.MOUSEMOTION and self._mouse is not None:
            self._mouse = event.pos
        elif event.type == pygame.JOYAXISMOTION and event.axis in self._tilt:
            self._tilt[event.axis] = event.value
        elif event.type == pygame.JOYDEVICEADDED:
            self._pads.append(pygame.joystick.Joystick(event.device_index))

    def show(self, frame: Frame, caption: str) -> None:
        """Show a frame (H, W, 3) RGB uint8, and a line of text above it."""
        pygame, size = self._pygame, (frame.shape[1], frame.shape[0])
        if size != self._size:
            self._size = size
            self._window = pygame.display.set_mode(size)
        pygame.display.set_caption(caption)
        self._window.blit(pygame.image.frombuffer(frame, size, "RGB"), (0, 0))
        pygame.display.flip()

    def wait(self, fps: float) -> None:
        """Wait until a frame's time is over, of so many a second."""
        self._clock.tick(fps)

    def close(self) -> None:
        """Take the window off the screen."""
        self._pygame.joystick.quit()
        self._pygame.display.quit()
