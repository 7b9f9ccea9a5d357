//! Whether the values of a source of frames fall under touch, so that no pressure is shown: the live form of what
//! `taxel info` says of a recording.

use taxel_core::rest::{TrackedRest, Value};

/// Values that fall go so many times as far below their rest as others go above it.
const FALLS: f64 = 3.0;

/// What is no noise is so many times that of the median taxel; a touch is so many times more.
const NOISE: f64 = 6.0;
const TOUCH: f64 = 4.0;

/// Of so many taxels the third largest move counts, of fewer the largest.
const MANY: usize = 9;
const THIRD: usize = 3;

/// Compares how far values go below the rest of the first quiet stretch with how far they go above it.
#[derive(Debug)]
pub(super) struct FallingValues {
    columns: usize,
    noise: f64,
    /// The frames before the noise is known.
    waiting: Vec<(i64, Vec<f32>)>,
    rest: Option<TrackedRest>,
    taxels: Vec<TaxelMoves>,
    frames: u64,
}

/// How far a taxel has gone from its rest.
#[derive(Debug, Clone, Copy)]
struct TaxelMoves {
    rest: f64,
    least: f64,
    greatest: f64,
    /// The greatest value since the least one.
    back: f64,
    /// Number of frames in which it was below its rest.
    below: u64,
}

impl FallingValues {
    pub(super) fn new(columns: usize) -> Self {
        Self { columns, noise: 0.0, waiting: vec![], rest: None, taxels: vec![], frames: 0 }
    }

    /// Takes a frame of values at `t` us; their noise is known after the first ones.
    pub(super) fn take(&mut self, t: i64, values: &[f32], noise: Option<f64>) {
        let Some(noise) = noise else {
            self.waiting.push((t, values.to_vec()));
            return;
        };
        for (t, values) in std::mem::take(&mut self.waiting) {
            self.compare(t, &values, noise);
        }
        self.compare(t, values, noise);
    }

    fn compare(&mut self, t: i64, values: &[f32], noise: f64) {
        if self.taxels.is_empty() {
            self.find_rest(t, values, noise);
            return;
        }
        self.frames += 1;
        let far = NOISE * self.noise;
        for (moves, value) in self.taxels.iter_mut().zip(values.iter().map(|&value| f64::from(value))) {
            if value < moves.least {
                (moves.least, moves.back) = (value, value);
            }
            // Missing values compare as false.
            moves.back = moves.back.max(value);
            moves.greatest = moves.greatest.max(value);
            moves.below += u64::from(value < moves.rest - far);
        }
    }

    fn find_rest(&mut self, t: i64, values: &[f32], noise: f64) {
        let noise = noise.max(f64::from(f32::EPSILON));
        let rest = self
            .rest
            .get_or_insert_with(|| TrackedRest::new(self.columns, NOISE * noise, vec![f64::NO_REST; values.len()]));
        rest.take(t, values.iter().copied());
        if rest.quiet().is_some() {
            let moves = |&rest: &f64| TaxelMoves { rest, least: rest, greatest: rest, back: rest, below: 0 };
            let known = |&rest: &f64| if rest == f64::NO_REST { f64::NAN } else { rest };
            self.taxels = rest.begins().iter().map(|rest| moves(&known(rest))).collect();
            (self.noise, self.rest) = (noise, None);
        }
    }

    /// Whether values went further below their rest than above it, and came back. A taxel that is below it for a third of
    /// the time or more was loaded while the rest was found.
    pub(super) fn are_found(&self) -> bool {
        let fall = |moves: &TaxelMoves| {
            let down = moves.rest - moves.least;
            if moves.back < moves.rest - down / FALLS || 3 * moves.below > self.frames { 0.0 } else { down }
        };
        let rank = if self.taxels.len() >= MANY { THIRD } else { 1 };
        let ranked = |far: &dyn Fn(&TaxelMoves) -> f64| {
            let mut moves: Vec<f64> = self.taxels.iter().map(far).filter(|far| !far.is_nan()).collect();
            moves.sort_by(|a, b| b.total_cmp(a));
            moves.get(rank - 1).copied().unwrap_or(0.0)
        };
        ranked(&fall) > (FALLS * ranked(&|moves| moves.greatest - moves.rest)).max(TOUCH * NOISE * self.noise)
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// Whether values fall that rest for a second, and of which a patch is then pressed by so much, again and again.
    fn fall(seed: u64, by: f64, is_pressed: impl Fn(u32) -> bool) -> bool {
        let (mut random, mut falling) = (StdRng::seed_from_u64(seed), FallingValues::new(8));
        for k in 0..800_u32 {
            let value = |taxel: usize| {
                let press = if is_pressed(k) && [9, 10, 17, 18].contains(&taxel) { by } else { 0.0 };
                (600.0 + press + random.random_range(-1.7..1.7)) as f32
            };
            let values: Vec<f32> = (0..64).map(value).collect();
            falling.take(i64::from(k) * 10_000, &values, (k >= 32).then_some(1.0));
        }
        falling.are_found()
    }

    #[test]
    fn values_that_fall_under_touch_are_found_and_those_that_rise_or_were_loaded_at_first_are_not() {
        for seed in 0..20 {
            let touches = |k: u32| k > 150 && k % 100 < 30;
            assert!(fall(seed, -150.0, touches), "seed {seed}");
            assert!(!fall(seed, 150.0, touches), "seed {seed}");
            assert!(!fall(seed, 0.0, touches), "seed {seed}");
            // Something lay there at first, was taken away, and is put back now and then.
            assert!(!fall(seed, 150.0, |k| k < 150 || k % 100 < 30), "seed {seed}");
        }
    }
}
