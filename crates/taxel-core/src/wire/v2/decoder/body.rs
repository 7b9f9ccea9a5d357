//! Decodes a datagram's body, by its kind.

use super::Decoder;
use super::words::{self, BodyReader, Meaning};
use crate::Marker;
use crate::wire::columns::Columns;
use crate::wire::v2::{BoardTotals, BodyKind, DIFFERENCES, DatagramHeader, START, STOP, body_of};

/// Five totals of 64 bits.
const STATUS_BYTES: usize = 40;

impl Decoder {
    /// `number` is the datagram's sequence number if it belongs to the latest session.
    pub(super) fn body(
        &mut self,
        header: &DatagramHeader,
        datagram: &[u8],
        base: i64,
        number: Option<i64>,
        out: &mut Columns<'_>,
    ) {
        let states = if number.is_some() { Meaning::States } else { Meaning::StaleStates };
        let words = |meaning| BodyReader::new(meaning, header, base, datagram);
        let differences = header.flags & DIFFERENCES != 0;
        match BodyKind::from_number(header.kind) {
            Some(BodyKind::Small) if differences => self.words::<2, 7, 8>(words(Meaning::Differences), out),
            Some(BodyKind::Large) if differences => self.words::<4, 15, 16>(words(Meaning::Differences), out),
            Some(BodyKind::Changes | BodyKind::Small | BodyKind::Large) => self.changes(header, datagram, base, out),
            Some(BodyKind::SmallStates) => self.words::<2, 7, 8>(words(states), out),
            Some(BodyKind::LargeStates) => self.words::<4, 15, 16>(words(states), out),
            Some(BodyKind::Markers) => self.markers(body_of(datagram), base, out),
            Some(BodyKind::Status) => self.totals(body_of(datagram), number),
            None => self.counts.unknown_kind += 1,
        }
    }

    /// Decodes changes that are no differences.
    #[inline(always)]
    pub(super) fn changes(&mut self, header: &DatagramHeader, datagram: &[u8], base: i64, out: &mut Columns<'_>) {
        let body = BodyReader::new(Meaning::Changes, header, base, datagram);
        match header.kind {
            0 => self.words::<2, 15, 0>(body, out),
            1 => self.words::<2, 7, 8>(body, out),
            _ => self.words::<4, 15, 16>(body, out),
        }
    }

    fn markers(&mut self, body: &[u8], base: i64, out: &mut Columns<'_>) {
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
            out.markers.push(Marker { t, start: code == START });
        }
    }

    fn totals(&mut self, body: &[u8], number: Option<i64>) {
        if body.len() < STATUS_BYTES {
            self.counts.malformed += 1;
            return;
        }
        let Some(number) = number.filter(|number| *number > self.status_number) else { return };
        self.status_number = number;
        let mut totals =
            body.chunks_exact(8).map(|b| u64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
        let mut next = || totals.next().unwrap_or_default();
        let (frames, events, dropped, datagrams, faults) = (next(), next(), next(), next(), next());
        let since = dropped.saturating_sub(self.dropped_before.unwrap_or(dropped));
        // A stranger's datagram may say any number.
        self.counts.events_dropped = self.counts.events_dropped.saturating_add(since);
        self.dropped_before = Some(dropped);
        self.status = Some(BoardTotals { frames, events, dropped, datagrams, faults });
    }

    #[inline(always)]
    fn words<const BYTES: usize, const SKIP: u32, const VALUE: u32>(
        &mut self,
        mut body: BodyReader<'_>,
        out: &mut Columns<'_>,
    ) {
        let Self { instructions, held, counts, latest, .. } = self;
        let first = out.rows;
        words::decode::<BYTES, SKIP, VALUE>(&mut body, *instructions, held, out, counts);
        *latest = body.latest.max(*latest);
        if matches!(body.meaning, Meaning::States | Meaning::StaleStates) {
            out.mark_repaired(first);
        }
    }
}
