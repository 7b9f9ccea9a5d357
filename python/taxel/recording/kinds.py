"""The kinds of recordings: their endings and their names."""

from __future__ import annotations

from taxel.recording.contents import RecordedSource
from taxel.recording.verdict import Verdict

#: taxel's own kinds of files by their endings.
ENDINGS = {".mcap": "mcap", ".lsa": "lsa", ".npz": "npz", ".csv": "csv", ".h5": "h5"}

#: The table of labels of a folder.
LABELS = "labels.csv"
#: What follows the name of a recording in the names of its tables of labels that other programs write.
TABLES = ("_labels.csv", "_events.csv", "_events.tsv", ".txt")


def kind_of_file(kind: str) -> str:
    """Return the name of a kind of recording: its ending if it is taxel's own, else its format.

    Examples
    --------
    >>> kind_of_file("npz"), kind_of_file("pedar"), kind_of_file("arrays")
    ('.npz', 'pedar recording', 'file of arrays')
    """
    return f".{kind}" if kind in ENDINGS.values() else _OTHERS.get(kind, f"{kind} recording")


#: Kinds of files that are no recordings of one format.
_OTHERS = {"arrays": "file of arrays", "records": "file of events", "table": "table", "ros": "ROS bag"}


def verdict_of(source: RecordedSource) -> Verdict:
    """Return what was lost of a recording, or that its file does not say it."""
    verdict = source.losses.verdict()
    return Verdict._of({"silent": kind_of_file(source.origin.kind)}) if verdict is None else verdict
