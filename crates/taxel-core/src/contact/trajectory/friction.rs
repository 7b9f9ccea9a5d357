//! Friction between a body and the foam (Coulomb), and of rolling.

use super::super::Body;
use super::super::shape::rotate;

/// Changes a body's speed along the foam, and that of its lowest point by its turning, by friction of sliding and of rolling.
///
/// `push` is by how much the normal force changes speed in this step, mm/ms. Friction of sliding acts against the slip and
/// at most stops it; friction of rolling follows.
pub fn act(body: &Body, push: f64, along: &mut [f64; 2], turning: &mut [f64; 2]) {
    if push <= 0.0 {
        return;
    }
    let (first, second, axis_deg) = body.shape.turns();
    let turns = [first, second];
    let by_axis = |v: [f64; 2]| <[f64; 2]>::from(rotate(v[0], v[1], axis_deg));
    let (before, turned_before) = (by_axis(*along), by_axis(*turning));
    let slip: [f64; 2] = std::array::from_fn(|k| before[k] + turned_before[k]);
    let stop: [f64; 2] = std::array::from_fn(|k| -slip[k] / (1.0 + turns[k]));
    let most = body.friction * push;
    let rub: [f64; 2] = if stop[0].hypot(stop[1]) <= most {
        stop
    } else {
        // Sliding friction acts against the slip, not along `stop`: the two differ for a cylinder, which is easier to turn
        // than to brake along its axis.
        let share = most / slip[0].hypot(slip[1]);
        std::array::from_fn(|k| -slip[k] * share.min(1.0 / (1.0 + turns[k])))
    };
    let mut after: [f64; 2] = std::array::from_fn(|k| before[k] + rub[k]);
    let mut turned_after: [f64; 2] = std::array::from_fn(|k| turned_before[k] + turns[k] * rub[k]);
    let speed = after[0].hypot(after[1]);
    if first + second > 0.0 && speed > 0.0 {
        let left = (1.0 - body.rolling_friction * push / speed).max(0.0);
        after = after.map(|v| v * left);
        turned_after = turned_after.map(|v| v * left);
    }
    let back = |v: [f64; 2]| <[f64; 2]>::from(rotate(v[0], v[1], -axis_deg));
    (*along, *turning) = (back(after), back(turned_after));
}

/// The part of a velocity across an axis.
pub fn across_axis(velocity: [f64; 2], axis_deg: f64) -> [f64; 2] {
    let (_, across) = rotate(velocity[0], velocity[1], axis_deg);
    rotate(0.0, across, -axis_deg).into()
}
