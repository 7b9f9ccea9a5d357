//! The way from events to detections, piece by piece: the same detections live and from a recording.

use std::collections::VecDeque;

use crate::detect::{Detection, FrameClock, TrainedNeuron};
use crate::encode::{Stream, Zeroing};
use crate::neuron::{Neuron, NeuronStream, OutputSpike};
use crate::spikes::{ms, us};
use crate::{Array, EventsView, FramesView, Result, Spike, Stop, problem};

/// How many events go through the stream between two looks at [`Stop`].
const PIECE: usize = 65_536;

/// Times farther from 0 than this lose their whole us in a neuron's ms, us.
const FARTHEST_US: i64 = 1 << 52;

/// A readout at work: events or pictures in, detections out.
///
/// A crossing counts once nothing can come before it any more: when a later event has come, or the caller has moved time
/// on with [`ReadoutStream::advance`]. Detections depend neither on where the input is cut nor on when time is moved.
#[derive(Clone)]
pub struct ReadoutStream {
    encoder: Box<dyn Stream>,
    array: Array,
    voices: Vec<Voice>,
    clock: FrameClock,
    /// Nothing comes before it any more, us.
    now: Option<i64>,
    /// Each train is heard once at each of these delays, ms.
    delays_ms: Vec<f64>,
    /// What the encoder just said.
    heard: Vec<Spike>,
    /// Spikes by the neurons' inputs that are known already and that others may still come before, and whether an event that
    /// a state repaired may have given them.
    waiting: Vec<(Spike, bool)>,
    /// When taxels were repaired last, us, as far back as the encoder may still speak of it.
    repaired: VecDeque<i64>,
    /// Taxels that are to be zeroed, by time, each after all events up to then.
    zeroings: VecDeque<Zeroing>,
    late: u64,
}

/// One neuron with its name.
#[derive(Clone)]
struct Voice {
    label: String,
    neuron: Neuron,
    weights: Vec<f64>,
    threshold: f64,
    /// What its crossings come later than the event: the encoder's latency and the trained delay, ms.
    offset_ms: f64,
    /// Begun with the first spike, so that a grid lies alike wherever the listening starts.
    stream: Option<NeuronStream>,
    crossings: Vec<OutputSpike>,
    /// When the last input came that may tell of a repaired taxel, ms.
    repaired: Option<f64>,
}

impl ReadoutStream {
    pub(super) fn new(
        encoder: Box<dyn Stream>,
        array: Array,
        clock: FrameClock,
        threshold: f64,
        delays_ms: Vec<f64>,
        neurons: impl Iterator<Item = (String, TrainedNeuron)>,
    ) -> Self {
        let latency_ms = encoder.latency_ms();
        let voices = neurons.map(|(label, one)| Voice {
            label,
            offset_ms: latency_ms + one.delay_ms,
            neuron: one.neuron,
            weights: one.weights,
            threshold,
            stream: None,
            crossings: vec![],
            repaired: None,
        });
        let voices = voices.collect();
        let (heard, waiting, repaired, zeroings) = (vec![], vec![], VecDeque::new(), VecDeque::new());
        Self { voices, encoder, array, clock, now: None, delays_ms, heard, waiting, repaired, zeroings, late: 0 }
    }

    /// Takes the next events; adds what is certain now to `out`.
    ///
    /// An event that is earlier than what came before (or than where time was moved to) counts as coming now: it is
    /// counted as [`late`](Self::late).
    ///
    /// # Errors
    ///
    /// `Problem` where events come from another array or lack what the encoder needs, or a time is beyond 2^52 us.
    pub fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Detection>) -> Result<()> {
        self.check_shape(events.array)?;
        let Some((&first, rest)) = events.t.split_first() else { return Ok(()) };
        for &t in events.t {
            check_time(t)?;
        }
        let mut latest = self.now.map_or(first, |now| now.max(first));
        let in_order = latest == first && rest.iter().is_sorted() && rest.first().is_none_or(|&t| t >= first);
        if in_order {
            self.hear(events)?;
        } else {
            let mut moved = events.t.to_vec();
            for t in &mut moved {
                self.late += u64::from(*t < latest);
                latest = latest.max(*t);
                *t = latest;
            }
            self.hear(EventsView { t: &moved, ..events })?;
        }
        self.settle(events.t[events.len() - 1].max(latest), out)
    }

    /// Takes the next picture, row by row, at `t` us; adds what is certain now to `out`.
    ///
    /// # Errors
    ///
    /// `Problem` where the picture has another size or comes out of order, the encoder reads events only, or the time is
    /// beyond 2^52 us.
    pub fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Detection>) -> Result<()> {
        check_time(t)?;
        self.zero_before(t);
        self.encoder.push_frame(t, values, &mut self.heard)?;
        self.settle(t, out)?;
        self.clock.picture(t);
        Ok(())
    }

    /// Moves time on to `t` us: nothing will come before it any more. An earlier time changes nothing.
    ///
    /// # Errors
    ///
    /// `Problem` where the time is beyond 2^52 us.
    pub fn advance(&mut self, t: i64, out: &mut Vec<Detection>) -> Result<()> {
        check_time(t)?;
        if self.now.is_none_or(|now| t > now) {
            self.zero_before(t);
            self.encoder.advance(t, &mut self.heard);
            self.settle(t, out)?;
        }
        Ok(())
    }

    /// From a time on, after all events up to then, a taxel rests at another value; where that time is over, from now on.
    ///
    /// # Errors
    ///
    /// `Problem` where no such taxel exists, the rest is no number, or the time is beyond 2^52 us.
    pub fn zero(&mut self, zeroing: &Zeroing) -> Result<()> {
        check_time(zeroing.t)?;
        zeroing.check(&self.array)?;
        let place = self.zeroings.partition_point(|earlier| earlier.t <= zeroing.t);
        self.zeroings.insert(place, *zeroing);
        Ok(())
    }

    /// What each taxel rests at, row by row; `None` where that is not known, or the encoder reads no tare.
    #[must_use]
    pub fn rest(&self) -> Vec<Option<f64>> {
        (0..self.array.len()).map(|place| self.encoder.rest(place)).collect()
    }

    /// How many events came later than others with a later time, or later than time was moved on.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Up to where everything has been said, us; `None` before anything came.
    #[must_use]
    pub fn now(&self) -> Option<i64> {
        self.now
    }

    /// Each neuron's label and potential now, mV.
    pub fn potentials(&self) -> impl Iterator<Item = (&str, f64)> {
        self.voices.iter().map(|v| (v.label.as_str(), v.stream.as_ref().map_or(0.0, NeuronStream::potential)))
    }

    /// Takes many events, and looks at `stop` now and then.
    ///
    /// # Errors
    ///
    /// As [`push_events`](Self::push_events); `Interrupted` where `stop` says so.
    pub fn push_recording(&mut self, events: EventsView<'_>, stop: Stop<'_>) -> Result<Vec<Detection>> {
        events.check()?;
        let mut out = Vec::new();
        for piece in events.pieces(PIECE) {
            stop.check()?;
            self.push_events(piece, &mut out)?;
        }
        Ok(out)
    }

    /// Takes many pictures, and looks at `stop` now and then.
    ///
    /// # Errors
    ///
    /// As [`push_frame`](Self::push_frame), and where they come from another array; `Interrupted` where `stop` says so.
    pub fn push_frames(&mut self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<Vec<Detection>> {
        self.check_shape(frames.array)?;
        frames.check()?;
        let mut out = Vec::new();
        for (k, (t, picture)) in frames.iter().enumerate() {
            if k % 256 == 0 {
                stop.check()?;
            }
            self.push_frame(t, picture, &mut out)?;
        }
        Ok(out)
    }

    /// Hands events on in order of time, and between them what is to be zeroed.
    fn hear(&mut self, events: EventsView<'_>) -> Result<()> {
        self.note_repaired(events);
        let mut from = 0;
        while let Some(zeroing) = self.zeroings.front() {
            let upto = events.t.partition_point(|&t| t <= zeroing.t);
            if upto == events.len() {
                break;
            }
            if upto > from {
                self.encoder.push_events(events.piece(from..upto), &mut self.heard)?;
                from = upto;
            }
            self.zero_before(events.t[upto]);
        }
        self.encoder.push_events(events.piece(from..events.len()), &mut self.heard)
    }

    /// Zeroes what is to be zeroed before `t` us.
    fn zero_before(&mut self, t: i64) {
        let over = self.zeroings.partition_point(|zeroing| zeroing.t < t);
        for zeroing in self.zeroings.drain(..over) {
            let at = self.now.map_or(zeroing.t, |now| now.max(zeroing.t));
            let place = self.array.index(zeroing.x, zeroing.y);
            self.encoder.set_rest(at, place, zeroing.rest, &mut self.heard);
        }
    }

    /// Moves the neurons on to `until` us, before which every spike is known.
    fn settle(&mut self, until: i64, out: &mut Vec<Detection>) -> Result<()> {
        self.now = Some(self.now.map_or(until, |now| now.max(until)));
        let until_ms = ms(until);
        self.take_in();
        // All spikes before `until` are said, so what lies too far behind it is forgotten.
        self.forget_repaired(until_ms);
        self.waiting.sort_by(|(a, _), (b, _)| a.t.total_cmp(&b.t).then(a.train.cmp(&b.train)));
        let certain = self.waiting.partition_point(|(spike, _)| spike.t < until_ms);
        let mut crossings: Vec<(OutputSpike, usize, bool)> = Vec::new();
        for (k, voice) in self.voices.iter_mut().enumerate() {
            for (spike, repaired) in &self.waiting[..certain] {
                voice.push(spike.t, spike.train)?;
                if *repaired {
                    // What the neuron said up to here cannot rest on it.
                    voice.say(k, &mut crossings);
                    voice.repaired = Some(spike.t);
                }
            }
            if let Some(stream) = &mut voice.stream {
                stream.advance(until_ms, &mut voice.crossings);
            }
            voice.say(k, &mut crossings);
        }
        self.waiting.drain(..certain);
        crossings.sort_by(|a, b| a.0.t.total_cmp(&b.0.t));
        out.extend(crossings.into_iter().map(|(OutputSpike { t, slope, .. }, k, repaired)| Detection {
            label: self.voices[k].label.clone(),
            t: us(t - self.voices[k].offset_ms).round() as i64,
            known: self.clock.end_of(t),
            slope,
            repaired,
        }));
        Ok(())
    }

    /// Remembers when taxels were repaired, where the encoder tells of it.
    fn note_repaired(&mut self, events: EventsView<'_>) {
        let Some(repaired) = events.repaired.filter(|_| self.encoder.hears_repaired_ms().is_some()) else { return };
        for (&t, _) in events.t.iter().zip(repaired).filter(|&(_, &repaired)| repaired) {
            if self.repaired.back() != Some(&t) {
                self.repaired.push_back(t);
            }
        }
    }

    /// Whether a spike of the encoder may tell of a repaired taxel. Spikes come in order of time.
    fn tells_of_repaired(&mut self, t: f64) -> bool {
        self.forget_repaired(t);
        self.repaired.front().is_some_and(|&at| ms(at) <= t)
    }

    /// Forgets what no spike at `t` ms or later can tell of any more.
    fn forget_repaired(&mut self, t: f64) {
        let within = self.encoder.hears_repaired_ms().unwrap_or(0.0);
        // Half a us for what a sum of ms loses.
        while self.repaired.front().is_some_and(|&at| ms(at) + within + 5e-4 < t) {
            self.repaired.pop_front();
        }
    }

    /// Sorts what the encoder said to the neurons' inputs.
    ///
    /// Trains come as the learner saw them: of signed ones all ON, then all OFF (`SpikeTrains::split_by_sign`), and all of
    /// these once a delay.
    fn take_in(&mut self) {
        let trains = u32::try_from(self.encoder.trains()).unwrap_or(u32::MAX);
        let signed = self.encoder.signed();
        let inputs = if signed { 2 * trains } else { trains };
        for spike in std::mem::take(&mut self.heard) {
            let repaired = self.tells_of_repaired(spike.t);
            let input = if signed && spike.value <= 0.0 { trains + spike.train } else { spike.train };
            for (copy, delay) in (0_u32..).zip(&self.delays_ms) {
                let delayed = Spike { t: spike.t + delay, train: copy * inputs + input, ..spike };
                self.waiting.push((delayed, repaired));
            }
        }
    }

    fn check_shape(&self, other: &Array) -> Result<()> {
        let (mine, theirs) = ((self.array.rows, self.array.columns), (other.rows, other.columns));
        if mine != theirs {
            return Err(problem!(
                "input from {} x {} taxels: this readout listens to {} x {}",
                theirs.0,
                theirs.1,
                mine.0,
                mine.1
            ));
        }
        Ok(())
    }
}

impl Voice {
    fn push(&mut self, t: f64, input: u32) -> Result<()> {
        let stream = match &mut self.stream {
            Some(stream) => stream,
            None => {
                let start = match self.neuron.time {
                    crate::neuron::Time::Continuous => t,
                    crate::neuron::Time::Grid => (t / self.neuron.step_ms).floor() * self.neuron.step_ms,
                };
                self.stream.insert(self.neuron.stream(&self.weights, self.threshold, start.min(t))?)
            }
        };
        stream.push(t, input, &mut self.crossings)
    }

    /// Hands its crossings on, each with whether it may rest on repaired taxels.
    fn say(&mut self, k: usize, out: &mut Vec<(OutputSpike, usize, bool)>) {
        let repaired = self.repaired;
        let rests = |t: f64| repaired.is_some_and(|at| at <= t && t - at <= self.neuron.memory_ms());
        out.extend(self.crossings.drain(..).map(|crossing| (crossing, k, rests(crossing.t))));
    }
}

fn check_time(t: i64) -> Result<()> {
    if (-FARTHEST_US..=FARTHEST_US).contains(&t) {
        Ok(())
    } else {
        Err(problem!("time {t} us: must lie within 2^52 us, {FARTHEST_US}, of 0"))
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::neuron::{AfterSpike, Time};
    use crate::{Events, Intensities};

    /// Says each event as a signed spike of its taxel's train at its stamp; a picture as a spike of each loaded taxel.
    #[derive(Clone)]
    struct Plain {
        latency_ms: f64,
    }

    impl Stream for Plain {
        fn fork(&self) -> Box<dyn Stream> {
            Box::new(self.clone())
        }
        fn late(&self) -> u64 {
            0
        }
        fn trains(&self) -> usize {
            4
        }
        fn signed(&self) -> bool {
            true
        }
        fn latency_ms(&self) -> f64 {
            self.latency_ms
        }
        fn push_events(&mut self, events: EventsView<'_>, out: &mut Vec<Spike>) -> Result<()> {
            for k in 0..events.len() {
                let train = events.array.index(events.x[k], events.y[k]) as u32;
                out.push(Spike { t: ms(events.t[k]), train, value: if events.p[k] { 1.0 } else { -1.0 } });
            }
            Ok(())
        }
        fn push_frame(&mut self, t: i64, values: &[f32], out: &mut Vec<Spike>) -> Result<()> {
            let loaded = values.iter().enumerate().filter(|(_, v)| **v > 0.0);
            out.extend(loaded.map(|(k, _)| Spike { t: ms(t), train: k as u32, value: 1.0 }));
            Ok(())
        }
        fn advance(&mut self, _t: i64, _out: &mut Vec<Spike>) {}
        fn finish(&mut self, _out: &mut Vec<Spike>) -> Option<f64> {
            None
        }
    }

    fn array() -> Array {
        Array::new(2, 2, 1.0, "small").unwrap()
    }

    fn stream(neuron: &Neuron, latency_ms: f64, period_us: f64) -> ReadoutStream {
        let on = vec![0.9, 0.5, 0.0, 0.2, -0.6, 0.0, 0.1, -0.3];
        let off = vec![-0.4, 0.0, -0.2, 0.0, 0.8, 0.6, 0.4, 0.3];
        let neurons = [("contact", on, 0.2), ("lift", off, 0.5)];
        ReadoutStream::new(
            Box::new(Plain { latency_ms }),
            array(),
            FrameClock::new(period_us).unwrap(),
            0.9,
            vec![0.0],
            neurons.into_iter().map(|(label, weights, delay_ms)| {
                (label.to_owned(), TrainedNeuron { neuron: neuron.clone(), weights, delay_ms })
            }),
        )
    }

    /// Events with the stamps of 192 us frames, some frames full of them, some silences long.
    fn events(seed: u64, n: usize) -> Events {
        let mut random = StdRng::seed_from_u64(seed);
        let mut events = Events::empty(array());
        events.intensity = Some(Intensities::default());
        let mut frame = random.random_range(0..1000_i64);
        for _ in 0..n {
            frame += [0, 0, 0, 1, 2, 30][random.random_range(0..6)];
            events.t.push(192 * frame / 100 * 100);
            events.x.push(random.random_range(0..2));
            events.y.push(random.random_range(0..2));
            events.p.push(random.random());
            let intensity = events.intensity.as_mut().unwrap();
            intensity.ticks.push(5);
            intensity.present.push(true);
        }
        events
    }

    fn neurons() -> Vec<Neuron> {
        let mut all = Vec::new();
        for time in [Time::Continuous, Time::Grid] {
            for after_spike in [AfterSpike::Keep, AfterSpike::Ignore, AfterSpike::Reset] {
                all.push(Neuron { tau: 2.0, refractory: 4.0, time, after_spike, step_ms: 0.192, ..Neuron::default() });
            }
        }
        all
    }

    fn run(mut stream: ReadoutStream, events: &Events, end: i64) -> Vec<Detection> {
        let mut found = stream.push_recording(events.view(), Stop::never()).unwrap();
        stream.advance(end, &mut found).unwrap();
        found
    }

    #[test]
    fn pieces_and_moves_of_time_change_nothing() {
        for (seed, neuron) in neurons().into_iter().cycle().take(60).enumerate() {
            let events = events(seed as u64, 400);
            let end = events.t[399] + 100_000;
            let whole = run(stream(&neuron, 0.0, 192.0), &events, end);
            assert!(whole.len() > 10, "something must be said to compare");

            let mut random = StdRng::seed_from_u64(1000 + seed as u64);
            let (mut pieces, mut from) = (Vec::new(), 0);
            let mut live = stream(&neuron, 0.0, 192.0);
            if random.random() {
                live.advance(events.t[0] - 500, &mut pieces).unwrap();
            }
            while from < 400 {
                let to = (from + random.random_range(0..40)).min(400);
                live.push_events(events.view().piece(from..to), &mut pieces).unwrap();
                from = to;
                // Time may move on up to the next event, itself excluded, but no farther.
                let last = live.now().unwrap_or(events.t[0]);
                let next = events.t.get(to).copied().unwrap_or(end);
                for _ in 0..random.random_range(0..3) {
                    live.advance(random.random_range(last..=next), &mut pieces).unwrap();
                }
            }
            live.advance(end, &mut pieces).unwrap();
            assert_eq!(pieces, whole, "seed {seed}");
            assert_eq!(live.late(), 0);
        }
    }

    #[test]
    fn known_is_the_end_of_a_frame_that_the_crossing_lies_in() {
        for (seed, neuron) in neurons().iter().enumerate() {
            let events = events(seed as u64, 2000);
            let end = events.t[1999] + 100_000;
            let found = run(stream(neuron, 1.25, 192.0), &events, end);
            for d in found {
                let offset_us = if d.label == "contact" { 1450 } else { 1750 };
                let crossing = d.t + offset_us;
                assert_eq!(d.known % 192, 0);
                assert!(crossing <= d.known && d.known <= crossing + 292, "{d:?}");
            }
        }
    }

    #[test]
    fn time_and_latency_are_taken_off_the_crossing_but_not_off_known() {
        let neuron = Neuron { tau: 2.0, ..Neuron::default() };
        let events = events(5, 300);
        let end = events.t[299] + 100_000;
        let plain = run(stream(&neuron, 0.0, 192.0), &events, end);
        let later = run(stream(&neuron, 7.5, 192.0), &events, end);
        assert_eq!(plain.len(), later.len());
        for (a, b) in plain.iter().zip(&later) {
            assert_eq!((a.t - 7500, a.known, a.slope), (b.t, b.known, b.slope));
        }
    }

    #[test]
    fn silence_is_told_by_moving_time_on() {
        let neuron = Neuron { tau: 2.0, ..Neuron::default() };
        let mut one = events(0, 1);
        (one.x[0], one.y[0], one.p[0]) = (0, 0, true);
        let (mut live, mut out) = (stream(&neuron, 0.0, 192.0), Vec::new());
        live.push_events(one.view(), &mut out).unwrap();
        assert_eq!(out, [], "the crossing lies ahead, and something could still come before it");
        live.advance(one.t[0] + 10 * 192, &mut out).unwrap();
        assert_eq!((out.len(), out[0].label.as_str()), (1, "contact"));
        assert!(out[0].slope > 0.0);
    }

    #[test]
    fn a_late_event_counts_as_coming_now() {
        let neuron = Neuron { tau: 2.0, ..Neuron::default() };
        let mut late = events(9, 50);
        let end = late.t[49] + 100_000;
        let moved = {
            let mut e = late.clone();
            e.t[20] = e.t[19];
            e
        };
        late.t[20] = late.t[0] - 300;
        let (mut a, mut b) = (stream(&neuron, 0.0, 192.0), stream(&neuron, 0.0, 192.0));
        let (mut said_a, mut said_b) = (Vec::new(), Vec::new());
        a.push_events(late.view(), &mut said_a).unwrap();
        b.push_events(moved.view(), &mut said_b).unwrap();
        a.advance(end, &mut said_a).unwrap();
        b.advance(end, &mut said_b).unwrap();
        assert_eq!(said_a, said_b);
        assert_eq!((a.late(), b.late()), (1, 0));
    }

    #[test]
    fn pictures_are_known_at_the_end_of_their_own_frames() {
        let neuron = Neuron { tau: 2.0, ..Neuron::default() };
        let (mut t, mut values) = (vec![], vec![]);
        for k in 0..200 {
            t.push(7 + 2000 * k);
            values.extend([f32::from(u8::from(k % 40 == 3)), 0.0, 0.0, 0.0]);
        }
        let mut live = stream(&neuron, 0.0, 2000.0);
        let mut found =
            live.push_frames(FramesView { array: &array(), t: &t, values: &values }, Stop::never()).unwrap();
        live.advance(500_000, &mut found).unwrap();
        assert_eq!(found.len(), 5);
        for (d, k) in found.iter().zip([3, 43, 83, 123, 163]) {
            assert_eq!((d.label.as_str(), d.known), ("contact", 7 + 2000 * (k + 1)));
            assert!((7 + 2000 * k..7 + 2000 * (k + 1)).contains(&(d.t + 200)));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let neuron = Neuron::default();
        let other = Events::empty(Array::new(3, 2, 1.0, "other").unwrap());
        let mut live = stream(&neuron, 0.0, 192.0);
        let mut out = Vec::new();
        let said = live.push_events(other.view(), &mut out).unwrap_err().to_string();
        assert_eq!(said, "input from 3 x 2 taxels: this readout listens to 2 x 2");
        assert!(live.advance(i64::MAX, &mut out).is_err());
        assert!(live.push_frame(i64::MIN, &[0.0; 4], &mut out).is_err());
        let mut far = events(1, 1);
        far.t[0] = 1 << 60;
        assert!(live.push_events(far.view(), &mut out).is_err());
    }
}
