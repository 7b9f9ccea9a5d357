//! The file of a readout.

use serde_json::Value;

use super::Readout;
use crate::detect::file;
use crate::encode::Encoder;
use crate::{Error, Result, reading};

impl Readout {
    /// The name of the format in the file.
    pub(in crate::detect) const FORMAT: &str = "taxel readout";

    /// Reads a readout from the text of its file and checks it.
    ///
    /// # Errors
    ///
    /// `Format` if the text is not a readout, has an unknown version, or has parts that are not valid.
    pub fn from_json(text: &str) -> Result<Self> {
        Self::from_parts(file::parts("readout", text, &[Self::FORMAT])?.1)
    }

    /// As [`Readout::from_json`], from the contents of the file without format and version.
    pub(in crate::detect) fn from_parts(parts: Value) -> Result<Self> {
        let invalid = |error: Error| error.in_part("readout").into_format();
        // An encoder nested in another value would lose the parameter names from its errors, so it is read by itself
        // first.
        if let Some(encoder) = parts.get("encoder") {
            Encoder::from_json(&encoder.to_string()).map_err(invalid)?;
        }
        let readout: Self = reading::from_value(parts).map_err(|unfit| unfit.format("readout"))?;
        readout.check().map_err(invalid)?;
        Ok(readout)
    }

    /// The readout as the text of its file; reading it returns exactly the same numbers.
    #[must_use]
    pub fn to_json(&self) -> String {
        file::text(Self::FORMAT, self)
    }
}
