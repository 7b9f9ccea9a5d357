use super::program::PrimalDualPoint;
use super::*;
use crate::learn::engines::nearest;
use crate::learn::statement::{Norm, relative_gap};
use crate::vectors::dot;
use rand::{Rng, SeedableRng, rngs::StdRng};

/// The approximate size of the largest weight.
const SIZE: f64 = 0.3;

/// A problem that owns its rows; `dense` keeps what [`Terms`] and [`HardRows`] borrow.
#[derive(Clone, Default)]
struct Problem {
    l1: f64,
    l2: f64,
    norm: Norm,
    lift: f64,
    behind: Vec<f64>,
    wanted: Vec<f64>,
    equal: Vec<f64>,
    equal_to: Vec<f64>,
    below: Vec<f64>,
    limit: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Problem {
    /// Alpha-kernel rows of random patterns: targets to reach, and silence before them.
    fn drawn(n: usize, targets: usize, silent: usize, random: &mut StdRng) -> Self {
        let mut out = Self { lower: vec![-0.3; n], upper: vec![0.3; n], ..Self::default() };
        let patterns: Vec<Vec<f64>> =
            (0..targets).map(|_| (0..n).map(|_| random.random_range(0.0..200.0)).collect()).collect();
        for spikes in &patterns {
            let t = random.random_range(50.0..150.0);
            out.equal.extend(alpha(spikes, t));
            out.equal_to.push(0.3);
            out.behind.extend(alpha(spikes, t + 1.5));
            out.wanted.push(0.36);
            for _ in 0..silent {
                out.below.extend(alpha(spikes, t - random.random_range(1.0..60.0)));
                out.limit.push(0.3);
            }
        }
        let largest = out.behind.chunks(n).map(|r| (0.3 * r.iter().sum::<f64>() + 0.36).powi(2)).sum::<f64>();
        out.l1 = 0.01 / (0.3 * n as f64);
        out.l2 = 0.01 / (0.3 * (n as f64).sqrt());
        out.lift = 0.98 / largest;
        out
    }

    fn with(mut self, l1: f64, l2: f64, lift: f64) -> Self {
        self.l1 *= l1;
        self.l2 *= l2;
        self.lift *= lift;
        self
    }

    fn bounds(&self) -> Bounds {
        Bounds { lower: self.lower.clone(), upper: self.upper.clone() }
    }

    fn program(&self) -> Program {
        Program::new(&self.terms(), &self.rows(), &self.bounds(), SIZE)
    }

    fn terms(&self) -> Terms<'_> {
        let Self { l1, l2, norm, lift, behind, wanted, .. } = self;
        Terms { l1: *l1, l2: *l2, norm: *norm, lift: *lift, behind, wanted }
    }

    fn rows(&self) -> HardRows<'_> {
        HardRows { equal: &self.equal, equal_to: &self.equal_to, below: &self.below, limit: &self.limit }
    }

    fn solve(&self) -> MixedMinimum {
        self.go_on(None, 1e-8)
    }

    fn go_on(&self, start: Option<&ResumeState>, tolerance: f64) -> MixedMinimum {
        minimise(&self.terms(), &self.rows(), &self.bounds(), SIZE, start, tolerance, Stop::never()).unwrap()
    }

    fn objective(&self, w: &[f64]) -> f64 {
        let square = dot(w, w);
        let behind = self.behind.chunks(w.len()).zip(&self.wanted);
        self.l1 * w.iter().map(|w| w.abs()).sum::<f64>()
            + self.l2 * if self.norm == Norm::Square { square } else { square.sqrt() }
            + self.lift * behind.map(|(row, m)| (dot(row, w) - m).powi(2)).sum::<f64>()
    }

    fn gap(&self, found: &MixedMinimum) -> f64 {
        relative_gap(self.objective(&found.weights), found.bound)
    }

    /// The objective by Clarabel on the same rows, which we do not scale.
    fn oracle(&self) -> f64 {
        let program = self.program();
        let point = program.clarabel(Stop::never()).unwrap();
        program.objective(&point.weights) * program.cost
    }

    fn assert_exact(&self, found: &MixedMinimum) {
        for (row, value) in self.equal.chunks(self.lower.len()).zip(&self.equal_to) {
            assert!((dot(row, &found.weights) - value).abs() <= 1e-12, "a target is missed");
        }
        for (row, limit) in self.below.chunks(self.lower.len()).zip(&self.limit) {
            assert!(dot(row, &found.weights) - limit <= 1e-13, "silence is broken");
        }
        let bounds = self.lower.iter().zip(&self.upper);
        assert!(found.weights.iter().zip(bounds).all(|(w, (l, u))| (*l..=*u).contains(w)), "a bound is crossed");
        assert!(found.inequality.iter().all(|z| *z >= 0.0), "a multiplier is below 0");
        assert!(found.bound <= self.objective(&found.weights), "the bound is above");
    }

    fn assert_best(&self, found: &MixedMinimum) {
        self.assert_exact(found);
        assert!(self.gap(found) <= 1e-8, "gap {:e}", self.gap(found));
        let (objective, oracle) = (self.objective(&found.weights), self.oracle());
        assert!((objective - oracle).abs() <= 1e-7 * oracle, "{objective} is not {oracle}");
    }
}

fn alpha(spikes: &[f64], t: f64) -> Vec<f64> {
    let value = |s: f64| if s < t { (t - s) / 15.0 * (1.0 - (t - s) / 15.0).exp() } else { 0.0 };
    spikes.iter().map(|&s| value(s)).collect()
}

const MIXES: [(f64, f64, f64); 7] = [
    (1.0, 1.0, 1.0),
    (1.0, 0.0, 0.0),
    (0.0, 1.0, 0.0),
    (1.0, 4.0, 0.0),
    (4.0, 1.0, 0.0),
    (0.0, 1.0, 1.0),
    (1.0, 0.0, 100.0),
];

#[test]
fn every_mix_of_terms_comes_out_as_from_clarabel() {
    let mut random = StdRng::seed_from_u64(1);
    for (k, (l1, l2, lift)) in MIXES.into_iter().enumerate() {
        for norm in [Norm::Norm, Norm::Square] {
            let mut problem = Problem::drawn(40 + 20 * (k % 3), 6, 8, &mut random).with(l1, l2, lift);
            problem.norm = norm;
            let found = problem.solve();
            assert_eq!(found.engine, Engine::Native, "{l1} {l2} {lift} {norm:?}");
            problem.assert_best(&found);
        }
    }
}

#[test]
fn bounds_may_differ_by_weight_lie_on_one_side_or_leave_no_room() {
    let mut random = StdRng::seed_from_u64(2);
    for (l1, l2, lift) in MIXES {
        let mut problem = Problem::drawn(60, 5, 6, &mut random).with(l1, l2, lift);
        for k in 0..60 {
            let (lower, upper) = match k % 5 {
                0 => (0.0, 0.1),
                1 => (-0.1, 0.3),
                2 => (0.01, 0.2),
                3 => (-0.05, -0.001),
                _ => (0.02, 0.02),
            };
            (problem.lower[k], problem.upper[k]) = (lower, upper);
        }
        problem.assert_best(&problem.solve());
    }
}

#[test]
fn tight_bounds_bind() {
    let mut random = StdRng::seed_from_u64(3);
    for (l1, l2, lift) in MIXES {
        let mut problem = Problem::drawn(80, 4, 6, &mut random).with(l1, l2, lift);
        problem.lower.fill(-0.03);
        problem.upper.fill(0.035);
        let found = problem.solve();
        problem.assert_best(&found);
        if lift == 0.0 && l2 == 0.0 {
            assert!(found.weights.contains(&0.035), "no bound binds");
        }
    }
}

#[test]
fn zeros_of_l1_are_exact() {
    let mut random = StdRng::seed_from_u64(4);
    let found = Problem::drawn(100, 3, 10, &mut random).with(1.0, 0.0, 0.0).solve();
    assert!(found.weights.iter().filter(|w| **w == 0.0).count() > 80);
}

#[test]
fn b_alone_has_many_minima_and_one_least_value() {
    let mut random = StdRng::seed_from_u64(5);
    for _ in 0..3 {
        let mut problem = Problem::drawn(50, 5, 12, &mut random).with(0.0, 0.0, 1.0);
        problem.wanted.fill(0.9);
        problem.lower.fill(-0.15);
        problem.upper.fill(0.15);
        let found = problem.solve();
        problem.assert_exact(&found);
        let objective = problem.objective(&found.weights);
        assert!(objective <= problem.oracle() * (1.0 + 1e-7) + 1e-12);
        assert!(problem.gap(&found) <= 1e-8 || objective < 1e-10 * problem.objective(&[0.0; 50]), "{objective}");
    }
}

#[test]
fn rows_said_twice_or_almost_twice_do_no_harm() {
    let mut random = StdRng::seed_from_u64(6);
    for (l1, l2, lift) in MIXES {
        let plain = Problem::drawn(60, 5, 6, &mut random).with(l1, l2, lift);
        let mut doubled = plain.clone();
        doubled.equal.extend_from_slice(&plain.equal[..120]);
        doubled.equal_to.extend_from_slice(&plain.equal_to[..2]);
        doubled.below.extend_from_slice(&plain.below);
        doubled.limit.extend_from_slice(&plain.limit);
        for (row, limit) in plain.below.chunks(60).zip(&plain.limit) {
            doubled.below.extend(row.iter().map(|v| v * (1.0 + 1e-8 * random.random::<f64>())));
            doubled.limit.push(limit + 1e-9);
        }
        let (a, b) = (plain.solve(), doubled.solve());
        doubled.assert_exact(&b);
        assert!(doubled.gap(&b) <= 1e-8, "gap {:e}", doubled.gap(&b));
        let (a, b) = (plain.objective(&a.weights), plain.objective(&b.weights));
        assert!((a - b).abs() <= 1e-6 * a, "{a} is not {b}");
    }
}

#[test]
fn without_targets_the_best_weights_are_none() {
    let mut random = StdRng::seed_from_u64(7);
    for (l1, l2, _) in MIXES {
        let mut problem = Problem::drawn(30, 2, 10, &mut random).with(l1, l2, 0.0);
        problem.equal.clear();
        problem.equal_to.clear();
        let found = problem.solve();
        problem.assert_exact(&found);
        assert!(problem.objective(&found.weights) < 1e-12);
        assert!(found.bound >= 0.0);
    }
}

#[test]
fn the_bound_holds_for_any_multipliers() {
    let mut random = StdRng::seed_from_u64(8);
    for (l1, l2, lift) in MIXES {
        for norm in [Norm::Norm, Norm::Square] {
            let mut problem = Problem::drawn(30, 3, 6, &mut random).with(l1, l2, lift);
            problem.norm = norm;
            let found = problem.solve();
            let program = problem.program();
            let mut best = f64::NEG_INFINITY;
            let (exact, _) = found.start.exact.as_ref().unwrap();
            let objective = problem.objective(&found.weights);
            for size in [0.0, 0.01, 0.1, 1.0] {
                let mut near = |v: &[f64]| v.iter().map(|x| x + size * (random.random::<f64>() - 0.5)).collect();
                let point = PrimalDualPoint {
                    weights: near(&exact.weights),
                    equality: near(&exact.equality),
                    inequality: near(&exact.inequality),
                    pull: near(&exact.pull),
                };
                let bound = program.bound(&point) * program.cost;
                assert!(bound <= objective, "{bound} is above {objective}");
                best = best.max(bound);
            }
            assert!(best >= objective * (1.0 - 1e-8), "no bound comes near");
        }
    }
}

#[test]
fn rows_may_come_and_go_between_calls() {
    let mut random = StdRng::seed_from_u64(9);
    for (l1, l2, lift) in MIXES {
        let whole = Problem::drawn(60, 6, 10, &mut random).with(l1, l2, lift);
        let mut part = whole.clone();
        part.below.truncate(60 * 20);
        part.limit.truncate(20);
        let mut start = part.go_on(None, 1e-2).start;
        let keep: Vec<bool> = (0..20).map(|i| i % 2 == 0).collect();
        start.retain(&keep);
        let mut next = part.clone();
        next.below = part.below.chunks(60).zip(&keep).filter(|(_, k)| **k).flat_map(|(row, _)| row.to_vec()).collect();
        next.limit.truncate(10);
        let dropped = part.below.chunks(60).zip(&keep).filter(|(_, k)| !**k).flat_map(|(row, _)| row.to_vec());
        next.below.extend(dropped);
        next.below.extend_from_slice(&whole.below[60 * 20..]);
        next.limit.clone_from(&whole.limit);
        let warm = next.go_on(Some(&start), 1e-8);
        next.assert_best(&warm);
    }
}

/// Covers the last resort, which hardly any problem needs.
#[test]
fn from_what_clarabel_finds_the_same_objective_is_reached() {
    let mut random = StdRng::seed_from_u64(13);
    for (l1, l2, lift) in MIXES {
        let problem = Problem::drawn(30, 3, 6, &mut random).with(l1, l2, lift);
        let program = problem.program();
        let point = program.clarabel(Stop::never()).unwrap();
        let mut best = BestPoint::new(&program);
        best.improve(&point, program.guess(&point), 1e-8, Stop::never()).unwrap();
        assert!(best.met && best.gap() <= 1e-8);
        let native = problem.solve();
        assert_eq!(native.engine, Engine::Native);
        let (ours, native) = (best.objective * program.cost, problem.objective(&native.weights));
        assert!((ours - native).abs() <= 2e-8 * native, "{ours} and {native}");
    }
}

#[test]
fn weights_that_meet_rows_that_nearly_coincide_are_found_nearby() {
    let mut random = StdRng::seed_from_u64(14);
    for apart in [1e-2, 1e-4, 1e-6] {
        let mut problem = Problem::drawn(40, 3, 4, &mut random);
        let twin: Vec<f64> = problem.equal[..40].iter().map(|a| a + apart * random.random::<f64>()).collect();
        problem.below.extend(twin);
        problem.limit.push(problem.equal_to[0] - 1e-3 * apart);
        let found = problem.solve();
        let off: Vec<f64> = found.weights.iter().map(|w| w + 1e-10 * random.random::<f64>()).collect();
        let near = nearest(&off, &problem.rows(), &problem.lower, &problem.upper, Stop::never()).unwrap().unwrap();
        let program = problem.program();
        let missing = |w: &[f64]| program.missing(&w.iter().map(|w| w / program.weight).collect::<Vec<_>>());
        assert!(missing(&off) > 1e-12 && missing(&near) < 1e-14, "{} then {}", missing(&off), missing(&near));
        let moved = near.iter().zip(&off).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(moved < 1e-8 / apart, "{apart}: moved {moved}");
    }
}

#[test]
fn rows_that_cannot_be_met_are_never_said_to_be() {
    let mut random = StdRng::seed_from_u64(10);
    for off in [1e-9, 1e-3] {
        let mut problem = Problem::drawn(40, 3, 4, &mut random);
        problem.below.extend_from_slice(&problem.equal[..40]);
        problem.limit.push(problem.equal_to[0] - off);
        let found = problem.solve();
        assert!(found.start.exact.is_none(), "rows are reported as met");
        assert!(found.weights.iter().all(|w| w.is_finite()));
    }
}

#[test]
fn a_request_to_stop_ends_with_what_there_is() {
    let problem = Problem::drawn(40, 3, 4, &mut StdRng::seed_from_u64(11));
    let asked = || true;
    let stop = Stop::when(&asked);
    let found = minimise(&problem.terms(), &problem.rows(), &problem.bounds(), SIZE, None, 1e-8, stop).unwrap();
    assert!(found.stopped);
    assert!(found.weights.iter().all(|w| w.abs() <= 0.3) && found.bound.is_finite());
}

/// The problem of 6.4.5, on which an augmented Lagrangian failed: one target at 40 ms, silent rows after it, B
/// not divided, inputs kept after a spike.
#[test]
fn lift_against_silence_behind_the_target_is_solved() {
    for kappa in [1.0, 1.04, 1.08, 1.16, 1.3] {
        let mut random = StdRng::seed_from_u64(12);
        let spikes: Vec<f64> = (0..200).map(|_| random.random_range(0.0..40.0)).collect();
        let value = |s: f64, t: f64| if s < t { (t - s) / 10.0 * (1.0 - (t - s) / 10.0).exp() } else { 0.0 };
        let row = |t: f64| spikes.iter().map(move |&s| value(s, t)).collect::<Vec<f64>>();
        let mut problem = Problem {
            l1: 0.0,
            l2: 2.0 / 102.0 / (200.0_f64.sqrt() * 0.3),
            lift: 100.0 / 102.0,
            behind: row(41.5),
            wanted: vec![0.3 * kappa],
            equal: row(40.0),
            equal_to: vec![0.3],
            lower: vec![-0.3; 200],
            upper: vec![0.3; 200],
            ..Problem::default()
        };
        for t in (0..=50).filter(|t| !(40..=43).contains(t)) {
            problem.below.extend(row(f64::from(t)));
            problem.limit.push(0.3);
        }
        let found = problem.solve();
        problem.assert_best(&found);
        problem.l1 = problem.l2;
        problem.assert_best(&problem.solve());
    }
}
