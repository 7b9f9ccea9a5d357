//! Decodes a datagram's body, by its kind.

use super::Decoder;
use super::words::{self, Body, Meaning};
use crate::Marker;
use crate::wire::columns::Table;
use crate::wire::v2::{DIFFERENCES, Header, Kind, START, STOP, Status};

/// Five totals of 64 bits.
const STATUS_BYTES: usize = 40;

impl Decoder {
    /// `number` is the datagram's sequence number if it belongs to the latest session.
    pub(super) fn body(&mut self, header: &Header, body: &[u8], base: i64, number: Option<i64>, out: &mut impl Table) {
        let Some(kind) = Kind::of(header.kind) else {
            self.counts.unknown_kind += 1;
            return;
        };
        match kind {
            Kind::Changes | Kind::Small | Kind::Large | Kind::SmallStates | Kind::LargeStates => {
                let Some(word) = kind.layout() else { return };
                let meaning = match kind {
                    Kind::SmallStates | Kind::LargeStates if number.is_none() => Meaning::StaleStates,
                    Kind::SmallStates | Kind::LargeStates => Meaning::States,
                    _ if header.flags & DIFFERENCES != 0 && word.value > 0 => Meaning::Differences,
                    _ => Meaning::Changes,
                };
                self.words(Body::new(word, meaning, header, base, body), out);
            }
            Kind::Markers => {
                self.counts.malformed += u64::from(!body.len().is_multiple_of(8));
                for marker in body.chunks_exact(8) {
                    let offset = u32::from_le_bytes([marker[0], marker[1], marker[2], marker[3]]);
                    let code = u16::from_le_bytes([marker[4], marker[5]]);
                    if code != START && code != STOP {
                        self.counts.unknown_marker += 1;
                        continue;
                    }
                    let t = base + i64::from(offset);
                    self.counts.markers += 1;
                    self.latest = self.latest.max(t);
                    out.mark(Marker { t, start: code == START });
                }
            }
            Kind::Status if body.len() < STATUS_BYTES => self.counts.malformed += 1,
            Kind::Status => {
                let Some(number) = number.filter(|number| *number > self.status_number) else { return };
                self.status_number = number;
                let mut totals =
                    body.chunks_exact(8).map(|b| u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
                let mut next = || totals.next().unwrap_or_default();
                let (frames, events, dropped, datagrams, faults) = (next(), next(), next(), next(), next());
                self.counts.events_dropped += dropped.saturating_sub(self.dropped_before.unwrap_or(dropped));
                self.dropped_before = Some(dropped);
                self.status = Some(Status { frames, events, dropped, datagrams, faults });
            }
        }
    }

    fn words(&mut self, mut body: Body<'_>, out: &mut impl Table) {
        let states = matches!(body.meaning, Meaning::States | Meaning::StaleStates);
        let valued = body.layout.value > 0;
        let Self { instructions, held, counts, latest, .. } = self;
        // SAFETY: `words::decode` writes each row that it counts, and with `paired` its ticks and present.
        unsafe {
            out.rows(words::most_rows(body.left()), valued, states, |room, first, paired| {
                body.rows = first;
                words::decode(&mut body, *instructions, held, room, paired, counts);
                *latest = body.latest.max(*latest);
                body.rows - first
            });
        }
    }
}
