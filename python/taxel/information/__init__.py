"""How many bits touches hold: estimators, classifiers, and the question of chapter 5 asked of one's own sensor."""

from taxel.information.analysis import answer
from taxel.information.answers import Answer, Control, Point
from taxel.information.bits import (
    confusion_matrix,
    label_entropy,
    local_information,
    panzeri_treves,
    plug_in,
    relevant_responses,
)
from taxel.information.estimate import Estimate, ZeroTest, estimate, zero_test
from taxel.information.folds import folds
from taxel.information.keeping import Keeping, keeps
from taxel.information.nested import Nested, nested_predictions
from taxel.information.trials import LabelledTrial, notes_as_trials, read_trials, recordings_as_trials

__all__ = [
    "Answer",
    "Control",
    "Estimate",
    "Keeping",
    "LabelledTrial",
    "Nested",
    "Point",
    "ZeroTest",
    "answer",
    "confusion_matrix",
    "estimate",
    "folds",
    "keeps",
    "label_entropy",
    "local_information",
    "nested_predictions",
    "notes_as_trials",
    "panzeri_treves",
    "plug_in",
    "read_trials",
    "recordings_as_trials",
    "relevant_responses",
    "zero_test",
]
