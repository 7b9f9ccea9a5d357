"""The console of rich on which a command shows tables, bars and its state."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import rich.console
from rich.segment import Segment
from rich.text import Text

from taxel._base.messages import escaped, escaped_lines

__all__ = ["Console"]


class Console(rich.console.Console):  # noqa: TID251  the place where it is allowed
    """Show texts as they are, in which control characters are escaped and brackets are not markup."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print; a text is one line, however long: a path that is broken in two cannot be copied or searched for."""
        super().print(*objects, **{"soft_wrap": all(isinstance(shown, str) for shown in objects), **options})

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text as one line: a name in it may hold line breaks."""
        return super().render_str(escaped(text), **options)

    def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
        """Yield the segments of anything that is shown, each without control characters but rich's own."""
        for segment in super().render(renderable, options):
            text = segment.text if segment.control else escaped_lines(segment.text)
            yield segment if text == segment.text else segment._replace(text=text)
