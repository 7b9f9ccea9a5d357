"""The topics of a ROS bag, as ``taxel info`` lists them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taxel.formats.ros import Topic


def listed(file: Path, found: Sequence[Topic], as_json: bool) -> list[str]:
    """Return the topics of a ROS bag that hold numbers as lines for people, or as one of JSON."""
    if as_json:
        return [json.dumps({"file": str(file), "kind": "ros", "topics": [asdict(one) for one in found]})]
    if not found:
        return [f"{file}: a ROS bag without a topic that holds numbers"]
    rows = [("topic", "field", "shape", "numbers", "messages", "rate")]
    for one in found:
        shape = " x ".join(map(str, one.shape)) if len(one.shape) > 1 else f"{one.shape[0]}" if one.shape else "-"
        rate = "-" if one.rate_hz is None else f"{one.rate_hz:.1f} Hz"
        rows.append((one.topic, one.field or "-", shape, one.dtype or "-", str(one.messages), rate))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    kinds = ["type", *(one.type + f": {one.trouble}" * bool(one.trouble) for one in found)]
    lines = [
        "  " + "  ".join([*(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)), kind])
        for row, kind in zip(rows, kinds, strict=True)
    ]
    named = next((one for one in found if not one.trouble), found[0])
    more = f" --field {named.field}" * bool(named.field) + " --array ROWSxCOLUMNS" * (len(named.shape) < 2)
    return [f"{file}: ROS bag; open a topic by --topic {named.topic}{more}", *lines]
