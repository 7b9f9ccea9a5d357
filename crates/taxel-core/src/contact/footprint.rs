//! Where a ball's force arrives on the taxels: a table in depth and distance.
//!
//! A rigid ball pressed without sliding is a one-parameter path, so what lies under it is worked out once: the columns'
//! pressure at each depth, carried through the layer by its Hankel transform and [`base_stress`].

use std::f64::consts::PI;

use super::Foam;
use super::layer::base_stress;
use crate::Result;

/// Distances at which the table is known are this far apart, mm.
const RING_MM: f64 = 0.5;
/// How far it reaches: past the widest contact by more than three thicknesses, the range of the layer's influence.
const RINGS: usize = 121;
/// Depths at which it is known, evenly spaced in the radius of contact.
const DEPTHS: usize = 72;
/// Wave numbers of the transform; the highest, 14 / thickness, passes 2e-5.
const WAVES: usize = 160;
/// Rings of the ball's own face in the transform.
const FACE: usize = 96;

/// Base stress under a ball, for each newton that it presses with.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// Stress at the base per force, 1/mm^2, by depth and then by ring.
    table: Vec<f32>,
    /// How many depths a square root of a millimetre spans.
    per_root_mm: f64,
}

impl Footprint {
    /// Works the table out for a ball of `radius_mm` on `foam`, within some milliseconds.
    ///
    /// # Errors
    ///
    /// `Scene` where the foam makes no sense.
    pub fn new(foam: &Foam, radius_mm: f64) -> Result<Self> {
        foam.check()?;
        let deepest = foam.floor_mm();
        let step = 14.0 / foam.thickness_mm / WAVES as f64;
        let waves: Vec<f64> = (0..WAVES).map(|k| (k as f64 + 0.5) * step).collect();
        let through: Vec<f64> = waves.iter().map(|q| base_stress(q * foam.thickness_mm, foam.poisson)).collect();
        // Midpoints sum too much by step^2 / 24 times the slope at wave number 0, which is 1 / 2 pi (Euler and Maclaurin).
        let surplus = step * step / (48.0 * PI);
        let bessel = Bessel::up_to(waves[WAVES - 1] * RING_MM * RINGS as f64);
        let mut table = Vec::with_capacity(DEPTHS * RINGS);
        for n in 0..DEPTHS {
            let depth = deepest * (n as f64 / (DEPTHS - 1) as f64).powi(2);
            let face = face(foam, radius_mm, depth);
            let passed: Vec<f64> = waves
                .iter()
                .zip(&through)
                .map(|(q, t)| face.iter().map(|(r, share)| share * bessel.at(q * r)).sum::<f64>() * t * q)
                .collect();
            for ring in 0..RINGS {
                let r = ring as f64 * RING_MM;
                let sum: f64 = waves.iter().zip(&passed).map(|(q, p)| p * bessel.at(q * r)).sum();
                table.push((sum * step / (2.0 * PI) - surplus) as f32);
            }
        }
        Ok(Self { table, per_root_mm: (DEPTHS - 1) as f64 / deepest.sqrt() })
    }

    /// Where `r_mm` lies among the rings of [`Footprint::profile`]: the ring inside it and the share of the next one;
    /// `None` beyond the last.
    #[must_use]
    pub fn ring(r_mm: f64) -> Option<(usize, f32)> {
        let position = r_mm / RING_MM;
        (position < (RINGS - 1) as f64).then(|| (position as usize, position.fract() as f32))
    }

    /// Base stress per force at each ring, 1/mm^2; nowhere negative, since the fabric cannot be pulled.
    pub fn profile(&self, depth_mm: f64, out: &mut Vec<f32>) {
        let position = (depth_mm.max(0.0).sqrt() * self.per_root_mm).min((DEPTHS - 1) as f64 - 1e-6);
        let (row, share) = (position as usize, position.fract() as f32);
        let (low, high) = self.table[row * RINGS..(row + 2) * RINGS].split_at(RINGS);
        out.clear();
        out.extend(low.iter().zip(high).map(|(a, b)| (a + share * (b - a)).max(0.0)));
    }
}

/// The columns under a ball at a depth: distance from its axis, share of its force. A point at depth 0.
fn face(foam: &Foam, radius_mm: f64, depth_mm: f64) -> Vec<(f64, f64)> {
    let part = depth_mm / FACE as f64;
    let mut rings: Vec<(f64, f64)> = (0..FACE)
        .map(|k| {
            // By height above the lowest point, `s`: r dr = (R - s) ds.
            let s = (k as f64 + 0.5) * part;
            let strain = (depth_mm - s) / foam.thickness_mm;
            ((2.0 * radius_mm * s - s * s).sqrt(), foam.stress_kpa(strain) * (radius_mm - s))
        })
        .collect();
    let sum: f64 = rings.iter().map(|r| r.1).sum();
    if sum > 0.0 {
        rings.iter_mut().for_each(|r| r.1 /= sum);
        rings
    } else {
        vec![(0.0, 1.0)]
    }
}

/// The Bessel function J0, tabulated: straight lines between steps of 1/64 err by less than 2e-5.
struct Bessel(Vec<f64>);

impl Bessel {
    const PER_UNIT: f64 = 64.0;

    fn up_to(x: f64) -> Self {
        Self((0..=(x * Self::PER_UNIT) as usize + 2).map(|k| libm::j0(k as f64 / Self::PER_UNIT)).collect())
    }

    fn at(&self, x: f64) -> f64 {
        let position = x * Self::PER_UNIT;
        let k = position as usize;
        self.0[k] + position.fract() * (self.0[k + 1] - self.0[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Base stress at distance `r` by waves in the plane, on a fine square grid: no Bessel function, no table.
    fn direct(foam: &Foam, radius: f64, depth: f64, distances: &[f64]) -> Vec<f64> {
        // A pressure that depends on the distance alone, seen along x: sum over y first (its Abel projection), then one
        // Fourier sum. Summing over directions inverts the projection of the base stress.
        let (side, n) = (160.0, 640_usize);
        let step = side / n as f64;
        let pressure = |x: f64, y: f64| {
            let r2 = x * x + y * y;
            if r2 >= radius * radius {
                return 0.0;
            }
            foam.stress_kpa((depth - (radius - (radius * radius - r2).sqrt())) / foam.thickness_mm)
        };
        let at = |k: usize| (k as f64 + 0.5) * step - side / 2.0;
        let projected: Vec<f64> = (0..n).map(|i| (0..n).map(|j| pressure(at(i), at(j))).sum::<f64>() * step).collect();
        let whole: f64 = projected.iter().sum::<f64>() * step;
        let (waves, dq) = (320, 1.6 / 320.0);
        let spectrum: Vec<f64> = (0..waves)
            .map(|k| {
                let q = (f64::from(k) + 0.5) * dq;
                let p: f64 = (0..n).map(|i| projected[i] * (q * at(i)).cos()).sum::<f64>() * step / whole;
                p * base_stress(q * foam.thickness_mm, foam.poisson) * q
            })
            .collect();
        let directions = 720;
        distances
            .iter()
            .map(|r| {
                let mut sum = 0.0;
                for d in 0..directions {
                    let along = r * (PI * (f64::from(d) + 0.5) / f64::from(directions)).cos();
                    sum += (0..waves)
                        .map(|k| spectrum[k as usize] * ((f64::from(k) + 0.5) * dq * along).cos())
                        .sum::<f64>();
                }
                sum * dq / (2.0 * PI * f64::from(directions))
            })
            .collect()
    }

    #[test]
    fn the_table_equals_the_sum_over_waves() {
        let foam = Foam::default();
        let distances = [0.0, 3.0, 8.0, 14.0, 20.0, 30.0];
        for (radius, depth) in [(25.0, 1.3), (33.0, 5.0), (30.0, 8.5)] {
            let footprint = Footprint::new(&foam, radius).unwrap();
            let mut profile = vec![];
            footprint.profile(depth, &mut profile);
            let oracle = direct(&foam, radius, depth, &distances);
            for (r, expected) in distances.iter().zip(&oracle) {
                let (ring, share) = Footprint::ring(*r).unwrap();
                let got = f64::from(profile[ring] + share * (profile[ring + 1] - profile[ring]));
                assert!(
                    (got - expected.max(0.0)).abs() < 4e-3 * oracle[0],
                    "R {radius}, d {depth}, r {r}: {got}, {expected}"
                );
            }
        }
    }

    #[test]
    fn all_of_the_force_arrives() {
        // Before it is cut off at 0: a bonded base is also pulled, a little, beside the contact.
        let footprint = Footprint::new(&Foam::default(), 30.0).unwrap();
        for depth in footprint.table.chunks(RINGS) {
            let ring = |k: usize| 2.0 * PI * k as f64 * RING_MM * RING_MM;
            let sum: f64 = depth.iter().enumerate().map(|(k, s)| f64::from(*s) * ring(k)).sum();
            assert!((sum - 1.0).abs() < 3e-3, "{sum}");
        }
    }

    #[test]
    fn a_deeper_ball_spreads_its_force_wider() {
        let footprint = Footprint::new(&Foam::default(), 30.0).unwrap();
        let centres: Vec<f32> = [0.1, 1.0, 3.0, 6.0]
            .map(|depth| {
                let mut profile = vec![];
                footprint.profile(depth, &mut profile);
                profile[0]
            })
            .to_vec();
        assert!(centres.windows(2).all(|w| w[1] < w[0]), "{centres:?}");
    }
}
