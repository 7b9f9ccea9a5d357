use super::*;
use crate::Stop;
use rand::{Rng, SeedableRng, rngs::StdRng};

/// Patterns of 6.4.4: one spike a train at a whole ms up to 200, one target by class.
struct Capacity {
    n: usize,
    spikes: Vec<Vec<f64>>,
    targets: Vec<f64>,
}

fn row(spikes: &[f64], t: f64) -> Vec<f64> {
    let alpha = |s: f64| if s < t { (t - s) / 15.0 * (1.0 - (t - s) / 15.0).exp() } else { 0.0 };
    spikes.iter().map(|&s| alpha(s)).collect()
}

impl Capacity {
    fn new(n: usize, p: usize, seed: u64) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let spikes = (0..p).map(|_| (0..n).map(|_| f64::from(random.random_range(1..=200_u32))).collect()).collect();
        Self { n, spikes, targets: (0..p).map(|k| 50.0 * ((k % 3) + 1) as f64).collect() }
    }
}

#[test]
#[ignore]
fn capacity() {
    let arg = |name: &str, or: &str| std::env::var(name).unwrap_or(or.into()).parse::<f64>().unwrap();
    let (n, p) = (arg("N", "100") as usize, arg("P", "18") as usize);
    let (l1, l2, l3) = (arg("L1", "2"), arg("L2", "2"), arg("L3", "200"));
    let sum = l1 + l2 + l3;
    let c = Capacity::new(n, p, 0);
    let (mut equal, mut behind) = (vec![], vec![]);
    for (s, &t) in c.spikes.iter().zip(&c.targets) {
        equal.extend(row(s, t));
        behind.extend(row(s, t + 1.5));
    }
    let equal_to = vec![0.3; p];
    let wanted = vec![0.3 * 1.2; p];
    let b_max: f64 = behind.chunks(n).map(|r| (0.3 * r.iter().sum::<f64>() + 0.36).powi(2)).sum();
    let terms = Terms {
        l1: l1 / sum / (n as f64 * 0.3),
        l2: l2 / sum / ((n as f64).sqrt() * 0.3),
        norm: Norm::Norm,
        lift: l3 / sum / b_max,
        behind: &behind,
        wanted: &wanted,
    };
    let (mut below, mut limit) = (vec![], vec![]);
    let (lower, upper) = (vec![-0.3; n], vec![0.3; n]);
    let mut w = times(&equal, &vec![0.0; n]);
    w.resize(n, 0.0);
    // start rows: each 4th ms in the 30 before the target
    let mut have = std::collections::HashSet::new();
    for k in 0..p {
        for d in (1..30).step_by(4) {
            let t = c.targets[k] - f64::from(d);
            have.insert((k, t as u64));
            below.extend(row(&c.spikes[k], t));
            limit.push(0.3);
        }
    }
    let begun = std::time::Instant::now();
    let mut start = None;
    for round in 0..20 {
        let rows = HardRows { equal: &equal, equal_to: &equal_to, below: &below, limit: &limit };
        let tolerance = [1e-1, 1e-2, 1e-3, 1e-4].get(round).copied().unwrap_or(1e-8);
        let at = std::time::Instant::now();
        let found = minimise(
            &terms,
            &rows,
            &lower,
            &upper,
            start.as_ref().filter(|_| arg("WARM", "1") > 0.0),
            tolerance,
            Stop::never(),
        )
        .unwrap();
        let w = found.weights.clone();
        let mut added = 0;
        let mut worst = 0.0_f64;
        for k in 0..p {
            let u: Vec<f64> = (0..=200).map(|t| dot(&row(&c.spikes[k], f64::from(t)), &w)).collect();
            let silent = |t: usize| !((t as f64) >= c.targets[k] && (t as f64) <= c.targets[k] + 3.0);
            let theta = |t: usize| {
                if t as f64 > c.targets[k] { 0.3 + 0.2 * (-(t as f64 - c.targets[k] - 3.0) / 30.0).exp() } else { 0.3 }
            };
            for t in 0..=200 {
                let x = u[t] - theta(t);
                if silent(t) && x > 1e-10 {
                    worst = worst.max(x);
                    let peak = (t == 0 || u[t - 1] - theta(t - 1) <= x)
                        && (t == 200 || u[t + 1] - theta(t + 1) <= x || !silent(t + 1));
                    if peak && have.insert((k, t as u64)) {
                        below.extend(row(&c.spikes[k], t as f64));
                        limit.push(theta(t));
                        added += 1;
                    }
                }
            }
        }
        eprintln!(
            "round {round}: {} rows, gap {:.1e}, {:.3} s, worst {worst:.1e}, added {added}, F {:.12e} {:?}",
            limit.len() - added,
            found.gap(),
            at.elapsed().as_secs_f64(),
            found.objective,
            found.engine,
        );
        start = Some(found.start);
        if added == 0 && tolerance < 1e-5 {
            break;
        }
    }
    eprintln!("total {:.3}", begun.elapsed().as_secs_f64());
}
