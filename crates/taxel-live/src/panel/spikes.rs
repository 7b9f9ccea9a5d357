//! What an encoder makes of what a view shows: spikes as they come, and by column of time.

use std::collections::VecDeque;
use std::ops::Range;

use serde_json::{Value, json};
use taxel_core::encode::{Encoder, Stream};
use taxel_core::{Array, Events, Intensities, Spike, problem};

use super::lens::{SPAN, column_of};
use crate::Result;
use crate::pipeline::{Change, UNKNOWN};

/// Spikes that are told at once at most.
const MOST: usize = 4096;

/// Changes that are pushed at once: what is laid out for them stays small.
const PIECE: usize = 1 << 16;

/// An encoder at work on a source's changes.
#[derive(Clone)]
pub(super) struct Spikes {
    name: String,
    stream: Box<dyn Stream>,
    array: Array,
    column_us: i64,
    /// Ups and downs of each row in a column of time, ascending by number.
    columns: VecDeque<(i64, Vec<u8>)>,
    waiting: Vec<Spike>,
    left_out: usize,
    /// Why it says nothing any more.
    failed: Option<String>,
}

impl Spikes {
    /// An encoder that begins where the taxels hold these values, at this time (us).
    ///
    /// # Errors
    ///
    /// `Core(Problem)` where the encoder cannot be of this array.
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
            waiting: vec![],
            left_out: 0,
            failed: None,
        };
        if let Some(t) = since {
            // What is held is where the encoder begins, and no change.
            let held = held.iter().enumerate().filter(|&(_, &ticks)| ticks != UNKNOWN);
            // A sensor has 2^22 taxels at most (recording's limits).
            #[allow(clippy::cast_possible_truncation)]
            let held: Vec<_> = held
                .map(|(taxel, &ticks)| Change { t, taxel: taxel as u32, ticks, up: true, repaired: false })
                .collect();
            let mut events = spikes.events(&held);
            events.repaired = Some(vec![true; events.len()]);
            spikes.push(&events);
            spikes.waiting.clear();
            spikes.columns.clear();
        }
        Ok(spikes)
    }

    /// Takes changes in the order in which they came.
    pub(super) fn take(&mut self, changes: &[Change]) {
        for piece in changes.chunks(PIECE) {
            let events = self.events(piece);
            self.push(&events);
        }
    }

    /// Nothing will come before this time any more, us.
    pub(super) fn advance(&mut self, t: i64) {
        if self.failed.is_none() {
            let from = self.waiting.len();
            self.stream.advance(t, &mut self.waiting);
            self.mark(from);
        }
    }

    fn push(&mut self, events: &Events) {
        if self.failed.is_some() || events.is_empty() {
            return;
        }
        let from = self.waiting.len();
        match self.stream.push_events(events.view(), &mut self.waiting) {
            Ok(()) => self.mark(from),
            Err(error) => self.failed = Some(format!("encoder {}: {error}", self.name)),
        }
    }

    /// Puts new spikes into their columns; of those that nobody was told the newest are kept.
    #[allow(clippy::cast_possible_truncation)]
    fn mark(&mut self, from: usize) {
        let (rows, trains) = (usize::from(self.array.rows), self.stream.trains().max(1));
        for spike in &self.waiting[from..] {
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
            // A train a taxel, or a few: by the rows that they belong to.
            let row = (spike.train as usize * rows / trains).min(rows - 1);
            let cell = &mut self.columns[place].1[row];
            let (ups, downs) = (*cell & 15, *cell >> 4);
            *cell = if spike.value < 0.0 { ups | (downs + 1).min(15) << 4 } else { (ups + 1).min(15) | downs << 4 };
        }
        let last = self.columns.back().map_or(0, |&(number, _)| number);
        while self.columns.front().is_some_and(|&(number, _)| number <= last - SPAN) {
            self.columns.pop_front();
        }
        let more = self.waiting.len().saturating_sub(MOST);
        self.waiting.drain(..more);
        self.left_out += more;
    }

    /// Appends these columns of time, a byte a row.
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

    /// Why it says nothing any more.
    pub(super) fn failed(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    /// What there is to tell, as a client is told.
    pub(super) fn tell(&mut self) -> Option<Value> {
        if self.waiting.is_empty() {
            return None;
        }
        let said = json!({
            "type": "spikes", "encoder": self.name, "trains": self.stream.trains(), "signed": self.stream.signed(),
            "latency_ms": self.stream.latency_ms(), "left_out": self.left_out,
            "t_ms": self.waiting.iter().map(|s| s.t).collect::<Vec<_>>(),
            "train": self.waiting.iter().map(|s| s.train).collect::<Vec<_>>(),
            "value": self.waiting.iter().map(|s| s.value).collect::<Vec<_>>(),
        });
        self.waiting.clear();
        self.left_out = 0;
        Some(said)
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
