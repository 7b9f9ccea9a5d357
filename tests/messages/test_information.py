"""What questions about information say that makes no answer possible."""

import numpy as np
from refusal import messages
from shell import run
from tests.information.touches import GOOD, ordered

import taxel
from taxel import Frames
from taxel.information import (
    LabelledTrial,
    answer,
    confusion_matrix,
    estimate,
    folds,
    nested_predictions,
    panzeri_treves,
    plug_in,
)

CALLS = {
    "classes": lambda _: estimate(["a", "a"], ["a", "b"]),
    "responses": lambda _: estimate(["a", "b"], ["a"]),
    "two kinds": lambda _: estimate(["a", "b"], [1, 2]),
    "confidence": lambda _: estimate(["a", "b"], ["a", "b"], confidence=1.0),
    "folds": lambda _: folds(["a", "b"] * 2, count=10),
    "one trial": lambda _: folds(["a", "a", "b"], count=2),
    "one group": lambda _: folds(["a", "a", "b", "b"], count=2, groups=["x", "y", "z", "z"]),
    "groups": lambda _: estimate(["a", "b"], ["a", "b"], groups=["x"]),
    "no number": lambda _: plug_in([[0, 0], [0, 0]]),
    "negative number": lambda _: plug_in([[1, -2], [0, 1]]),
    "half a number": lambda _: panzeri_treves([[0.5, 1]]),
    "names of a matrix": lambda _: confusion_matrix(["a", 1.5], ["a", "b"], ["b"]),
    "one class": lambda _: nested_predictions([np.eye(4)], [4], [0, 0, 0, 0], count=2),
    "features": lambda _: nested_predictions([np.eye(4)], [4, 4], [0, 1, 0, 1], count=2),
    "ridge": lambda _: nested_predictions([np.eye(4)], [4], [0, 1, 0, 1], count=2, ridges=[0.0]),
    "not symmetric": lambda _: nested_predictions([[[1.0, 2.0], [3.0, 1.0]]], [3], [0, 1], count=2),
    "arrays": lambda _: answer(
        [LabelledTrial(Frames(np.zeros((5, 1, n)), np.arange(5)), str(n), 0) for n in (2, 3)], window_ms=20
    ),
    "table": lambda folder: taxel.information.read_trials(written(folder / "trials.csv"), []),
}


def written(table):
    table.write_text("label,t_us\n")
    return table


def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot


TWO = "recording,t_us,label\ntouches.npz,100000,a\ntouches.npz,500000,b\n"
FOUR = "recording,t_us,label,stop_us\n" + "".join(
    f"touches.npz,{k}00000,{label},{k + 1}00000\n" for k, label in zip((1, 5, 9, 13), "abab", strict=True)
)
#: Tables of trials and options of the command, of which something is wrong.
ASKED = {
    "no times": ("recording,label\na,b\n", []),
    "times twice": ("recording,t_us,label,t_us\na,1,b,2\n", []),
    "no row": ("recording,t_us,label\n", []),
    "another recording": (GOOD.replace("touches.npz", "other.npz", 1), []),
    "other recordings": (GOOD.replace("touches.npz", "other.npz"), []),
    "no time": (GOOD.replace("100000,a", "noon,a"), []),
    "outside": (GOOD.replace("100000,a,200000", "99000000,a,99100000"), []),
    "ends before": (GOOD.replace("100000,a,200000", "100000,a,90000"), []),
    "one label": (GOOD.replace(",b,", ",a,"), []),
    "no group": (GOOD.replace("touches.npz,100000,a,200000,u", "touches.npz,100000,a,200000,"), []),
    "few trials": (FOUR, []),
    "a label of one group": (GOOD.replace(",b,", ",c,", 1), []),
    "no end": (TWO, []),
    "a long window": (TWO, ["--window-ms", "450"]),
    "too large a time": (GOOD.replace("100000,a,200000", "1e30,a,200000"), []),
    "within another": (GOOD.replace("100000,a,200000", "100000,a,500001"), []),
    "at one time": (GOOD + GOOD.splitlines()[1], []),
    "a quote": (GOOD.replace(",a,", ',"a,', 1), []),
    "a column without a name": (GOOD.replace("group\n", "group,\n").replace("u\n", "u,9\n"), []),
    "no table": ("\n\n", []),
    "periods": (GOOD, ["--periods", "fast"]),
    "a period": (GOOD, ["--periods", "0"]),
    "windows": (GOOD, ["--windows", "1000"]),
    "folds of the command": (GOOD, ["--folds", "1"]),
    "taxels": (GOOD, ["--taxels", "1.5"]),
    "a parameter": (GOOD, ["--set", "alpha=2"]),
}


def test_messages_of_the_command(tmp_path, snapshot):
    taxel.convert(ordered(24)[0], tmp_path / "touches.npz")
    usual = {"--draws": "1", "--shuffles": "1", "--taxels": "1", "--periods": "5"}
    said = {}
    for name, (table, arguments) in ASKED.items():
        (tmp_path / "labels.csv").write_text(table)
        quick = [word for option, value in usual.items() if option not in arguments for word in (option, value)]
        done = run("information", tmp_path / "touches.npz", "--labels", tmp_path / "labels.csv", *quick, *arguments)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), name
        said[name] = done.stderr.replace(str(tmp_path), "DIR").rstrip("\n")
    assert said == snapshot
