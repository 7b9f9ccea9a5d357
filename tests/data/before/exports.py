"""Write the exports of recordings of this folder, which must not be there, and what they hold.

`PYTHONPATH=tests python tests/data/before/exports.py`
"""

from __future__ import annotations

import json
from pathlib import Path

from test_before import contents

import taxel

HERE = Path(__file__).parent
#: The exports, and the recordings that they are of.
EXPORTS = {
    "events.npz": "board.mcap",
    "events.h5": "board.mcap",
    "frames.npz": "frames.mcap",
    "frames.h5": "frames.mcap",
}

held = json.loads((HERE / "contents.json").read_text("utf-8"))
for name, source in EXPORTS.items():
    taxel.convert(HERE / source, HERE / name)
    held[name] = contents(HERE / name)
places = taxel.Places([0.0, 10.0, 4.0], [0.0, 2.0, 8.0], None, "mm")
insole = taxel.open(HERE / "frames.mcap").frames().values[:, :1, :3]
array = taxel.Array(1, 3, name="insole", places=places)
taxel.convert(taxel.Frames(insole, [0, 1000, 2500, 4000], unit="N", array=array), HERE / "insole.npz")
held["insole.npz"] = contents(HERE / "insole.npz")
lines = [f"{json.dumps(name)}: {json.dumps(held[name], sort_keys=True)}" for name in sorted(held)]
(HERE / "contents.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8", newline="\n")
