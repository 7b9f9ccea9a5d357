//! The file of a readout: JSON with the name and version of its format.

use serde::Serialize;
use serde_json::Value;

use super::Readout;
use crate::encode::Encoder;
use crate::{Error, Result, reading};

/// The name of the format in the file.
const FORMAT: &str = "taxel readout";

/// The version of the format that is written; there is no other so far.
const VERSION: u64 = 1;

impl Readout {
    /// Reads a readout from the text of its file and checks it.
    ///
    /// # Errors
    ///
    /// `Format` if the text is not a readout, has an unknown version, or has parts that are not valid.
    pub fn from_json(text: &str) -> Result<Self> {
        let format = |said: String| Error::Format(said);
        let mut value: Value = reading::from_text(text).map_err(|unfit| format(unfit.of("readout")))?;
        let Some(object) = value.as_object_mut() else {
            return Err(format("readout: not a JSON object".to_owned()));
        };
        match object.remove("format") {
            Some(Value::String(name)) if name == FORMAT => {}
            Some(other) => return Err(format(format!("readout: format is {other}, must be \"{FORMAT}\""))),
            None => return Err(format(format!("readout: does not say \"format\": \"{FORMAT}\", so it is none"))),
        }
        match object.remove("version") {
            Some(version) if version.as_u64() == Some(VERSION) => {}
            Some(version) => {
                return Err(format(format!("readout: version {version}, this taxel reads version {VERSION} only")));
            }
            None => return Err(format(format!("readout: says no version, must be {VERSION}"))),
        }
        // An encoder nested in another value would lose the parameter names from its errors, so it is read by itself
        // first.
        if let Some(encoder) = object.get("encoder") {
            Encoder::from_json(&encoder.to_string()).map_err(|e| format(format!("readout: {e}")))?;
        }
        let readout: Self = reading::from_value(value).map_err(|unfit| format(unfit.of("readout")))?;
        readout.check().map_err(|e| format(format!("readout: {e}")))?;
        Ok(readout)
    }

    /// The readout as the text of its file; reading it returns exactly the same numbers.
    #[must_use]
    pub fn to_json(&self) -> String {
        #[derive(Serialize)]
        struct File<'a> {
            format: &'a str,
            version: u64,
            #[serde(flatten)]
            readout: &'a Readout,
        }
        // Serialising can fail only for numbers that are not finite, which the checks exclude.
        serde_json::to_string_pretty(&File { format: FORMAT, version: VERSION, readout: self }).unwrap_or_default()
    }
}
