"""What the demo draws while it runs fits the terminal, and its newest line is seen."""

import io

import numpy as np
import pytest
from rich.console import Console

from taxel import Detection
from taxel.demo.screen import Screen
from taxel.live import Live
from taxel.simulate import Contact


class Drawing:
    """Keeps what was drawn last."""

    def __init__(self, width: int, height: int) -> None:
        self.console = Console(width=width, height=height, file=io.StringIO(), force_terminal=True)
        self.drawn = None

    def update(self, drawn: object) -> None:
        self.drawn = drawn


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 50), (200, 20), (60, 24), (40, 12), (30, 10)])
def test_the_newest_detection_is_visible_whatever_the_terminal(width: int, height: int) -> None:
    drawing = Drawing(width, height)
    contacts = [Contact("first", 1e5 * k, 1e5 * k + 2e4, 1.0, 1.0) for k in range(1, 30)]
    said = [
        Detection("contact", 100_000 * k, 100_600 + 100_000 * k, 1.0, 101_000 + 100_000 * k, 0) for k in range(1, 30)
    ]
    with Live(0, host="127.0.0.1") as live:
        counters = live.counters
    Screen(drawing, contacts, 3.0).draw(counters, np.full((64, 64), 40, np.uint16), said)
    console = Console(width=width, height=height, file=io.StringIO())
    lines = ["".join(piece.text for piece in line) for line in console.render_lines(drawing.drawn, pad=False)]
    assert max(map(len, lines)) <= width
    text = " ".join(" ".join(lines).split())
    assert "2.900 s contact" in text, "the newest"
    if height >= 20:
        assert len(lines) < height
        assert "nothing measured" in " ".join(text.replace("│", " ").split())
    if width >= 80 and height >= 24:
        assert "▀" in text
        assert sum("contact" in line and " s  " in line for line in lines) >= 4
