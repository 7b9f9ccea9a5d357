"""``taxel steps``: the steps of insoles as tables and a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import taxel
from taxel.cli.app import WRONG_INPUT, App, Flat, say
from taxel.cli.task import Output, progress, say_warnings
from taxel.options import Reading
from taxel.tasks import Workers
from taxel_gait import kept, running
from taxel_gait.cohort import Cohort, Entry
from taxel_gait.measures import CENTRE
from taxel_gait.measuring import Measured, StepOptions, measure
from taxel_gait.tables import (
    SUMMED,
    SYMMETRIES,
    Summary,
    Table,
    columns_of,
    curves,
    figure,
    load_name,
    summary,
    symmetry,
)

app = App(name="steps")

#: Where results are written if no folder is given.
FOLDER = Path("taxel-steps")
_TABLES = ("steps.csv", "summary.csv", "symmetry.csv", "curves.csv")
_PAGE = "report.html"
#: How many recordings a line names.
_NAMED = 3
#: What the columns are, in words from which they can be computed anew.
_RULE = (
    "a stance: from where the load rises to 30 % of its range (10th, of a single sensor 15th, to 95th percentile of 20 "
    "s around, each second) until it falls below 20 %; a gap under 0.05 s, or never below 15 %, is no swing between "
    "two; stances are 0.1 s or longer",
    "contact: the sample after the swing's last one below its level; lift: the swing's first one below its level; a "
    "swing's base: the 25th percentile of its load, of a single sensor the 75th",
)
_WORDS = (
    "stance_s: lift - contact; swing_s: the foot's next contact - lift; stride_s: next contact - contact; stance_pct: "
    "stance / stride; cadence: 120 / stride_s, steps a minute",
    "step_s: contact - the other foot's last contact; double_support_initial_s: the other foot's lift - contact; "
    "double_support_terminal_s: lift - the other foot's next contact; single_support_s: stance without both",
    "max, mean: of the samples from contact to before lift; impulse: trapezoids from contact to lift",
    "first_peak, second_peak: the largest load of the first and of the second half of stance; valley: the least "
    "between; _pct: when, % of stance; empty where a half's largest load is at 50 %",
    "loading_rate: 0.6 of the maximum / the time from 20 to 80 % of it on the first rise, interpolated",
    f"cop: the path of the centre of pressure where the load is above {100 * CENTRE:g} % of the step's maximum",
    "turn or unusual: a stride or a stance off the foot's running median of 11 by more than 3 robust SD (1.4826 times "
    "the median of all distances from it) and 8 %; turn: two or more of them within 2.5 s",
    "a bout ends where both feet are loaded for over 1 s, at a gap over 0.1 s, at two contacts of one foot in a row",
)
#: Columns that insoles leave empty, and a plate's footprints do not.
_EMPTY = ("saturated_cells", "cpei_pct", "arch_index")


@app.default
def steps(
    paths: list[Path],
    /,
    *,
    out: Annotated[Path | None, Parameter(name=("--out", "-o"), metavar="FOLDER")] = None,
    decimal_comma: bool = False,
    options: Flat[StepOptions] = StepOptions(),
    workers: Flat[Workers] = Workers(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> int:
    """Measure the steps of insoles: tables, mean curves over stance, and a page that prints.

    Writes steps.csv (a row a step), summary.csv (by person, foot and condition), symmetry.csv, curves.csv and
    report.html, and for each recording NAME.steps.csv: contacts and lifts as labels. What is taken out there stays
    out in the next run. Files that cannot be read are named at the end, with exit code 2. A run that was stopped goes
    on where it was.

    Example: taxel steps walk.txt
    Example: taxel steps left.asf right.asf --same-clock
    Example: taxel steps insole_gaitpdb -o results --jobs 2

    Parameters
    ----------
    paths
        A recording of one foot or both; the left and the right foot's recording; or a folder, with people.csv or
        without.
    out
        The folder for all that is written. Default: taxel-steps, and NAME.steps.csv beside each recording.
    decimal_comma
        Write decimal commas, with semicolons between cells.
    """
    from taxel_gait.report import write_report  # noqa: PLC0415  jinja2 loads slowly

    reading, options = running.found_anywhere(reading), running.found_anywhere(options)
    cohort = Cohort.of([path.absolute() for path in paths], reading.layout)
    folder = (FOLDER if out is None else out).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    output.check(*(folder / name for name in (*_TABLES, _PAGE)))
    label_tables = [_label_tables(entry, None if out is None else folder) for entry in cohort.entries]
    by_entry = dict(zip(cohort.entries, label_tables, strict=True))
    stamps = [running.stamp(one, [*one.paths, *of], options, reading) for one, of in by_entry.items()]
    with progress(output.json) as show:
        work = partial(_measure, by_entry, options, reading)
        found, failed = running.run(cohort.entries, work, stamps, folder, workers, show)
    measured = dict[Entry, Measured]()
    for entry, file in zip(cohort.entries, found, strict=True):
        if file is None:
            continue
        one = Measured.from_dict(running.read(file))
        for table, labels in zip(by_entry[entry], one.labels, strict=True):
            table.parent.mkdir(parents=True, exist_ok=True)
            kept.write(table, labels)
        # Of many recordings all the labels would be much.
        measured[entry] = replace(one, labels=[])
    rows = [row for one in measured.values() for row in one.rows]
    say_warnings(dict.fromkeys(text for one in measured.values() for text in one.warnings))
    left_out = {**cohort.left_out, **failed}
    say(*(f"taxel: {why if name in why else f'{name}: {why}'}" for name, why in left_out.items()), err=True)
    if not rows:
        running.clear(folder)
        if len(left_out) != 1:
            say(f"taxel: {cohort.place}: no step was found, so no table is written", err=True)
        return WRONG_INPUT
    definitions = list(dict.fromkeys(words for one in measured.values() for words in one.definitions))
    about = _about(measured, definitions, rows, left_out, options)
    over_stance = [curve for one in measured.values() for curve in one.curves]
    written = _write(folder, about, rows, over_stance, decimal_comma=decimal_comma, overwrite=output.overwrite)
    write_report(folder / _PAGE, about, definitions, rows, over_stance, overwrite=output.overwrite)
    running.clear(folder)
    used = Counter(row["used"] for row in rows)
    people = len({(row["person"], row["condition"]) for row in rows})
    output.say(
        {
            "recordings": len(measured),
            "people": len({row["person"] for row in rows}),
            "steps": len(rows),
            "used": dict(used),
            "left_out": left_out,
            "written": [str(path) for path in (*written, folder / _PAGE)],
        },
        f"{len(measured)} of {len(cohort.entries)} recordings, {len(rows)} steps, of which {used['yes']} are in means: "
        + ", ".join(f"{count} {name}" for name, count in used.items() if name != "yes"),
        *_lines(summary(rows)) * (people == 1),
        f"written to {FOLDER if out is None else out}: {', '.join((*_TABLES, _PAGE))}",
        f"labels: {by_entry[next(iter(measured))][0]}" + " ..." * (len(measured) > 1),
    )
    return WRONG_INPUT if left_out else 0


def _label_tables(entry: Entry, out: Path | None) -> list[Path]:
    """Return where the table of labels of each file is."""
    if out is None:
        # As the page names its tables of labels.
        return [path.with_name(f"{path.stem}.steps.csv") for path in entry.paths]
    if len(entry.paths) > 1:
        return [out / f"{path.stem}.steps.csv" for path in entry.paths]
    return [out / f"{entry.name}.steps.csv"]


def _measure(tables: dict[Entry, list[Path]], options: StepOptions, reading: Reading, entry: Entry) -> dict[str, Any]:
    return measure(entry, options, reading, tables[entry]).to_dict()


def _about(
    measured: Mapping[Entry, Measured],
    definitions: Sequence[str],
    rows: Sequence[dict[str, Any]],
    left_out: dict[str, str],
    options: StepOptions,
) -> list[str]:
    """Return what stands above the names of each table."""
    used = Counter(row["used"] for row in rows)
    reasons: dict[str, list[str]] = {}
    for entry, one in measured.items():
        for name, why in one.reasons.items():
            reasons.setdefault(f"{name}: {why}", []).append(entry.name)
    return [
        f"taxel {taxel.__version__}, taxel steps",
        *definitions,
        *(() if options.readout is not None else _RULE),
        *_WORDS,
        f"means are of {used['yes']} steps that are used; left out: "
        + (", ".join(f"{count} {name}" for name, count in used.items() if name != "yes") or "none"),
        *(f"empty: {why}{_of(names, len(measured))}" for why, names in reasons.items()),
        *(f"not measured: {name}: {why}" for name, why in left_out.items()),
    ]


def _of(names: Sequence[str], count: int) -> str:
    """Return of which recordings something is said, of so many; "" of all."""
    more = f" and {len(names) - _NAMED} more" * (len(names) > _NAMED)
    return "" if len(names) == count else f", of {', '.join(names[:_NAMED])}{more}"


def _write(
    folder: Path,
    about: list[str],
    rows: list[dict[str, Any]],
    over_stance: Sequence[Sequence[float] | None],
    *,
    decimal_comma: bool,
    overwrite: bool,
) -> list[Path]:
    """Write the tables; return their paths."""
    summed, group = summary(rows), ["person", "condition"]
    loads = {tuple(row[name] for name in (*group, "foot")): load for row in rows if (load := load_name(row))}
    of_curves = [
        dict(zip((*group, "foot"), key, strict=True))
        | {"load": loads[key], "stance_pct": pct, "n": n, "mean": m, "sd": s}
        for key, (n, mean, sd) in curves(rows, over_stance).items()
        for pct, (m, s) in enumerate(zip(mean.tolist(), sd.tolist(), strict=True))
    ]
    tables = [
        Table(about, columns_of(rows, _EMPTY), rows),
        Table(about, [*group, "foot", *SUMMED], [one.row() for one in summed]),
        Table(about, [*group, "measure", "left", "right", *SYMMETRIES], symmetry(summed)),
        Table(about, [*group, "foot", "load", "stance_pct", "n", "mean", "sd"], of_curves),
    ]
    paths = [folder / name for name in _TABLES]
    for path, table in zip(paths, tables, strict=True):
        table.write(path, decimal_comma=decimal_comma, overwrite=overwrite)
    return paths


def _lines(summed: Sequence[Summary]) -> list[str]:
    """Return the summary of one person as lines."""
    return [
        f"  {one.foot:<6} {one.measure:<28} {figure(one.means.mean, 4):>10}  "
        f"SD {figure(one.means.sd, 2):<9} n {one.means.n}"
        for one in summed
    ]
