//! Spikes that an encoder makes of the changes in a view, counted by row and column of time.

use std::ops::Range;
use std::sync::Arc;

use taxel_core::encode::{Encoder, Stream};
use taxel_core::{Array, Error, Events, Hint, Intensities, Spike, problem};

use crate::columns::{TimeColumns, column_of};
use crate::frame_values::Frames;
use crate::index::Index;
use crate::state::{Keyframe, Sensor};
use taxel_core::held::{UNKNOWN, as_events};
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;

/// Maximum number of changes converted at a time, which bounds the temporary memory.
const PIECE: usize = 1 << 16;

/// An encoder applied to the changes of a board, or to the frames of each source.
#[derive(Clone)]
pub(crate) struct EncodedSpikes {
    sensor: Arc<Sensor>,
    /// One of a board; of frames one a source.
    encoders: Vec<SourceEncoder>,
    /// The values that taxels hold, if they come in frames.
    held: Vec<u16>,
    column_us: i64,
    /// Spike counts of each row by column of time.
    raster: TimeColumns,
    /// Spikes that are not counted yet.
    pending: Vec<Spike>,
    /// Why the encoder stopped.
    failed: Option<Error>,
}

/// The encoder of a source.
#[derive(Clone)]
struct SourceEncoder {
    stream: Box<dyn Stream>,
    /// Number of its first train among those of all sources.
    first: u32,
    rows: usize,
}

impl EncodedSpikes {
    /// Begins an encoder with what the taxels held.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder does not fit a sensor, or frames have no times.
    pub(crate) fn new(encoder: &Encoder, sensor: &Arc<Sensor>, column_us: i64, from: &Keyframe) -> Result<Self> {
        let sensors: Vec<&Array> = match &sensor.frames {
            Some(Frames { number_us: Some(_), .. }) => {
                let text = "spikes need times, but these frames have only numbers: state the frame rate";
                return Err(problem!("{text}").with_hint("rate_hz", Hint::Give).into());
            }
            Some(frames) => frames.sources.iter().map(|source| &source.sensor).collect(),
            None => vec![&sensor.array],
        };
        let (mut encoders, mut first) = (vec![], 0);
        for sensor in sensors {
            let stream = encoder.stream(sensor).map_err(of_encoder)?;
            let trains = u32::try_from(stream.trains()).map_err(|_| of_encoder(problem!("too many trains")))?;
            encoders.push(SourceEncoder { stream, first, rows: sensor.rows.into() });
            first += trains;
        }
        let mut spikes = Self {
            sensor: Arc::clone(sensor),
            encoders,
            held: from.held.clone(),
            column_us,
            raster: TimeColumns::new(&sensor.array, 0, 0),
            pending: vec![],
            failed: None,
        };
        if let Some(t) = from.latest {
            match &sensor.frames {
                Some(frames) => {
                    let columns = sensor.array.columns;
                    for (number, source) in frames.sources.iter().enumerate() {
                        if source.taxels(columns).any(|taxel| from.held[taxel] != UNKNOWN) {
                            spikes.push_frame(t, frames, number);
                        }
                    }
                }
                None => spikes.push_events(&as_events(&from.held, t, &sensor.array)),
            }
            // The spikes of what the encoder begins with are none of the view.
            spikes.pending.clear();
        }
        Ok(spikes)
    }

    /// Encodes the first two frames of each source.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder does not encode them.
    pub(crate) fn check(mut self, index: &Index) -> Result<()> {
        if self.sensor.frames.is_some()
            && let Some(block) = index.next(&mut 0)?
        {
            let times = block.changes.chunk_by(|change, next| change.t == next.t);
            let first: usize = times.take(2 * self.encoders.len()).map(<[TaxelChange]>::len).sum();
            self.push(&block.changes[..first]);
        }
        self.failed.map_or(Ok(()), |error| Err(error.into()))
    }

    /// Encodes the next changes.
    pub(crate) fn push(&mut self, changes: &[TaxelChange]) {
        let sensor = Arc::clone(&self.sensor);
        match &sensor.frames {
            Some(frames) => {
                for together in changes.chunk_by(|change, next| change.t == next.t) {
                    self.push_frames(frames, together);
                }
            }
            None => changes.chunks(PIECE).for_each(|piece| self.push_events(&self.events(piece))),
        }
        self.count();
    }

    /// Encodes the frames of one time, of each source that has one.
    fn push_frames(&mut self, frames: &Frames, changes: &[TaxelChange]) {
        let mut have = vec![false; frames.sources.len()];
        for change in changes {
            self.held[change.taxel as usize] = change.ticks;
            have[frames.source_at(self.sensor.position(change.taxel as usize).0)] = true;
        }
        (0..have.len()).filter(|&source| have[source]).for_each(|source| self.push_frame(changes[0].t, frames, source));
    }

    /// Encodes the frame that a source holds: whole values are those of the file, others differ by half a step at most.
    #[allow(clippy::cast_possible_truncation)]
    fn push_frame(&mut self, t: i64, frames: &Frames, source: usize) {
        let value = |taxel: usize| match self.held[taxel] {
            UNKNOWN => f32::NAN,
            ticks => ((f64::from(ticks) - f64::from(frames.steps.zero)) * frames.steps.size) as f32,
        };
        let values: Vec<f32> = frames.sources[source].taxels(self.sensor.array.columns).map(value).collect();
        self.encode(source, |stream, out| stream.push_frame(t, &values, out));
    }

    fn push_events(&mut self, events: &Events) {
        if !events.is_empty() {
            self.encode(0, |stream, out| stream.push_events(events.view(), out));
        }
    }

    /// Appends the spikes that a source's encoder emits, with the numbers of their trains among those of all sources.
    fn encode(&mut self, source: usize, work: impl FnOnce(&mut dyn Stream, &mut Vec<Spike>) -> taxel_core::Result<()>) {
        if self.failed.is_some() {
            return;
        }
        let (from, encoder) = (self.pending.len(), &mut self.encoders[source]);
        let done = work(&mut *encoder.stream, &mut self.pending);
        self.pending[from..].iter_mut().for_each(|spike| spike.train += encoder.first);
        self.failed = done.err().map(of_encoder);
    }

    /// Informs the encoder that no change before `t` (us) will follow.
    pub(crate) fn advance(&mut self, t: i64) {
        for source in 0..self.encoders.len() {
            self.encode(source, |stream, out| {
                stream.advance(t, out);
                Ok(())
            });
        }
        self.count();
    }

    /// Counts the pending spikes in their columns.
    #[allow(clippy::cast_possible_truncation)]
    fn count(&mut self) {
        let rows = usize::from(self.sensor.array.rows);
        self.pending.sort_by(|a, b| a.t.total_cmp(&b.t));
        for spike in self.pending.drain(..) {
            let column = column_of((spike.t * 1000.0).floor() as i64, self.column_us);
            // The trains of a source are assigned to its rows evenly: with one train per taxel that is the row of the taxel.
            let next = self.encoders.partition_point(|encoder| encoder.first <= spike.train);
            let encoder = &self.encoders[next.saturating_sub(1)];
            let row = (spike.train - encoder.first) as usize * encoder.rows / encoder.stream.trains().max(1);
            // A row of the sensor, whose sides fit.
            let row = row.min(rows - 1) as u16;
            self.raster.extend_to(column);
            self.raster.count(column, std::iter::once((row, spike.value >= 0.0)));
        }
    }

    /// Appends these columns of time, one byte per row.
    pub(crate) fn write(&self, columns: Range<i64>, out: &mut Vec<u8>) {
        for column in columns {
            let begin = out.len();
            out.resize(begin + usize::from(self.sensor.array.rows), 0);
            self.raster.add_raster(column..column + 1, &mut out[begin..]);
        }
    }

    /// Why the encoder stopped, if it did.
    pub(crate) fn failed(&self) -> Option<&Error> {
        self.failed.as_ref()
    }

    fn events(&self, changes: &[TaxelChange]) -> Events {
        let valued = changes.iter().any(|change| change.ticks != UNKNOWN);
        Events {
            t: changes.iter().map(|c| c.t).collect(),
            x: changes.iter().map(|c| self.sensor.position(c.taxel as usize).0).collect(),
            y: changes.iter().map(|c| self.sensor.position(c.taxel as usize).1).collect(),
            p: changes.iter().map(|c| c.up).collect(),
            intensity: valued.then(|| Intensities {
                ticks: changes.iter().map(|c| if c.ticks == UNKNOWN { 0 } else { c.ticks }).collect(),
                present: changes.iter().map(|c| c.ticks != UNKNOWN).collect(),
            }),
            ..Events::empty(self.sensor.array.clone())
        }
    }
}

fn of_encoder(error: Error) -> Error {
    error.in_part("encoder")
}
