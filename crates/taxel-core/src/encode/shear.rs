//! The shear of a sensor whose taxels have three axes: a vector, and how much its length grows or shrinks.

use super::driver::Sample;
use super::tare::Tare;
use crate::rest::{Baseline, Value, Waiting};
use crate::{Array, Result, problem};

/// Which axis each channel is of, where names end in _x, _y and _z and all do: 0 to 2; none where they do not.
pub(super) fn axes(array: &Array) -> Vec<usize> {
    let names = array.names.as_deref().unwrap_or_default();
    let axis_of = |name: &String| ["_x", "_y", "_z"].iter().position(|axis| name.ends_with(axis));
    let axes: Vec<_> = names.iter().map(axis_of).collect::<Option<_>>().unwrap_or_default();
    if (0..3).all(|axis| axes.contains(&axis)) { axes } else { vec![] }
}

/// Computes the rise and the fall of the shear from the values of all channels.
#[derive(Clone)]
pub(super) struct Shear {
    /// Of each channel which axis it is of: 0 for x, 1 for y, 2 for z.
    axes: Vec<usize>,
    rest: Vec<f64>,
    values: Vec<f32>,
    waiting: Waiting,
    /// The running mean of the length.
    mean: Baseline,
}

impl Shear {
    /// Starts from a tare; channels whose rest is not known are left out.
    ///
    /// # Errors
    ///
    /// `Problem` if the names of the channels do not end in _x, _y and _z, or the tare is of another array.
    pub(super) fn new(array: &Array, tare: &Tare, mean_us: f64) -> Result<Self> {
        let axes = axes(array);
        if axes.is_empty() {
            return Err(problem!("quantity"; " shear: needs channels whose names end in _x, _y and _z"));
        }
        let rest = tare.rest_of(array)?.values().to_vec();
        let (values, mean) = (vec![0.0; rest.len()], Baseline::running(1, mean_us));
        Ok(Self { axes, rest, values, waiting: Waiting::default(), mean })
    }

    /// Reads the values of all channels; returns the rise and the fall of the length of the sum of all taxels' shear above
    /// rest.
    pub(super) fn take(&mut self, now: Sample<'_>) -> [f64; 2] {
        self.values.copy_from_slice(&now.held.as_flattened()[..self.rest.len()]);
        self.waiting.fill(&mut self.values, &self.rest);
        let mut vector = [0.0; 2];
        for ((&axis, &value), &rest) in self.axes.iter().zip(&self.values).zip(&self.rest) {
            if axis < 2 && rest != f64::NO_REST {
                vector[axis] += f64::from(value) - rest;
            }
        }
        let change = f64::from(self.mean.take(now.t, &[f64::hypot(vector[0], vector[1]) as f32])[0]);
        [change.max(0.0), (-change).max(0.0)]
    }

    /// Sets the rest of a channel.
    pub(super) fn set_rest(&mut self, channel: usize, rest: f64) {
        self.rest[channel] = rest;
    }
}
