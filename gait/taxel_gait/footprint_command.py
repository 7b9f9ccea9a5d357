"""``taxel footprint``: footprints and their regions as tables and a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

import taxel
from taxel.cli.app import WRONG_INPUT, App, Flat, say
from taxel.cli.task import Output, progress, say_warnings
from taxel.options import Reading
from taxel.tasks import Workers
from taxel_gait import running
from taxel_gait.cohort import Cohort
from taxel_gait.footprints import FootprintOptions, Footprints, Person, mask_file, measure_person, people_of
from taxel_gait.tables import SUMMED, SYMMETRIES, Curves, Table, columns_of, load_name, summary, symmetry

app = App(name="footprint")

#: Where results are written if no folder is given.
FOLDER = Path("taxel-footprints")
_TABLES = ("footprints.csv", "regions.csv", "summary.csv", "symmetry.csv", "curves.csv")
_PAGE = "report.html"
_KEYS = ("recording", "person", "condition", "foot", "step", "used")


@app.default
def footprint(
    path: Path,
    /,
    *,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), metavar="FOLDER")] = None,
    wide: bool = False,
    decimal_comma: bool = False,
    options: Flat[FootprintOptions] = FootprintOptions(),
    workers: Flat[Workers] = Workers(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> int:
    """Measure footprints on plates, and on insoles of a grid: regions, tables, and a page that prints.

    Writes footprints.csv (a row a print), regions.csv (a row for each of its regions), summary.csv, symmetry.csv,
    curves.csv and report.html, and for each foot PERSON-SIDE.nine.regions.json: the regions of the person's mean
    footprint, in its own mm. What is changed there is used in the next run. Prints that are partial, turned the wrong
    way, of unknown side or of two feet are named, and left out of means.

    Example: taxel footprint step.lst
    Example: taxel footprint plate -o results --mask footscan --jobs 2

    Parameters
    ----------
    path
        A recording, or a folder, with people.csv or without.
    out
        The folder for what is written. Default: taxel-footprints.
    wide
        Write regions.csv with a row a print.
    decimal_comma
        Write decimal commas, with semicolons between cells.
    """
    from taxel_gait.footprint_report import write_report  # noqa: PLC0415  jinja2 loads slowly

    reading, options = running.found_anywhere(reading), running.found_anywhere(options)
    cohort = Cohort.of([path.absolute()], reading.layout)
    folder = (FOLDER if out is None else out).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    output.check(*(folder / name for name in (*_TABLES, _PAGE)))
    people = people_of(cohort.entries)
    stamps = [
        running.stamp(
            one, [*(p for e in one.entries for p in e.paths), *_masks(folder, one, options)], options, reading
        )
        for one in people
    ]
    with progress(output.json) as show:
        work = partial(_work, options, reading, folder)
        found, failed = running.run(people, work, stamps, folder, workers, show)
    by_person = {
        one.name: Footprints(**running.read(file)) for one, file in zip(people, found, strict=True) if file is not None
    }
    measured = list(by_person.values())
    left_out = {**cohort.left_out, **failed, **{k: v for one in measured for k, v in one.failed.items()}}
    say_warnings(dict.fromkeys(text for one in measured for text in one.warnings))
    say(*(f"taxel: {why if name in why else f'{name}: {why}'}" for name, why in left_out.items()), err=True)
    rows = [row for one in measured for row in one.rows]
    if not rows:
        running.clear(folder)
        if len(left_out) != 1:
            say(f"taxel: {cohort.place}: no footprint was found, so no table is written", err=True)
        return WRONG_INPUT
    regions = [row for one in measured for row in one.regions]
    feet = {name: one.feet for name, one in by_person.items()}
    for name, by_side in feet.items():
        for side, foot in by_side.items():
            file = mask_file(folder, name, side, options.mask)
            own = [taxel.Region(one["name"], one["polygon"]) for one in foot["regions"]]
            file.parent.mkdir(parents=True, exist_ok=True)
            taxel.write_regions(file, own, overwrite=True)
    about = _about(rows, feet, options, left_out)
    about += dict.fromkeys(line for one in measured for line in one.about)
    summed = [*summary(rows), *summary(regions)]
    means = _means(rows, [one for each in measured for one in each.curves])
    group = ["person", "condition"]
    written = {
        "footprints.csv": Table(about, columns_of(rows), rows),
        "regions.csv": _wide(about, rows, regions) if wide else Table(about, columns_of(regions), regions),
        "summary.csv": Table(about, [*group, "foot", "region", *SUMMED], [one.row() for one in summed]),
        "symmetry.csv": Table(about, [*group, "region", "measure", "left", "right", *SYMMETRIES], symmetry(summed)),
        "curves.csv": Table(
            about,
            [*group, "foot", "load", "region", "stance_pct", "mean", "sd"],
            [
                dict(zip((*group, "foot", "load"), key, strict=True))
                | {"region": name, "stance_pct": pct, "mean": m, "sd": s}
                for key, own in means.items()
                for name, (mean, sd) in own.items()
                for pct, (m, s) in enumerate(zip(mean.tolist(), sd.tolist(), strict=True))
            ],
        ),
    }
    for name, table in written.items():
        table.write(folder / name, decimal_comma=decimal_comma, overwrite=output.overwrite)
    write_report(folder / _PAGE, about, feet, means, summed, overwrite=output.overwrite)
    if options.boxes:
        text = "\n".join(["recording,label,t_us", *(line for one in measured for line in one.labels), ""])
        (folder / "boxes" / "labels.csv").write_text(text, "utf-8")
    running.clear(folder)
    used = Counter(row["used"] for row in rows)
    output.say(
        {
            "people": len(feet),
            "prints": len(rows),
            "used": dict(used),
            "left_out": left_out,
            "written": [str(folder / one) for one in (*written, _PAGE)],
        },
        f"{len(rows)} footprints of {len(feet)} people, of which {used['yes']} are in means",
        *(f"  {count} left out: {why}" for why, count in used.items() if why != "yes"),
        f"written to {FOLDER if out is None else out}: {', '.join((*_TABLES, _PAGE))}",
    )
    return WRONG_INPUT if left_out else 0


def _masks(folder: Path, person: Person, options: FootprintOptions) -> list[Path]:
    return [mask_file(folder, person.name, side, options.mask) for side in ("left", "right")]


def _work(options: FootprintOptions, reading: Reading, folder: Path, person: Person) -> dict[str, Any]:
    return vars(measure_person(person, options, reading, folder))


def _about(
    rows: Sequence[dict[str, Any]],
    feet: dict[str, dict[str, Any]],
    options: FootprintOptions,
    left_out: dict[str, str],
) -> list[str]:
    """Return what stands above the names of each table."""
    used = Counter(row["used"] for row in rows)
    kept = [foot["kept"] for by_side in feet.values() for foot in by_side.values() if foot["kept"]]
    above = "1 % of the print's largest value" if options.above is None else f"{options.above:g}"
    whose = "each print's own" if options.own_mask else "one for each person's foot, found on its mean footprint"
    known = any("saturated_cells" in row for row in rows)
    reasons = {} if known else {"saturated_cells": "the end of a taxel's range is not known: say --saturation VALUE"}
    if options.mask != "footscan":
        reasons["balance_foot_pct, balance_forefoot_pct"] = "of footscan's regions: say --mask footscan"
    of_prints = [
        f"regions: {options.mask}, {whose}; a cell counts as loaded above {above}",
        "stance: from the first loaded frame to the last; contact and lift at 5 and 10 % of the largest load beside it",
        "cells that a border cuts count with their share of area, for peaks where their middle lies",
        "side: as seen from above, by the print, unless it is stated",
        "cop: the path of the centre of pressure where the load is above 2 % of its maximum",
        "cpei_pct: at 2/3 of the print's length, across, the path (load above 5 %) from the line between its ends, % "
        "of the print's width there, lateral above 0",
        "arch_index: area of the middle third / area, ever loaded, without toes, thirds from the heel to the front of "
        "the metatarsals",
        "max_mean_pressure: largest force / area loaded then; region_pressure: largest force / area ever loaded",
        "contact_area: largest at one moment; contact_area_ever: loaded at any moment",
        "pti_force_area: fti / area ever loaded; pti_mean_curve: integral of force / area loaded then",
    ]
    return [
        f"taxel {taxel.__version__}, taxel footprint",
        *(of_prints if any(feet.values()) else ()),
        "fti: force-time integral by trapezoids; pti_peak_cell: largest integral of one cell; pti_peak_curve: integral "
        "of the largest cell of each moment; loading_rate: 0.6 of the maximum / the time from 20 to 80 % of it",
        "contact_time_s: frames in which it is loaded x their period; times and % from the first loaded frame",
        f"means are of {used['yes']} prints that are used; left out: "
        + ("; ".join(f"{count} {why}" for why, count in used.items() if why != "yes") or "none"),
        *(f"regions read from {file}" for file in kept),
        *(f"empty: {name}: {why}" for name, why in reasons.items()),
        *(f"not measured: {name}: {why}" for name, why in left_out.items()),
    ]


def _means(rows: Sequence[dict[str, Any]], curves: Sequence[dict[str, list[float]]]) -> Curves:
    """Return mean and SD of the curves of the prints that are used."""
    by_foot: dict[tuple[str, str, str, str], dict[str, list[list[float]]]] = {}
    for row, own in zip(rows, curves, strict=True):
        if row["used"] == "yes":
            key = (row["person"], row["condition"], row["foot"], load_name(row))
            for name, curve in own.items():
                by_foot.setdefault(key, {}).setdefault(name, []).append(curve)
    return {
        key: {
            name: (np.mean(some, axis=0), np.std(some, axis=0, ddof=1) if len(some) > 1 else np.full(101, np.nan))
            for name, some in own.items()
        }
        for key, own in by_foot.items()
    }


def _wide(about: list[str], rows: Sequence[dict[str, Any]], regions: Sequence[dict[str, Any]]) -> Table:
    """Return the table of regions with a row a print."""
    wide: dict[tuple[Any, ...], dict[str, Any]] = {
        tuple(row[k] for k in _KEYS): {k: row[k] for k in _KEYS} for row in rows
    }
    for row in regions:
        own = wide[tuple(row[k] for k in _KEYS)]
        cells = {name: value for name, value in row.items() if name not in (*_KEYS, "region", "contact_s")}
        own.update({f"{row['region']} {name}": value for name, value in cells.items()})
    listed = list(wide.values())
    return Table(about, list(dict.fromkeys(name for row in listed for name in row)), listed)
