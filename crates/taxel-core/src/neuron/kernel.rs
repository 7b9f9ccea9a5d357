//! The kernels, and the two-number state from which a weighted sum of kernels follows at any later time.

use serde::{Deserialize, Serialize};

/// The effect of an input spike on the potential.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// `t/tau e^{-t/tau}` (6.5); its largest value is `1/e`, at `tau`.
    #[default]
    Alpha,
    /// `V0 (e^{-t/tau} - e^{-t/tau_s})`, the Tempotron's; `V0` makes its largest value 1.
    DoubleExponential,
    /// `e^{-t/tau}`: the potential jumps, just after the input.
    Exponential,
}

/// A kernel with its constants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    pub(crate) kernel: Kernel,
    /// Its time constant, ms.
    pub tau: f64,
    /// Its second one, ms.
    pub tau_s: f64,
    /// `V0`.
    pub scale: f64,
    /// `1/tau_s - 1/tau`.
    pub rate: f64,
}

/// The state of a weighted sum of kernels without further input.
///
/// Advancing this state neither overflows nor loses digits after a long time, unlike the closed form
/// `e^{-t/tau} (A t/tau - B)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KernelSum {
    /// The decayed sum of the weights, which drives the potential, mV; unused if an input makes the potential itself
    /// jump.
    pub a: f64,
    /// The potential, mV.
    pub b: f64,
}

/// How a [`KernelSum`] decays over a time without input: `a' = aa a`, `b' = ba a + bb b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// From `a` to `a`.
    pub aa: f64,
    /// From `a` to `b`.
    pub ba: f64,
    /// From `b` to `b`.
    pub bb: f64,
}

impl Step {
    /// The state at the end of the step.
    #[must_use]
    #[inline]
    pub fn apply(&self, state: KernelSum) -> KernelSum {
        KernelSum { a: state.a * self.aa, b: state.b * self.bb + state.a * self.ba }
    }
}

impl Shape {
    /// A kernel with its time constants, ms; only [`Kernel::DoubleExponential`] uses `tau_s`.
    #[must_use]
    pub fn new(kernel: Kernel, tau: f64, tau_s: f64) -> Self {
        let rate = 1.0 / tau_s - 1.0 / tau;
        let peak = (tau / tau_s).ln() / rate;
        let scale = 1.0 / ((-peak / tau).exp() - (-peak / tau_s).exp());
        Self { kernel, tau, tau_s, scale, rate }
    }

    /// The state just after one input of weight 1, from a state of 0.
    #[must_use]
    #[inline]
    pub fn input(&self) -> KernelSum {
        match self.kernel {
            Kernel::Alpha | Kernel::DoubleExponential => KernelSum { a: 1.0, b: 0.0 },
            Kernel::Exponential => KernelSum { a: 0.0, b: 1.0 },
        }
    }

    /// The decay over `dt` ms without input.
    #[must_use]
    #[inline]
    pub fn step(&self, dt: f64) -> Step {
        let x = dt / self.tau;
        let decay = (-x).exp();
        match self.kernel {
            Kernel::Alpha => Step { aa: decay, ba: x * decay, bb: decay },
            Kernel::DoubleExponential => {
                Step { aa: decay, ba: -self.scale * decay * (-dt * self.rate).exp_m1(), bb: (-dt / self.tau_s).exp() }
            }
            Kernel::Exponential => Step { aa: decay, ba: 0.0, bb: decay },
        }
    }

    /// The state `dt` ms later.
    #[must_use]
    #[inline]
    pub fn after(&self, state: KernelSum, dt: f64) -> KernelSum {
        self.step(dt).apply(state)
    }

    /// Adds an input of weight `weight` and of this value (1 of an unsigned spike) that arrived `age` ms ago, 0 or more.
    #[inline]
    pub fn add(&self, state: &mut KernelSum, weight: f64, value: f64, age: f64) {
        let unit = self.after(self.input(), age);
        state.a += weight * (value * unit.a);
        state.b += weight * (value * unit.b);
    }

    /// The kernel `age` ms after the input; 0 up to and including the input's own time.
    #[must_use]
    #[inline]
    pub fn value(&self, age: f64) -> f64 {
        if age <= 0.0 { 0.0 } else { self.after(self.input(), age).b }
    }

    /// The time at which the kernel is largest, ms after the input.
    #[must_use]
    pub fn peak(&self) -> f64 {
        match self.kernel {
            Kernel::Alpha => self.tau,
            Kernel::DoubleExponential => (self.tau / self.tau_s).ln() / self.rate,
            Kernel::Exponential => 0.0,
        }
    }

    /// The slope of the potential now, mV/ms.
    #[must_use]
    #[inline]
    pub fn slope(&self, state: KernelSum) -> f64 {
        match self.kernel {
            Kernel::Alpha => (state.a - state.b) / self.tau,
            Kernel::DoubleExponential => self.scale * self.rate * state.a - state.b / self.tau_s,
            Kernel::Exponential => -state.b / self.tau,
        }
    }

    /// An upper bound of the potential until the next input, mV.
    #[must_use]
    #[inline]
    pub fn bound(&self, state: KernelSum) -> f64 {
        let largest = if self.kernel == Kernel::Exponential { 0.0 } else { self.largest() };
        state.b.max(0.0) + state.a.max(0.0) * largest
    }

    /// The largest value of the kernel.
    #[must_use]
    #[inline]
    pub fn largest(&self) -> f64 {
        const ONE_OVER_E: f64 = 0.367_879_441_171_442_33;
        if self.kernel == Kernel::Alpha { ONE_OVER_E } else { 1.0 }
    }

    /// The age of an input, ms, from which on its kernel is smaller than the rounding of its largest value.
    #[must_use]
    pub fn negligible_age(&self) -> f64 {
        45.0 * self.tau
    }
}
