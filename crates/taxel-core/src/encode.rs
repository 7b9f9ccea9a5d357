//! Encodes events or frames as spikes, live or as a whole recording, with identical spikes.

mod begin_area;
mod blocks;
mod channel_levels;
mod channels;
mod driver;
mod encoding;
mod features;
mod level_count;
mod levels;
mod load_sum;
mod loaded;
mod local_sums;
mod moved;
mod peak_load;
mod periods;
mod pieces;
mod power;
mod quantity;
mod range_load;
mod recent;
mod receptor;
mod running_range;
mod shear;
mod side_by_side;
mod slowly_adapting;
mod stream;
mod tare;
mod touched;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use pieces::Pieces;
pub use quantity::{Measure, Quantity};
pub use running_range::{FirstWindow, RunningRange};
pub use stream::Stream;
pub use tare::{Tare, TareBuilder, Zeroing};

use encoding::Encoding;
use side_by_side::SideBySide;
use stream::{spikes_of_events, spikes_of_frames};

use crate::parameters::Described;
use crate::reading::{self, Unfit};
use crate::spikes::ms;
use crate::{Array, EventsView, FramesView, Result, Spike, SpikeKind, SpikeTrains, Stop, problem};

/// The registry: one line per encoder, `NAME: Kind`; the encoder's file is `encode/NAME.rs`, and its name in JSON is
/// `NAME`.
macro_rules! encoders {
    ($($(#[$about:meta])* $name:ident: $Kind:ident,)*) => {
        $(pub mod $name;)*
        $(pub use $name::$Kind;)*

        /// Any encoder with its parameters; in JSON an object with its `name`.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "name", rename_all = "snake_case")]
        pub enum Encoder {
            $($(#[$about])* $Kind($Kind),)*
            /// Several of the others side by side.
            Composite(Composite),
        }

        /// The names of all encoders but `composite`, which is made of the others, as in JSON.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];

        impl Encoder {
            fn encoding(&self) -> &dyn Encoding {
                match self { $(Self::$Kind(e) => e,)* Self::Composite(e) => e }
            }

            fn encoding_mut(&mut self) -> &mut dyn Encoding {
                match self { $(Self::$Kind(e) => e,)* Self::Composite(e) => e }
            }

            /// Parses the parameters of the encoder with this name; none if there is no such encoder.
            fn read(name: &str, parameters: Value) -> Option<std::result::Result<Self, Unfit>> {
                $(if name == stringify!($name) {
                    return Some(reading::from_value(parameters).map(Self::$Kind));
                })*
                (name == "composite").then(|| reading::from_value(parameters).map(Self::Composite))
            }

            /// The parameters of an encoder, by its name, with their defaults and ranges.
            #[must_use]
            pub fn described(name: &str) -> Option<Described> {
                $(if name == stringify!($name) {
                    return Some($Kind::described());
                })*
                (name == "composite").then(Composite::described)
            }
        }
    };
}

// Rustfmt does not find modules in a macro, so the Makefile passes it their files.
encoders! {
    /// Changes since the last sent value, with 1 to 10 bits.
    change_events: ChangeEvents,
    /// Plain crossings of levels.
    level_crossing: LevelCrossing,
    /// A threshold and a pair of Izhikevich neurons.
    threshold_izhikevich: ThresholdIzhikevich,
    /// The FA-1 afferent of equations 5.1 to 5.5.
    fa1: Fa1,
    /// The SA-1 afferent, whose rate follows the force while a taxel is pressed.
    sa1: Sa1,
    /// The SA-2 afferent, which fires steadily under a held load.
    sa2: Sa2,
    /// The FA-2 afferent, which responds to vibration and to the moment of contact.
    fa2: Fa2,
    /// The number of loaded taxels.
    contact_area: ContactArea,
    /// Quantities of a touch in units of each taxel's own noise.
    local_load: LocalLoad,
    /// The area and force of a touch, and the displacement of its centre.
    moments: Moments,
    /// The largest deviation of a taxel in units of its own noise.
    peak: Peak,
}

impl Encoder {
    /// Parses an encoder from JSON and checks every parameter; missing parameters have their defaults.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn from_json(json: &str) -> Result<Self> {
        let mut parameters: Map<String, Value> = reading::from_text(json).map_err(|unfit| unfit.problem("encoder"))?;
        let names = NAMES.join(", ");
        let name = match parameters.remove("name") {
            Some(Value::String(name)) => name,
            Some(other) => return Err(problem!("encoder {other}: must be one of {names}")),
            None => return Err(problem!("encoder: the name is missing: must be one of {names}")),
        };
        // Errors of an encoder inside of another would not name its parameters, so each part is also read by itself.
        if let (true, Some(Value::Object(parts))) = (name == "composite", parameters.get("parts")) {
            for (part, encoder) in parts {
                Self::from_json(&encoder.to_string()).map_err(|error| error.in_part(part))?;
            }
        }
        let encoder = Self::read(&name, parameters.into())
            .ok_or_else(|| problem!("encoder {name}: must be one of {names}"))?
            .map_err(|unfit| unfit.problem(&format!("encoder {name}")))?;
        encoder.check()?;
        Ok(encoder)
    }

    /// The encoder with all its parameters, as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        // `check` guarantees finite numbers, and no other value of an encoder can fail to serialise.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Checks every parameter, for encoders that were not read from JSON.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what is valid.
    pub fn check(&self) -> Result<()> {
        self.encoding().check()
    }

    /// Starts a stream that encodes the input of an array.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter is out of range, or if an encoder that needs a tare has none or one of another array.
    pub fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        self.check()?;
        self.encoding().stream(array)
    }

    /// The latency that the encoder's own algorithm adds between a touch and its spike, ms.
    #[must_use]
    pub fn latency_ms(&self) -> f64 {
        self.encoding().latency_ms()
    }

    /// The number of spike trains of the encoder for an array.
    #[must_use]
    pub fn trains(&self, array: &Array) -> usize {
        self.encoding().trains(array)
    }

    /// The meaning of the spikes' values; a neuron receives each signed train as two, ON and OFF.
    #[must_use]
    pub fn kind(&self) -> SpikeKind {
        self.encoding().kind()
    }

    /// The same encoder with this tare; an encoder that uses no tare is returned unchanged.
    #[must_use]
    pub fn with_tare(&self, tare: &Tare) -> Self {
        let mut with = self.clone();
        with.encoding_mut().set_tare(tare);
        with
    }

    /// Encodes a whole recording of events.
    ///
    /// The window begins at the first stamp and ends one period plus the latency after the last stamp; the last values
    /// hold until then.
    ///
    /// # Errors
    ///
    /// As [`Encoder::stream`] and [`Stream::push_events`]; `Problem` also if an event is too far behind an earlier one
    /// ([`EventsView::check_order`]); `Interrupted` if asked to stop.
    pub fn encode_events(&self, events: EventsView<'_>, stop: Stop<'_>) -> Result<SpikeTrains> {
        let mut stream = self.stream(events.array)?;
        let (out, end) = spikes_of_events(&mut *stream, events, stop)?;
        collect(&*stream, &out, events.t.first().copied(), end)
    }

    /// Encodes a whole recording of frames.
    ///
    /// # Errors
    ///
    /// As [`Encoder::stream`], [`FramesView::check`] and [`Stream::push_frame`]; `Interrupted` if asked to stop.
    pub fn encode_frames(&self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<SpikeTrains> {
        let mut stream = self.stream(frames.array)?;
        let (out, end) = spikes_of_frames(&mut *stream, frames, stop)?;
        collect(&*stream, &out, frames.t.first().copied(), end)
    }
}

fn collect(stream: &dyn Stream, out: &[Spike], first: Option<i64>, end: Option<f64>) -> Result<SpikeTrains> {
    let start = first.map_or(0.0, ms);
    SpikeTrains::from_spikes(out, stream.trains(), stream.kind(), start, end.unwrap_or(start))
}

/// Encoders side by side: first all trains of the part whose name comes first, then those of the next.
///
/// Signed trains of a part are split by sign, all ON, then all OFF. If a part is graded, the whole is, and the spikes of
/// the others have the value 1. The latency is the largest of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Composite {
    /// The encoders by name.
    pub parts: BTreeMap<String, Encoder>,
}

impl Composite {
    fn described() -> Described {
        Described::by(&Self { parts: BTreeMap::new() }, &["parts"], &[])
    }

    /// The parts with these names, in the order of all parts; no name stands for all of them.
    ///
    /// # Errors
    ///
    /// `Problem` if there is no such part, or if a name comes twice.
    pub fn parts_named(&self, names: &[String]) -> Result<Vec<(&str, &Encoder)>> {
        for (n, name) in names.iter().enumerate() {
            if !self.parts.contains_key(name) {
                let known: Vec<&str> = self.parts.keys().map(String::as_str).collect();
                return Err(problem!(
                    "inputs"; ": the composite has no encoder {name:?}: its encoders are {}", known.join(", ")
                ));
            }
            if names[..n].contains(name) {
                return Err(problem!("inputs"; ": {name:?} comes twice"));
            }
        }
        let chosen = |name: &str| names.is_empty() || names.iter().any(|wanted| wanted == name);
        Ok(self.parts.iter().map(|(name, part)| (name.as_str(), part)).filter(|(name, _)| chosen(name)).collect())
    }

    /// Whether each train of the whole is one of the parts with these names.
    ///
    /// # Errors
    ///
    /// As [`Composite::parts_named`].
    pub fn of_parts(&self, names: &[String], array: &Array) -> Result<Vec<bool>> {
        let named = self.parts_named(names)?;
        let chosen = |name: &str| named.iter().any(|(part, _)| *part == name);
        let parts = self.parts.iter();
        Ok(parts.flat_map(|(name, part)| std::iter::repeat_n(chosen(name), inputs(part, array))).collect())
    }
}

/// The inputs of a neuron that a part's trains are.
fn inputs(part: &Encoder, array: &Array) -> usize {
    part.trains(array) * part.kind().inputs_per_train()
}

impl Encoding for Composite {
    fn check(&self) -> Result<()> {
        if self.parts.is_empty() {
            return Err(problem!("composite: parts is empty: must contain one encoder or more, each with a name"));
        }
        for (name, part) in &self.parts {
            if name.trim().is_empty() {
                return Err(problem!("composite: the name of a part is empty"));
            }
            if matches!(part, Encoder::Composite(_)) {
                return Err(problem!("composite: part {name} is a composite: must be another encoder"));
            }
            part.check().map_err(|error| error.in_part(name))?;
        }
        Ok(())
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        let mut trains = 0;
        let mut parts = vec![];
        for (name, part) in &self.parts {
            parts.push((trains, part.stream(array).map_err(|error| error.in_part(name))?));
            trains += inputs(part, array);
        }
        Ok(Box::new(SideBySide::new(parts, trains, self.kind())))
    }

    fn trains(&self, array: &Array) -> usize {
        self.parts.values().map(|part| inputs(part, array)).sum()
    }

    fn kind(&self) -> SpikeKind {
        let graded = self.parts.values().any(|part| part.kind() == SpikeKind::Graded);
        if graded { SpikeKind::Graded } else { SpikeKind::Unsigned }
    }

    fn latency_ms(&self) -> f64 {
        self.parts.values().map(Encoder::latency_ms).fold(0.0, f64::max)
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.parts.values_mut().for_each(|part| part.encoding_mut().set_tare(tare));
    }
}
