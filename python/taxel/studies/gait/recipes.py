"""The study's parameters as data: the notes' recipe, what may be chosen inside, Table 6.2 as printed, the encoders.

A point is everything that a readout has but its weights: encoder, neuron, learner, delay. Lambdas are those of 6.14 in
its order (l1, l2, B, C, D).
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

__all__ = ["ENCODERS", "FULL", "NOTES", "PRINTED", "RULE_ENCODERS", "SEARCH", "SETTINGS", "TONIC", "Point", "changed"]

Point = dict[str, Any]

#: The relative gap at which a fit counts as solved: far below what moves a spike by a grid step.
TOLERANCE = 1e-4


def izhikevich(*levels: float, published: str = "6.5.1") -> dict[str, Any]:
    """Threshold and Izhikevich pair."""
    return {"class": "ThresholdIzhikevich", "levels": list(levels), "published": published}


def crossing(*levels: float, **options: Any) -> dict[str, Any]:
    """Plain crossings of levels."""
    return {"class": "LevelCrossing", "levels": list(levels), **options}


def changed(point: Point, **changes: Any) -> Point:
    """Return a point with some parameters changed, whichever part of it they belong to.

    `bound` sets both bounds; what is None follows `tau` (Table 6.2: `tau_rec` is 2 tau, `delta_t_ms` 0.1 tau).
    """
    new = deepcopy(point)
    if "bound" in changes:
        changes["ub"] = changes.pop("bound")
        changes["lb"] = -changes["ub"]
    for name, value in changes.items():
        place = next(part for part in (new, new["neuron"], new["learn"]) if name in part)
        place[name] = value
    return new


def _plate(
    encoder: dict[str, Any], tau: float, kappa: float, l1: float, l2: float, bound: float, delay: float
) -> Point:
    """Build a point of the notes' recipe for the plate: B divided by the number of targets, "reset" after a spike."""
    return {
        "encoder": encoder,
        "neuron": {
            "tau": tau,
            "theta_0": 0.3,
            "theta_plus": 0.2,
            "tau_rec": None,
            "refractory": 3.0,
            "after_spike": "reset",
        },
        "learn": {
            "kappa": kappa,
            "delta_t_ms": None,
            "lambdas": [l1, l2, 100.0, 100.0, 80.0],
            "lb": -bound,
            "ub": bound,
            "divide_b_by": "targets",
            "norm": "norm",
            "margin": 0.0,
            "tolerance": TOLERANCE,
        },
        "delay_ms": delay,
    }


def _walk(encoder: dict[str, Any], kappa: float, delta_t: float, lambdas: list[float]) -> Point:
    """Build a point of the notes' recipe for walking: a threshold that rises tenfold and recovers in 100 ms."""
    return {
        "encoder": encoder,
        "neuron": {
            "tau": 30.0,
            "theta_0": 0.3,
            "theta_plus": 3.0,
            "tau_rec": 100.0,
            "refractory": 3.0,
            "after_spike": "keep",
        },
        "learn": {
            "kappa": kappa,
            "delta_t_ms": delta_t,
            "lambdas": lambdas,
            "lb": -0.3,
            "ub": 0.3,
            "divide_b_by": "B_max",
            "norm": "norm",
            "margin": 0.05,
            "tolerance": TOLERANCE,
        },
        "delay_ms": 8.0,
    }


_ONE, _FOUR = izhikevich(100), izhikevich(1, 60, 200, 500)
_NEWTONS = crossing(5, 10, 20, 30, 40, 50, release_share=0.7)
_STRIKE = crossing(
    *(0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.11, 0.15, 0.2, 0.3, 0.45),
    release_share=0.7,
    running_range={"low": 10, "high": 95, "first_window": "itself"},
)
_LIFT = crossing(0.06, release_share=0.7, running_range={"low": 28, "high": 95, "first_window": "itself"})

#: gaitndd's recipe in the trials' own form: B by target, the l2 term squared; `tau_rec` and `delta_t_ms` do not grow
#: with `tau`. Its lambdas are the trials' weights (B 5, silence 0.02 and 0.1, l2 0.001 a target) times 100 K / C_max.
_PER_TARGET: dict[str, Any] = {"divide_b_by": "targets", "norm": "square"}

#: The recipes of the trials, tuned on the shared people.
NOTES: dict[str, dict[str, Point]] = {
    "plate": {
        "contact": _plate(_ONE, 40.0, 1.2, 2.8, 1.2, 1.0, 12.0),
        "heel_off": _plate(_FOUR, 70.0, 1.2, 0.0, 4.0, 0.3, 12.0),
        "foot_off": _plate(_FOUR, 190.0, 1.3, 0.0, 4.0, 0.3, 8.0),
    },
    "gaitpdb": {
        "contact": _walk(_NEWTONS, 2.0, 8.0, [0.0, 1.2, 536.0, 100.0, 879.0]),
        "foot_off": _walk(_NEWTONS, 2.0, 10.0, [0.0, 1.2, 1012.0, 100.0, 414.0]),
    },
    "gaitndd": {
        "contact": changed(
            _walk(_STRIKE, 2.0, 8.0, [0.0, 0.32, 63.0, 100.0, 160.0]), **_PER_TARGET, tau=6.0, bound=5.0, delay_ms=9.0
        ),
        "foot_off": changed(
            _walk(_LIFT, 1.3, 5.0, [0.0, 1.9, 384.0, 100.0, 2214.0]),
            **_PER_TARGET,
            tau=40.0,
            bound=5.0,
            margin=0.0,
            delay_ms=9.0,
        ),
    },
    "moticon": {
        "contact": _walk(crossing(1, release_share=0.7), 2.0, 8.0, [0.0, 1.2, 536.0, 100.0, 879.0]),
        "foot_off": _walk(crossing(1, release_share=0.7), 2.0, 10.0, [0.0, 1.2, 1012.0, 100.0, 414.0]),
    },
    "pedar": {
        "contact": _walk(crossing(20), 2.0, 8.0, [0.0, 1.2, 536.0, 100.0, 879.0]),
        "foot_off": _walk(crossing(20), 2.0, 10.0, [0.0, 1.2, 1012.0, 100.0, 414.0]),
    },
}

#: One more input a sensor: a spike each 20 ms while above 20 N, a memory that the crossings lack.
TONIC: dict[str, dict[str, Point]] = {
    "gaitpdb": {
        event: changed(point, encoder=_NEWTONS | {"tonic_ms": 20.0, "tonic_level": 20})
        for event, point in NOTES["gaitpdb"].items()
    }
}


def _printed(encoder: dict[str, Any], event: str) -> Point:
    """Build Table 6.2 as printed: heel-off as foot-off (6.5.3), "keep" after a spike, B divided by B_max."""
    tau, kappa = (70.0, 1.2) if event == "contact" else (190.0, 1.25)
    point = _plate(encoder, tau, kappa, 2.8, 1.2, 0.3, 8.0)
    return changed(point, after_spike="keep", divide_b_by="B_max")


#: Table 6.2 as printed, each recording with the encoder of its recipe (the plate with one level, as 6.5.1 has it).
PRINTED: dict[str, dict[str, Point]] = {
    source: {event: _printed(_ONE if source == "plate" else point["encoder"], event) for event, point in points.items()}
    for source, points in NOTES.items()
    if source in {"plate", "gaitpdb", "gaitndd"}
}

_CONTACT, _HEEL, _LIFTED = NOTES["plate"].values()
_RESET = {"after_spike": "reset", "theta_plus": 0.2}

#: What may be chosen inside the training folds, 24 points an event at most.
SEARCH: dict[str, dict[str, list[Point]]] = {
    "plate": {
        "contact": [
            _CONTACT,
            changed(_CONTACT, tau=20.0),
            changed(_CONTACT, tau=20.0, kappa=1.3),
            changed(_CONTACT, kappa=1.3),
            changed(_CONTACT, tau=10.0, delay_ms=8.0),
            changed(_CONTACT, encoder=izhikevich(1), tau=10.0, bound=0.3, delay_ms=4.0),
        ],
        "heel_off": [
            _HEEL,
            changed(_HEEL, tau=50.0),
            changed(_HEEL, tau=100.0),
            changed(_HEEL, kappa=1.3),
            changed(_HEEL, tau=50.0, kappa=1.3),
            changed(_HEEL, lambdas=[0.0, 4.0, 300.0, 100.0, 80.0]),
        ],
        "foot_off": [
            _LIFTED,
            changed(_LIFTED, tau=160.0),
            changed(_LIFTED, kappa=1.2),
            changed(_LIFTED, kappa=1.4),
            changed(_LIFTED, tau=160.0, kappa=1.4),
            changed(_LIFTED, delay_ms=12.0),
        ],
    },
    "gaitpdb": {
        event: [
            point,
            changed(point, theta_plus=1.0),
            changed(point, kappa=1.5),
            changed(point, tau=20.0),
            changed(point, tau=45.0 if event == "contact" else 25.0),
            changed(point, **_RESET, refractory=250.0 if event == "contact" else 120.0),
        ]
        for event, point in NOTES["gaitpdb"].items()
    },
    "gaitndd": {
        event: [
            point,
            changed(point, theta_plus=1.0),
            changed(point, kappa=1.5),
            changed(point, delay_ms=12.0),
            changed(point, delay_ms=6.0),
            changed(point, **_RESET, refractory=250.0),
        ]
        for event, point in NOTES["gaitndd"].items()
    },
}

#: The 528 settings of 6.5.2: tau (ms), kappa, lambda_1; lambda_2 is what that leaves of 4.
SETTINGS: dict[str, tuple[float, ...]] = {
    "tau": tuple(float(tau) for tau in range(10, 221, 30)),
    "kappa": (1.05, 1.1, 1.15, 1.2, 1.25, 1.3),
    "lambda_1": tuple(round(4 - 0.4 * k, 1) for k in range(11)),
}

#: All else, where those settings are searched: as printed, and as in the notes' recipe. 6.5.2 has these two events.
FULL: dict[str, dict[str, Point]] = {
    name: {event: points[event] for event in ("contact", "foot_off")}
    for name, points in {"528: as printed": PRINTED["plate"], "528: recipe": NOTES["plate"]}.items()
}

_HELD = crossing(1, 60, 200, 500, hold_ms=10.0)
_TAUS = {"contact": (10.0, 20.0, 40.0), "heel_off": (50.0, 70.0, 100.0), "foot_off": (130.0, 160.0, 190.0)}

#: Encoders compared on the plate, each with the same number of points on the same folds.
ENCODERS: dict[str, dict[str, list[Point]]] = {
    name: {
        event: [changed(NOTES["plate"][event], encoder=encoder, tau=tau) for tau in taus]
        for event, taus in _TAUS.items()
    }
    for name, encoder in {
        "Izhikevich 6.5.1, 1 level": _ONE,
        "Izhikevich 6.5.1, 4 levels": _FOUR,
        "Izhikevich 3.4.3, 1 level": izhikevich(100, published="3.4.3"),
        "Izhikevich 3.4.3, 4 levels": izhikevich(1, 60, 200, 500, published="3.4.3"),
        "crossings that hold 10 ms, 4 levels": _HELD,
        "FA-1": {"class": "FA1", "theta_0": 0.163, "period_ms": 2.0},
        "change events of 100 counts": {"class": "ChangeEvents", "noise_floor": 100.0, "bits": 1},
    }.items()
}

_RANGE = {"low": 28, "high": 95, "first_window": "itself"}

#: What the plain rules hear.
RULE_ENCODERS: dict[str, dict[str, dict[str, Any]]] = {
    "plate": dict.fromkeys(("contact", "heel_off", "foot_off"), crossing(1, 100)),
    "gaitpdb": dict.fromkeys(("contact", "foot_off"), _NEWTONS),
    "gaitndd": {
        "contact": _STRIKE,
        "foot_off": crossing(0.03, 0.045, 0.06, 0.08, 0.11, 0.15, release_share=0.7, running_range=_RANGE),
    },
    "moticon": dict.fromkeys(("contact", "foot_off"), crossing(1, 2, 5, release_share=0.7)),
    "pedar": dict.fromkeys(("contact", "foot_off"), crossing(20, 40, 80)),
}
