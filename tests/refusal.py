"""What is wrong is refused in one clear line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from taxel import Error, ProblemError


@contextmanager
def refused(said: str, kind: type[Error] = ProblemError) -> Iterator[pytest.ExceptionInfo[Error]]:
    """Expect an error of a kind, of one line, in which the regular expression `said` is found."""
    with pytest.raises(kind, match=said) as caught:
        yield caught
    assert "\n" not in str(caught.value)
