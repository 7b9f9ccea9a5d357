"""Keep what a report of studies found for the page of figures: numbers as JSON, pictures drawn from them as SVG.

python docs/figures.py            judges all claims and draws all pictures again
python docs/figures.py REPORT     takes the numbers of a report (taxel study all --report REPORT) first, with the commit

A report is taken if the commit that is checked out computed it, without local changes. Beside each figure its toy
result is kept, with which the tests compare that of later code.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

from taxel_studies import STUDIES, load
from taxel_studies.commit import code_version
from taxel_studies.study import drawn

FIGURES = Path(__file__).resolve().parents[1] / "benchmarks" / "results" / "figures"


def keep(report: Path, data: Path | None = None) -> None:
    """Copy the numbers of a report, and run it at toy size; its tables are made again where they are shown."""
    for name in STUDIES:
        summary = report / name / "summary.json"
        if summary.exists():
            section = json.loads(summary.read_text())
            section.pop("tables")
            if section.get("commit") != code_version("taxel", "taxel_rules", "taxel_studies"):
                sys.exit(f"{name}: not computed by the commit that is checked out, without local changes; run it again")
            (FIGURES / f"{name}.json").write_text(json.dumps(section) + "\n")
            (FIGURES / "toy").mkdir(exist_ok=True)
            (FIGURES / "toy" / f"{name}.json").write_text(json.dumps(toy_result(name, data)) + "\n")


def toy_result(name: str, data: Path | None = None) -> dict[str, Any]:
    """Run a study at its smallest size; return parameters and results, with commit, date and machine."""
    with tempfile.TemporaryDirectory() as report:
        section = load(name).run(Path(report), size="toy", data=data, quiet=True)
    return {key: section[key] for key in ("parameters", "said", "commit", "date", "machine")}


def judged(section: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a study's judgements, made from its numbers."""
    return [asdict(one) for one in load(section["name"]).judge(section["parameters"], section["said"])]


def draw(name: str) -> list[str]:
    """Judge a study's claims and draw its pictures from its numbers, and name them there."""
    file = FIGURES / f"{name}.json"
    section = json.loads(file.read_text())
    pictures = drawn(load(name), section["parameters"], section["said"])
    names = [f"{name}.svg"] if len(pictures) == 1 else [f"{name}-{k}.svg" for k in range(1, len(pictures) + 1)]
    for picture, data in zip(names, pictures, strict=True):
        (FIGURES / picture).write_bytes(data)
    file.write_text(json.dumps(section | {"judgements": judged(section), "pictures": names}) + "\n")
    return names


if __name__ == "__main__":
    for place in sys.argv[1:]:
        keep(Path(place), Path(os.environ["TAXEL_DATA"]) if "TAXEL_DATA" in os.environ else None)
    for found in sorted(FIGURES.glob("*.json")):
        print(*draw(found.stem))
