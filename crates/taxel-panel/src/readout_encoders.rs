//! Which encoder makes the spikes of a view: one with the parameters of a request, or that of the readout that reads what is shown.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use taxel_core::encode::{Composite, Encoder, Tare};
use taxel_core::problem;
use taxel_live::Result;

/// The encoders of a readout by their names: a composite, and its parts.
#[derive(Debug, Clone, Default)]
pub(super) struct ReadoutEncoders(BTreeMap<String, Encoder>);

impl From<Encoder> for ReadoutEncoders {
    fn from(encoder: Encoder) -> Self {
        let mut encoders = BTreeMap::new();
        if let Encoder::Composite(Composite { parts }) = &encoder {
            let mut parts_by_name = BTreeMap::<_, BTreeMap<_, _>>::new();
            for (part, encoder) in parts {
                parts_by_name.entry(name_of(encoder)).or_default().insert(part.clone(), encoder.clone());
            }
            encoders.extend(parts_by_name.into_iter().map(|(name, parts)| (name, side_by_side(parts))));
        }
        encoders.insert(name_of(&encoder), encoder);
        Self(encoders)
    }
}

impl ReadoutEncoders {
    /// Their names.
    pub(super) fn names(&self) -> Vec<&str> {
        self.0.keys().map(String::as_str).collect()
    }

    /// These encoders with a tare.
    pub(super) fn with_tare(&self, tare: &Tare) -> Self {
        Self(self.0.iter().map(|(name, encoder)| (name.clone(), encoder.with_tare(tare))).collect())
    }
}

/// The parts of a composite that are of one name: the encoder itself where there is one.
fn side_by_side(parts: BTreeMap<String, Encoder>) -> Encoder {
    match <[_; 1]>::try_from(Vec::from_iter(parts.values().cloned())) {
        Ok([encoder]) => encoder,
        Err(_) => Encoder::Composite(Composite { parts }),
    }
}

fn name_of(encoder: &Encoder) -> String {
    json!(encoder)["name"].as_str().unwrap_or_default().to_owned()
}

/// The names of an encoder and of its parts.
#[must_use]
pub fn encoder_names(encoder: Encoder) -> Vec<String> {
    ReadoutEncoders::from(encoder).0.into_keys().collect()
}

/// The encoder of a view.
#[derive(Debug, Clone)]
pub struct ViewEncoder {
    pub(super) encoder: Encoder,
    pub(super) name: String,
    /// Whether it is one of the readout that reads what is shown.
    pub(super) of_readout: bool,
}

impl From<Encoder> for ViewEncoder {
    fn from(encoder: Encoder) -> Self {
        Self { name: name_of(&encoder), encoder, of_readout: false }
    }
}

impl ViewEncoder {
    /// The encoder of an `encode` request. A name without parameters is that of the readout's encoder, where it has one of this
    /// name.
    ///
    /// # Errors
    ///
    /// As [`Encoder::from_json`].
    pub(super) fn requested(request: &Map<String, Value>, readout: &ReadoutEncoders) -> Result<Self> {
        let name = request.get("name").and_then(Value::as_str).filter(|_| request.len() == 1);
        match (name, name.and_then(|name| readout.0.get(name))) {
            (Some(name), Some(encoder)) => {
                Ok(Self { encoder: encoder.clone(), name: name.to_owned(), of_readout: true })
            }
            (Some("composite"), None) => Err(problem!(
                "encoder composite: needs a readout with several encoders, but no such readout reads the shown \
                     sensor"
            )
            .into()),
            _ => Ok(Encoder::from_json(&json!(request).to_string())?.into()),
        }
    }
}
