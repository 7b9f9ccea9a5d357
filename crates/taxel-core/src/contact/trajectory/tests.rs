//! Against energy, momentum, Coulomb's law and the ranges of the model.

use super::super::shape::rotate;
use super::super::{BodyShape, Foam, Motion};
use super::*;

const QUARTER_US: f64 = 48.0;

fn body(shape: BodyShape, mass_g: f64, motion: Move) -> Body {
    Body {
        shape,
        x_mm: 80.0,
        y_mm: 80.0,
        mass_g: Some(mass_g),
        material: None,
        stiffness_n_mm: None,
        friction: 0.6,
        rolling_friction: 0.0,
        after_ms: 0.0,
        motion,
    }
}

fn alone(foam: Foam, body: Body) -> Scene {
    let bodies = vec![body];
    Scene { cells_per_pitch: 1, foam, bodies, slant_deg: 0.0, downhill_deg: 0.0, lead_ms: 20.0, tail_ms: 20.0 }
}

fn dropped(foam: Foam, radius_mm: f64, height_mm: f64, after: u32) -> Scene {
    let press = Press { peak_n: Some(1.0), depth_mm: None, speed_mm_s: 50.0, hold_ms: 100.0, wait_ms: 50.0 };
    let motion = Move::Dropped { height_mm, ending: Ending::Caught { after, press } };
    alone(foam, body(BodyShape::Sphere { radius_mm }, 36.0, motion))
}

fn play(scene: &Scene, step_us: f64) -> Result<Motion> {
    Motion::compute(scene, &Array::thesis(), step_us, Stop::never())
}

fn undamped() -> Foam {
    Foam { damping_s_m: 0.0, dashpot_ms: 0.0, modulus_kpa: 75.0, ..Foam::default() }
}

#[test]
fn without_losses_the_ball_comes_back_as_fast_as_it_fell() {
    let motion = play(&dropped(undamped(), 30.0, 120.0, 3), QUARTER_US).unwrap();
    let speeds: Vec<f64> = motion.contacts[..3].iter().map(|c| c.speed_m_s).collect();
    let fallen = (2.0 * GRAVITY * 120.0_f64).sqrt();
    for speed in speeds {
        assert!((speed / fallen - 1.0).abs() < 0.02, "{speed} of {fallen} m/s");
    }
}

#[test]
fn damping_takes_the_share_of_speed_that_it_should() {
    // Ranges of the model over radii, drops and moduli.
    for (chi, low, high) in [(0.25, 0.72, 0.81), (0.5, 0.56, 0.66), (1.0, 0.37, 0.47)] {
        for (radius, drop, modulus) in [(25.0, 100.0, 60.0), (35.0, 200.0, 60.0), (30.0, 150.0, 100.0)] {
            let foam = Foam { damping_s_m: chi, dashpot_ms: 0.0, modulus_kpa: modulus, ..Foam::default() };
            let motion = play(&dropped(foam, radius, drop, 2), QUARTER_US).unwrap();
            let ratio = motion.contacts[1].speed_m_s / motion.contacts[0].speed_m_s;
            assert!((low..=high).contains(&ratio), "chi {chi}, R {radius}: {ratio}");
        }
    }
}

#[test]
fn an_impact_is_as_long_deep_and_hard_as_the_model_says() {
    // E 60 kPa, 36 g: contact 14 to 19 ms, depth 7.2 to 9.8 of 10 mm, peak 12 N to 70 where the solid is pressed.
    for (radius, drop) in [(25.0, 100.0), (25.0, 200.0), (35.0, 100.0), (35.0, 200.0)] {
        let foam = Foam { dashpot_ms: 0.0, ..Foam::default() };
        let motion = play(&dropped(foam, radius, drop, 2), QUARTER_US).unwrap();
        let first = &motion.contacts[0];
        let ms = 1e-3 * (first.stop_us - first.start_us);
        let deepest = motion.tracks[0].depth_mm.iter().fold(0.0_f32, |a, b| a.max(*b));
        assert!((13.0..19.5).contains(&ms), "{ms} ms");
        assert!((7.2..9.8).contains(&deepest), "{deepest} mm");
        assert!((11.0..75.0).contains(&first.peak_n), "{} N", first.peak_n);
    }
}

#[test]
fn truth_does_not_hang_on_the_step() {
    let scene = dropped(Foam::default(), 28.0, 150.0, 4);
    let (coarse, fine) = (play(&scene, 48.0).unwrap(), play(&scene, 6.0).unwrap());
    for (a, b) in coarse.contacts.iter().zip(&fine.contacts).take(2) {
        assert!((a.start_us - b.start_us).abs() < 40.0 && (a.stop_us - b.stop_us).abs() < 40.0, "{a:?} {b:?}");
    }
    let fallen_us = 1e3 * (2.0 * 150.0 / GRAVITY).sqrt();
    assert!((fine.contacts[0].start_us - 20_000.0 - fallen_us).abs() < 3.0);
}

#[test]
fn force_is_zero_outside_touches_and_only_there() {
    let motion = play(&dropped(Foam::default(), 30.0, 150.0, 3), QUARTER_US).unwrap();
    assert_eq!(motion.contacts.iter().filter(|c| c.kind == TouchKind::Hand).count(), 1);
    for (k, force) in motion.tracks[0].force_n.iter().enumerate() {
        let at = k as f64 * QUARTER_US;
        let inside = motion.contacts.iter().any(|c| c.start_us < at && at < c.stop_us);
        assert_eq!(*force > 0.0, inside, "at {at} us: {force} N");
    }
}

#[test]
fn the_dashpot_frees_the_ball_before_it_is_out_of_the_foam() {
    let motion = play(&dropped(Foam::default(), 30.0, 150.0, 2), QUARTER_US).unwrap();
    let left = (motion.contacts[0].stop_us / QUARTER_US) as usize;
    assert!(motion.tracks[0].depth_mm[left] > 0.2, "{}", motion.tracks[0].depth_mm[left]);
}

#[test]
fn a_ball_left_alone_comes_to_rest_at_its_weight() {
    let ending = Ending::LeftToRest { rest_ms: 1500.0, lift_mm_s: 50.0 };
    let mut scene = dropped(Foam::default(), 30.0, 120.0, 2);
    scene.bodies[0].motion = Move::Dropped { height_mm: 120.0, ending };
    let motion = play(&scene, QUARTER_US).unwrap();
    let last = motion.contacts.last().unwrap();
    assert_eq!(last.kind, TouchKind::Rest);
    let still = ((20.0 + 1400.0) * 1e3 / QUARTER_US) as usize;
    assert!(
        (f64::from(motion.tracks[0].force_n[still]) - 36.0 * GRAVITY).abs() < 2e-3,
        "{} N",
        motion.tracks[0].force_n[still]
    );
}

#[test]
fn a_press_reaches_its_force() {
    let motion = play(&dropped(Foam::default(), 30.0, 120.0, 2), QUARTER_US).unwrap();
    let hand = motion.contacts.last().unwrap();
    assert!((1.0..1.3).contains(&hand.peak_n), "{}", hand.peak_n);
    assert!((hand.speed_m_s - 0.05).abs() < 1e-3);
}

#[test]
fn what_cannot_be_played_is_said() {
    let soft = Foam { modulus_kpa: 5.0, ..Foam::default() };
    assert!(matches!(play(&dropped(soft, 30.0, 400.0, 2), QUARTER_US), Err(Error::Scene(_))));
    let tired = Foam { damping_s_m: 5.0, ..Foam::default() };
    assert!(matches!(play(&dropped(tired, 30.0, 100.0, 9), QUARTER_US), Err(Error::Scene(_))));
    assert!(play(&dropped(Foam::default(), 30.0, 100.0, 2), f64::NAN).is_err());
}

#[test]
fn a_step_that_would_not_end_is_refused_before_or_on_the_way_and_ctrl_c_is_answered() {
    let scene = dropped(Foam::default(), 30.0, 100.0, 2);
    for step_us in [1e-3, 5e-324] {
        assert!(matches!(play(&scene, step_us), Err(Error::Scene(_))));
    }
    // What is known beforehand fits, what the ball then does is longer.
    let mut long = scene.clone();
    (long.lead_ms, long.tail_ms) = (0.0, 0.0);
    let least_us = us(long.least_ms()) / MOST_STEPS as f64;
    assert!(matches!(play(&long, 1.001 * least_us), Err(Error::Scene(_))));
    let asked = || true;
    let stopped = Motion::compute(&scene, &Array::thesis(), QUARTER_US, Stop::when(&asked));
    assert_eq!(stopped.unwrap_err(), Error::Interrupted);
}

#[test]
fn a_course_that_leads_off_the_array_and_a_lift_before_the_landing_are_said() {
    for motion in [
        Move::Rolled(Along { speed_mm_s: 300.0, ..along(2_000.0) }),
        Move::Slid(Along { speed_mm_s: 300.0, press_n: Some(1.0), ..along(2_000.0) }),
    ] {
        let mut scene = alone(Foam::default(), ball(motion));
        scene.bodies[0].rolling_friction = 0.0;
        assert!(matches!(play(&scene, QUARTER_US), Err(Error::Scene(_))));
    }
    let early = Ending::LeftToRest { rest_ms: 150.0, lift_mm_s: 50.0 };
    let scene = alone(Foam::default(), ball(Move::Dropped { height_mm: 120.0, ending: early.clone() }));
    assert!(matches!(play(&scene, QUARTER_US), Err(Error::Scene(_))));
    let heavy = body(BodyShape::Sphere { radius_mm: 20.0 }, 1e300, Move::Dropped { height_mm: 50.0, ending: early });
    assert!(matches!(play(&alone(Foam::default(), heavy), QUARTER_US), Err(Error::Scene(_))));
}

fn ball(motion: Move) -> Body {
    body(BodyShape::Sphere { radius_mm: 20.0 }, 36.0, motion)
}

fn along(for_ms: f64) -> Along {
    Along { speed_mm_s: 60.0, toward_deg: 30.0, for_ms, press_n: None }
}

/// Speed along the foam so long after the scene's start, over 5 ms, mm/s.
fn speed_at(scene: &Scene, ms: f64) -> f64 {
    let motion = play(scene, QUARTER_US).unwrap();
    let track = &motion.tracks[0];
    let end = (ms * 1e3 / QUARTER_US) as usize;
    let moved = |v: &[f32]| f64::from(v[end] - v[end - 100]);
    1e3 * moved(&track.x_mm).hypot(moved(&track.y_mm)) / (0.1 * QUARTER_US)
}

#[test]
fn a_ball_that_slides_ends_rolling_at_five_sevenths_of_its_speed() {
    // Whatever the friction: angular momentum about the point of contact is kept.
    for friction in [0.1, 0.6] {
        let mut scene = alone(Foam::default(), ball(Move::Slid(along(400.0))));
        scene.bodies[0].friction = friction;
        let speed = speed_at(&scene, 365.0);
        assert!((speed / 60.0 - 5.0 / 7.0).abs() < 2e-3, "{friction}: {speed} mm/s");
    }
}

#[test]
fn a_block_that_slides_stops_where_coulomb_says() {
    let flat = BodyShape::HeightMap { heights_mm: vec![vec![0.0; 2]; 2], pitch_mm: 20.0 };
    let mut scene = alone(Foam::default(), body(flat, 80.0, Move::Slid(along(200.0))));
    scene.bodies[0].friction = 0.3;
    let motion = play(&scene, QUARTER_US).unwrap();
    let track = &motion.tracks[0];
    let moved = |v: &[f32]| f64::from(v[v.len() - 1] - v[0]);
    let way = moved(&track.x_mm).hypot(moved(&track.y_mm));
    let coulomb = 0.06_f64.powi(2) / (2.0 * 0.3 * GRAVITY);
    assert!((way / coulomb - 1.0).abs() < 0.03, "{way} mm, {coulomb}");
    assert!((moved(&track.y_mm) / moved(&track.x_mm) - 30f64.to_radians().tan()).abs() < 1e-3);
}

#[test]
fn a_ball_rolls_down_a_slant_at_five_sevenths_of_gravity_and_slides_down_a_slippery_one() {
    for (friction, share) in [(0.6, 5.0 / 7.0), (0.0, 1.0)] {
        let mut scene = alone(Foam::default(), ball(Move::Rolled(Along { speed_mm_s: 1.0, ..along(300.0) })));
        (scene.slant_deg, scene.downhill_deg, scene.bodies[0].friction) = (5.0, 30.0, friction);
        let speed = speed_at(&scene, 350.0) - speed_at(&scene, 150.0);
        let expected = 1e3 * share * GRAVITY * 5f64.to_radians().sin() * 200.0;
        assert!((speed / expected - 1.0).abs() < 0.01, "{friction}: {speed} of {expected} mm/s");
    }
}

#[test]
fn a_cylinder_rolls_across_its_axis_and_slides_along_it() {
    let shape = BodyShape::Cylinder { radius_mm: 15.0, length_mm: 30.0, axis_deg: 120.0 };
    let scene = |toward_deg| {
        let along = Along { toward_deg, ..along(120.0) };
        alone(Foam::default(), body(shape.clone(), 60.0, Move::Rolled(along)))
    };
    assert!((speed_at(&scene(30.0), 165.0) / 60.0 - 1.0).abs() < 1e-3, "{}", speed_at(&scene(30.0), 165.0));
    assert!(speed_at(&scene(120.0), 165.0) < 0.1);
}

#[test]
fn friction_acts_against_the_slip_of_a_cylinder_that_slides_aslant() {
    // Along the axis friction only brakes, across it it also turns: slip there is lost three times as fast.
    let (friction, steps, dt) = (0.3, 1_400, 1e-3 * QUARTER_US);
    let shape = BodyShape::Cylinder { radius_mm: 10.0, length_mm: 30.0, axis_deg: 45.0 };
    let course = Along { speed_mm_s: 500.0, toward_deg: 0.0, for_ms: 80.0, press_n: None };
    let mut scene = alone(Foam::default(), body(shape, 100.0, Move::Slid(course)));
    (scene.bodies[0].friction, scene.bodies[0].x_mm) = (friction, 60.0);
    let motion = play(&scene, QUARTER_US).unwrap();
    let track = &motion.tracks[0];
    let began = (0..track.x_mm.len()).find(|k| track.x_mm[*k] > 60.0).unwrap() - 1;
    let (mut speed, mut at): ([f64; 2], [f64; 2]) = (rotate(0.5, 0.0, 45.0).into(), [0.0; 2]);
    let mut slip = speed;
    for _ in 0..steps {
        let loss = slip.map(|part| friction * GRAVITY * dt * part / slip[0].hypot(slip[1]));
        at = std::array::from_fn(|k| at[k] + dt * (speed[k] - loss[k] / 2.0));
        speed = [speed[0] - loss[0], speed[1] - loss[1]];
        slip = [slip[0] - loss[0], slip[1] - 3.0 * loss[1]];
    }
    assert!(slip[0].hypot(slip[1]) > 0.05, "it slips until then");
    let (x, y) = rotate(at[0], at[1], -45.0);
    let (right, down) = (track.x_mm[began + steps] - 60.0, track.y_mm[began + steps] - 80.0);
    assert!((f64::from(right) - x).abs() < 0.1 && (f64::from(down) - y).abs() < 0.1, "{right} {down}, {x} {y}");
}

#[test]
fn a_fall_on_a_slant_meets_it_where_it_should() {
    let mut scene = alone(Foam::default(), ball(Move::Dropped { height_mm: 100.0, ending: Ending::default() }));
    (scene.slant_deg, scene.downhill_deg) = (25.0, 90.0);
    let motion = play(&scene, QUARTER_US).unwrap();
    let first = &motion.contacts[0];
    assert!((first.start_us - 20e3 - 1e3 * (2.0 * 100.0 / GRAVITY).sqrt()).abs() < 300.0, "{first:?}");
    let normal = (2.0 * GRAVITY * 100.0).sqrt() * 25f64.to_radians().cos();
    assert!((first.speed_m_s / normal - 1.0).abs() < 5e-3, "{first:?}");
    let k = (first.start_us / QUARTER_US) as usize;
    assert!((motion.tracks[0].y_mm[k] - 80.0).abs() < 0.5 && (motion.tracks[0].x_mm[k] - 80.0).abs() < 1e-3);
}

#[test]
fn a_ball_that_gives_is_off_sooner_and_without_bottoming_out() {
    // A tennis ball: 56 g from 0.6 m. A rigid one would press the solid.
    let motion = Move::Dropped { height_mm: 600.0, ending: Ending::LeftToRest { rest_ms: 420.0, lift_mm_s: 50.0 } };
    let mut scene = alone(Foam::default(), body(BodyShape::Sphere { radius_mm: 33.0 }, 56.0, motion));
    let rigid = play(&scene, QUARTER_US).unwrap().contacts[0].peak_n;
    scene.bodies[0].stiffness_n_mm = Some(25.0);
    let motion = play(&scene, QUARTER_US).unwrap();
    let first = &motion.contacts[0];
    let ms = 1e-3 * (first.stop_us - first.start_us);
    assert!((4.0..16.0).contains(&ms) && first.peak_n < 0.8 * rigid, "{first:?}, rigid {rigid} N");
    assert!(motion.tracks[0].depth_mm.iter().all(|d| *d <= 10.0));
}

#[test]
fn a_touch_that_is_too_narrow_is_told_how_many_cells_would_do() {
    // A touch that needs more cells than allowed is reported with the most there may be; a wide touch is not.
    let press = Press { peak_n: None, depth_mm: Some(0.05), speed_mm_s: 50.0, hold_ms: 2.0, wait_ms: 0.0 };
    let shape = BodyShape::Edge { slope_deg: 45.0, length_mm: 20.0, axis_deg: 0.0 };
    let mut scene = alone(undamped(), body(shape, 36.0, Move::Pressed(press)));
    assert!(play(&scene, 200.0).unwrap().narrow.unwrap().to_string().contains("the maximum is 16"));
    scene.bodies[0].shape = BodyShape::Sphere { radius_mm: 60.0 };
    assert_eq!(play(&scene, 200.0).unwrap().narrow, None);
}
