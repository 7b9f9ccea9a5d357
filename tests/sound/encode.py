"""Sound calls of `taxel.encode`."""

from collections.abc import Callable
from typing import Any

from encode import test_laws as laws

import taxel
from sound.things import ARRAY, FRAMES, LEVELS, TARE, Sound, fresh, method, plain

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.encode.Composite.only": method(taxel.encode.Composite({"a": LEVELS}), "only", names=["a"]),
    "taxel.encode.Composite.places": method(taxel.encode.Composite({"a": LEVELS}), "places", names=["a"], array=ARRAY),
    "taxel.encode.Encoder.encode": method(LEVELS, "encode", x=FRAMES),
    "taxel.encode.Encoder.from_json": plain(taxel.encode.Encoder.from_json, text=LEVELS.to_json()),
    "taxel.encode.Encoder.transform": method(LEVELS, "transform", recordings=[FRAMES]),
    "taxel.encode.Encoder.stream": method(LEVELS, "stream", array=ARRAY),
    "taxel.encode.Encoder.trains": method(LEVELS, "trains", array=ARRAY),
    "taxel.encode.Encoder.with_tare": method(LEVELS, "with_tare", tare=TARE),
    "taxel.encode.Skin.afferents": method(taxel.encode.Skin(), "afferents", array=ARRAY),
    "taxel.encode.LocalLoad.values": method(taxel.encode.LocalLoad(tare=TARE), "values", x=FRAMES),
    "taxel.encode.Afferents.trains": method(taxel.encode.Skin().afferents(ARRAY), "trains", kind="SA-1"),
    "taxel.encode.EncoderStream": plain(taxel.encode.EncoderStream, encoder=LEVELS, array=ARRAY),
    "taxel.encode.EncoderStream.push": fresh(lambda: LEVELS.stream(ARRAY), "push", x=FRAMES),
    "taxel.encode.EncoderStream.advance": fresh(lambda: LEVELS.stream(ARRAY), "advance", t_us=5),
    "taxel.encode.RunningRange": plain(
        lambda **given: taxel.encode.LevelCrossing([0.5], running_range=taxel.encode.RunningRange(**given)),
        low=10.0,
        high=95.0,
        window_s=10.0,
        renew_s=1.0,
        first_window="silent",
    ),
    "taxel.encode.Encoder.fit": method(LEVELS, "fit", recordings=[FRAMES], targets=None),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.encode.Afferents": lambda: taxel.encode.Skin().afferents(ARRAY),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}

for encoder in laws.ENCODERS.values():
    # One valid call of each encoder of the registry: its first example.
    SOUND.setdefault(f"taxel.encode.{type(encoder).__name__}", plain(type(encoder), **encoder.get_params(deep=False)))
