"""Studies: modules with a protocol, its parameters and the published values as data, which one runner runs.

A study is a module of this package, with the constants and functions that `taxel_studies.study.Study` lists, and a line
in `STUDIES`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import taxel  # noqa: F401  before a study loads matplotlib, which then reads no settings of the current folder

if TYPE_CHECKING:
    from taxel_studies.study import Study

__all__ = ["DRAWN", "FIGURES", "STUDIES", "load"]

#: The title of every study by its name, in the order of the page. The module of "fig6.1" is ``fig6_1.py``.
STUDIES = {
    "fig3.3": "the fabric array's readout, thresholded, as spikes of Izhikevich pairs: one a rise, one a fall",
    "fig3.5": "two spheres told apart by a Tempotron from first spikes of the fabric array",
    "fig4.3": "single-slope conversion: the time until the ramp passes grows with the input",
    "adaptive_ramp": "a ramp that adapts to the signal: steep in gross movement, gentle in fine control",
    "fig4.6": "a taxel's voltage against its load at two line voltages: sensitivity against range",
    "fig4.7": "the transducer's answer to an impact, and settling while four channels are multiplexed",
    "foam": "one foam for all dropped balls, from three numbers that the thesis states of them",
    "fig4.8": "a tennis ball dropped on the array: its frames, and its bits by sampling rate (4.8, 4.10)",
    "fig4.9": "drops of a tennis ball laid out by t-SNE, by sampling rate",
    "contact": "a half disc pressed on silicone, sampled by taxels at its base (5.1 to 5.4)",
    "fig5.5": "bits of an indentation by sampling period, by parameter, and by time since contact (5.5, 5.6, 5.8)",
    "fig5.7": "bits of an indentation by sampling period and by bits an event",
    "drops": "a ball dropped on the array, and what its events and frames cost (5.10, 5.14)",
    "fig5.11": "bits of a drop by sampling period, by parameter, and by time since impact (5.11 to 5.13)",
    "fig6.1": "input spikes, potential, threshold and refractory time, and the output spikes they make",
    "fig6.2": "kappa lifts the potential behind the target, steepens the crossing and keeps the spike's time",
    "fig6.3": "the objectives of CONE-X and CONE-R over two weights",
    "fig6.4": "a larger kappa lifts the potential behind the target and leaves the spike where it is",
    "fig6.5": "the l1 norm uses few synapses, l2 all of them; the spike stays where it is",
    "fig6.6": "Poisson trains mapped to five spikes; l1 keeps the potential lower between them",
    "fig6.7": "how many patterns a neuron can learn exactly, by inputs and classes",
    "fig6.8": "three noises on a wave train, and what a trained neuron makes of them",
    "fig6.9": "kappa against jitter, background and shunting, trained without noise and with it",
    "fig6.10": "dense against sparse weights under jitter, background and shunting",
    "fig6.11": "how the weights are distributed, trained without noise and with it",
    "delays": "what learnt delays buy: copies of every input, chosen from by l1",
    "gait": "gait events by one neuron an event, on published walking recordings (6.12 to 6.14)",
    "asynchronous": "an array whose taxels compare by themselves: bits of a touch, and what they cost",
    "receptors": "what SA-1, FA-1, SA-2 and FA-2 answer to: phases of a ramp-and-hold, thresholds against frequency",
    "fa1": "which properties of FA-1 are worth keeping, in bits and in events",
    "stdp": "a neuron finds a pattern that repeats in its inputs, without labels",
    "rivals": "how many spike times each rule learns, beside CONE-X",
    "fig6.15": "SKIM against CONE on the gait recordings, in the same folds",
}


#: The study that shows each figure and table of the thesis after which no study is named.
FIGURES = {
    "fig3.6": "fig3.5",
    "fig4.10": "fig4.8",
    **dict.fromkeys(("fig5.1", "fig5.2", "fig5.3", "fig5.4", "table5.1", "table5.2"), "contact"),
    **dict.fromkeys(("fig5.6", "fig5.8", "table5.3"), "fig5.5"),
    **dict.fromkeys(("fig5.10", "fig5.14"), "drops"),
    **dict.fromkeys(("fig5.12", "fig5.13"), "fig5.11"),
    **dict.fromkeys(("fig6.12", "fig6.13", "fig6.14", "table6.2"), "gait"),
    "table6.1": "fig6.1",
    "table7.1": "asynchronous",
}

#: The pages that show the other figures and tables: drawings, and tables of words.
DRAWN = {
    "fig4.1": "docs/sensor.md",
    "fig4.2": "docs/sensor.md",
    "fig4.4": "docs/sensor.md",
    "fig4.5": "docs/sensor.md",
    "fig5.9": "docs/sensor.md",
    "table3.1": "docs/sensor.md",
    "table4.1": "docs/sensor.md",
}


def load(name: str) -> Study:
    """Return a study by its name in `STUDIES`."""
    from taxel_studies.study import Study  # noqa: PLC0415  matplotlib loads slowly

    return Study.of(name, STUDIES[name], import_module(f"taxel_studies.{name.replace('.', '_')}"))
