"""Write a region of a recording of this folder: `region.mcap` and `region.npz`, which must not be there.

`PYTHONPATH=tests python tests/data/before/region.py`
"""

from __future__ import annotations

import json
from pathlib import Path

from test_before import contents

import taxel

HERE = Path(__file__).parent

(part,) = taxel.cut(taxel.open(HERE / "board.mcap"), columns=slice(2, 9), rows=slice(1, 7))
held = json.loads((HERE / "contents.json").read_text("utf-8"))
for ending in (".mcap", ".npz"):
    file = HERE / f"region{ending}"
    taxel.convert(part, file)
    held[file.name] = contents(file)
lines = [f"{json.dumps(name)}: {json.dumps(held[name], sort_keys=True)}" for name in sorted(held)]
(HERE / "contents.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8", newline="\n")
