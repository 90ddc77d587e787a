"""A window for ``render_mode="human"`` that survives machines without a screen."""

from __future__ import annotations

import os
from typing import Any

import gymnasium as gym
import numpy as np


class Window:
    """Shows frames at ``fps``; without a display it says so once and shows nothing."""

    def __init__(self, title: str, fps: int) -> None:
        import pygame

        self._pg, self._title, self._fps = pygame, title, fps
        self._screen: Any = None
        self._clock = pygame.time.Clock()

    def show(self, frame: np.ndarray) -> None:
        """Show a frame, (height, width, 3) uint8."""
        pg = self._pg
        if self._screen is None:
            self._screen = self._open((frame.shape[1], frame.shape[0]))
        self._screen.blit(pg.surfarray.make_surface(frame.transpose(1, 0, 2)), (0, 0))
        pg.event.pump()
        pg.display.flip()
        self._clock.tick(self._fps)

    def _open(self, size: tuple[int, int]) -> Any:
        pg = self._pg
        try:
            pg.display.init()
            screen = pg.display.set_mode(size)
        except pg.error as error:
            gym.logger.warn(f"no display for render_mode='human' ({error}); the window is drawn to nowhere")
            os.environ["SDL_VIDEODRIVER"] = "dummy"
            pg.display.quit()
            pg.display.init()
            screen = pg.display.set_mode(size)
        pg.display.set_caption(self._title)
        return screen

    def close(self) -> None:
        """Close the window."""
        if self._screen is not None:
            self._pg.display.quit()
            self._screen = None
