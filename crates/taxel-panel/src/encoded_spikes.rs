//! Spikes that an encoder makes of the changes in a view: one by one, and counted by column of time.

use std::collections::VecDeque;
use std::ops::Range;

use serde_json::{Value, json};
use taxel_core::encode::{Encoder, Stream};
use taxel_core::{Array, Events, Intensities, Spike, SpikeKind, problem};

use super::time_columns::{SPAN, column_of};
use taxel_core::held::{UNKNOWN, as_events};
use taxel_live::Result;
use taxel_live::pipeline::Change;

/// Maximum number of spikes in a message.
const MOST: usize = 4096;

/// Maximum number of changes converted at a time, which bounds the temporary memory.
const PIECE: usize = 1 << 16;

/// An encoder applied to the changes of a source.
#[derive(Clone)]
pub(super) struct EncodedSpikes {
    name: String,
    stream: Box<dyn Stream>,
    array: Array,
    column_us: i64,
    /// Spike counts of each row by column of time, ascending by number.
    columns: VecDeque<(i64, Vec<u8>)>,
    /// Spikes that no message has had yet.
    pending: Vec<Spike>,
    left_out: usize,
    /// Why the encoder stopped.
    failed: Option<String>,
}

impl EncodedSpikes {
    /// Begins an encoder at time `since` (us), when the taxels hold these values.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder does not fit the array.
    pub(super) fn new(
        encoder: &Encoder,
        array: &Array,
        column_us: i64,
        held: &[u16],
        since: Option<i64>,
    ) -> Result<Self> {
        let name = json!(encoder)["name"].as_str().unwrap_or_default().to_owned();
        let stream = encoder.stream(array).map_err(|error| problem!("encoder {name}: {error}"))?;
        let mut spikes = Self {
            name,
            stream,
            array: array.clone(),
            column_us,
            columns: VecDeque::new(),
            pending: vec![],
            left_out: 0,
            failed: None,
        };
        if let Some(t) = since {
            // The held values are where the encoder begins, and not changes.
            spikes.push_events(&as_events(held, t, array));
            spikes.pending.clear();
            spikes.columns.clear();
        }
        Ok(spikes)
    }

    /// Encodes the next changes.
    pub(super) fn push(&mut self, changes: &[Change]) {
        for piece in changes.chunks(PIECE) {
            let events = self.events(piece);
            self.push_events(&events);
        }
    }

    /// Informs the encoder that no change before `t` (us) will follow.
    pub(super) fn advance(&mut self, t: i64) {
        if self.failed.is_none() {
            let from = self.pending.len();
            self.stream.advance(t, &mut self.pending);
            self.count(from);
        }
    }

    fn push_events(&mut self, events: &Events) {
        if self.failed.is_some() || events.is_empty() {
            return;
        }
        let from = self.pending.len();
        match self.stream.push_events(events.view(), &mut self.pending) {
            Ok(()) => self.count(from),
            Err(error) => self.failed = Some(format!("encoder {}: {error}", self.name)),
        }
    }

    /// Counts the pending spikes from index `from` on in their columns; only the newest stay pending.
    #[allow(clippy::cast_possible_truncation)]
    fn count(&mut self, from: usize) {
        let (rows, trains) = (usize::from(self.array.rows), self.stream.trains().max(1));
        for spike in &self.pending[from..] {
            let column = column_of((spike.t * 1000.0).floor() as i64, self.column_us);
            let place = match self.columns.back() {
                Some((last, _)) if *last == column => self.columns.len() - 1,
                _ => match self.columns.binary_search_by_key(&column, |&(number, _)| number) {
                    Ok(place) => place,
                    Err(place) => {
                        self.columns.insert(place, (column, vec![0; rows]));
                        place
                    }
                },
            };
            // Trains are assigned to rows evenly: with one train per taxel that is the row of the taxel.
            let row = (spike.train as usize * rows / trains).min(rows - 1);
            let cell = &mut self.columns[place].1[row];
            let (ups, downs) = (*cell & 15, *cell >> 4);
            *cell = if spike.value < 0.0 { ups | (downs + 1).min(15) << 4 } else { (ups + 1).min(15) | downs << 4 };
        }
        let last = self.columns.back().map_or(0, |&(number, _)| number);
        while self.columns.front().is_some_and(|&(number, _)| number <= last - SPAN) {
            self.columns.pop_front();
        }
        let more = self.pending.len().saturating_sub(MOST);
        self.pending.drain(..more);
        self.left_out += more;
    }

    /// Appends these columns of time, one byte per row.
    pub(super) fn write(&self, columns: Range<i64>, out: &mut Vec<u8>) {
        let mut place = self.columns.partition_point(|&(number, _)| number < columns.start);
        for column in columns {
            match self.columns.get(place) {
                Some((number, rows)) if *number == column => {
                    out.extend_from_slice(rows);
                    place += 1;
                }
                _ => out.resize(out.len() + usize::from(self.array.rows), 0),
            }
        }
    }

    /// Why the encoder stopped, if it did.
    pub(super) fn failed(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    /// The `spikes` message of the pending spikes, if there are any.
    pub(super) fn message(&mut self) -> Option<Value> {
        if self.pending.is_empty() {
            return None;
        }
        let message = json!({
            "type": "spikes", "encoder": self.name, "trains": self.stream.trains(), "signed": self.stream.kind() == SpikeKind::Signed,
            "latency_ms": self.stream.latency_ms(), "left_out": self.left_out,
            "t_ms": self.pending.iter().map(|s| s.t).collect::<Vec<_>>(),
            "train": self.pending.iter().map(|s| s.train).collect::<Vec<_>>(),
            "value": self.pending.iter().map(|s| s.value).collect::<Vec<_>>(),
        });
        self.pending.clear();
        self.left_out = 0;
        Some(message)
    }

    fn events(&self, changes: &[Change]) -> Events {
        let columns = u32::from(self.array.columns.max(1));
        // A taxel lies on the array, whose sides fit.
        #[allow(clippy::cast_possible_truncation)]
        let place = |taxel: u32| ((taxel % columns) as u16, (taxel / columns) as u16);
        let valued = changes.iter().any(|change| change.ticks != UNKNOWN);
        Events {
            t: changes.iter().map(|c| c.t).collect(),
            x: changes.iter().map(|c| place(c.taxel).0).collect(),
            y: changes.iter().map(|c| place(c.taxel).1).collect(),
            p: changes.iter().map(|c| c.up).collect(),
            intensity: valued.then(|| Intensities {
                ticks: changes.iter().map(|c| if c.ticks == UNKNOWN { 0 } else { c.ticks }).collect(),
                present: changes.iter().map(|c| c.ticks != UNKNOWN).collect(),
            }),
            ..Events::empty(self.array.clone())
        }
    }
}
