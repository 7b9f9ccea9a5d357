//! The neuron of the rules that learn by epochs: a leaky membrane on a fine grid, with the resets that their papers have.

use serde::{Deserialize, Serialize};

use taxel_core::neuron::{Grid, MOST_LAID_OUT, check_points, points_between};
use taxel_core::{Result, SpikeTrains, Stop, problem};

/// The effect of an output spike on the potential.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AfterSpike {
    /// It falls by `theta_0`, a fall that decays with `tau` (the SRM0 of Florian, and of Gardner and Grüning).
    Subtract,
    /// The potential is reset to 0; synaptic currents continue (leaky integrate-and-fire).
    Membrane,
    /// All inputs up to the spike are lost, as `after_spike` "reset" of the other learners has it.
    Reset,
}

/// A leaky membrane, compared with its threshold every `step_ms`; inputs keep their true times.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SteppedNeuron {
    /// The membrane, and the current that drives it.
    pub kernels: Kernels,
    /// Threshold, mV.
    pub theta_0: f64,
    /// The effect of an output spike.
    pub after_spike: AfterSpike,
    /// How long the membrane stays at 0 after a spike, ms; for [`AfterSpike::Membrane`] alone.
    pub refractory: f64,
    /// Step of the grid, from the pattern's start on, ms.
    pub step_ms: f64,
}

/// The effect of some time on currents and potential: their decays, and what each current adds to the potential.
#[derive(Debug, Clone, Copy)]
struct Pass {
    a: f64,
    b: f64,
    v: f64,
    a_to_v: f64,
    b_to_v: f64,
}

/// One input, propagated to the first grid point at or after it.
#[derive(Debug, Clone, Copy)]
struct Input {
    step: usize,
    train: usize,
    t: f64,
    a: f64,
    b: f64,
    v: f64,
}

/// A pattern laid out for one neuron.
#[derive(Debug)]
pub(super) struct Laid {
    inputs: Vec<Input>,
    grid: Grid,
    steps: usize,
}

/// `V0` of a difference of exponentials: the factor that makes its peak 1.
fn peak_factor(slow: f64, fast: f64) -> f64 {
    let at = slow * fast / (slow - fast) * (slow / fast).ln();
    1.0 / ((-at / slow).exp() - (-at / fast).exp())
}

/// A neuron's kernels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kernels {
    /// Membrane time constant, ms.
    pub tau: f64,
    /// The difference of exponentials: its time constants, ms, and its factor.
    pub slow: f64,
    pub fast: f64,
    pub peak: f64,
    /// Whether that difference is the current, which the membrane filters once more.
    twice: bool,
}

impl Kernels {
    /// Those of a current `e^{-s/tau_s}`, scaled so that the potential of one input of weight 1 peaks at 1 mV: it is the
    /// double exponential `V0 (e^{-s/tau} - e^{-s/tau_s})` of Tempotron, Chronotron, INST and FILT.
    pub(super) fn of_exponential(tau: f64, tau_s: f64) -> Self {
        Self { tau, slow: tau, fast: tau_s, peak: peak_factor(tau, tau_s), twice: false }
    }

    /// Those of a current `V0 (e^{-s/tau_1} - e^{-s/tau_2})` that peaks at 1, over 1 MOhm: the membrane filters it once
    /// more (PSD).
    pub(super) fn of_double_exponential(tau: f64, tau_1: f64, tau_2: f64) -> Self {
        Self { tau, slow: tau_1, fast: tau_2, peak: peak_factor(tau_1, tau_2), twice: true }
    }

    /// Checks what its time constants are to each other.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub(super) fn check(&self) -> Result<()> {
        let (slow, fast) = if self.twice { ("tau_1", "tau_2") } else { ("tau", "tau_s") };
        if self.fast >= self.slow {
            return Err(problem!(fast; " is {} ms: must be below {slow}, {} ms", self.fast, self.slow));
        }
        Ok(())
    }

    /// The potential `since` ms after an input of weight 1, mV.
    pub(super) fn value(&self, since: f64) -> f64 {
        if since <= 0.0 {
            return 0.0;
        }
        if !self.twice {
            return self.peak * ((-since / self.slow).exp() - (-since / self.fast).exp());
        }
        let pass = self.pass(since);
        pass.a_to_v + pass.b_to_v
    }

    /// The current `since` ms after an input of weight 1.
    pub(super) fn current(&self, since: f64) -> f64 {
        if since < 0.0 {
            0.0
        } else if self.twice {
            self.peak * ((-since / self.slow).exp() - (-since / self.fast).exp())
        } else {
            (-since / self.fast).exp()
        }
    }

    /// The effect of `dt` ms.
    fn pass(&self, dt: f64) -> Pass {
        let v = (-dt / self.tau).exp();
        if !self.twice {
            let a = (-dt / self.fast).exp();
            return Pass { a, b: 0.0, v, a_to_v: self.peak * (v - a), b_to_v: 0.0 };
        }
        let (a, b) = ((-dt / self.slow).exp(), (-dt / self.fast).exp());
        // e^{-t/tau_c} filtered by the membrane; where both time constants are one, its limit.
        let filtered = |tau_c: f64, decay: f64| {
            let apart = 1.0 / self.tau - 1.0 / tau_c;
            if (apart * dt).abs() < 1e-9 { dt * v } else { (decay - v) / apart }
        };
        let scale = self.peak / self.tau;
        Pass { a, b, v, a_to_v: scale * filtered(self.slow, a), b_to_v: -scale * filtered(self.fast, b) }
    }
}

impl SteppedNeuron {
    /// Checks what its parameters, each in its range, are to each other.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub(super) fn check(&self) -> Result<()> {
        self.kernels.check()?;
        if self.refractory > 0.0 && self.after_spike != AfterSpike::Membrane {
            return Err(
                problem!("refractory"; " is {} ms: must be 0 unless after_spike is \"membrane\"", self.refractory),
            );
        }
        Ok(())
    }

    /// Refuses a potential that is not linear in the weights once the spikes are known: FP and HTP need one.
    pub(super) fn check_linear(&self, rule: &str) -> Result<()> {
        if self.after_spike == AfterSpike::Membrane {
            return Err(problem!(
                "after_spike"; " is \"membrane\": {rule} needs a potential linear in the weights, \"reset\" or \"subtract\""
            ));
        }
        Ok(())
    }

    /// Sorts the inputs of a pattern by time, each with its contribution at its first grid point.
    ///
    /// # Errors
    ///
    /// `Problem` where its grid has too many points; `Interrupted` where the caller stops it.
    pub(super) fn lay_out(&self, trains: &SpikeTrains, stop: Stop<'_>) -> Result<Laid> {
        let grid = Grid::new(trains.start, self.step_ms);
        let points = grid.points_until(trains.stop);
        check_points(points, MOST_LAID_OUT, self.step_ms)?;
        let steps = points as usize - 1;
        let inputs = trains
            .by_time(stop)?
            .into_iter()
            .map(|spike| {
                let point = grid.first_from(spike.t);
                let pass = self.kernels.pass((grid.time(point) - spike.t).max(0.0));
                Input {
                    step: point as usize,
                    train: spike.train as usize,
                    t: spike.t,
                    a: pass.a,
                    b: pass.b,
                    v: pass.a_to_v + pass.b_to_v,
                }
            })
            .collect();
        Ok(Laid { inputs, grid, steps })
    }

    /// The output spikes (ms, on the grid) that these weights make.
    pub(super) fn fire(&self, weights: &[f64], laid: &Laid, spikes: &mut Vec<f64>) {
        spikes.clear();
        let held_steps = points_between(0.0, self.refractory, self.step_ms) as usize - 1;
        let mut walk = Walk::new(self, weights, laid);
        let mut held_until = 0;
        for step in 0..=laid.steps {
            walk.to(step);
            walk.add_inputs(step, f64::NEG_INFINITY);
            if step < held_until {
                walk.v = 0.0;
            } else if walk.v >= self.theta_0 {
                spikes.push(laid.grid.time(step as f64));
                match self.after_spike {
                    AfterSpike::Subtract => walk.v -= self.theta_0,
                    AfterSpike::Membrane => {
                        walk.v = 0.0;
                        held_until = step + 1 + held_steps;
                    }
                    AfterSpike::Reset => walk.clear(),
                }
            }
        }
    }

    /// Calls `each` with time and potential of every grid point, the neuron firing at `forced` (ms, ascending) and nowhere
    /// else; for resets that leave the potential linear in the weights, [`AfterSpike::Subtract`] and [`AfterSpike::Reset`].
    pub(super) fn run_forced(&self, weights: &[f64], laid: &Laid, forced: &[f64], mut each: impl FnMut(f64, f64)) {
        let mut walk = Walk::new(self, weights, laid);
        let mut forced = forced.iter().copied().peekable();
        for step in 0..=laid.steps {
            let t = laid.grid.time(step as f64);
            walk.to(step);
            let mut lost_up_to = f64::NEG_INFINITY;
            while let Some(at) = forced.next_if(|&at| at < t) {
                match self.after_spike {
                    AfterSpike::Reset => {
                        walk.clear();
                        lost_up_to = at;
                    }
                    _ => walk.v -= self.theta_0 * (-(t - at) / self.kernels.tau).exp(),
                }
            }
            walk.add_inputs(step, lost_up_to);
            each(t, walk.v);
        }
    }
}

/// Currents and potential at a point of the grid.
struct Walk<'a> {
    weights: &'a [f64],
    inputs: std::iter::Peekable<std::iter::Copied<std::slice::Iter<'a, Input>>>,
    pass: Pass,
    a: f64,
    b: f64,
    v: f64,
}

impl<'a> Walk<'a> {
    fn new(neuron: &SteppedNeuron, weights: &'a [f64], laid: &'a Laid) -> Self {
        let inputs = laid.inputs.iter().copied().peekable();
        Self { weights, inputs, pass: neuron.kernels.pass(neuron.step_ms), a: 0.0, b: 0.0, v: 0.0 }
    }

    /// Moves currents and potential one step on, except at the first.
    #[inline]
    fn to(&mut self, step: usize) {
        if step > 0 {
            self.v = self.v * self.pass.v + (self.a * self.pass.a_to_v + self.b * self.pass.b_to_v);
            self.a *= self.pass.a;
            self.b *= self.pass.b;
        }
    }

    /// Adds the inputs of this step that come after `lost_up_to`.
    #[inline]
    fn add_inputs(&mut self, step: usize, lost_up_to: f64) {
        while let Some(input) = self.inputs.next_if(|input| input.step == step) {
            if input.t > lost_up_to {
                let w = self.weights[input.train];
                self.a += w * input.a;
                self.b += w * input.b;
                self.v += w * input.v;
            }
        }
    }

    fn clear(&mut self) {
        (self.a, self.b, self.v) = (0.0, 0.0, 0.0);
    }
}
