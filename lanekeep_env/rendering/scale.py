"""A bar of a round length on a picture from above."""

from __future__ import annotations

import math
from typing import Any

#: Thickness of the bar and distance from the corner, pixels of a picture that is shown at half its size.
_THICK, _APART = 6, 24


def bar_length(extent: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at most a fifth of ``extent`` and more than a thirteenth."""
    power = 10.0 ** math.floor(math.log10(extent / 5.0))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= extent / 5.0)


def draw_bar(pg: Any, sheet: Any, window: Any, extent: float, font: Any, colour: tuple[int, int, int]) -> None:
    """Draw the bar and its length into the lower left corner of a ``window`` that is ``extent`` m wide."""
    length = bar_length(extent)
    left, low = window.left + _APART, window.bottom - _APART
    pg.draw.rect(sheet, colour, pg.Rect(left, low - _THICK, round(length * window.width / extent), _THICK))
    words = font.render(f"{length:g} m", True, colour)
    sheet.blit(words, words.get_rect(bottomleft=(left, low - 2 * _THICK)))
