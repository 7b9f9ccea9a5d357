//! Tests of the dual active set: optimality conditions, proofs of infeasibility, starts.

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

use super::*;

/// Rows as stated, so that verdicts are checked by plain sums.
#[derive(Default)]
struct Stated {
    equalities: Vec<(Vec<f64>, f64)>,
    inequalities: Vec<(Vec<f64>, f64)>,
    bound: f64,
}

impl Stated {
    fn random(random: &mut StdRng, n: usize, equalities: usize, inequalities: usize, bound: f64) -> Self {
        let mut row = |value: f64| {
            let scale = 10f64.powf(random.random_range(-2.0..2.0));
            ((0..n).map(|_| scale * random.random_range(-0.5..1.0)).collect(), scale * value)
        };
        Self {
            equalities: (0..equalities).map(|_| row(0.3)).collect(),
            inequalities: (0..inequalities).map(|k| row(0.2 - 0.1 * (k % 3) as f64)).collect(),
            bound,
        }
    }

    fn solver(&self) -> DualActiveSet {
        let n = self.equalities.first().or(self.inequalities.first()).unwrap().0.len();
        let mut solver = DualActiveSet::new(&vec![-self.bound; n], &vec![self.bound; n]).unwrap();
        for (a, value) in &self.equalities {
            solver.equality(a, *value).unwrap();
        }
        solver
    }

    fn solve(&self) -> (DualActiveSet, SolveOutcome) {
        let mut solver = self.solver();
        for (a, limit) in &self.inequalities {
            solver.inequality(a, *limit).unwrap();
        }
        let verdict = solver.solve(Stop::never()).unwrap();
        (solver, verdict)
    }

    /// A row with its multiplier, and whether it is an inequality: the equalities were added before all of these.
    fn row(&self, &(id, u): &(RowId, f64)) -> (&[f64], f64, f64, bool) {
        let after = id.index().checked_sub(self.equalities.len());
        let (a, limit) = after.map_or_else(|| &self.equalities[id.index()], |k| &self.inequalities[k]);
        (a, *limit, u, after.is_some())
    }

    fn combine(&self, m: &Multipliers) -> Vec<f64> {
        let n = self.equalities.first().or(self.inequalities.first()).unwrap().0.len();
        let mut g = vec![0.0; n];
        for (a, _, u, _) in m.iter().map(|row| self.row(row)) {
            for (g, a) in g.iter_mut().zip(a) {
                *g += u * a;
            }
        }
        g
    }

    /// The Karush-Kuhn-Tucker conditions, which are sufficient because the problem is convex.
    fn assert_optimal(&self, solver: &DualActiveSet) {
        let w = solver.weights();
        let dot = |a: &[f64]| a.iter().zip(w).map(|(a, w)| a * w).sum::<f64>();
        let length = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
        let m = solver.multipliers();
        for (a, value) in &self.equalities {
            assert!((dot(a) - value).abs() < 1e-13 * (1.0 + length(a)), "equality off by {}", dot(a) - value);
        }
        for (a, limit) in &self.inequalities {
            assert!(dot(a) - limit < 1e-12 * length(a), "inequality off by {}", dot(a) - limit);
        }
        for (a, limit, z, _) in m.iter().map(|row| self.row(row)).filter(|row| row.3) {
            assert!(z > 0.0 && (dot(a) - limit).abs() < 1e-13 * (1.0 + length(a)), "held but not met");
        }
        for (n, (w, g)) in w.iter().zip(self.combine(&m)).enumerate() {
            let slope = w + g;
            assert!(w.abs() < self.bound + 1e-12, "weight {n} beyond its bound");
            let at = if slope < 0.0 { self.bound - w } else { w + self.bound };
            assert!(slope.abs() < 1e-9 || at < 1e-12, "weight {n}: slope {slope} at {at} from the bound");
        }
    }

    fn assert_refuted(&self, ray: &Ray) {
        let rows = || ray.multipliers.iter().map(|row| self.row(row));
        assert!(rows().all(|(.., u, inequality)| u >= 0.0 || !inequality));
        let least: f64 = self.combine(&ray.multipliers).iter().map(|g| -self.bound * g.abs()).sum();
        let demanded: f64 = rows().map(|(_, limit, u, _)| limit * u).sum();
        assert!(least - demanded > 0.0, "ray proves nothing: {least} against {demanded}");
    }
}

#[test]
fn random_problems_end_optimal_or_refuted() {
    let mut random = StdRng::seed_from_u64(1);
    let mut counts = [0; 2];
    for trial in 0..600 {
        let n = random.random_range(2..30);
        let equalities = random.random_range(0..=n / 2);
        let inequalities = random.random_range(1..3 * n);
        let bound = [0.1, 0.5, 5.0][trial % 3];
        let stated = Stated::random(&mut random, n, equalities, inequalities, bound);
        match stated.solve() {
            (solver, SolveOutcome::Optimal) => stated.assert_optimal(&solver),
            (_, SolveOutcome::Infeasible(ray)) => stated.assert_refuted(&ray),
            (_, SolveOutcome::Stopped) => panic!("problem {trial} is undecided"),
        }
        counts[usize::from(matches!(stated.solve().1, SolveOutcome::Optimal))] += 1;
    }
    assert!(counts[0] > 100 && counts[1] > 100, "{counts:?}");
}

#[test]
fn equalities_that_repeat_others_are_met_or_refuted() {
    let mut random = StdRng::seed_from_u64(2);
    let mut stated = Stated::random(&mut random, 12, 4, 6, 9.0);
    let sum: Vec<f64> = (0..12).map(|n| stated.equalities[0].0[n] - 2.0 * stated.equalities[1].0[n]).collect();
    let value = stated.equalities[0].1 - 2.0 * stated.equalities[1].1;
    for off in [0.0, 1e-6, -1e-6, 1.0] {
        stated.equalities.truncate(4);
        stated.equalities.push((sum.clone(), value + off));
        match (stated.solve(), off == 0.0) {
            ((solver, SolveOutcome::Optimal), true) => stated.assert_optimal(&solver),
            ((_, SolveOutcome::Infeasible(ray)), false) => stated.assert_refuted(&ray),
            ((_, verdict), _) => panic!("off by {off}: {verdict:?}"),
        }
    }
    stated.equalities.truncate(4);
    stated.equalities.push((vec![0.0; 12], 0.3));
    match stated.solve().1 {
        SolveOutcome::Infeasible(ray) => stated.assert_refuted(&ray),
        verdict => panic!("a target without inputs: {verdict:?}"),
    }
}

#[test]
fn cuts_that_are_nearly_parallel_are_told_apart() {
    let mut random = StdRng::seed_from_u64(3);
    for apart in [1e-3, 1e-5, 1e-6, 1e-7] {
        let mut stated = Stated::random(&mut random, 20, 3, 8, 9.0);
        for k in 0..8 {
            let (a, limit) = stated.inequalities[k].clone();
            let length = a.iter().map(|a| a * a).sum::<f64>().sqrt();
            let near: Vec<f64> = a.iter().map(|a| a + apart * length * random.random_range(-1.0..1.0)).collect();
            stated.inequalities.push((near, limit - 0.01 * apart * length));
        }
        match stated.solve() {
            (solver, SolveOutcome::Optimal) => stated.assert_optimal(&solver),
            (_, verdict) => panic!("{apart} apart: {verdict:?}"),
        }
    }
}

/// A row nearly identical to `a`.
fn beside(random: &mut StdRng, a: &[f64]) -> Vec<f64> {
    let length = a.iter().map(|a| a * a).sum::<f64>().sqrt();
    a.iter().map(|a| a + 3e-3 * length * random.random_range(-1.0..1.0)).collect()
}

#[test]
fn a_cut_takes_the_place_of_one_that_it_hardly_differs_from() {
    let mut random = StdRng::seed_from_u64(6);
    let mut stated = Stated::random(&mut random, 20, 3, 0, 9.0);
    let mut solver = stated.solver();
    assert_eq!(solver.solve(Stop::never()).unwrap(), SolveOutcome::Optimal);
    let a: Vec<f64> = (0..20).map(|_| random.random_range(0.0..1.0)).collect();
    let limit = dot(&a, solver.weights()) - 0.3;
    let near = beside(&mut random, &a);
    let mut held = Vec::new();
    for (row, limit, exchanged) in [(a, limit, false), (near, limit - 0.1, true)] {
        held.push(solver.inequality(&row, limit).unwrap());
        stated.inequalities.push((row, limit));
        let fresh = solver.extend_gram();
        solver.replace_similar(&fresh);
        assert_eq!(solver.positions[fresh[0]].is_some(), exchanged, "it is held at once where one is near");
        assert_eq!(solver.active.len(), 3 + usize::from(exchanged), "instead of that");
        assert_eq!(solver.solve(Stop::never()).unwrap(), SolveOutcome::Optimal);
    }
    assert_eq!(solver.multipliers().iter().skip(3).map(|(id, _)| *id).collect::<Vec<_>>(), held[1..]);
    stated.assert_optimal(&solver);
}

#[test]
fn rows_in_rounds_give_what_all_rows_at_once_give() {
    let mut random = StdRng::seed_from_u64(4);
    for trial in 0..20 {
        let mut stated = Stated::random(&mut random, 40, 6, 60, 0.5);
        // Every other trial adds a nearly identical row to each one, which row exchanges then swap.
        for k in 0..if trial % 2 == 0 { 0 } else { 60 } {
            let (a, limit) = stated.inequalities[k].clone();
            stated.inequalities.push((beside(&mut random, &a), limit));
        }
        let (whole, verdict) = stated.solve();
        let mut solver = stated.solver();
        let (mut names, mut round) = (Vec::new(), 0);
        let last = loop {
            let verdict = solver.solve(Stop::never()).unwrap();
            let w = solver.weights().to_vec();
            solver.drop_inactive();
            let held = solver.multipliers();
            let mut added = false;
            for (k, (a, limit)) in stated.inequalities.iter().enumerate() {
                let over = a.iter().zip(&w).map(|(a, w)| a * w).sum::<f64>() - limit;
                if over > 1e-11 * a.iter().map(|a| a * a).sum::<f64>().sqrt() {
                    let is_held = |id: RowId| id.index() >= 6 && names[id.index() - 6] == k;
                    assert!(!held.iter().any(|(id, _)| is_held(*id)), "a held row is violated");
                    assert_eq!(solver.inequality(a, *limit).unwrap().index(), 6 + names.len());
                    names.push(k);
                    added = true;
                }
            }
            round += 1;
            if !added || verdict != SolveOutcome::Optimal {
                break verdict;
            }
            assert!(round < 100);
        };
        match verdict {
            SolveOutcome::Optimal => {
                assert_eq!(last, SolveOutcome::Optimal);
                for (a, b) in whole.weights().iter().zip(solver.weights()) {
                    assert!((a - b).abs() < 1e-9);
                }
            }
            _ => assert!(matches!(last, SolveOutcome::Infeasible(_))),
        }
    }
}

#[test]
fn a_start_from_multipliers_ends_where_a_cold_one_does() {
    let mut random = StdRng::seed_from_u64(5);
    let mut stated = Stated::random(&mut random, 30, 5, 40, 3.0);
    let (cold, verdict) = stated.solve();
    assert_eq!(verdict, SolveOutcome::Optimal);
    let mut warm = stated.solver();
    for (a, limit) in &stated.inequalities {
        warm.inequality(a, *limit).unwrap();
    }
    warm.start(&cold.multipliers()).unwrap();
    for (a, b) in cold.weights().iter().zip(warm.combine_rows()) {
        assert!((a - b).abs() < 1e-10, "the start alone is not there");
    }
    for (_, limit) in &mut stated.inequalities {
        *limit -= 1e-3;
    }
    let mut warm = stated.solver();
    for (a, limit) in &stated.inequalities {
        warm.inequality(a, *limit).unwrap();
    }
    warm.start(&cold.multipliers()).unwrap();
    assert_eq!(warm.solve(Stop::never()).unwrap(), SolveOutcome::Optimal);
    stated.assert_optimal(&warm);
}

#[test]
fn nonsense_is_refused() {
    assert!(DualActiveSet::new(&[0.0], &[-1.0]).is_err());
    assert!(DualActiveSet::new(&[0.0, 0.0], &[1.0]).is_err());
    assert!(DualActiveSet::new(&[f64::NAN], &[1.0]).is_err());
    let mut solver = DualActiveSet::new(&[-1.0; 2], &[1.0; 2]).unwrap();
    assert!(solver.equality(&[1.0], 0.0).is_err());
    assert!(solver.equality(&[1.0, f64::NAN], 0.0).is_err());
    assert!(solver.inequality(&[1.0, 1.0], f64::INFINITY).is_err());
    let id = solver.inequality(&[1.0, 1.0], -1.0).unwrap();
    assert!(solver.start(&[(id, 1.0), (RowId(7), 1.0)]).is_err());
    assert!(solver.start(&[(id, -1.0)]).is_err());
    assert!(solver.start(&[(id, 1.0)]).is_ok());
    assert_eq!(solver.solve(Stop::when(&|| true)).unwrap(), SolveOutcome::Stopped);
}
