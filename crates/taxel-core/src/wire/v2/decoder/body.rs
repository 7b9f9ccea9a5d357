//! Decodes a datagram's body, by its kind.

use super::Decoder;
use super::words::{self, BodyReader, Meaning};
use crate::Marker;
use crate::wire::columns::Table;
use crate::wire::v2::{BoardTotals, BodyKind, DIFFERENCES, DatagramHeader, START, STOP};

/// Five totals of 64 bits.
const STATUS_BYTES: usize = 40;

impl Decoder {
    /// `number` is the datagram's sequence number if it belongs to the latest session.
    pub(super) fn body(
        &mut self,
        header: &DatagramHeader,
        body: &[u8],
        base: i64,
        number: Option<i64>,
        out: &mut impl Table,
    ) {
        let Some(kind) = BodyKind::from_number(header.kind) else {
            self.counts.unknown_kind += 1;
            return;
        };
        match kind {
            BodyKind::Changes | BodyKind::Small | BodyKind::Large | BodyKind::SmallStates | BodyKind::LargeStates => {
                let Some(word) = kind.layout() else { return };
                let meaning = match kind {
                    BodyKind::SmallStates | BodyKind::LargeStates if number.is_none() => Meaning::StaleStates,
                    BodyKind::SmallStates | BodyKind::LargeStates => Meaning::States,
                    _ if header.flags & DIFFERENCES != 0 && word.value > 0 => Meaning::Differences,
                    _ => Meaning::Changes,
                };
                self.words(BodyReader::new(word, meaning, header, base, body), out);
            }
            BodyKind::Markers => {
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
            BodyKind::Status if body.len() < STATUS_BYTES => self.counts.malformed += 1,
            BodyKind::Status => {
                let Some(number) = number.filter(|number| *number > self.status_number) else { return };
                self.status_number = number;
                let mut totals =
                    body.chunks_exact(8).map(|b| u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
                let mut next = || totals.next().unwrap_or_default();
                let (frames, events, dropped, datagrams, faults) = (next(), next(), next(), next(), next());
                self.counts.events_dropped += dropped.saturating_sub(self.dropped_before.unwrap_or(dropped));
                self.dropped_before = Some(dropped);
                self.status = Some(BoardTotals { frames, events, dropped, datagrams, faults });
            }
        }
    }

    fn words(&mut self, mut body: BodyReader<'_>, out: &mut impl Table) {
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
