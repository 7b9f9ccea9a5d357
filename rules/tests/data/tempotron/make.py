"""Make spikingjelly_2.0.0.json: what SpikingJelly 2.0.0 says of drawn patterns."""

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from spikingjelly.timing_based.neuron import Tempotron

assert version("spikingjelly") == "2.0.0"
cases = []
for seed in range(8):
    random = np.random.default_rng(seed)
    tau, tau_s, duration = [(15.0, 3.75, 120.0), (10.0, 2.5, 80.0)][seed % 2]
    lists = [np.sort(random.uniform(0, duration, random.integers(1, 4))).round(3) for _ in range(10)]
    weights = random.normal(0.05, 0.1 if seed < 4 else 0.5, 10).round(6)
    theirs = Tempotron(10, 1, duration=duration, tau=tau, tau_s=tau_s).double()
    with torch.no_grad():
        theirs.weight[:] = torch.tensor(weights)
    times, trains = np.concatenate(lists), np.repeat(np.arange(10), [len(t) for t in lists])
    v_max, t_peak, t_spike = theirs(torch.tensor(times), torch.tensor(trains), torch.tensor([0, len(times)]))
    v_max.sum().backward()
    v_max, t_peak, t_spike = (x.detach() for x in (v_max, t_peak, t_spike))
    case = {"tau": tau, "tau_s": tau_s, "duration_ms": duration, "times_ms": [t.tolist() for t in lists]}
    case |= {"weights": weights.tolist(), "v_max": float(v_max), "t_peak": float(t_peak)}
    case |= {"t_spike": float(t_spike) if torch.isfinite(t_spike) else None}
    cases.append(case | {"gradient": theirs.weight.grad[0].tolist()})
text = json.dumps({"made_by": "SpikingJelly 2.0.0, make.py", "cases": cases}, indent=1)
(Path(__file__).parent / "spikingjelly_2.0.0.json").write_text(text + "\n")
