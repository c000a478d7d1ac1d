"""A window that shows a canvas."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bug_gym.drawing.brush import load_pygame
from bug_gym.drawing.canvas import Canvas, logger
from bug_gym.policy import Drawing

if TYPE_CHECKING:
    import pygame

UNSEEN = {"dummy", "offscreen"}
"""Drivers of SDL that show nothing to anybody."""


class Window:
    """Shows a Canvas on the screen, at most `fps` frames a second; without a screen it shows nothing and goes on.

    Args:
        canvas: what to show.
        fps: frames a second of real time.

    Raises:
        ValueError: fps that is not positive.
    """

    def __init__(self, canvas: Canvas, fps: float) -> None:
        if not fps > 0.0:
            raise ValueError(f"fps must be positive, got {fps}")
        self.canvas = canvas
        self.fps = fps
        self.is_open = True
        """False once somebody has closed it; then `update` does nothing."""
        self._clock = load_pygame().time.Clock()
        self._screen: pygame.Surface | None = None

    def update(self, drawing: Drawing | Sequence[Drawing | None] | None = None, *, note: str = "") -> None:
        """Draw the row, show it, answer the window's events and wait until the frame's time is over."""
        pygame = load_pygame()
        if not self.is_open:
            return
        # Another program part may have shut the display down.
        if self._screen is None or not pygame.display.get_init():
            self._screen = open_screen((self.canvas.width, self.canvas.height))
        frame = self.canvas.draw(drawing, note=note)
        self._screen.blit(pygame.image.frombuffer(frame, (self.canvas.width, self.canvas.height), "RGB"), (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
        self._clock.tick(self.fps)

    def close(self) -> None:
        """Take the window off the screen."""
        pygame = load_pygame()
        if self._screen is not None and pygame.display.get_init():
            pygame.display.quit()
        self._screen = None
        self.is_open = False


def open_screen(size: tuple[int, int]) -> pygame.Surface:
    """A window of this size, on SDL's dummy driver where there is no screen."""
    module = load_pygame()
    asked = os.environ.get("SDL_VIDEODRIVER")
    try:
        module.display.init()
        driver = module.display.get_driver()
        reason = f"SDL chose its driver {driver!r}" if driver in UNSEEN and driver != asked else ""
    except module.error as error:
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        module.display.init()
        reason = str(error)
    if reason:
        logger.warning("no screen to draw on (%s): the window stays invisible", reason)
    module.display.set_caption("bug_gym")
    screen: pygame.Surface = module.display.set_mode(size)
    return screen
