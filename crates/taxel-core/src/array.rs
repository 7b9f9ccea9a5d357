//! The geometry of a sensor.

use serde::{Deserialize, Serialize};

use crate::allowed::above_0;
use crate::{Hint, Result, problem};

/// The geometry of a sensor: rows, columns, which taxels exist, and how far apart or where they are, if that is known.
///
/// A taxel's index is `row * columns + column`; `x` is the column, `y` the row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Array {
    /// Number of rows, from top to bottom.
    pub rows: u16,
    /// Number of columns, from left to right.
    pub columns: u16,
    /// Distance between the centres of neighbours; `None` where it is unknown, or where `places` are known.
    #[serde(default)]
    pub pitch_mm: Option<Pitch>,
    /// Name of the sensor.
    pub name: String,
    /// Which taxels exist, by index; `None` if all do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exists: Option<Vec<bool>>,
    /// The place of each taxel, of a sensor without even distances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
    /// The name of each taxel, by index, as a table's columns name them; "" for one without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub names: Option<Vec<String>>,
}

/// Distance between the centres of neighbours, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "PitchInFile", into = "PitchInFile")]
pub struct Pitch {
    /// From one row to the next.
    pub rows: f64,
    /// From one column to the next.
    pub columns: f64,
}

impl Pitch {
    /// The same distance between rows and between columns.
    #[must_use]
    pub fn square(pitch_mm: f64) -> Self {
        Self { rows: pitch_mm, columns: pitch_mm }
    }

    /// The area of a taxel, mm2.
    #[must_use]
    pub fn area(self) -> f64 {
        self.rows * self.columns
    }
}

/// The pitch in files.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "pitch_mm must be a number, a pair of numbers (rows, columns), or null")]
enum PitchInFile {
    Square(f64),
    Pair([f64; 2]),
}

impl From<PitchInFile> for Pitch {
    fn from(stated: PitchInFile) -> Self {
        match stated {
            PitchInFile::Square(pitch) => Self::square(pitch),
            PitchInFile::Pair([rows, columns]) => Self { rows, columns },
        }
    }
}

impl From<Pitch> for PitchInFile {
    fn from(Pitch { rows, columns }: Pitch) -> Self {
        if rows == columns { Self::Square(rows) } else { Self::Pair([rows, columns]) }
    }
}

/// The place of each taxel, by index; what is given for one that does not exist is not used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Places {
    /// To the right.
    pub x: Vec<f64>,
    /// Downwards.
    pub y: Vec<f64>,
    /// The area of each taxel, in the square of the unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub area: Option<Vec<f64>>,
    /// The unit of places; `None` where it is unknown.
    #[serde(default)]
    pub unit: Option<PlaceUnit>,
}

/// The unit of places.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlaceUnit {
    /// Millimetres.
    Mm,
}

impl Array {
    /// An array whose taxels all exist, as far apart in rows as in columns.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no row or no column, or the pitch is not above 0.
    pub fn new(rows: u16, columns: u16, pitch_mm: f64, name: &str) -> Result<Self> {
        let array = Self { pitch_mm: Some(Pitch::square(pitch_mm)), ..Self::unmeasured(rows, columns, name) };
        array.check()?;
        Ok(array)
    }

    /// An array whose taxels all exist, of unknown pitch; `check` refuses one without rows or columns.
    #[must_use]
    pub fn unmeasured(rows: u16, columns: u16, name: &str) -> Self {
        Self { rows, columns, pitch_mm: None, name: name.to_owned(), exists: None, places: None, names: None }
    }

    /// The thesis' array: 64 x 64 taxels, 2.67 mm apart (chapter 4).
    #[must_use]
    pub fn thesis() -> Self {
        Self { pitch_mm: Some(Pitch::square(2.67)), ..Self::unmeasured(64, 64, "thesis 64x64") }
    }

    /// Checks an array that a file or a caller described.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no row or no column, if the pitch is not above 0, if there is a pitch beside places, if
    /// `exists`, places or names have another length, or if a place is not finite or an area not above 0.
    pub fn check(&self) -> Result<()> {
        let Self { rows, columns, .. } = self;
        if *rows == 0 || *columns == 0 {
            return Err(problem!("array of {rows} x {columns} taxels: needs 1 row and 1 column or more"));
        }
        if let Some(Pitch { rows, columns }) = self.pitch_mm {
            above_0("pitch_mm", rows, "")?;
            above_0("pitch_mm", columns, "")?;
            if self.places.is_some() {
                return Err(problem!("array {}: pitch_mm and places are both given: give only one of them", self.name));
            }
        }
        let of_each = |name: &str, entries: usize| {
            (entries == self.len())
                .then_some(())
                .ok_or_else(|| problem!(name; " has {entries} entries for {rows} x {columns} taxels"))
        };
        if let Some(exists) = &self.exists {
            of_each("exists", exists.len())?;
        }
        if let Some(names) = &self.names {
            of_each("names", names.len())?;
        }
        let Some(Places { x, y, area, unit: _ }) = &self.places else { return Ok(()) };
        for (name, values) in [("places.x", Some(x)), ("places.y", Some(y)), ("places.area", area.as_ref())] {
            let Some(values) = values else { continue };
            of_each(name, values.len())?;
            for (taxel, &value) in values.iter().enumerate().filter(|&(taxel, _)| self.has(taxel)) {
                let is_area = name == "places.area";
                if !value.is_finite() || (is_area && value <= 0.0) {
                    let right = if is_area { "above 0 and finite" } else { "finite" };
                    return Err(problem!(
                        "{name} of the taxel at {} is {value}: must be {right}",
                        self.position_text(taxel)
                    ));
                }
            }
        }
        Ok(())
    }

    /// Number of cells in the grid, whether a taxel exists there or not.
    #[must_use]
    pub fn len(&self) -> usize {
        usize::from(self.rows) * usize::from(self.columns)
    }

    /// Always false: an array has at least one taxel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The index of the taxel at column `x`, row `y`; both must be on the array.
    #[must_use]
    pub fn index(&self, x: u16, y: u16) -> usize {
        usize::from(y) * usize::from(self.columns) + usize::from(x)
    }

    /// Where a taxel is, in text for people; `taxel` is its index, row by row.
    #[must_use]
    pub fn position_text(&self, taxel: usize) -> String {
        let columns = usize::from(self.columns).max(1);
        format!("row {}, column {}", taxel / columns, taxel % columns)
    }

    /// Whether a taxel exists.
    #[must_use]
    pub fn has(&self, taxel: usize) -> bool {
        self.exists.as_ref().is_none_or(|exists| exists[taxel])
    }

    /// The area of each taxel, mm2, by index; `None` where it is not known.
    #[must_use]
    pub fn areas_mm2(&self) -> Option<Vec<f64>> {
        match (&self.pitch_mm, &self.places) {
            (Some(pitch), _) => Some(vec![pitch.area(); self.len()]),
            (None, Some(Places { area, unit: Some(PlaceUnit::Mm), .. })) => area.clone(),
            _ => None,
        }
    }

    /// The axis of each channel, 0 to 2, where the channels are the axes of taxels, as names that end in _x, _y and _z say,
    /// equally many of each; else empty.
    #[must_use]
    pub fn axes(&self) -> Vec<usize> {
        let axis_of = |name: &String| ["_x", "_y", "_z"].iter().position(|axis| name.ends_with(axis));
        let axes: Vec<_> = self.names.iter().flatten().map_while(axis_of).collect();
        let is_third = |axis| 3 * axes.iter().filter(|&&of| of == axis).count() == self.len();
        if self.is_channels() && (0..3).all(is_third) { axes } else { vec![] }
    }

    /// Whether it is a single row or column with neither pitch nor places, which has no map, centre or area.
    #[must_use]
    pub fn is_channels(&self) -> bool {
        self.pitch_mm.is_none() && self.places.is_none() && (self.rows == 1 || self.columns == 1)
    }

    /// Whether another array has the same rows, columns and taxels, so that what was measured or trained on it fits.
    #[must_use]
    pub fn fits(&self, other: &Self) -> bool {
        (self.rows, self.columns) == (other.rows, other.columns)
            && (self.exists == other.exists || (0..self.len()).all(|taxel| self.has(taxel) == other.has(taxel)))
    }

    /// Whether frames of another sensor can be those of this one's first rows and columns: both are grids of taxels that all
    /// exist, and the other one is smaller.
    #[must_use]
    pub fn holds(&self, other: &Self) -> bool {
        let is_whole =
            |array: &Self| array.exists.is_none() && array.places.is_none() && array.rows.min(array.columns) > 1;
        is_whole(self)
            && is_whole(other)
            && other.rows <= self.rows
            && other.columns <= self.columns
            && other.len() < self.len()
    }

    /// Values of a smaller array, row by row, as those of this one's first rows and columns, with others beyond its far edges.
    #[must_use]
    pub fn padded<T: Clone>(&self, values: &[T], columns: u16, beyond: &T) -> Vec<T> {
        let mut padded = vec![beyond.clone(); self.len()];
        let rows = padded.chunks_exact_mut(usize::from(self.columns));
        for (row, values) in rows.zip(values.chunks_exact(usize::from(columns))) {
            row[..values.len()].clone_from_slice(values);
        }
        padded
    }

    /// The distance between neighbours, for `subject` that needs it.
    ///
    /// # Errors
    ///
    /// `Problem` if it is not known.
    pub fn pitch(&self, subject: &str) -> Result<Pitch> {
        let name = &self.name;
        self.pitch_mm.ok_or_else(|| match self.places {
            None => problem!("{subject} needs distances in mm, but the pitch of {name} is not known")
                .with_hint("array", Hint::Pitch),
            Some(_) => problem!("{subject} needs one pitch, but {name} states the position of each taxel separately"),
        })
    }

    /// The distance between neighbours, for `subject` that needs the same between rows and between columns, mm.
    ///
    /// # Errors
    ///
    /// `Problem` if it is not known, or not the same.
    pub fn square_pitch(&self, subject: &str) -> Result<f64> {
        let Pitch { rows, columns } = self.pitch(subject)?;
        if rows == columns {
            return Ok(rows);
        }
        Err(problem!(
            "{subject} needs the same pitch between rows and between columns; {} has {rows} and {columns} mm",
            self.name
        ))
    }

    /// Whether taxels are known to be side by side: those of channels and a single one are not.
    #[must_use]
    pub fn has_neighbours(&self) -> bool {
        self.len() > 1 && (self.pitch_mm.is_some() || (self.rows > 1 && self.columns > 1))
    }

    /// Refuses, for `subject` that needs them, an array whose taxels are not known to have neighbours: channels.
    ///
    /// # Errors
    ///
    /// `Problem` for a single row or column without a pitch.
    pub fn check_neighbours(&self, subject: &str) -> Result<()> {
        if self.has_neighbours() || self.len() == 1 {
            return Ok(());
        }
        Err(problem!(
            "{subject} needs taxels that are neighbours on a grid; {} has {} x {} channels without a pitch",
            self.name,
            self.rows,
            self.columns
        )
        .with_hint("array", Hint::LayOut))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Array {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn a_pitch_is_a_number_a_pair_or_unknown() {
        let pitch_of = |pitch: &str| read(&format!(r#"{{"rows": 2, "columns": 3, "pitch_mm": {pitch}, "name": "a"}}"#));
        assert_eq!(pitch_of("1").pitch_mm, Some(Pitch::square(1.0)));
        assert_eq!(pitch_of("[1, 1]").pitch_mm, Some(Pitch::square(1.0)));
        assert_eq!(pitch_of("null").pitch_mm, None);
        assert_eq!(pitch_of("2.67").pitch_mm, Some(Pitch::square(2.67)));
        assert_eq!(pitch_of("[7.62, 5.08]").pitch_mm, Some(Pitch { rows: 7.62, columns: 5.08 }));
        assert!(
            serde_json::from_str::<Array>(r#"{"rows": 2, "columns": 3, "pitch_mm": "wide", "name": "a"}"#).is_err()
        );
        for array in [Array::thesis(), Array::new(3, 4, 1.0, "one").unwrap(), Array::unmeasured(3, 4, "none")] {
            assert_eq!(read(&serde_json::to_string(&array).unwrap()), array);
        }
    }

    #[test]
    fn the_board_s_array_is_written_as_before() {
        let text = serde_json::to_string(&Array::thesis()).unwrap();
        assert_eq!(text, r#"{"rows":64,"columns":64,"pitch_mm":2.67,"name":"thesis 64x64"}"#);
    }

    #[test]
    fn places_are_one_a_taxel_and_beside_no_pitch() {
        let places = Places { x: vec![0.0, 1.5], y: vec![2.0, 0.5], area: Some(vec![9.0, 4.0]), unit: None };
        let array = Array { places: Some(places.clone()), ..Array::unmeasured(1, 2, "two") };
        array.check().unwrap();
        assert_eq!(read(&serde_json::to_string(&array).unwrap()), array);
        let pitched = Array { pitch_mm: Some(Pitch::square(2.0)), ..array.clone() };
        assert!(pitched.check().is_err());
        let short = Places { x: vec![0.0], ..places.clone() };
        assert!(Array { places: Some(short), ..array.clone() }.check().is_err());
        let flat = Places { area: Some(vec![9.0, 0.0]), ..places.clone() };
        assert!(Array { places: Some(flat.clone()), ..array.clone() }.check().is_err());
        let exists = Some(vec![true, false]);
        Array { places: Some(flat), exists, ..array }.check().unwrap();
    }

    #[test]
    fn names_are_one_a_taxel_and_kept_and_no_ground_to_refuse() {
        let names = Some(vec!["thumb".to_owned(), String::new()]);
        let array = Array { names: names.clone(), ..Array::unmeasured(1, 2, "two") };
        array.check().unwrap();
        assert_eq!(read(&serde_json::to_string(&array).unwrap()), array);
        assert!(array.fits(&Array::unmeasured(1, 2, "two")));
        let long = Array { names, ..Array::unmeasured(1, 3, "three") };
        assert!(long.check().is_err());
    }

    #[test]
    fn arrays_fit_by_rows_columns_and_taxels_alone() {
        let thesis = Array::thesis();
        assert!(thesis.fits(&Array::unmeasured(64, 64, "any")));
        assert!(thesis.fits(&Array { exists: Some(vec![true; 4096]), ..thesis.clone() }));
        assert!(!thesis.fits(&Array { exists: Some(vec![false; 4096]), ..thesis.clone() }));
        assert!(!thesis.fits(&Array::unmeasured(64, 63, "any")));
    }

    #[test]
    fn what_needs_mm_or_neighbours_refuses_by_name() {
        let channels = Array::unmeasured(1, 8, "foot");
        assert!(channels.pitch("moments").is_err());
        assert!(channels.check_neighbours("area").is_err());
        Array::new(1, 8, 5.0, "line").unwrap().check_neighbours("area").unwrap();
        Array::unmeasured(2, 8, "grid").check_neighbours("area").unwrap();
        let plate = Array { pitch_mm: Some(Pitch { rows: 7.62, columns: 5.08 }), ..Array::unmeasured(9, 9, "plate") };
        assert!(plate.square_pitch("foam").is_err());
        assert_eq!(Array::thesis().square_pitch("foam").unwrap(), 2.67);
    }
}
