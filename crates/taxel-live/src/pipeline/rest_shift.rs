//! Whether the taxels of a source of frames rest elsewhere after a gap than their tare has it, as those of a sensor do that
//! was unplugged.

use super::recent_frames::RecentFrames;

/// A gap lasts so long, ns, and so many frames.
const GAP_NS: i64 = 1_000_000_000;
const GAP_FRAMES: f64 = 3.0;

/// Of so many times its noise a taxel has left its rest, where the readout has no noise floor.
const NOISE: f64 = 6.0;

/// One in so many taxels must have left it: what lies on a sensor covers fewer.
const PART: usize = 4;

/// Looks at the frames after a gap until the taxels hold still.
#[derive(Debug, Default)]
pub(super) struct RestShift {
    gap_ns: i64,
    /// The noise floor of the readout, in the unit of the values; 0 if it has none.
    noise_floor: f64,
    last_ns: Option<i64>,
    longest_ns: i64,
    /// Whether the taxels were not still since a gap.
    is_waiting: bool,
    /// The frames since a gap.
    recent: RecentFrames,
    still: Option<StillTaxels>,
}

/// Taxels that hold still after a gap.
#[derive(Debug, Clone)]
struct StillTaxels {
    values: Vec<f64>,
    floor: f64,
}

impl RestShift {
    pub(super) fn new(noise_floor: f64, frame_us: f64) -> Self {
        #[allow(clippy::cast_possible_truncation)]
        let gap_ns = GAP_NS.max((GAP_FRAMES * 1000.0 * frame_us) as i64);
        Self { gap_ns, noise_floor, ..Self::default() }
    }

    /// Takes a frame that arrived at `at_ns`, whose values have this noise; returns whether the taxels hold still for the
    /// first time after a gap.
    pub(super) fn take(&mut self, at_ns: i64, values: &[f32], noise: Option<f64>) -> bool {
        let silent_ns = self.last_ns.replace(at_ns).map_or(0, |last| at_ns - last);
        if silent_ns >= self.gap_ns {
            self.longest_ns = self.longest_ns.max(silent_ns);
            self.recent.clear();
            self.is_waiting = true;
        }
        let is_kept = self.recent.take(at_ns, values);
        let (true, Some(noise)) = (is_kept && self.is_waiting && self.recent.is_full(), noise) else { return false };
        let floor = if self.noise_floor > 0.0 { self.noise_floor } else { NOISE * noise };
        if (0..values.len()).any(|taxel| self.recent.range(taxel) > 2.0 * floor) {
            return false;
        }
        self.is_waiting = false;
        let middles = (0..values.len()).map(|taxel| self.recent.middle(taxel).unwrap_or(f64::NAN)).collect();
        self.still = Some(StillTaxels { values: middles, floor });
        true
    }

    /// The rest of a taxel that nothing touches now: the median of its last second; none without a value.
    pub(super) fn rest_now(&self, taxel: usize) -> Option<f64> {
        self.recent.middle(taxel)
    }

    /// What is wrong, if a part of the taxels that hold still lies elsewhere than their rest, in this unit.
    pub(super) fn found(&self, rest: &[Option<f64>], unit: &str) -> Option<String> {
        let StillTaxels { values, floor } = self.still.as_ref()?;
        let shifts = values.iter().zip(rest).filter_map(|(value, rest)| Some((value - (*rest)?).abs()));
        let shifted: Vec<f64> = shifts.filter(|shift| shift > floor).collect();
        if PART * shifted.len() <= values.len() {
            return None;
        }
        let farthest = (shifted.iter().copied().fold(0.0, f64::max) * 1e3).round() / 1e3;
        #[allow(clippy::cast_precision_loss)]
        let gap_s = self.longest_ns as f64 / 1e9;
        Some(format!(
            "after a gap of {gap_s:.1} s, the rest of {} of {} taxels differs from the tare by up to {farthest} \
             {unit}, so taxel misses presses: remove everything from the sensor, then click Zero all on the page, or \
             start again with --tare SECONDS",
            shifted.len(),
            values.len()
        ))
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    const TAXELS: usize = 144;
    const REST: f64 = 500.0;

    /// What is told of taxels that rest, are silent for a while, and then rest this much elsewhere.
    fn told(shift: impl Fn(usize) -> f64, gap_s: f64, noise_floor: f64) -> Option<String> {
        let (mut random, mut watch) = (StdRng::seed_from_u64(3), RestShift::new(noise_floor, 1e4));
        let mut found = None;
        for k in 0..400_u32 {
            let at_s = f64::from(k) * 0.01 + if k < 100 { 0.0 } else { gap_s };
            let moved = |taxel: usize| if k < 100 { 0.0 } else { shift(taxel) };
            let values: Vec<f32> =
                (0..TAXELS).map(|taxel| (REST + moved(taxel) + random.random_range(-1.7..1.7)) as f32).collect();
            if watch.take((at_s * 1e9) as i64, &values, Some(1.0)) {
                assert!(found.is_none(), "reported twice");
                found = Some(watch.found(&[Some(REST); TAXELS], "counts"));
            }
        }
        found.flatten()
    }

    #[test]
    fn a_rest_that_shifted_in_a_gap_is_reported_with_how_many_taxels_and_how_far() {
        for noise_floor in [10.0, 0.0] {
            let line = told(|taxel| if taxel < 76 { 32.0 - 64.0 * (taxel % 2) as f64 } else { 0.0 }, 2.4, noise_floor);
            let line = line.expect("a line");
            assert!(
                line.starts_with("after a gap of 2.4 s, the rest of 76 of 144 taxels differs from the tare by up to 3"),
                "{line}"
            );
            assert!(line.contains("start again with --tare SECONDS"), "{line}");
        }
    }

    #[test]
    fn nothing_is_told_without_a_gap_or_a_shift_or_of_a_press() {
        assert_eq!(told(|_| 32.0, 0.5, 10.0), None);
        assert_eq!(told(|_| 0.0, 2.4, 10.0), None);
        assert_eq!(told(|taxel| if taxel < 9 { 200.0 } else { 0.0 }, 2.4, 10.0), None);
    }

    #[test]
    fn values_that_do_not_hold_still_are_those_of_a_press() {
        let (mut random, mut watch) = (StdRng::seed_from_u64(3), RestShift::new(10.0, 1e4));
        for k in 0..300_i64 {
            let values: Vec<f32> = (0..TAXELS).map(|_| 500.0 + random.random_range(0.0..99.0)).collect();
            assert!(!watch.take(k * 10_000_000 + if k > 0 { 2_000_000_000 } else { 0 }, &values, Some(1.0)));
        }
    }

    #[test]
    fn a_taxel_that_is_zeroed_is_compared_with_its_new_rest() {
        let mut watch = RestShift::new(10.0, 1e4);
        for k in 0..200_i64 {
            watch.take(k * 10_000_000 + if k > 0 { 2_000_000_000 } else { 0 }, &[532.0; TAXELS], Some(1.0));
        }
        assert!(watch.found(&[Some(500.0); TAXELS], "counts").is_some());
        assert_eq!(watch.found(&[Some(532.0); TAXELS], "counts"), None);
        assert_eq!(watch.found(&[], "counts"), None);
    }
}
