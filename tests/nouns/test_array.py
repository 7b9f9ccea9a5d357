"""Array: geometry, equality, and an error for every nonsense."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taxel import Array


@given(
    st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4), st.booleans()), min_size=1, max_size=4), st.integers(0, 2)
)
def test_arrays_side_by_side_are_the_parts_of_one(sizes: list[tuple[int, int, bool]], gap: int) -> None:
    draw = np.random.default_rng(len(sizes))
    arrays = []
    for rows, columns, named in sizes:
        exists = draw.random((rows, columns)) < 0.7
        exists[0, 0] = True
        names = [f"{k}" for k in range(rows * columns)] if named else None
        arrays.append(Array(rows, columns, 2.0, exists, "a", names=names))
    beside, lefts = Array._beside(arrays, gap)
    assert beside.taxels == sum(array.taxels for array in arrays)
    assert beside.columns == sum(array.columns for array in arrays) + gap * (len(arrays) - 1)
    for left, array in zip(lefts, arrays, strict=True):
        part = beside._part(slice(left, left + array.columns), slice(0, array.rows))
        assert part.fits(array)
        assert (part.pitch_mm, part.name) == (2.0, "a")
        assert part.names in (array.names, ("",) * array.rows * array.columns)
