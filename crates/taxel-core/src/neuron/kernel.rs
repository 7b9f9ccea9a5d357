//! The alpha kernel (6.5) and the two numbers that carry a sum of them through time.

/// The alpha kernel `t/tau e^{-t/tau}` (6.5), 0 before `t = 0`; its largest value is `1/e`, at `t = tau`.
#[must_use]
pub fn alpha(t: f64, tau: f64) -> f64 {
    if t <= 0.0 { 0.0 } else { t / tau * (-t / tau).exp() }
}

/// A weighted sum of alpha kernels, as it goes on without further input: `U(s) = e^{-s/tau} (a s/tau + b)`.
///
/// This stepwise form neither overflows nor loses digits after a long time, as the form `e^{-t/tau} (A t/tau - B)` does.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// The sum of the decayed weights, mV.
    pub a: f64,
    /// The potential, mV.
    pub b: f64,
}

impl State {
    /// The state `dt` ms later.
    #[must_use]
    pub fn after(self, dt: f64, tau: f64) -> Self {
        self.decayed(dt / tau, (-dt / tau).exp())
    }

    /// The state later by `x = dt/tau`, with `decay = e^{-x}` given.
    #[must_use]
    pub fn decayed(self, x: f64, decay: f64) -> Self {
        Self { a: self.a * decay, b: (self.b + self.a * x) * decay }
    }

    /// Adds an input of this weight that came `age` ms ago.
    pub fn add(&mut self, weight: f64, age: f64, tau: f64) {
        let x = age / tau;
        let v = weight * (-x).exp();
        self.a += v;
        self.b += v * x;
    }

    /// How steeply the potential rises now, mV/ms.
    #[must_use]
    pub fn slope(self, tau: f64) -> f64 {
        (self.a - self.b) / tau
    }

    /// A value that the potential will not exceed while no input comes, mV.
    #[must_use]
    pub fn bound(self) -> f64 {
        const ONE_OVER_E: f64 = 0.367_879_441_171_442_33;
        self.b.max(0.0) + self.a.max(0.0) * ONE_OVER_E
    }
}
