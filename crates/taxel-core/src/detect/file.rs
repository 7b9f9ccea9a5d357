//! The files of readouts and plain rules: JSON with the name and version of its format.

use serde::Serialize;
use serde_json::Value;

use crate::{Error, Result, problem, reading};

/// The version of each format that is written and read. Rules of version 1 had thresholds, frames and other quantities.
const VERSION: u64 = 2;

/// Reads the text of a file of one of `formats`; returns the format and the other contents.
///
/// # Errors
///
/// `Format`, beginning with `name`, if the text is not JSON, or if its format or version is another.
pub(super) fn parts(name: &str, text: &str, formats: &[&'static str]) -> Result<(&'static str, Value)> {
    let format = |message: String| Error::format(format!("{name}: {message}"));
    let names = formats.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(" or ");
    let mut value: Value = reading::from_text(text).map_err(|unfit| unfit.format(name))?;
    let Some(object) = value.as_object_mut() else {
        return Err(format("not a JSON object".to_owned()));
    };
    let stated = object.remove("format");
    let Some(stated) = stated else {
        return Err(format(format!("the key \"format\" is missing; must be {names}")));
    };
    let Some(&name) = formats.iter().find(|&&name| stated == name) else {
        return Err(format(format!("format is {stated}; must be {names}")));
    };
    match object.remove("version") {
        Some(version) if version.as_u64() == Some(VERSION) => Ok((name, value)),
        Some(version) if version.as_u64() == Some(1) => {
            Err(format(format!("was written by an earlier taxel: train again; version is 1, must be {VERSION}")))
        }
        Some(version) => Err(format(format!("version is {version}; this taxel reads only version {VERSION}"))),
        None => Err(format(format!("the key \"version\" is missing; must be {VERSION}"))),
    }
}

/// Checks the unit of the values that a readout was trained on, or a rule was tuned on.
///
/// # Errors
///
/// `Problem` if it has no name.
pub(super) fn check_unit(unit: Option<&str>) -> Result<()> {
    match unit {
        Some(name) if name.trim().is_empty() => Err(problem!("unit"; " is empty: must be a name, or left out")),
        _ => Ok(()),
    }
}

/// The text of a file; reading it returns exactly the same numbers.
pub(super) fn text(format: &str, parts: &impl Serialize) -> String {
    #[derive(Serialize)]
    struct File<'a, T> {
        format: &'a str,
        version: u64,
        #[serde(flatten)]
        parts: &'a T,
    }
    // Serialising can fail only for numbers that are not finite, which the checks exclude.
    serde_json::to_string_pretty(&File { format, version: VERSION, parts }).unwrap_or_default()
}
