//! Against closed forms, and the two ways of solving against each other.

use super::sweep::CellRun;
use super::*;
use crate::Error;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

/// Foam that stays linear however far it is pressed in these tests.
fn linear(modulus_kpa: f64, thickness_mm: f64, poisson: f64) -> Foam {
    Foam { modulus_kpa, thickness_mm, poisson, yield_strain: 0.9, densification_strain: 0.99, ..Foam::default() }
}

/// Cells below a height over the point (x, y), sunk by a depth; and those that the layer may bulge to.
fn cells(layer: &Bonded, depth: f64, height: impl Fn(f64, f64) -> f64) -> Vec<Cell> {
    let (rows, columns) = layer.shape();
    let above = -layer.bulge() * depth;
    let mut found = vec![];
    for y in 0..rows {
        for x in 0..columns {
            let sunk_mm = depth - height(layer.cell_mm(x), layer.cell_mm(y));
            if sunk_mm > above {
                found.push(Cell { x: x as u32, y: y as u32, sunk_mm });
            }
        }
    }
    found
}

fn parabola(radius: f64, at: (f64, f64)) -> impl Fn(f64, f64) -> f64 {
    move |x, y| ((x - at.0).powi(2) + (y - at.1).powi(2)) / (2.0 * radius)
}

#[test]
fn a_ball_on_a_thick_layer_is_pressed_as_hertz_says() {
    // a / h is 0.03 here: the layer is a half-space to 2 %, less what a pitch of a / 10 leaves.
    let (radius, depth, nu) = (40.0_f64, 0.9_f64, 0.3_f64);
    let array = Array::new(72, 72, 0.4, "fine").unwrap();
    let layer = Bonded::new(&linear(50.0, 200.0, nu), &array, 1, Stop::never()).unwrap();
    let mut layer = layer.to_within(1e-7);
    let found = cells(&layer, depth, parabola(radius, (14.2, 14.2)));
    let force: f64 = layer.press(&found, Stop::never()).unwrap().iter().sum::<f64>() * layer.area_mm2();
    let stiff = 0.05 / (1.0 - nu * nu);
    let hertz = 4.0 / 3.0 * stiff * radius.sqrt() * depth.powf(1.5);
    assert!((force / hertz - 1.0).abs() < 0.03, "{force} N, Hertz {hertz}");
    let peak = layer.press(&found, Stop::never()).unwrap().iter().fold(0.0_f64, |a, b| a.max(*b));
    let expected = 2.0 * stiff / std::f64::consts::PI * (depth / radius).sqrt();
    assert!((peak / expected - 1.0).abs() < 0.03, "{peak} MPa, Hertz {expected}");
}

#[test]
fn sweeps_and_gradients_agree_and_meet_the_conditions_of_contact() {
    let mut draw = StdRng::seed_from_u64(5);
    for round in 0..24 {
        let nu = [0.0, 0.1, 0.3, 0.45, 0.49][round % 5];
        let thick = [2.0, 10.0, 40.0][round % 3];
        let array = Array::new(24, 30, draw.random_range(1.0..4.0), "drawn").unwrap();
        let foam = linear(10f64.powf(draw.random_range(0.5..3.0)), thick, nu);
        let make = || Bonded::new(&foam, &array, 1, Stop::never()).unwrap().to_within(1e-9);
        let (mut swept, mut descended) = (make(), make());
        // One to three bodies, round or edged, from far too flat to a needle, some over the array's edge.
        let span = array.square_pitch("foam").unwrap() * 26.0;
        let bodies: Vec<(f64, f64, f64, f64)> = (0..draw.random_range(1..4))
            .map(|_| {
                let at = (draw.random_range(-5.0..span), draw.random_range(-5.0..span));
                (at.0, at.1, 10f64.powf(draw.random_range(0.0..3.0)), draw.random_range(0.0..1.0))
            })
            .collect();
        let depth = thick * 10f64.powf(draw.random_range(-4.0..-0.7));
        let found = cells(&swept, depth, |x, y| {
            bodies
                .iter()
                .map(|(bx, by, radius, edge)| {
                    let (dx, dy) = (x - bx, y - by);
                    edge * dx.abs() * 0.3 + (1.0 - edge) * (dx * dx + dy * dy) / (2.0 * radius)
                })
                .fold(f64::INFINITY, f64::min)
        });
        if found.len() < 2 || found.len() > MOST_SWEPT || found.iter().all(|cell| cell.sunk_mm <= 0.0) {
            continue;
        }
        let pressure = swept.press(&found, Stop::never()).unwrap().to_vec();
        descended.wanted.clone_from(&swept.wanted);
        descended.pressure = vec![0.0; found.len()];
        descended.descend(&found, Stop::never()).unwrap();
        let peak = pressure.iter().fold(0.0_f64, |a, b| a.max(*b));
        for (a, b) in pressure.iter().zip(&descended.pressure) {
            assert!((a - b).abs() < 1e-4 * peak, "round {round}, nu {nu}: {a} against {b}, peak {peak}");
        }
        // Gaps of every cell of the grid, those that were no candidates too.
        let grid = Influence { table: &swept.influence, rows: swept.rows, columns: swept.columns };
        let all: Vec<CellRun> =
            (0..swept.rows).map(|y| CellRun { first: y * swept.columns, count: swept.columns, x: 0, y }).collect();
        let mut pushed = vec![0.0; swept.rows * swept.columns];
        for (cell, p) in found.iter().zip(&pressure) {
            grid.push(&mut pushed, &all, *cell, *p);
        }
        for (k, (cell, p)) in found.iter().zip(&pressure).enumerate() {
            let gap = pushed[cell.y as usize * swept.columns + cell.x as usize] - swept.wanted[k];
            assert!(*p >= 0.0 && gap > -1e-5 * depth, "round {round}: gap {gap} of {depth}");
            assert!(p * gap.abs() < 1e-5 * peak * depth, "round {round}: {p} MPa at a gap of {gap}");
        }
    }
}

#[test]
fn no_cell_outside_the_candidates_is_entered() {
    // The worst: a nearly incompressible layer bulges beside the body, the more the thinner it is beside the touch.
    for (nu, thick) in [(0.0, 10.0), (0.1, 10.0), (0.3, 10.0), (0.45, 10.0), (0.49, 10.0), (0.49, 1.0), (0.499, 1.5)] {
        let array = Array::new(40, 40, 1.5, "bulging").unwrap();
        for (radius, depth) in [(20.0, 0.05 * thick), (35.0, 0.2 * thick), (300.0, 0.1 * thick)] {
            let mut layer = Bonded::new(&linear(60.0, thick, nu), &array, 1, Stop::never()).unwrap().to_within(1e-7);
            let shape = parabola(radius, (29.0, 30.0));
            let found = cells(&layer, depth, &shape);
            let pressure = layer.press(&found, Stop::never()).unwrap().to_vec();
            let (rows, columns) = layer.shape();
            layer.waves.plane.fill(0.0);
            for (cell, p) in found.iter().zip(&pressure) {
                layer.waves.plane[cell.y as usize * layer.wide + cell.x as usize] = *p;
            }
            let surface = layer.surface.clone();
            layer.waves.convolve(&surface, Stop::never()).unwrap();
            for y in 0..rows {
                for x in 0..columns {
                    let gap = layer.waves.plane[y * layer.wide + x] + shape(layer.cell_mm(x), layer.cell_mm(y));
                    assert!(gap > (1.0 - 2e-3) * depth, "nu {nu}, R {radius}: {} at {x}, {y}", gap - depth);
                }
            }
        }
    }
}

#[test]
fn a_wide_flat_touch_follows_the_foams_own_law() {
    // Far from its rim a wide punch presses a confined layer; without widening that is the column itself.
    let foam = Foam::default();
    let array = Array::new(60, 60, 2.0, "wide").unwrap();
    for depth in [0.3, 2.0, 6.0, 9.2] {
        let mut layer = Bonded::new(&foam, &array, 1, Stop::never()).unwrap().to_within(1e-6);
        let found =
            cells(&layer, depth, |x, y| if (8.0..110.0).contains(&x) && (8.0..110.0).contains(&y) { 0.0 } else { 1e3 });
        let pressure = layer.press(&found, Stop::never()).unwrap().to_vec();
        let centre = found
            .iter()
            .position(|c| layer.cell_mm(c.x as usize) == 60.0 && layer.cell_mm(c.y as usize) == 60.0)
            .unwrap();
        let law = 1e-3 * foam.stress_kpa(depth / foam.thickness_mm);
        assert!((pressure[centre] / law - 1.0).abs() < 2e-3, "{depth} mm: {} against {law}", pressure[centre]);
        let mut base = vec![];
        layer.arrive(&found, &pressure, &mut base, Stop::never()).unwrap();
        assert!((f64::from(base[30 * 60 + 30]) / law - 1.0).abs() < 3e-3);
    }
}

#[test]
fn all_of_the_force_arrives_at_the_base() {
    let array = Array::thesis();
    for (nu, per_pitch) in [(0.0, 1), (0.3, 1), (0.0, 2), (0.3, 3)] {
        let mut layer = Bonded::new(&linear(60.0, 10.0, nu), &array, per_pitch, Stop::never()).unwrap();
        let found = cells(&layer, 2.0, parabola(30.0, (80.0, 85.0)));
        let pressure = layer.press(&found, Stop::never()).unwrap().to_vec();
        let mut near = vec![];
        layer.arrive(&found, &pressure, &mut near, Stop::never()).unwrap();
        let up = pressure.iter().sum::<f64>() * layer.area_mm2();
        let down = near.iter().map(|s| f64::from(*s)).sum::<f64>() * array.square_pitch("foam").unwrap().powi(2);
        assert!((down / up - 1.0).abs() < 1e-2, "nu {nu}, {per_pitch}: {down} of {up} N");
        let total =
            layer.taxel_pressures(&found, &pressure).iter().sum::<f64>() * array.square_pitch("foam").unwrap().powi(2);
        assert!((total / up - 1.0).abs() < 1e-9, "nu {nu}, {per_pitch}: {total} of {up} N");
    }
}

#[test]
fn cells_along_a_pitch_are_the_grid_of_as_many_taxels_and_a_taxel_feels_their_mean() {
    let foam = linear(60.0, 3.0, 0.2);
    for n in [2_u16, 3] {
        let array = Array::new(16, 20, 1.5, "coarse").unwrap();
        let pitch = 1.5 / f64::from(n);
        let fine = Array::new(16 * n, 20 * n, pitch, "fine").unwrap();
        let mut cut = Bonded::new(&foam, &array, n, Stop::never()).unwrap().to_within(1e-8);
        let mut small = Bonded::new(&foam, &fine, 1, Stop::never()).unwrap().to_within(1e-8);
        // The array's first cell lies before its first taxel.
        let first = (pitch - 1.5) / 2.0;
        let touch = cells(&cut, 0.3, parabola(6.0, (14.0, 9.0)));
        let same = cells(&small, 0.3, parabola(6.0, (14.0 - first, 9.0 - first)));
        assert_eq!(touch.len(), same.len());
        let pressure = cut.press(&touch, Stop::never()).unwrap().to_vec();
        let expected = small.press(&same, Stop::never()).unwrap().to_vec();
        let peak = expected.iter().fold(0.0_f64, |a, b| a.max(*b));
        for (a, b) in pressure.iter().zip(&expected) {
            assert!((a - b).abs() < 1e-4 * peak, "{n}: {a} against {b}");
        }
        let (mut felt, mut by_cell) = (vec![], vec![]);
        cut.arrive(&touch, &pressure, &mut felt, Stop::never()).unwrap();
        small.arrive(&same, &expected, &mut by_cell, Stop::never()).unwrap();
        let (side, columns) = (usize::from(n), 20 * usize::from(n));
        let most = felt.iter().fold(0.0_f32, |a, b| a.max(*b));
        for (k, stress) in felt.iter().enumerate() {
            let (y, x) = (k / 20 * side, k % 20 * side);
            let mean = (0..side * side).map(|c| by_cell[(y + c / side) * columns + x + c % side]).sum::<f32>()
                / (side * side) as f32;
            assert!((stress - mean).abs() < 1e-3 * most, "{n}, taxel {k}: {stress} against {mean}");
        }
        // By waves, as of many cells, and cell by cell.
        let (mut whole, many) = (vec![], vec![1e-3; cut.over_array().0 * cut.over_array().1]);
        let all = cut.cells_under(&many);
        assert!(all.len() > cut.most_swept());
        cut.arrive(&all, &many, &mut whole, Stop::never()).unwrap();
        let (mut sum, mut part) = (vec![0.0_f32; felt.len()], vec![]);
        for some in all.chunks(cut.most_swept()) {
            cut.arrive(some, &many[..some.len()], &mut part, Stop::never()).unwrap();
            sum.iter_mut().zip(&part).for_each(|(sum, part)| *sum += part);
        }
        for (k, (a, b)) in whole.iter().zip(&sum).enumerate() {
            assert!((a - b).abs() < 2e-2 * 1e-3, "{n}, taxel {k}: {a} against {b}");
        }
    }
}

#[test]
fn more_cells_than_can_be_reckoned_with_are_refused_with_how_many_can() {
    let message = |array: &Array, n: u16| check_cells(&Foam::default(), array, n).unwrap_err().to_string();
    let (thesis, large) = (Array::thesis(), Array::new(256, 256, 2.67, "large").unwrap());
    assert!(message(&thesis, 0).contains("cells_per_pitch is 0") && message(&thesis, 17).contains("from 1 to 16"));
    check_cells(&Foam::default(), &thesis, 16).unwrap();
    let most = most_cells(&Foam::default(), &large).unwrap();
    assert!((2..16).contains(&most) && message(&large, 16).contains(&format!("must be {most} or less")));
}

#[test]
fn the_next_frame_begins_where_the_last_two_lead() {
    let mut layer = Bonded::new(&linear(60.0, 10.0, 0.0), &Array::thesis(), 1, Stop::never()).unwrap();
    let mut cold = Bonded::new(&linear(60.0, 10.0, 0.0), &Array::thesis(), 1, Stop::never()).unwrap().to_within(1e-9);
    for k in 1..60 {
        let depth = 0.02 * f64::from(k);
        let found = cells(&layer, depth, parabola(35.0, (80.0, 80.0)));
        let warm = layer.press(&found, Stop::never()).unwrap().to_vec();
        cold.forget();
        let exact = cold.press(&found, Stop::never()).unwrap().to_vec();
        let peak = exact.iter().fold(0.0_f64, |a, b| a.max(*b));
        for (a, b) in warm.iter().zip(&exact) {
            assert!((a - b).abs() < 2e-3 * peak, "frame {k}: {a} against {b}");
        }
    }
}

#[test]
fn a_call_that_is_asked_to_stop_stops_and_the_next_one_finds_the_same() {
    let (asked, array) = (|| true, Array::thesis());
    assert!(matches!(Bonded::new(&Foam::default(), &array, 2, Stop::when(&asked)), Err(Error::Interrupted)));
    let mut layer = Bonded::new(&Foam::default(), &array, 1, Stop::never()).unwrap();
    let mut fresh = Bonded::new(&Foam::default(), &array, 1, Stop::never()).unwrap();
    for depth in [0.5, 6.0] {
        let found = cells(&layer, depth, parabola(60.0, (80.0, 80.0)));
        assert_eq!(layer.press(&found, Stop::when(&asked)).unwrap_err(), Error::Interrupted);
        assert_eq!(layer.press(&found, Stop::never()).unwrap(), fresh.press(&found, Stop::never()).unwrap());
    }
}
