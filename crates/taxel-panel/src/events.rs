//! The index of a recording's events.

use crossbeam_channel as channel;
use taxel_core::held::UNKNOWN;
use taxel_core::{Events, EventsView, Stop, problem};
use taxel_live::Result;
use taxel_live::pipeline::TaxelChange;
use taxel_live::recording::{DecodedRecording, Reader, Remarks, Topic};

use crate::block::Block;
use crate::index::{CHANGES, Index, Indexing, Kept};
use crate::state::{Keyframe, Sensor};

/// Decoded blocks that may wait for the indexing thread.
const AHEAD: usize = 4;

impl Index {
    /// Decodes the datagrams of a board and indexes their events. Returns also what else there is in the recording, and what
    /// decoding found.
    ///
    /// # Errors
    ///
    /// `File` where the recording cannot be read; `Core(Problem)` where the temporary file cannot be made or has no room.
    pub fn of_board(reader: &Reader, kept: Kept) -> Result<(Self, Remarks, DecodedRecording)> {
        let header = reader.header();
        let noise_floor = header.registers.map_or(0, |registers| registers.noise_floor.into());
        let blank = Keyframe::blank(header.array.len());
        let mut indexing = Indexing::new(Sensor::new(header.array.clone(), noise_floor, None), &blank, kept);
        let (decoded, pieces) = channel::bounded(AHEAD);
        let (remarks, rest) = std::thread::scope(|scope| {
            let decoding = scope.spawn(move || decode(reader, &decoded));
            pieces.into_iter().try_for_each(|piece| match piece {
                Piece::Held(held) => {
                    indexing.begin_with(&held);
                    Ok(())
                }
                Piece::Changes(changes) => indexing.push(of_changes(changes)),
            })?;
            decoding.join().unwrap_or_else(|_| Err(problem!("indexing failed within taxel; please report it").into()))
        })?;
        Ok((indexing.finish(), remarks, rest))
    }

    /// Indexes events, before which the taxels held these values, if that is known.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` for events outside the array, and where the temporary file cannot be made or has no room.
    pub fn of_events(events: EventsView<'_>, held: Option<&[u16]>, noise_floor: u16, kept: Kept) -> Result<Self> {
        events.check()?;
        let sensor = Sensor::new(events.array.clone(), noise_floor, None);
        let mut indexing = Indexing::new(sensor, &Keyframe::blank(events.array.len()), kept);
        indexing.begin_with(held.unwrap_or_default());
        events.pieces(CHANGES).try_for_each(|piece| indexing.push(of_changes(changes(piece))))?;
        Ok(indexing.finish())
    }
}

fn of_changes(changes: Vec<TaxelChange>) -> Block {
    Block { changes: changes.into(), ..Block::default() }
}

/// What a recording holds, in the order of the file.
enum Piece {
    /// The values that taxels held before its first event.
    Held(Vec<u16>),
    Changes(Vec<TaxelChange>),
}

/// Decodes a recording, and passes its events on in blocks.
fn decode(reader: &Reader, to: &channel::Sender<Piece>) -> Result<(Remarks, DecodedRecording)> {
    let send = |piece| -> Result<()> { to.send(piece).map_err(|_| problem!("indexing ended early").into()) };
    let (mut remarks, mut begun) = (Remarks::default(), false);
    let flush = |events: &mut Events| {
        let changes = changes(events.view());
        events.clear();
        send(Piece::Changes(changes))
    };
    let mut decoded = reader.decode_each(Stop::never(), |message, events| {
        remarks.add(message);
        if message.topic == Topic::Held && !begun && events.is_empty() {
            send(Piece::Held(remarks.held.clone().unwrap_or_default()))?;
        }
        if events.len() >= CHANGES {
            begun = true;
            flush(events)?;
        }
        Ok(())
    })?;
    flush(&mut decoded.events)?;
    Ok((remarks, decoded))
}

fn changes(events: EventsView<'_>) -> Vec<TaxelChange> {
    let columns = usize::from(events.array.columns);
    let change = |k: usize| TaxelChange {
        t: events.t[k],
        // A sensor has 2^22 taxels at most (the limits of recordings).
        taxel: (usize::from(events.y[k]) * columns + usize::from(events.x[k])) as u32,
        ticks: events
            .intensity
            .filter(|intensity| intensity.present[k])
            .map_or(UNKNOWN, |intensity| intensity.ticks[k]),
        up: events.p[k],
        repaired: events.is_repaired(k),
    };
    (0..events.len()).map(change).collect()
}

#[cfg(test)]
pub(crate) mod tests;
