//! Encodes events of any origin as datagrams of version 2, in their own order, for files that store a table of events.
//!
//! Unlike a board ([`super::Packer`]), a table may step back in time, mix events with values and without, and contain
//! events that were decoded from states. Every event is written; decoding returns the same columns.

use super::event_words::{EventWords, marker_body};
use super::{BASE_BITS, BodyKind, DatagramHeader, NEVER, checked_stride};
use crate::events::EventsView;
use crate::{Result, problem};

/// The first sequence number: 0 would mean that the board was reset, and that every taxel's value is 0.
const FIRST_SEQUENCE: u32 = 1;

/// Events as datagrams.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Encoded {
    /// Added to times in the datagrams, us.
    pub origin_us: i64,
    /// Where each datagram begins, and where the last one ends.
    pub offsets: Vec<i64>,
    /// Their bytes, one datagram after the other.
    pub bytes: Vec<u8>,
    /// A time of each datagram, us: its promise, or the latest time of its events.
    pub times: Vec<i64>,
    /// Indices of events that are marked as repaired but could not be written as states, because a decoder would decode
    /// another event.
    pub unmarked: Vec<i64>,
}

/// Writes events as datagrams.
///
/// `held` is each taxel's value before the first event, by index, 65 535 if it is unknown; a file stores it before the
/// first datagram. With `promised` each datagram promises that no later one has an event before a time, if that is
/// true.
///
/// # Errors
///
/// `Problem` if the array has more than 65 536 positions, or times span more than 8.9 years.
pub fn encode(events: EventsView<'_>, held: Option<&[u16]>, promised: bool) -> Result<Encoded> {
    let times = || events.t.iter().copied().chain(events.markers.iter().map(|marker| marker.t));
    let (first, last) = (times().min().unwrap_or(0), times().max().unwrap_or(0));
    let fits = |origin: i64| first >= origin && last.abs_diff(origin) < 1 << BASE_BITS;
    let origin_us = if fits(0) { 0 } else { first };
    if !fits(origin_us) {
        return Err(problem!("times from {first} to {last} us: a file of datagrams can contain at most 8.9 years"));
    }
    let mut writer = Writing::new(events, held, origin_us)?;
    // The earliest time from each event on; the last entry belongs to the end.
    let mut from_here = vec![i64::MAX; events.t.len() + 1];
    if promised {
        for k in (0..events.t.len()).rev() {
            from_here[k] = from_here[k + 1].min(events.t[k]);
        }
    } else {
        from_here.fill(NEVER);
    }
    let mut markers = events.markers.iter().peekable();
    for (k, (&t, &earliest)) in events.t.iter().zip(&from_here).enumerate() {
        while let Some(marker) = markers.next_if(|marker| marker.t <= t) {
            writer.flush(earliest);
            writer.marker(marker.t, marker.start);
        }
        writer.event(k, earliest);
    }
    writer.flush(from_here[events.t.len()]);
    for marker in markers {
        writer.marker(marker.t, marker.start);
    }
    writer.out.offsets.push(writer.out.bytes.len() as i64);
    Ok(writer.out)
}

/// The current datagram, and the taxels' values as a decoder will have them.
struct Writing<'a> {
    events: EventsView<'a>,
    out: Encoded,
    sequence: u32,
    stride: u8,
    /// Whether every value fits in 8 bits.
    small: bool,
    /// The events of the current datagram, all written as one kind; none before the first.
    words: Option<(BodyKind, EventWords)>,
    values: Vec<u16>,
    since: Vec<i64>,
}

impl<'a> Writing<'a> {
    fn new(events: EventsView<'a>, held: Option<&[u16]>, origin_us: i64) -> Result<Self> {
        let stride = checked_stride(events.array)?;
        let values = held.map_or_else(|| vec![u16::MAX; events.array.len()], <[u16]>::to_vec);
        let since = values.iter().map(|&value| if value == u16::MAX { NEVER } else { NEVER + 1 }).collect();
        let small = events.intensity.is_none_or(|all| all.ticks.iter().all(|&ticks| ticks <= u16::from(u8::MAX)));
        let out = Encoded { origin_us, ..Encoded::default() };
        Ok(Self { events, out, sequence: FIRST_SEQUENCE, stride, small, words: None, values, since })
    }

    /// Adds an event; no later event is earlier than `promise`.
    fn event(&mut self, k: usize, promise: i64) {
        let events = self.events;
        let (t, taxel, p) = (events.t[k], (events.x[k], events.y[k]), events.p[k]);
        let value = events.intensity.filter(|all| all.present[k]).map(|all| all.ticks[k]);
        let index = events.array.index(taxel.0, taxel.1);
        let kind = self.kind_of(k, index, value);
        let Some(layout) = kind.layout() else { return };
        // A state has the time of its datagram, and positions of states ascend.
        let states = matches!(kind, BodyKind::SmallStates | BodyKind::LargeStates);
        let takes = |words: &EventWords| words.takes(t, taxel) && (!states || words.continues(t, taxel));
        if !self.words.as_ref().is_some_and(|(last, words)| *last == kind && takes(words)) {
            self.flush(promise);
        }
        let (_, words) = self.words.get_or_insert_with(|| (kind, EventWords::new(layout, self.stride)));
        words.add(t, taxel, p, value.unwrap_or(0));
        if let Some(value) = value
            && t >= self.since[index]
        {
            (self.values[index], self.since[index]) = (value, t);
        }
    }

    /// The kind as which an event is written; a state only if a decoder decodes the same event from it.
    fn kind_of(&mut self, k: usize, index: usize, value: Option<u16>) -> BodyKind {
        let repaired = self.events.is_repaired(k);
        let Some(value) = value else {
            self.out.unmarked.extend(repaired.then_some(k as i64));
            return BodyKind::Changes;
        };
        let (before, known) = (self.values[index], self.since[index] != NEVER);
        let same = !(known && before == value)
            && self.events.t[k] >= self.since[index]
            && self.events.p[k] == (!known || value > before);
        self.out.unmarked.extend((repaired && !same).then_some(k as i64));
        match (repaired && same, self.small) {
            (false, true) => BodyKind::Small,
            (false, false) => BodyKind::Large,
            (true, true) => BodyKind::SmallStates,
            (true, false) => BodyKind::LargeStates,
        }
    }

    /// Ends the current datagram, if there is one; no later event is earlier than `promise`.
    fn flush(&mut self, promise: i64) {
        let Some((kind, EventWords { bytes, base, latest, line, .. })) = self.words.take() else { return };
        // The promise of the last datagram is the time after the last event.
        let until = if promise == i64::MAX { latest + 1 } else { promise };
        let span = until.saturating_sub(base).clamp(0, i64::from(u16::MAX)) as u16;
        self.write(kind, (base, line, span), &bytes, if span > 0 { base + i64::from(span) } else { latest });
    }

    fn marker(&mut self, t: i64, start: bool) {
        self.write(BodyKind::Markers, (t, 0, 0), &marker_body(start), t);
    }

    fn write(&mut self, kind: BodyKind, (base, line, span): (i64, u8, u16), body: &[u8], time: i64) {
        let header = DatagramHeader {
            kind: kind.number(),
            board: 0,
            sequence: self.sequence,
            base: base.abs_diff(self.out.origin_us),
            session: 0,
            stride: self.stride,
            line,
            flags: 0,
            span,
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.out.offsets.push(self.out.bytes.len() as i64);
        self.out.bytes.extend(header.datagram(body));
        self.out.times.push(time);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::v2::Decoder;
    use crate::{Array, Events, Intensities, Marker};

    /// Decodes what was written, as a reader of files does.
    fn again(encoded: &Encoded, array: &Array, held: Option<&[u16]>) -> Events {
        let (mut decoder, mut events) = (Decoder::new(array.clone()), Events::empty(array.clone()));
        decoder.begin_with(held.unwrap_or_default().iter().map(|&h| (h != u16::MAX).then_some(h)));
        for pair in encoded.offsets.windows(2) {
            decoder.push(&encoded.bytes[pair[0] as usize..pair[1] as usize], None, &mut events);
        }
        events.t.iter_mut().for_each(|t| *t += encoded.origin_us);
        events.markers.iter_mut().for_each(|m| m.t += encoded.origin_us);
        assert_eq!((decoder.counts().intact, decoder.counts().missing), (encoded.offsets.len() as u64 - 1, 0));
        events
    }

    #[test]
    fn any_table_comes_back_in_its_own_order() {
        let mut seed = 7_u64;
        let mut draw = |n: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) % n
        };
        for round in 0..300 {
            let array = Array::new(1 + draw(90) as u16, 1 + draw(200) as u16, 1.0, "any").unwrap();
            let n = draw(if round % 10 == 0 { 4000 } else { 60 }) as usize;
            let mut t = draw(1 << 40) as i64 - (1 << 39);
            let large = round % 2 == 0;
            let mut events = Events::empty(array.clone());
            let (mut ticks, mut present) = (vec![], vec![]);
            for _ in 0..n {
                t += match draw(8) {
                    0 => -(draw(100_000) as i64),
                    1 => draw(1 << 30) as i64,
                    2 | 3 => draw(40_000) as i64,
                    _ => 0,
                };
                events.t.push(t);
                events.x.push(draw(array.columns.into()) as u16);
                events.y.push(draw(array.rows.into()) as u16);
                events.p.push(draw(2) == 0);
                let has_value = round % 3 != 0 && draw(5) > 0;
                present.push(has_value);
                ticks.push(if has_value { draw(if large { 65_536 } else { 256 }) as u16 } else { 0 });
            }
            if present.iter().any(|&has_value| has_value) {
                events.intensity = Some(Intensities { ticks, present });
            }
            for _ in 0..draw(4) {
                events.markers.push(Marker { t: t - draw(1000) as i64, start: draw(2) == 0 });
            }
            events.markers.sort_by_key(|marker| marker.t);
            for promised in [false, true] {
                let encoded = encode(events.view(), None, promised).unwrap();
                assert_eq!(again(&encoded, &array, None), events, "round {round}");
                assert_eq!(encoded.unmarked, [0; 0]);
            }
        }
    }

    #[test]
    fn a_promise_holds_of_all_that_follows() {
        let array = Array::thesis();
        let mut events = Events::empty(array);
        for (k, t) in [0, 100, 50, 40_000, 200_000, 199_000].into_iter().enumerate() {
            events.t.push(t);
            events.x.push(k as u16);
            events.y.push(0);
            events.p.push(true);
        }
        let encoded = encode(events.view(), None, true).unwrap();
        let mut earliest = i64::MAX;
        for pair in encoded.offsets.windows(2).rev() {
            let (header, _) = DatagramHeader::read(&encoded.bytes[pair[0] as usize..pair[1] as usize]).unwrap();
            // A span of 0 promises nothing.
            assert!(header.span == 0 || header.base as i64 + i64::from(header.span) <= earliest);
            earliest = earliest.min(header.base as i64);
        }
    }

    #[test]
    fn what_a_state_gave_stays_marked_where_a_decoder_can_give_it_again() {
        let array = Array::new(2, 2, 1.0, "four").unwrap();
        let mut events = Events::empty(array.clone());
        // Values 5 to 9, unknown to 7, 9 to 9 (no decoder outputs this event), and 9 to 3 with rising polarity.
        for (t, x, p, repaired) in [(0, 0, true, true), (1, 1, true, true), (2, 0, true, true), (3, 0, true, true)] {
            events.t.push(t);
            events.x.push(x);
            events.y.push(0);
            events.p.push(p);
            events.repaired.get_or_insert_default().push(repaired);
        }
        events.intensity = Some(Intensities { ticks: vec![9, 7, 9, 3], present: vec![true; 4] });
        let held = [5, u16::MAX, u16::MAX, u16::MAX];
        let encoded = encode(events.view(), Some(&held), false).unwrap();
        assert_eq!(encoded.unmarked, [2, 3]);
        let back = again(&encoded, &array, Some(&held));
        assert_eq!(back.repaired, Some(vec![true, true, false, false]));
        assert_eq!((&back.t, &back.p, &back.intensity), (&events.t, &events.p, &events.intensity));
    }
}
