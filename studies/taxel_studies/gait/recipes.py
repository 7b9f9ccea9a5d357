"""The study's parameters as data: its own recipe, what may be chosen inside, Table 6.2 as printed, rules' encoders.

A point is a recipe for one neuron, in the notation of `taxel.detect.Recipe`: an encoder, and a learner's parameters
with the delay. Lambdas are those of 6.14 in its order (l1, l2, B, C, D).
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any

Point = dict[str, Any]


def izhikevich(*levels: float) -> dict[str, Any]:
    """Threshold and Izhikevich pair."""
    return {"name": "threshold_izhikevich", "levels": list(levels), "published": "6.5.1"}


def crossing(*levels: float, **options: Any) -> dict[str, Any]:
    """Plain crossings of levels."""
    return {"name": "level_crossing", "levels": list(levels), **options}


def changed(point: Point, **changes: Any) -> Point:
    """Return a point with another `encoder`, or other parameters of its learner; `bound` sets both bounds."""
    new = deepcopy(point)
    if "encoder" in changes:
        new["encoder"] = changes.pop("encoder")
    if "bound" in changes:
        changes["ub"] = changes.pop("bound")
        changes["lb"] = -changes["ub"]
    new["learner"].update(changes)
    return new


#: What the neurons of all recipes share.
_ALL: dict[str, Any] = {"theta_0": 0.3, "refractory": 3.0, "tolerance": 1e-4, "step_ms": 1.0}
#: What those of one source share: of many taxels, of a few force sensors, and of one channel.
_PLATE = _ALL | {
    "theta_plus": 0.2,
    "after_spike": "reset",
    "divide_b_by": "targets",
    "norm": "norm",
    "margin": 0.0,
}
_SENSORS = _ALL | {
    "tau": 30.0,
    "theta_plus": 3.0,
    "tau_rec": 100.0,
    "after_spike": "keep",
    "kappa": 2.0,
    "lb": -0.3,
    "ub": 0.3,
    "divide_b_by": "B_max",
    "norm": "norm",
    "margin": 0.05,
    "delay_ms": 8.0,
}
_CHANNEL = _ALL | {
    "theta_plus": 3.0,
    "tau_rec": 100.0,
    "after_spike": "keep",
    "lb": -5.0,
    "ub": 5.0,
    "divide_b_by": "targets",
    "norm": "square",
    "delay_ms": 9.0,
}


def _of_sensors(contact: dict[str, Any], foot_off: dict[str, Any]) -> dict[str, Point]:
    """Return the recipe of a few force sensors, with encoders of contact and foot-off."""
    lambdas = {"contact": [0.0, 1.2, 536.0, 100.0, 879.0], "foot_off": [0.0, 1.2, 1012.0, 100.0, 414.0]}
    return {
        event: {"encoder": encoder, "learner": _SENSORS | {"delta_t_ms": delta_t_ms, "lambdas": lambdas[event]}}
        for event, encoder, delta_t_ms in (("contact", contact, 8.0), ("foot_off", foot_off, 10.0))
    }


_ONE, _FOUR = izhikevich(100.0), izhikevich(1.0, 60.0, 200.0, 500.0)
_NEWTONS = crossing(5.0, 10.0, 20.0, 30.0, 40.0, 50.0, release_share=0.7)
_STRIKE = crossing(
    *(0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.11, 0.15, 0.2, 0.3, 0.45),
    release_share=0.7,
    running_range={"low": 10.0, "high": 95.0, "first_window": "itself"},
)
_LIFT = crossing(0.06, release_share=0.7, running_range={"low": 28, "high": 95, "first_window": "itself"})

#: The recipes of the trials, tuned on the shared people; some events with an encoder of their own.
RECIPE: dict[str, dict[str, Point]] = {
    "plate": {
        "contact": {
            "encoder": _ONE,
            "learner": _PLATE
            | {"tau": 40.0, "kappa": 1.2, "lambdas": [2.8, 1.2, 100.0, 100.0, 80.0]}
            | {"lb": -1.0, "ub": 1.0, "delay_ms": 12.0},
        },
        "heel_off": {
            "encoder": _FOUR,
            "learner": _PLATE
            | {"tau": 70.0, "kappa": 1.2, "lambdas": [0.0, 4.0, 100.0, 100.0, 80.0]}
            | {"lb": -0.3, "ub": 0.3, "delay_ms": 12.0},
        },
        "foot_off": {
            "encoder": _FOUR,
            "learner": _PLATE
            | {"tau": 190.0, "kappa": 1.3, "lambdas": [0.0, 4.0, 100.0, 100.0, 80.0]}
            | {"lb": -0.3, "ub": 0.3, "delay_ms": 8.0},
        },
    },
    "gaitpdb": _of_sensors(_NEWTONS, _NEWTONS),
    "gaitndd": {
        "contact": {
            "encoder": _STRIKE,
            "learner": _CHANNEL
            | {"tau": 6.0, "kappa": 2.0, "delta_t_ms": 8.0, "margin": 0.05}
            | {"lambdas": [0.0, 0.32, 63.0, 100.0, 160.0]},
        },
        "foot_off": {
            "encoder": _LIFT,
            "learner": _CHANNEL
            | {"tau": 40.0, "kappa": 1.3, "delta_t_ms": 5.0, "margin": 0.0}
            | {"lambdas": [0.0, 1.9, 384.0, 100.0, 2214.0]},
        },
    },
}


def _printed(encoder: dict[str, Any], event: str) -> Point:
    """Build Table 6.2 as printed: heel-off as foot-off (6.5.3), "keep" after a spike, B divided by B_max."""
    tau, kappa = (70.0, 1.2) if event == "contact" else (190.0, 1.25)
    lambdas = [2.8, 1.2, 100.0, 100.0, 80.0]
    about = {"bound": 0.3, "delay_ms": 8.0, "after_spike": "keep", "divide_b_by": "B_max"}
    return changed(RECIPE["plate"]["contact"], encoder=encoder, tau=tau, kappa=kappa, lambdas=lambdas, **about)


#: Table 6.2 as printed, each recording with the encoder of its recipe (the plate with one level, as 6.5.1 has it).
PRINTED: dict[str, dict[str, Point]] = {
    source: {event: _printed(_ONE if source == "plate" else point["encoder"], event) for event, point in points.items()}
    for source, points in RECIPE.items()
}

_CONTACT, _HEEL, _LIFTED = RECIPE["plate"].values()
_RESET = {"after_spike": "reset", "theta_plus": 0.2}


def _tried(point: Point, *changes: dict[str, Any]) -> list[Point]:
    """Return a point, and the same with each of the changes."""
    return [point, *(changed(point, **one) for one in changes)]


#: What may be chosen inside the training folds, 24 points an event at most.
SEARCH: dict[str, dict[str, list[Point]]] = {
    "plate": {
        "contact": _tried(
            _CONTACT,
            {"tau": 20.0},
            {"tau": 20.0, "kappa": 1.3},
            {"kappa": 1.3},
            {"tau": 10.0, "delay_ms": 8.0},
            {"encoder": izhikevich(1), "tau": 10.0, "bound": 0.3, "delay_ms": 4.0},
        ),
        "heel_off": _tried(
            _HEEL,
            *({"tau": 50.0}, {"tau": 100.0}, {"kappa": 1.3}, {"tau": 50.0, "kappa": 1.3}),
            {"lambdas": [0.0, 4.0, 300.0, 100.0, 80.0]},
        ),
        "foot_off": _tried(
            _LIFTED,
            *({"tau": 160.0}, {"kappa": 1.2}, {"kappa": 1.4}, {"tau": 160.0, "kappa": 1.4}, {"delay_ms": 12.0}),
        ),
    },
    "gaitpdb": {
        event: _tried(
            point,
            *({"theta_plus": 1.0}, {"kappa": 1.5}, {"tau": 20.0}, {"tau": 45.0 if event == "contact" else 25.0}),
            _RESET | {"refractory": 250.0 if event == "contact" else 120.0},
        )
        for event, point in RECIPE["gaitpdb"].items()
    },
    "gaitndd": {
        event: _tried(
            point,
            *({"theta_plus": 1.0}, {"kappa": 1.5}, {"delay_ms": 12.0}, {"delay_ms": 6.0}),
            _RESET | {"refractory": 250.0},
        )
        for event, point in RECIPE["gaitndd"].items()
    },
}

_RANGE = {"low": 28, "high": 95, "first_window": "itself"}

#: The encoders that give the plain rules their input.
RULE_ENCODERS: dict[str, dict[str, dict[str, Any]]] = {
    "plate": dict.fromkeys(("contact", "heel_off", "foot_off"), crossing(1, 100)),
    "gaitpdb": dict.fromkeys(("contact", "foot_off"), _NEWTONS),
    "gaitndd": {
        "contact": _STRIKE,
        "foot_off": crossing(0.03, 0.045, 0.06, 0.08, 0.11, 0.15, release_share=0.7, running_range=_RANGE),
    },
}
