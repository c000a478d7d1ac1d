"""Pictures of a face's worlds in a render mode."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym

from bug_gym.limits import MEMORY, told_bytes
from bug_gym.simulation import Simulation

if TYPE_CHECKING:
    from bug_gym.drawing.canvas import Canvas
    from bug_gym.drawing.clips import Frame
    from bug_gym.drawing.window import Window


SIZE = 600
"""Longer side of a picture [pixels]."""


class Pictures:
    """What a face shows of its worlds in a render mode: one canvas a world, and for "human" a window on the first.

    Raises:
        ImportError: a render mode, but pygame-ce is not installed.
        ValueError: a render mode, but more worlds than there is memory for pictures of.
    """

    def __init__(self, simulation: Simulation, render_mode: str | None) -> None:
        self.render_mode = render_mode
        self._simulation = simulation
        self._fps = 1.0 / simulation.scenario.time.step
        self._canvases: list[Canvas] = []
        self._window: Window | None = None
        if render_mode is not None:
            from bug_gym.drawing.canvas import PIXEL_BYTES, Canvas  # pygame, of the extra `render`

            memory = simulation.count * PIXEL_BYTES * SIZE**2
            if memory > MEMORY:
                what = f"pictures of {simulation.count:,} worlds would take {told_bytes(memory)}"
                raise ValueError(f"{what}, expected at most {told_bytes(MEMORY)}: render fewer worlds")
            self._canvases = [Canvas(simulation, size=SIZE, row=row) for row in range(simulation.count)]

    def record(self) -> None:
        """Take down where the robots are now, after each step and reset; show it in the window."""
        for canvas in self._canvases:
            canvas.record()
        if self.render_mode != "human":
            return
        if self._window is None:
            from bug_gym.drawing.window import Window  # pygame, of the extra `render`

            self._window = Window(self._canvases[0], self._fps)
        self._window.update()

    def frames(self) -> tuple[Frame, ...]:
        """A picture (H, W, 3) of each world, RGB uint8; none in a mode that returns none.

        Raises:
            gymnasium.error.ResetNeeded: a mode, but a world that has never been reset.
        """
        if self.render_mode is None:
            gym.logger.warn("render() shows nothing: make the env with render_mode='rgb_array' or 'human'")
            return ()
        self._simulation.require_episodes()
        return tuple(canvas.draw() for canvas in self._canvases) if self.render_mode == "rgb_array" else ()

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def __getstate__(self) -> dict[str, Any]:
        """The window stays with the original."""
        return {**self.__dict__, "_window": None}
