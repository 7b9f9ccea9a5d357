"""The topics of a ROS bag, as ``taxel info`` lists them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from taxel.cli._say import in_columns

if TYPE_CHECKING:
    from taxel.formats.ros import Topic


def list_topics(file: Path, found: Sequence[Topic], as_json: bool) -> list[str]:
    """Return the topics of a ROS bag that hold numbers as lines for people, or as one of JSON."""
    if as_json:
        return [json.dumps({"file": str(file), "kind": "ros", "topics": [asdict(topic) for topic in found]})]
    if not found:
        return [f"{file}: this ROS bag has no topic with numbers"]
    rows = [("topic", "field", "shape", "numbers", "messages", "rate", "type")]
    for topic in found:
        shape = " x ".join(map(str, topic.shape)) or "-"
        rate = "-" if topic.rate_hz is None else f"{topic.rate_hz:.1f} Hz"
        kind = topic.type + f": {topic.trouble}" * bool(topic.trouble)
        rows.append((topic.topic, topic.field or "-", shape, topic.dtype or "-", str(topic.messages), rate, kind))
    # An id is no skin: most numbers are.
    named = max(found, key=lambda topic: (not topic.trouble, math.prod(topic.shape)))
    more = f" --field {named.field}" * bool(named.field) + " --array ROWSxCOLUMNS" * (len(named.shape) < 2)
    return [
        f"{file}: ROS bag; open a topic by --topic {named.topic}{more}",
        *(f"  {line}" for line in in_columns(rows)),
    ]
