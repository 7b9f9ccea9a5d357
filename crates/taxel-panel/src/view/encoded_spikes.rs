//! Spikes that an encoder makes of the changes or the frames in a view: one by one, and counted by column of time.

use std::ops::Range;
use std::slice;
use std::sync::Arc;

use serde_json::{Value, json};
use taxel_core::encode::Stream;
use taxel_core::{Array, Error, Events, Hint, Intensities, Spike, SpikeKind, problem};

use crate::keyframe_index::FrameSources;
use crate::readout_encoders::ViewEncoder;
use crate::time_columns::{TimeColumns, column_of};
use taxel_core::held::{UNKNOWN, as_events};
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;

/// Maximum number of spikes in a message.
const MOST: usize = 4096;

/// Maximum number of changes converted at a time, which bounds the temporary memory.
const PIECE: usize = 1 << 16;

/// An encoder applied to the changes of a board, or to the frames of each source.
#[derive(Clone)]
pub(crate) struct EncodedSpikes {
    name: String,
    of_readout: bool,
    /// One of a board; of frames one a source.
    encoders: Vec<SourceEncoder>,
    /// What is encoded, if it is frames.
    frames: Option<Arc<dyn FrameSources>>,
    array: Array,
    column_us: i64,
    /// Spike counts of each row by column of time.
    raster: TimeColumns,
    /// Spikes that no message has had yet.
    pending: Vec<Spike>,
    left_out: usize,
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
    /// Number of the next frame.
    next: usize,
}

impl EncodedSpikes {
    fn begin(encoder: &ViewEncoder, sensors: &[Array], array: &Array, column_us: i64) -> Result<Self> {
        let ViewEncoder { encoder, name, of_readout } = encoder;
        let (mut encoders, mut first) = (vec![], 0);
        for sensor in sensors {
            let stream = encoder.stream(sensor).map_err(|error| error.in_part(&format!("encoder {name}")))?;
            let trains = u32::try_from(stream.trains()).map_err(|_| problem!("encoder {name}: too many trains"))?;
            encoders.push(SourceEncoder { stream, first, rows: sensor.rows.into(), next: 0 });
            first += trains;
        }
        Ok(Self {
            name: name.clone(),
            of_readout: *of_readout,
            encoders,
            frames: None,
            array: array.clone(),
            column_us,
            raster: TimeColumns::new(array, 0),
            pending: vec![],
            left_out: 0,
            failed: None,
        })
    }

    /// Begins an encoder at time `since` (us), when the taxels hold these values.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder does not fit the array.
    pub(crate) fn new(
        encoder: &ViewEncoder,
        array: &Array,
        column_us: i64,
        held: &[u16],
        since: Option<i64>,
    ) -> Result<Self> {
        let mut spikes = Self::begin(encoder, slice::from_ref(array), array, column_us)?;
        if let Some(t) = since {
            spikes.push_events(&as_events(held, t, array));
            spikes.forget();
        }
        Ok(spikes)
    }

    /// Begins an encoder for each source with its last frame up to `since` (us), or with its first one.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder does not fit a sensor, or the frames have no times.
    pub(crate) fn of_frames(
        encoder: &ViewEncoder,
        frames: &Arc<dyn FrameSources>,
        column_us: i64,
        since: Option<i64>,
    ) -> Result<Self> {
        if frames.numbered() {
            let text = "spikes need times, but these frames have only numbers: state the frame rate";
            return Err(problem!("{text}").with_hint("rate_hz", Hint::Give).into());
        }
        let sensors = frames.sensors();
        let mut spikes = Self::begin(encoder, &sensors, frames.array(), column_us)?;
        spikes.frames = Some(Arc::clone(frames));
        if let Some(t) = since {
            for (source, encoder) in spikes.encoders.iter_mut().enumerate() {
                encoder.next = frames.until(source, t).saturating_sub(1);
            }
            spikes.push_frames(t);
            spikes.forget();
        }
        Ok(spikes)
    }

    /// Encodes the first two frames of each source.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder does not encode them.
    pub(crate) fn check(mut self) -> Result<()> {
        if let Some(frames) = self.frames.clone() {
            let second = (0..self.encoders.len()).filter_map(|source| frames.frame(source, 1));
            if let Some(t) = second.map(|(t, _)| t).max() {
                self.push_frames(t);
            }
        }
        self.failed.map_or(Ok(()), |error| Err(error.into()))
    }

    /// Drops the spikes of what the encoder begins with, which are none of the view.
    fn forget(&mut self) {
        self.pending.clear();
        self.raster = TimeColumns::new(&self.array, 0);
    }

    /// Encodes the next changes; frames are read from their index as time advances.
    pub(crate) fn push(&mut self, changes: &[TaxelChange]) {
        if self.frames.is_some() {
            return;
        }
        for piece in changes.chunks(PIECE) {
            let events = self.events(piece);
            self.push_events(&events);
        }
    }

    /// Informs the encoder that no change before `t` (us) will follow; frames up to then are encoded.
    pub(crate) fn advance(&mut self, t: i64) {
        self.push_frames(t);
        if self.failed.is_none() {
            let from = self.pending.len();
            let advance = |encoder| emit(&mut self.pending, encoder, |stream, out| stream.advance(t, out));
            self.encoders.iter_mut().for_each(advance);
            self.count(from);
        }
    }

    fn push_events(&mut self, events: &Events) {
        if self.failed.is_some() || events.is_empty() {
            return;
        }
        let from = self.pending.len();
        let push = |encoder| emit(&mut self.pending, encoder, |stream, out| stream.push_events(events.view(), out));
        let pushed = self.encoders.iter_mut().try_for_each(push);
        self.note_outcome(pushed, from);
    }

    /// Encodes the frames up to `t` (us) that have not been encoded yet.
    fn push_frames(&mut self, t: i64) {
        let Some(frames) = self.frames.clone().filter(|_| self.failed.is_none()) else { return };
        let (from, mut pushed) = (self.pending.len(), Ok(()));
        for (source, encoder) in self.encoders.iter_mut().enumerate() {
            while let Some((at, values)) =
                frames.frame(source, encoder.next).filter(|&(at, _)| at <= t && pushed.is_ok())
            {
                encoder.next += 1;
                pushed = emit(&mut self.pending, encoder, |stream, out| stream.push_frame(at, &values, out));
            }
        }
        self.note_outcome(pushed, from);
    }

    fn note_outcome(&mut self, pushed: taxel_core::Result<()>, from: usize) {
        match pushed {
            Ok(()) => self.count(from),
            Err(error) => self.failed = Some(error.in_part(&format!("encoder {}", self.name))),
        }
    }

    /// Counts the pending spikes from index `from` on in their columns; only the newest stay pending.
    #[allow(clippy::cast_possible_truncation)]
    fn count(&mut self, from: usize) {
        let rows = usize::from(self.array.rows);
        self.pending[from..].sort_by(|a, b| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
        for spike in &self.pending[from..] {
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
        let more = self.pending.len().saturating_sub(MOST);
        self.pending.drain(..more);
        self.left_out += more;
    }

    /// Appends these columns of time, one byte per row.
    pub(crate) fn write(&self, columns: Range<i64>, out: &mut Vec<u8>) {
        for column in columns {
            let begin = out.len();
            out.resize(begin + usize::from(self.array.rows), 0);
            self.raster.add_raster(column..column + 1, &mut out[begin..]);
        }
    }

    /// Why the encoder stopped, if it did.
    pub(crate) fn failed(&self) -> Option<&Error> {
        self.failed.as_ref()
    }

    /// The `spikes` message of the pending spikes, if there are any.
    pub(crate) fn message(&mut self) -> Option<Value> {
        if self.pending.is_empty() {
            return None;
        }
        let stream = &self.encoders.first()?.stream;
        let trains: usize = self.encoders.iter().map(|encoder| encoder.stream.trains()).sum();
        let message = json!({
            "type": "spikes",
            "encoder": self.name,
            "of_readout": self.of_readout,
            "trains": trains,
            "signed": stream.kind() == SpikeKind::Signed,
            "latency_ms": stream.latency_ms(),
            "t_ms": self.pending.iter().map(|spike| spike.t).collect::<Vec<_>>(),
            "train": self.pending.iter().map(|spike| spike.train).collect::<Vec<_>>(),
            "value": self.pending.iter().map(|spike| spike.value).collect::<Vec<_>>(),
            "left_out": self.left_out,
        });
        self.pending.clear();
        self.left_out = 0;
        Some(message)
    }

    fn events(&self, changes: &[TaxelChange]) -> Events {
        let columns = u32::from(self.array.columns.max(1));
        // A taxel lies on the array, whose sides fit.
        #[allow(clippy::cast_possible_truncation)]
        let position = |taxel: u32| ((taxel % columns) as u16, (taxel / columns) as u16);
        let valued = changes.iter().any(|change| change.ticks != UNKNOWN);
        Events {
            t: changes.iter().map(|c| c.t).collect(),
            x: changes.iter().map(|c| position(c.taxel).0).collect(),
            y: changes.iter().map(|c| position(c.taxel).1).collect(),
            p: changes.iter().map(|c| c.up).collect(),
            intensity: valued.then(|| Intensities {
                ticks: changes.iter().map(|c| if c.ticks == UNKNOWN { 0 } else { c.ticks }).collect(),
                present: changes.iter().map(|c| c.ticks != UNKNOWN).collect(),
            }),
            ..Events::empty(self.array.clone())
        }
    }
}

/// Appends the spikes that a source's encoder emits, with the numbers of their trains among those of all sources.
fn emit<T>(
    pending: &mut Vec<Spike>,
    encoder: &mut SourceEncoder,
    work: impl FnOnce(&mut dyn Stream, &mut Vec<Spike>) -> T,
) -> T {
    let from = pending.len();
    let done = work(&mut *encoder.stream, pending);
    pending[from..].iter_mut().for_each(|spike| spike.train += encoder.first);
    done
}
