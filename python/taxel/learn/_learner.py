"""The base of all learners: parameters, the error before `fit`, the score."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Literal

from numpy import float64
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import floats, instance, several
from taxel._base.parameters import Parameters, defaults
from taxel._core import NotFittedError, ProblemError
from taxel.learn._examples import examples
from taxel.metrics import f1
from taxel.spikes import SpikeTrains

#: How a fit ended, of all learners; the page on errors has the table.
Status = Literal["solved", "feasible", "infeasible", "stopped", "assigned"]
#: What a fit says of its weights. It does not hold of others; a certificate and multipliers are of the problem.
_OF_WEIGHTS = ("objective_", "parts_", "gap_", "violation_", "margin_", "reason_", "fired_")


_DEFAULT = defaults("matching")


class Learner(Parameters):
    """Learn weights; names of results end in ``_``."""

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; weights that are assigned after a fit have none of its verdicts."""
        super().__setattr__(name, value)
        fit = vars(self)
        if name == "weights_" and "status_" in fit:
            fit["status_"] = "assigned"
            for of_weights in _OF_WEIGHTS:
                fit.pop(of_weights, None)

    def __repr__(self) -> str:
        """Return the parameters, of a fit with a proven gap how it ended, and how many targets fire."""
        parameters, fit = super().__repr__(), vars(self)
        if "gap_" not in fit:
            return parameters
        # The gap says nothing about weights that miss rows.
        if fit["status_"] == "stopped" and "violation_" in fit:
            return f"<{parameters}: stopped, violation_ {fit['violation_']:.1e} mV>"
        gap = f", gap_ {fit['gap_']:.1e}" * (fit["status_"] != "infeasible")
        fired = "{} of {} targets fire".format(*fit["fired_"]) if "fired_" in fit else ""
        return f"<{parameters}: {fit['status_']}{gap}{fired and f', {fired}'}>"

    def _fitted(self) -> NDArray[float64]:
        """Return the weights; raise NotFittedError before `fit`."""
        weights = getattr(self, "weights_", None)
        if weights is None:
            raise NotFittedError(f"{type(self).__name__}: not fitted yet, call fit first")
        return floats("weights_", weights)


class SpikeLearner(Learner):
    """Learn spike times."""

    #: Largest distance of a spike from its target in a score, ms.
    _WINDOW_MS: ClassVar[float] = _DEFAULT.window_ms

    def predict(self, patterns: Sequence[SpikeTrains]) -> list[NDArray[float64]]:
        """Return the output spikes of the trained neuron, one array a pattern, ms.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains as in `fit`.

        Returns
        -------
        list of float64, shape (spikes,), ms

        Raises
        ------
        ProblemError : an invalid pattern (names it)
        NotFittedError : before `fit`
        """
        return self._fired(patterns_of(patterns))

    def _fired(self, patterns: list[SpikeTrains]) -> list[NDArray[float64]]:
        """Return the output spikes in each pattern: those of `neuron_` with its weights."""
        weights, fit = self._fitted(), vars(self)
        if fit.get("status_") == "infeasible":
            raise ProblemError(
                "the fit is infeasible: no weights meet its targets (status_, certificate_), so it cannot be run"
            )
        return [fit["neuron_"].run(weights, pattern) for pattern in patterns]

    def score(
        self, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike], window_ms: float | None = None
    ) -> float:
        """Return how well the output spikes match the targets.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
        targets : sequence of float sequences, ms
            Target spike times, one list per pattern.
        window_ms : float, ms, 0 or more, optional
            Largest distance of a spike from its target. Default: 50, of exact learners 1.

        Returns
        -------
        float, 0 to 1
            F1 over all patterns, as in `taxel.metrics.f1`.

        Raises
        ------
        ProblemError : invalid patterns or targets
        NotFittedError : before `fit`
        """
        _, target_times = examples(patterns, targets)
        return f1(self.predict(patterns), target_times, window_ms=self._WINDOW_MS if window_ms is None else window_ms)


def patterns_of(patterns: Sequence[SpikeTrains]) -> list[SpikeTrains]:
    """Return patterns as a list, each of which was checked; an error names the pattern."""
    return [instance(f"pattern {p}", pattern, SpikeTrains) for p, pattern in enumerate(several("patterns", patterns))]
