"""Several encoders side by side, each with a name."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance, several, shown, text
from taxel._base.errors import refused
from taxel.array import Array
from taxel.encode._encoder import Encoder
from taxel.encode._tared import Tared
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded
from taxel.spikes import SpikeTrains
from taxel.tare import Tare


@dataclass(eq=False, repr=False)
class Composite(Encoder):
    """Set several encoders side by side, so that one neuron can receive the trains of all of them, or of some.

    The trains are those of all parts, as `SpikeTrains.side_by_side` joins them, in the order of the parts' names. The
    signed trains of a part are split into ON and OFF. If a part is graded, all trains are graded, and the spikes of the
    other parts have the value 1. The latency is the largest latency of a part.

    Parameters
    ----------
    parts : mapping of str to Encoder, one or more
        The encoders by name; none of them a composite.

    Raises
    ------
    ProblemError : no part, a part that is not an encoder, or an invalid parameter of a part (names it)

    Examples
    --------
    >>> from taxel.encode import FA1, LevelCrossing
    >>> both = Composite({"skin": FA1(), "level": LevelCrossing([10.0])})
    >>> both.encode(Frames([[[0.0]], [[12.0]]], [0, 1000]))
    SpikeTrains(4 trains, 2 spikes, 0 to 1 ms)
    """

    name = "composite"

    parts: Mapping[str, Encoder]

    def _json(self) -> str:
        if not isinstance(self.parts, Mapping):
            raise refused("parts", f" is {shown(self.parts)}: must be a dict of encoders, with their names as keys")
        # The parts write themselves, as a tare is inserted as text.
        each = [
            f"{json.dumps(text('a name in parts', name))}: {instance(f'parts[{name!r}]', part, Encoder)._json()}"
            for name, part in self.parts.items()
        ]
        return f'{{"name": "{self.name}", "parts": {{{", ".join(each)}}}}}'

    @classmethod
    def _from_values(cls, values: Mapping[str, Any]) -> Self:
        return cls({name: Encoder._of(part) for name, part in values["parts"].items()})

    def _each(self) -> list[Encoder]:
        return [self.parts[name] for name in sorted(self.parts)]

    def with_tare(self, tare: Tare) -> Self:
        return type(self)({name: part.with_tare(tare) for name, part in self.parts.items()})

    def encode(self, x: Events | Frames | Recorded) -> SpikeTrains:
        source = recorded(x)
        parts = {
            n: part._with_rest_of(source)[0] if isinstance(part, Tared) else part for n, part in self.parts.items()
        }
        return super(Composite, type(self)(parts)).encode(source)

    def only(self, names: Sequence[str]) -> Encoder:
        """Return some of the parts side by side; for a single name, the part itself.

        Parameters
        ----------
        names : sequence of str, one or more
            In any order.

        Returns
        -------
        Encoder

        Raises
        ------
        ProblemError : a name that no part has, or a name that is given twice

        Examples
        --------
        >>> from taxel.encode import FA1, LevelCrossing
        >>> Composite({"skin": FA1(), "level": LevelCrossing([10.0])}).only(["level"])
        LevelCrossing(levels=[10.0])
        """
        chosen = {name: self.parts[name] for name in self._named(names)}
        return type(self)(chosen) if len(chosen) > 1 else next(iter(chosen.values()))

    def places(self, names: Sequence[str], array: Array) -> NDArray[np.bool_]:
        """Return a mask of the trains that belong to some of the parts.

        Parameters
        ----------
        names : sequence of str, one or more
            In any order.
        array : Array
            The sensor; the number of trains of some encoders depends on it.

        Returns
        -------
        bool, shape (trains,)

        Raises
        ------
        ProblemError : a name that no part has, or a name that is given twice

        Examples
        --------
        >>> from taxel.encode import FA1, LevelCrossing
        >>> both = Composite({"skin": FA1(), "level": LevelCrossing([10.0])})
        >>> both.places(["level"], Array(1, 1)).tolist()
        [True, True, False, False]
        """
        chosen = self._named(names)
        counts = [part.trains(array) * (2 if part.signed else 1) for part in self._each()]
        return np.repeat([name in chosen for name in sorted(self.parts)], counts)

    def _named(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return names of parts in their order."""
        given = [text("inputs", name) for name in several("inputs", names)]
        for n, name in enumerate(given):
            if name not in self.parts:
                raise refused(
                    "inputs",
                    f": {name!r} is not the name of an encoder: must be one of {', '.join(sorted(self.parts))}",
                )
            if name in given[:n]:
                raise refused("inputs", f": {name!r} appears twice")
        if not given:
            raise refused("inputs", " is empty: must be names of encoders, one or more")
        return tuple(sorted(given))
