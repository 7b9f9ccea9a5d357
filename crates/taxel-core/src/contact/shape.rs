//! The shape of a body from below.

use serde::{Deserialize, Serialize};

use super::within;
use crate::Result;
use crate::allowed::Range;

/// The lower face of a body, which does not bend.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BodyShape {
    /// A ball.
    Sphere {
        /// mm.
        radius_mm: f64,
    },
    /// A cylinder that lies on its side, with flat ends.
    Cylinder {
        /// mm.
        radius_mm: f64,
        /// mm.
        length_mm: f64,
        /// Which way its axis lies: from the rows' direction (x) towards the columns' (y), degrees.
        #[serde(default)]
        axis_deg: f64,
    },
    /// A straight edge: two slopes that meet in a line.
    Edge {
        /// How steep each slope is, degrees from the foam's face.
        slope_deg: f64,
        /// Length of the line, mm.
        length_mm: f64,
        /// Which way the line lies, degrees as of a cylinder.
        #[serde(default)]
        axis_deg: f64,
    },
    /// Any other: its lower face above its lowest point, on a grid.
    HeightMap {
        /// Row by row, mm.
        heights_mm: Vec<Vec<f64>>,
        /// From one height to the next, mm.
        pitch_mm: f64,
    },
}

/// Longest side of a body, mm.
const LARGEST_MM: f64 = 1_000.0;

impl BodyShape {
    /// Checks that it makes sense.
    ///
    /// # Errors
    ///
    /// `Scene`, naming the parameter.
    pub fn check(&self, path: &str) -> Result<()> {
        let size = Range::ABOVE_0.at_most(LARGEST_MM);
        match self {
            Self::Sphere { radius_mm } => within(path, "radius_mm", *radius_mm, "mm", size),
            Self::Cylinder { radius_mm, length_mm, axis_deg } => {
                within(path, "radius_mm", *radius_mm, "mm", size)?;
                within(path, "length_mm", *length_mm, "mm", size)?;
                within(path, "axis_deg", *axis_deg, "degrees", Range::FINITE)
            }
            Self::Edge { slope_deg, length_mm, axis_deg } => {
                within(path, "slope_deg", *slope_deg, "degrees", Range::within(1.0, 89.0))?;
                within(path, "length_mm", *length_mm, "mm", size)?;
                within(path, "axis_deg", *axis_deg, "degrees", Range::FINITE)
            }
            Self::HeightMap { heights_mm, pitch_mm } => {
                within(path, "pitch_mm", *pitch_mm, "mm", size)?;
                let columns = heights_mm.first().map_or(0, Vec::len);
                if columns < 2 || heights_mm.len() < 2 || heights_mm.iter().any(|row| row.len() != columns) {
                    return Err(crate::Error::scene(format!(
                        "{path}: heights_mm has {} rows, and {columns} heights in the first row: must be 2 rows or \
                         more, each with the same number of heights, 2 or more",
                        heights_mm.len()
                    )));
                }
                for (y, row) in heights_mm.iter().enumerate() {
                    for (x, height) in row.iter().enumerate() {
                        within(&format!("{path}: row {y}, column {x}"), "heights_mm", *height, "mm", Range::FROM_0)?;
                    }
                }
                Ok(())
            }
        }
    }

    /// Height above the lowest point, at a point from the middle, mm; infinite where there is nothing.
    #[must_use]
    pub fn height_mm(&self, x: f64, y: f64) -> f64 {
        match self {
            Self::Sphere { radius_mm } => arc(*radius_mm, x.hypot(y)),
            Self::Cylinder { radius_mm, length_mm, axis_deg } => {
                let (along, across) = rotate(x, y, *axis_deg);
                if along.abs() <= length_mm / 2.0 { arc(*radius_mm, across.abs()) } else { f64::INFINITY }
            }
            Self::Edge { slope_deg, length_mm, axis_deg } => {
                let (along, across) = rotate(x, y, *axis_deg);
                let slope = slope_deg.to_radians().tan();
                if along.abs() <= length_mm / 2.0 { across.abs() * slope } else { f64::INFINITY }
            }
            Self::HeightMap { heights_mm, pitch_mm } => {
                let (rows, columns) = (heights_mm.len(), heights_mm[0].len());
                let index = |mm: f64, count: usize| mm / pitch_mm + (count - 1) as f64 / 2.0;
                let (px, py) = (index(x, columns), index(y, rows));
                if !(0.0..=(columns - 1) as f64).contains(&px) || !(0.0..=(rows - 1) as f64).contains(&py) {
                    return f64::INFINITY;
                }
                let (kx, ky) = ((px as usize).min(columns - 2), (py as usize).min(rows - 2));
                let (sx, sy) = (px - kx as f64, py - ky as f64);
                let row = |k: usize| heights_mm[k][kx] * (1.0 - sx) + heights_mm[k][kx + 1] * sx;
                row(ky) * (1.0 - sy) + row(ky + 1) * sy
            }
        }
    }

    /// Half of what the part below a height covers, along x and along y, mm.
    #[must_use]
    pub fn reach_mm(&self, height_mm: f64) -> (f64, f64) {
        let box_of = |along: f64, across: f64, axis_deg: f64| {
            let (sin, cos) = axis_deg.to_radians().sin_cos();
            ((along * cos).abs() + (across * sin).abs(), (along * sin).abs() + (across * cos).abs())
        };
        let chord = |radius: f64| half_chord(radius, height_mm);
        match self {
            Self::Sphere { radius_mm } => (chord(*radius_mm), chord(*radius_mm)),
            Self::Cylinder { radius_mm, length_mm, axis_deg } => box_of(length_mm / 2.0, chord(*radius_mm), *axis_deg),
            Self::Edge { slope_deg, length_mm, axis_deg } => {
                box_of(length_mm / 2.0, height_mm / slope_deg.to_radians().tan(), *axis_deg)
            }
            Self::HeightMap { heights_mm, pitch_mm } => {
                let half = |count: usize| (count - 1) as f64 * pitch_mm / 2.0;
                (half(heights_mm[0].len()), half(heights_mm.len()))
            }
        }
    }

    /// How wide the part below a height is the narrow way, mm; of a height map, whose parts differ, what a point of it
    /// finds around itself along x or y, in the mean.
    #[must_use]
    pub fn width_mm(&self, height_mm: f64) -> f64 {
        match self {
            Self::Sphere { radius_mm } => 2.0 * half_chord(*radius_mm, height_mm),
            Self::Cylinder { radius_mm, length_mm, .. } => length_mm.min(2.0 * half_chord(*radius_mm, height_mm)),
            Self::Edge { slope_deg, length_mm, .. } => length_mm.min(2.0 * height_mm / slope_deg.to_radians().tan()),
            Self::HeightMap { .. } => {
                let (half_x, half_y) = self.reach_mm(height_mm);
                let step = 2.0 * half_x.max(half_y) / SAMPLES as f64;
                let count = |half: f64| (2.0 * half / step) as usize + 1;
                let (columns, rows) = (count(half_x), count(half_y));
                let at = |x: usize, y: usize| self.height_mm(x as f64 * step - half_x, y as f64 * step - half_y);
                let below: Vec<bool> = (0..columns * rows).map(|k| at(k % columns, k / columns) < height_mm).collect();
                let mut narrow = vec![usize::MAX; below.len()];
                for y in 0..rows {
                    runs(&below, (y * columns..(y + 1) * columns).collect(), &mut narrow);
                }
                for x in 0..columns {
                    runs(&below, (x..below.len()).step_by(columns).collect(), &mut narrow);
                }
                let (sum, many) = narrow.iter().zip(&below).fold((0.0, 0.0), |(sum, many), (run, below)| {
                    if *below { (sum + *run as f64, many + 1.0) } else { (sum, many) }
                });
                if many > 0.0 { step * sum / many } else { 0.0 }
            }
        }
    }

    /// Its volume, mm^3, where that is known.
    #[must_use]
    pub fn volume_mm3(&self) -> Option<f64> {
        use std::f64::consts::PI;
        match self {
            Self::Sphere { radius_mm } => Some(4.0 / 3.0 * PI * radius_mm.powi(3)),
            Self::Cylinder { radius_mm, length_mm, .. } => Some(PI * radius_mm * radius_mm * length_mm),
            Self::Edge { .. } | Self::HeightMap { .. } => None,
        }
    }

    /// How easily it turns, along x and y turned by the angle that comes third: mass times radius squared over the moment
    /// of inertia. Of a solid body; 0 where it does not roll.
    #[must_use]
    pub fn turns(&self) -> (f64, f64, f64) {
        match self {
            Self::Sphere { .. } => (2.5, 2.5, 0.0),
            // It rolls across its axis.
            Self::Cylinder { axis_deg, .. } => (0.0, 2.0, *axis_deg),
            Self::Edge { .. } | Self::HeightMap { .. } => (0.0, 0.0, 0.0),
        }
    }
}

/// Number of samples along the longer side of a height map.
const SAMPLES: usize = 400;

/// Limits the width at each sample of a line to the length of the run of samples, below or not, that contains it.
fn runs(below: &[bool], line: Vec<usize>, narrow: &mut [usize]) {
    for run in line.chunk_by(|a, b| below[*a] == below[*b]) {
        for k in run {
            narrow[*k] = narrow[*k].min(run.len());
        }
    }
}

/// Half of how wide a ball is so high above its lowest point, mm.
fn half_chord(radius: f64, height: f64) -> f64 {
    if height >= radius { radius } else { (height * (2.0 * radius - height)).sqrt() }
}

fn arc(radius: f64, off: f64) -> f64 {
    if off < radius { radius - (radius * radius - off * off).sqrt() } else { f64::INFINITY }
}

/// A point by an axis: along it and across it.
pub(super) fn rotate(x: f64, y: f64, axis_deg: f64) -> (f64, f64) {
    let (sin, cos) = axis_deg.to_radians().sin_cos();
    (x * cos + y * sin, y * cos - x * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_below_a_height_lies_beyond_its_reach() {
        let heights_mm = (0..7).map(|y| (0..5).map(|x| f64::from(x * y) * 0.3).collect()).collect();
        for shape in [
            BodyShape::Sphere { radius_mm: 12.0 },
            BodyShape::Cylinder { radius_mm: 9.0, length_mm: 40.0, axis_deg: 35.0 },
            BodyShape::Edge { slope_deg: 50.0, length_mm: 30.0, axis_deg: -70.0 },
            BodyShape::HeightMap { heights_mm, pitch_mm: 3.0 },
        ] {
            shape.check("body").unwrap();
            for height in [0.05, 1.0, 5.0, 30.0] {
                let (rx, ry) = shape.reach_mm(height);
                for k in 0..160 {
                    for l in 0..160 {
                        let (x, y) = (0.5 * f64::from(k) - 40.0, 0.5 * f64::from(l) - 40.0);
                        let outside = x.abs() > rx + 1e-9 || y.abs() > ry + 1e-9;
                        assert!(!(outside && shape.height_mm(x, y) < height), "{shape:?}: {x}, {y} below {height}");
                    }
                }
            }
            assert!(shape.height_mm(0.0, 0.0).is_finite());
        }
    }

    #[test]
    fn a_height_map_is_as_wide_as_the_body_that_it_shows() {
        let map = |shape: &BodyShape| BodyShape::HeightMap {
            heights_mm: (0..121)
                .map(|y| {
                    (0..161)
                        .map(|x| shape.height_mm(0.1 * f64::from(x - 80), 0.1 * f64::from(y - 60)).min(9.0))
                        .collect()
                })
                .collect(),
            pitch_mm: 0.1,
        };
        // Mean length of the shorter of two perpendicular chords through a point of a disc, in diameters.
        let disc = 4.359 * 8.0 / std::f64::consts::PI * (1.0 - 0.5_f64.sqrt());
        for (shape, height, width, map_width) in [
            (BodyShape::Sphere { radius_mm: 5.0 }, 0.5, 4.359, disc),
            (BodyShape::Cylinder { radius_mm: 4.0, length_mm: 12.0, axis_deg: 0.0 }, 0.2, 2.498, 2.498),
            (BodyShape::Cylinder { radius_mm: 9.0, length_mm: 1.5, axis_deg: 90.0 }, 0.9, 1.5, 1.5),
            (BodyShape::Edge { slope_deg: 45.0, length_mm: 10.0, axis_deg: 90.0 }, 0.6, 1.2, 1.2),
        ] {
            assert!((shape.width_mm(height) / width - 1.0).abs() < 0.01, "{shape:?}: {}", shape.width_mm(height));
            let map = map(&shape).width_mm(height);
            assert!((map / map_width - 1.0).abs() < 0.1, "{shape:?}: {map} of {map_width}");
        }
        // Two ridges are no wider than one.
        let ridges = vec![(0..81).map(|x: i32| f64::from((x - 20).abs().min((x - 60).abs()))).collect(); 9];
        let width = BodyShape::HeightMap { heights_mm: ridges, pitch_mm: 0.5 }.width_mm(2.0);
        assert!((width / 2.0 - 1.0).abs() < 0.1, "{width}");
    }

    #[test]
    fn each_nonsense_parameter_is_named() {
        let ragged = BodyShape::HeightMap { heights_mm: vec![vec![0.0, 1.0], vec![0.0]], pitch_mm: 1.0 };
        let below = BodyShape::HeightMap { heights_mm: vec![vec![0.0, 1.0], vec![0.0, -1.0]], pitch_mm: 1.0 };
        for (name, shape) in [
            ("radius_mm", BodyShape::Sphere { radius_mm: -1.0 }),
            ("length_mm", BodyShape::Cylinder { radius_mm: 1.0, length_mm: f64::NAN, axis_deg: 0.0 }),
            ("slope_deg", BodyShape::Edge { slope_deg: 90.0, length_mm: 5.0, axis_deg: 0.0 }),
            ("heights_mm", ragged),
            ("row 1, column 1: heights_mm", below),
        ] {
            let text = shape.check("bodies[2]").unwrap_err().to_string();
            assert!(text.contains(name) && text.contains("bodies[2]"), "{text}");
        }
    }
}
