//! What the values of frames are: their unit, steps, sources and rest.

use serde::{Deserialize, Serialize};
use taxel_core::Array;
use taxel_core::rest::ValueSteps;

/// Where the rest comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RestSource {
    /// A tare, or the values held at a moment; 0 of frames of force or pressure.
    Given,
    /// A quiet stretch, from which it is tracked.
    Quiet,
    /// There was no quiet stretch so far: the taxels' first values, from which it is tracked; 0 of frames.
    None,
}

/// What the values of a source's frames are above.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameRest {
    /// Where it is known from. That of a quiet stretch is tracked from its values on; without any the values are above 0, or
    /// above the least of a cell where most are negative.
    pub source: RestSource,
    /// The rest of each cell, in the unit; [`Value::NO_REST`](taxel_core::rest::Value::NO_REST) where it is unknown.
    pub values: Vec<f64>,
    /// Ticks, in which the noise floor is, by the unit.
    pub ticks_by_unit: f64,
    /// From how much above the rest on a value is a load, in the unit.
    pub loaded_from: f64,
    /// Whether values fall from that of a quiet stretch: less may mean more pressure.
    pub falls: bool,
    /// Where something lay in the quiet stretch, for people; empty where nothing did.
    pub preload_at: String,
}

/// A source of frames.
#[derive(Debug, Clone)]
pub struct FramesOfSource {
    /// Its name.
    pub name: String,
    /// The column of the array of the recording that is its first.
    pub left: u16,
    /// Its sensor.
    pub sensor: Array,
    /// What its values are above.
    pub rest: FrameRest,
}

impl FramesOfSource {
    /// Its taxels in an array of `columns` columns, row by row.
    pub(crate) fn taxels(&self, columns: u16) -> impl Iterator<Item = usize> + use<> {
        let (left, width, columns) = (usize::from(self.left), usize::from(self.sensor.columns), usize::from(columns));
        (0..usize::from(self.sensor.rows)).flat_map(move |y| (0..width).map(move |x| y * columns + left + x))
    }
}

/// What the values of a recording of frames are.
#[derive(Debug)]
pub struct Frames {
    /// Their unit.
    pub unit: String,
    /// Time from one frame to the next in the index, where the frames are numbered, us; `None` where they have times.
    pub number_us: Option<i64>,
    /// Size of a tick in the unit, and the ticks of the value 0.
    pub steps: ValueSteps,
    /// Number of frames.
    pub count: usize,
    /// The force that a tick of the sums is, N; `None` where they are sums of the values.
    pub newtons: Option<f64>,
    /// The sources, from left to right.
    pub sources: Vec<FramesOfSource>,
    /// Mean time from one frame of a source to the next, us; 0 where there is one alone.
    pub frame_us: i64,
    /// Where the rest of all sources comes from; none where they differ.
    pub(crate) rest_source: RestSource,
    /// Ticks above rest that count as none in the sums. Forces and pressures are summed over all taxels; of others, above a rest that was found, the noise is no load.
    pub(crate) sum_floor: u16,
    /// Number of the source of each column of the array; empty where there is one, or more than have a curve each.
    pub(crate) source_of: Vec<usize>,
}
