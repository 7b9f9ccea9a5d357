//! The shear of a sensor whose taxels have three axes: how much the vector of its sum changes, as it grows or shrinks.

use super::driver::Sample;
use super::moved::MEAN_US;
use super::tare::Tare;
use crate::rest::{Baseline, Value, Waiting};
use crate::{Array, Result, problem};

/// The time constant with which the sum is smoothed, us: of 0 to 50 ms the best for lifts in the recordings that
/// `taxel bench grip` learns from.
const SMOOTH_US: f64 = 20_000.0;

/// Computes the rise and the fall of the shear from the values of all channels.
#[derive(Clone)]
pub(super) struct Shear {
    /// Of each channel which axis it is of: 0 for x, 1 for y, 2 for z.
    axes: Vec<usize>,
    rest: Vec<f64>,
    values: Vec<f32>,
    waiting: Waiting,
    /// The smoothed sum, x and y, and when it was last computed, us.
    sum: [f32; 2],
    t: Option<i64>,
    means: Baseline,
}

impl Shear {
    /// Starts from a tare; channels whose rest is not known are left out.
    ///
    /// # Errors
    ///
    /// `Problem` if the names of the channels do not end in _x, _y and _z, or the tare is of another array.
    pub(super) fn new(array: &Array, tare: &Tare) -> Result<Self> {
        let (axes, rest) = (array.axes(), tare.rest_of_axes(array)?);
        if axes.is_empty() {
            return Err(problem!("quantity"; " shear: needs channels whose names end in _x, _y and _z"));
        }
        let (values, means) = (vec![0.0; rest.len()], Baseline::running(2, MEAN_US));
        Ok(Self { axes, rest, values, waiting: Waiting::default(), sum: [0.0; 2], t: None, means })
    }

    /// Reads the values of all channels; returns by how much the sum of all shear above rest, as a vector, differs from its
    /// running mean, where it is longer than that and where it is shorter; 0 for the other.
    pub(super) fn take(&mut self, now: Sample<'_>) -> [f64; 2] {
        self.values.copy_from_slice(&now.held.as_flattened()[..self.rest.len()]);
        self.waiting.fill(&mut self.values, &self.rest);
        let mut sum = [0.0; 2];
        for ((&axis, &value), &rest) in self.axes.iter().zip(&self.values).zip(&self.rest) {
            if axis < 2 && rest != f64::NO_REST {
                sum[axis] += f64::from(value) - rest;
            }
        }
        let passed = self.t.replace(now.t).map_or(f64::INFINITY, |before| (now.t - before).max(0) as f64);
        let step = -libm::expm1(-passed / SMOOTH_US);
        for (smooth, sum) in self.sum.iter_mut().zip(sum) {
            *smooth += (step * (sum - f64::from(*smooth))) as f32;
        }
        let length = |[x, y]: [f64; 2]| f64::hypot(x, y);
        let change = self.means.take(now.t, &self.sum);
        let change = [change[0], change[1]].map(f64::from);
        let sum = self.sum.map(f64::from);
        let grows = length(sum) > length([sum[0] - change[0], sum[1] - change[1]]);
        if grows { [length(change), 0.0] } else { [0.0, length(change)] }
    }

    /// Sets the rest of a channel.
    pub(super) fn set_rest(&mut self, channel: usize, rest: f64) {
        self.rest[channel] = rest;
    }
}
