"""The study as the runner, the page and the command line take it."""

from __future__ import annotations

from taxel_studies.gait import plans, sources
from taxel_studies.gait.outcomes import summarise
from taxel_studies.gait.pictures import draw
from taxel_studies.gait.realise import realise
from taxel_studies.gait.statements import statements, tables
from taxel_studies.study import Study

__all__ = ["STUDY"]

STUDY = Study(
    name="gait",
    title="gait events by one neuron an event, on published walking recordings (6.12 to 6.14)",
    where="thesis 6.5, figures 6.12 to 6.14, Table 6.2",
    protocol=(
        "The protocols of 6.5.2 and 6.5.3 on recordings of other people, as far as each recording's truth allows. "
        "Errors are neuron minus reference (negative: early), window ±50 ms, one to one; every further spike counts as "
        "false, inside the window too. Where parameters are chosen, they are chosen inside each training fold "
        "(taxel.detect.choose)."
    ),
    parameters=plans.PARAMETERS,
    sizes={"toy": plans.TOY},
    tasks=plans.tasks,
    realise=realise,
    summarise=summarise,
    statements=statements,
    tables=tables,
    draw=draw,
    data=tuple(source.folder for source in sources.SOURCES.values()),
    unread=plans.unread,
)
