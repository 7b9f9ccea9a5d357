"""Detections against touches, by class."""

import numpy as np
import pytest

from taxel import Detections
from taxel.detect import score
from taxel.simulate import Contact
from taxel_benchmarks.demo import CLASSES, by_class


def test_each_touch_belongs_to_one_class_and_each_error_to_its_touch() -> None:
    contacts = [
        Contact(kind, 1e6 * n, 1e6 * n + 15_000, speed, peak)
        for n, (kind, speed, peak) in enumerate(
            [(k, s, p) for k in ("first", "bounce", "hand") for s in (0.05, 0.2, 0.9) for p in (0.1, 0.7, 4.0)], 1
        )
    ]
    for contact in contacts:
        assert sum(belongs(contact) for _, belongs in CLASSES) == 1, contact
    truth = {"contact": [int(c.start_us) for c in contacts], "lift": [int(c.stop_us) for c in contacts]}
    late = np.arange(1, len(contacts))  # us; the last touch is missed
    t = np.r_[np.array(truth["contact"][:-1]) + late, truth["lift"][:-1] - late]
    labels = ["contact"] * len(late) + ["lift"] * len(late)
    classes = by_class(score(Detections(labels, t, t + 200), truth), contacts)["classes"]
    for name, belongs in CLASSES:
        of_class = [n for n, contact in enumerate(contacts) if belongs(contact)]
        found = [n for n in of_class if n < len(late)]
        for label, sign in (("contact", 1), ("lift", -1)):
            row = classes[name][label]
            assert (row["touches"], row["found"]) == (len(of_class), len(found))
            assert row["error_ms"]["mean"] == pytest.approx(sign * np.mean(late[found]) / 1e3)
