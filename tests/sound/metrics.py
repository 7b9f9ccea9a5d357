"""Sound calls of `taxel.metrics`."""

from collections.abc import Callable
from typing import Any

import taxel
from sound.things import UNSIGNED, Sound, plain
from taxel import _core
from taxel._base.parameters import described

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.metrics.matching": plain(taxel.metrics.matching, spikes=[[1.0, 2.0]], targets=[[1.5]], window_ms=5.0),
    "taxel.metrics.f1": plain(taxel.metrics.f1, spikes=[[1.0, 2.0]], targets=[[1.5]], window_ms=5.0),
    "taxel.metrics.victor_purpura": plain(taxel.metrics.victor_purpura, a=[1.0, 2.0], b=[1.5], q=0.1),
    "taxel.metrics.victor_purpura_multi_unit": plain(
        taxel.metrics.victor_purpura_multi_unit, a=UNSIGNED, b=UNSIGNED, q=0.1, k=0.5
    ),
    "taxel.metrics.van_rossum": plain(taxel.metrics.van_rossum, a=[1.0, 2.0], b=[1.5], tau=5.0, normalisation="spike"),
    "taxel.metrics.van_rossum_absolute": plain(
        taxel.metrics.van_rossum_absolute, a=[1.0, 2.0], b=[1.5], tau=5.0, window=(0.0, 50.0), step_ms=1.0
    ),
    "taxel.metrics.van_rossum_spatial": plain(
        taxel.metrics.van_rossum_spatial,
        a=UNSIGNED,
        b=UNSIGNED,
        array=taxel.Array(1, 2, 1.0),
        tau=5.0,
        sigma=2.0,
        own_train="twice",
        normalisation="spike",
    ),
    "taxel.metrics.van_rossum_spatial_absolute": plain(
        taxel.metrics.van_rossum_spatial_absolute,
        a=UNSIGNED,
        b=UNSIGNED,
        array=taxel.Array(1, 2, 1.0),
        tau=5.0,
        sigma=2.0,
        own_train="twice",
        window=(0.0, 50.0),
        step_ms=1.0,
    ),
    "taxel.metrics.isi_distance": plain(taxel.metrics.isi_distance, a=[1.0, 2.0], b=[1.5], window=(0.0, 50.0)),
    "taxel.metrics.spike_distance": plain(taxel.metrics.spike_distance, a=[1.0, 2.0], b=[1.5], window=(0.0, 50.0)),
    "taxel.metrics.pairwise": plain(
        taxel.metrics.pairwise,
        metric="van_rossum",
        a=[[1.0], [2.0]],
        b=[[3.0]],
        threads=1,
        progress=lambda *_: None,
        tau=5.0,
        normalisation="spike",
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.metrics.Matching": lambda: taxel.metrics.matching([[1.0]], [[1.5]], window_ms=5.0),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}

for metric in _core.metric_names():
    # A sound call of each metric that has no required parameters: its defaults are tried.
    distance = getattr(taxel.metrics, metric, None)
    if distance is not None and not described(metric)["required"]:
        SOUND.setdefault(f"taxel.metrics.{metric}", plain(distance, a=UNSIGNED, b=UNSIGNED))
