"""The SRM0 neuron: from input spikes to output spikes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import floats, number, numbers
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._base.parameters import Value, defaults
from taxel.spikes import SpikeTrains

__all__ = ["Neuron"]


_DEFAULT = defaults("neuron")


@dataclass(kw_only=True, eq=False, repr=False)
class Neuron(Value):
    """Describe a neuron of the simplified Spike Response Model (SRM0); run it on spike trains.

    The defaults are those of Table 6.1; Table 6.2 (gait) differs in `tau`: 70 ms for contact, 190 ms for foot-off.

    Parameters
    ----------
    tau : float, ms, above 0
        Membrane time constant.
    theta_0 : float, mV, above 0
        Baseline threshold.
    theta_plus : float, mV, 0 or more
        Increase of the threshold at a spike.
    tau_rec : float, ms, above 0, optional
        Time constant with which that increase decays; default: ``2 * tau``, as in Tables 6.1 and 6.2.
    refractory : float, ms, 0 or more
        Absolute refractory time: the potential is 0 and no spike occurs. May be 0 only if `after_spike` is "reset".
    after_spike : {"keep", "ignore", "reset"}
        Effect of a spike on the inputs. "keep": all remain (6.7 as printed). "ignore": those of the refractory time
        are dropped. "reset": all up to the end of the refractory time are dropped.
    first_threshold : {"theta_0", "printed"}
        The threshold before the first spike: `theta_0`, or raised from the start as equation 6.9 is printed.
    time : {"continuous", "grid"}
        Crossings are computed exactly, or tested only at the times ``start + k * step_ms``.
    step_ms : float, ms, above 0
        Step of the grid.
    kernel : {"alpha", "double_exponential", "exponential"}
        The effect of an input on the potential: ``t/tau * exp(-t/tau)`` (6.5); ``V0 * (exp(-t/tau) - exp(-t/tau_s))``,
        with a maximum of 1 (the Tempotron's); ``exp(-t/tau)``, on a grid only, as that potential rises in jumps.
    tau_s : float, ms, above 0 and below `tau`, optional
        Synaptic time constant of the double exponential; default: ``tau / 4``.
    rearm : float, above 0 and at most 1, optional
        After a spike no further one until the potential was below `rearm` times the threshold at some grid point, the
        threshold being the one in force there; default: no such condition. Only with `time` "grid". In the refractory
        time the sum of the inputs is compared, if `after_spike` leaves any, with `rearm` times `theta_0`. With "reset"
        no input is left, so that the next point already fulfils the condition.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Thesis 6.3.1, equations 6.4 to 6.8. The page *Readings* lists the choices that the thesis leaves open.

    Times are in double precision: at 2**33 ms (100 days) neighbouring numbers are 1.9e-6 ms apart. On a grid a
    potential counts as reaching the threshold within a tolerance of its slope times four such distances, so that far
    from 0 a neuron may fire at a grid point up to four distances before the crossing. Times that count from the start
    of a recording avoid both.

    Examples
    --------
    >>> neuron = Neuron(tau=10.0, after_spike="reset")
    >>> trains = SpikeTrains.from_lists([[0.0], [2.0]], stop=50.0)
    >>> neuron.run([1.0, 0.5], trains).round(3)
    array([3.366])
    >>> neuron.potential([1.0, 0.5], trains, [0.0, 10.0]).round(3)
    array([0.   , 0.548])
    """

    tau: float = _DEFAULT.tau
    theta_0: float = _DEFAULT.theta_0
    theta_plus: float = _DEFAULT.theta_plus
    tau_rec: float | None = _DEFAULT.tau_rec
    refractory: float = _DEFAULT.refractory
    after_spike: Literal["keep", "ignore", "reset"] = _DEFAULT.after_spike
    first_threshold: Literal["theta_0", "printed"] = _DEFAULT.first_threshold
    time: Literal["continuous", "grid"] = _DEFAULT.time
    step_ms: float = _DEFAULT.step_ms
    kernel: Literal["alpha", "double_exponential", "exponential"] = _DEFAULT.kernel
    tau_s: float | None = _DEFAULT.tau_s
    rearm: float | None = _DEFAULT.rearm

    _kind = "neuron"

    def run(self, weights: ArrayLike, trains: SpikeTrains, *, threshold: float = 1.0) -> NDArray[np.float64]:
        """Return the neuron's spike times.

        Parameters
        ----------
        weights : float64, shape (trains,), mV
        trains : SpikeTrains
            Unsigned; graded, whose values multiply the weights; or signed trains split into ON and OFF
            (`SpikeTrains.split_by_sign`).
        threshold : float, above 0
            A factor on the threshold (a readout's `run_threshold`), and so on the potential that `rearm` stands for.

        Returns
        -------
        float64, shape (spikes,), ms, between the start and the stop of `trains`

        Raises
        ------
        ProblemError : not one weight for each train, or a value that is not finite

        Notes
        -----
        In continuous time each crossing is the root of the potential less the threshold, to rounding. Cost: O(1) a
        spike.

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[0.0], [2.0]], stop=50.0)
        >>> Neuron(tau=10.0, after_spike="reset").run([1.0, 0.5], trains).round(3)
        array([3.366])
        """
        return self._run(weights, trains, threshold)[0]

    def run_many(self, weights: ArrayLike, trains: SpikeTrains, *, threshold: float = 1.0) -> SpikeTrains:
        """Return the spike times of many neurons with these parameters, all on the same inputs.

        Parameters
        ----------
        weights : float64, shape (neurons, trains), mV
        trains : SpikeTrains
            As in `run`.
        threshold : float, above 0
            A factor on the threshold.

        Returns
        -------
        SpikeTrains
            One train for each neuron, with the window of `trains`: the spikes that `run` returns for that row of
            weights.

        Raises
        ------
        ProblemError : not one weight for each neuron and train, or a value that is not finite (names the train)

        Notes
        -----
        A loop over `run`.

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[0.0], [2.0]], stop=50.0)
        >>> fired = Neuron(tau=10.0, after_spike="reset").run_many([[1.0, 0.5], [0.1, 0.1], [2.0, 0.0]], trains)
        >>> [train.round(3).tolist() for train in fired]
        [[3.366], [], [1.795]]
        """
        matrix = numbers("weights", weights, np.float64)
        if matrix.ndim != 2:
            raise refused("weights", f" has {matrix.ndim} dimensions: must have two, neurons and trains")
        if matrix.shape[1] != len(_trains(trains)):
            raise refused(
                "weights", f": {matrix.shape[1]} per neuron for {counted(len(trains), 'train')}; must be one per train"
            )
        fired = [self.run(row, trains, threshold=threshold) for row in matrix]
        return SpikeTrains.from_lists(fired, trains.start, trains.stop)

    def potential(
        self,
        weights: ArrayLike,
        trains: SpikeTrains,
        times: ArrayLike,
        *,
        spikes: ArrayLike = (),
    ) -> NDArray[np.float64]:
        """Return the membrane potential.

        Parameters
        ----------
        weights : float64, shape (trains,), mV
        trains : SpikeTrains
        times : float64, shape (n,), ms, ascending
        spikes : float64, shape (m,), ms, ascending
            The neuron's spikes. Without any the result is the linear sum 6.4. With spikes it is 6.7: 0 in the
            refractory time, then the effect of the inputs that `after_spike` leaves; at a spike itself, the potential
            that it reached.

        Returns
        -------
        float64, shape (n,), mV

        Raises
        ------
        ProblemError : times that do not ascend, or not one weight for each train

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[0.0], [2.0]], stop=50.0)
        >>> Neuron(tau=10.0).potential([1.0, 0.5], trains, [0.0, 3.0, 10.0], spikes=[2.5]).round(3)
        array([0.   , 0.   , 0.548])
        """
        return _core.neuron_potential(
            self._json(),
            floats("weights", weights),
            _trains(trains),
            floats("times", times),
            floats("spikes", spikes),
        )

    def _run(
        self, weights: ArrayLike, trains: SpikeTrains, threshold: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        factor = number("threshold", threshold)
        return _core.neuron_run(self._json(), floats("weights", weights), _trains(trains), factor)


def _trains(trains: SpikeTrains) -> SpikeTrains:
    if not isinstance(trains, SpikeTrains):
        raise refused("trains", f" is a {type(trains).__name__}: must be SpikeTrains")
    return trains
