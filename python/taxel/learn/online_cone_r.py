"""Online CONE-R: a sliding window of patterns."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Self

from numpy.typing import ArrayLike

from taxel import _core
from taxel._base.arguments import callback, floats, instance, several
from taxel._base.errors import refused
from taxel._base.parameters import defaults
from taxel.learn._examples import windows
from taxel.learn.cone_r import ConeR, _keep, _warn, _weighed
from taxel.spikes import SpikeTrains

_DEFAULT = defaults("online_cone_r")


@dataclass(kw_only=True, eq=False, repr=False)
class OnlineConeR(ConeR):
    """Learn weights by CONE-R online: each new pattern is added to a sliding window, and the oldest is removed.

    After each pattern the weights are those of a fit to the whole window, with the same proven gap, in a fraction of
    the time: the rows of a pattern are computed once, and the solver starts from the previous fit.

    Parameters
    ----------
    neuron : Neuron, optional
    kappa : float, above 0
    delta_t_ms : float, ms, 0 or more, optional
    lambdas : five floats, 0 or more
    lb, ub : float, or float sequence of shape (trains,), mV
    form_b : {"square", "sum"}
    divide_b_by : {"B_max", "targets"}
    divide_c_by : {"C_max", "targets"}
    divide_d_by : {"D_max", "targets"}
    sides_b, sides_c : {"both", "below"}
    norm : {"norm", "square"}
    margin : float, mV, 0 or more
    horizon : float, ms, optional
    tolerance : float, from 1e-10 to 0.1
    max_seconds : float, s, above 0, optional
        All up to here as in `ConeR`.
    window : int, 1 or more
        Largest number of patterns in the window.

    Attributes
    ----------
    patterns_ : int
        Current number of patterns in the window.
    weights_, objective_, parts_, gap_, multipliers_, status_, rounds_, rows_, silent_rows_, unreachable_,
    neuron_
        Results of the last fit, as in `ConeR`; patterns are counted from the oldest in the window.
    refires_, fired_ : int, (int, int)
        As in `ConeR`, for the newest pattern only.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    The thesis names the lack of online learning as a limit of CONE, and suggests a sliding window (chapter 6).

    Examples
    --------
    >>> from taxel import Neuron
    >>> cone = OnlineConeR(window=2, neuron=Neuron(tau=10.0, after_spike="reset"), lb=-1.0, ub=1.0)
    >>> for shift in (0.0, 1.0, 2.0):
    ...     trains = SpikeTrains.from_lists([[5.0 + shift], [12.0 + shift], [30.0]], stop=60.0)
    ...     cone = cone.partial_fit(trains, [20.0 + shift])
    >>> cone.patterns_, cone.status_
    (2, 'solved')
    """

    _kind = "online_cone_r"

    window: int = _DEFAULT.window

    patterns_: int = field(init=False)

    #: Parameters and patterns of the window, from which a copy or a pickle is restored.
    _begun: str = field(init=False)
    _held: deque[tuple[Any, Any, Any]] = field(init=False)
    _stream: _core.OnlineConeR = field(init=False)

    def partial_fit(self, pattern: SpikeTrains, targets: ArrayLike, *, silence: ArrayLike | None = None) -> Self:
        """Add a pattern to the window, and fit the weights to all patterns that the window then holds.

        Parameters
        ----------
        pattern : SpikeTrains
            The same trains as in all patterns before.
        targets : float sequence, ms
            Target spike times; empty for a pattern without spikes.
        silence : float sequence of shape (windows, 2), ms, optional
            The windows (start, stop) of this pattern in which silence counts, as in `ConeR.fit`; default: everywhere.

        Returns
        -------
        OnlineConeR
            Itself.

        Raises
        ------
        ProblemError : an invalid pattern or invalid targets (names them, counted from the first pattern ever added);
        the window is then unchanged KeyboardInterrupt : Ctrl-C, within a fraction of a second; the pattern is in the
        window, the weights are the
            best so far

        Warns
        -----
        UserWarning : as `ConeR.fit`

        Examples
        --------
        >>> from taxel import Neuron
        >>> window = OnlineConeR(window=2, neuron=Neuron(tau=5.0, time="grid"), ub=1.0)
        >>> for first in (1.0, 2.0, 3.0):
        ...     pattern = SpikeTrains.from_lists([[first], [3.0], [4.0]], stop=20.0)
        ...     window = window.partial_fit(pattern, [6.0])
        >>> window.patterns_, window.status_
        (2, 'solved')
        """
        with self._locked():
            if not hasattr(self, "_stream"):
                self._begin()
            self._add(pattern, targets, windows("silence", silence), "pattern", "targets")
            return self._fit()

    def fit(
        self,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        *,
        silence: Sequence[ArrayLike | None] | None = None,
        start: ConeR | ArrayLike | None = None,
        progress: Callable[[int, int, float, float], object] | None = None,
    ) -> Self:
        """Empty the window, add the last of these patterns that it can hold, and fit once.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
        targets : sequence of float sequences, ms
        silence : sequence of float sequences of shape (windows, 2), ms, optional
            As in `ConeR.fit`.
        start : ConeR, or float64 of shape (trains,), mV, refused
        progress : function, refused
            A window starts from its own last fit, and does not report rounds.

        Returns
        -------
        OnlineConeR
            Itself.

        Raises
        ------
        ProblemError : invalid patterns or targets (names pattern and target)
        """
        if start is not None:
            raise refused("start", ": must be left out, because a window starts from its last fit")
        if progress is not None:
            callback("progress", progress)
            raise refused("progress", ": must be left out, because a window reports no progress")
        trains, times = several("patterns", patterns), several("targets", targets)
        if len(trains) != len(times) or not trains:
            raise refused("targets", f": {len(times)} lists for {len(trains)} patterns; must be one per pattern")
        each = [None] * len(trains) if silence is None else several("silence", silence)
        if len(each) != len(trains):
            raise refused("silence", f": {len(each)} lists for {len(trains)} patterns; must be one per pattern")
        silences = [windows(f"silence of pattern {p}", silence) for p, silence in enumerate(each)]
        with self._locked():
            self._begin()
            for p, (pattern, target, here) in enumerate(zip(trains, times, silences, strict=True)):
                self._add(pattern, target, here, f"pattern {p}", f"targets of pattern {p}")
            return self._fit()

    def _locked(self) -> Lock:
        """Return the lock of this learner: its window and the attributes of its last fit change together."""
        lock: Lock = vars(self).setdefault("_lock", Lock())
        return lock

    def _add(self, pattern: SpikeTrains, targets: ArrayLike, silence: Any, name: str, targets_name: str) -> None:
        example = instance(name, pattern, SpikeTrains), floats(targets_name, targets), silence
        # A train that is silent in this window may have spikes in the next.
        _weighed(name, len(pattern), "trains")
        self._stream.add(*example)
        self._held.append(example)

    def _begin(self) -> None:
        self._begun = self._json()
        self._stream = _core.OnlineConeR(self._begun)
        self._held = deque(maxlen=self.window)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_stream", "_lock")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        if "_begun" in state:
            self._stream = _core.OnlineConeR(self._begun)
            for example in self._held:
                self._stream.add(*example)

    def _fit(self) -> Self:
        fit = self._stream.fit()
        self.patterns_ = self._stream.patterns
        _keep(self, fit, self._stream.silent_rows, 0, lambda values: values)
        _warn(self)
        return self
