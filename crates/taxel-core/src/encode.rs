//! Events or frames to spikes, live or whole: the same spikes either way.

mod blocks;
mod bracket;
mod channels;
mod fields;
mod law;
mod loaded;
mod periods;
mod pieces;
mod power;
mod receptor;
mod running_range;
mod sampled;
mod slow;
mod stream;
mod tare;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use pieces::Pieces;
pub use running_range::{FirstWindow, RunningRange};
pub use stream::Stream;
pub use tare::{Tare, TareBuilder, Zeroing};

use law::Law;

use crate::parameters::Described;
use crate::reading::{self, Unfit};
use crate::spikes::ms;
use crate::{Array, Error, EventsView, FramesView, Result, Spike, SpikeTrains, Stop, problem};

/// The registry: a line an encoder, `NAME: Kind`, whose file is `encode/NAME.rs` and whose name in JSON is `NAME`.
macro_rules! encoders {
    ($($(#[$about:meta])* $name:ident: $Kind:ident,)*) => {
        $(pub mod $name;)*
        $(pub use $name::$Kind;)*

        /// Any encoder with its parameters; in JSON an object with its `name`.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "name", rename_all = "snake_case")]
        pub enum Encoder {
            $($(#[$about])* $Kind($Kind),)*
        }

        /// The names of all encoders, as JSON has them.
        pub const NAMES: &[&str] = &[$(stringify!($name)),*];

        impl Encoder {
            fn law(&self) -> &dyn Law {
                match self { $(Self::$Kind(e) => e,)* }
            }

            fn law_mut(&mut self) -> &mut dyn Law {
                match self { $(Self::$Kind(e) => e,)* }
            }

            /// Reads the parameters of the encoder of a name; none if there is none of that name.
            fn read(name: &str, parameters: Value) -> Option<std::result::Result<Self, Unfit>> {
                $(if name == stringify!($name) {
                    return Some(reading::from_value(parameters).map(Self::$Kind));
                })*
                None
            }

            /// The parameters of an encoder, by its name, with their defaults and ranges.
            #[must_use]
            pub fn described(name: &str) -> Option<Described> {
                $(if name == stringify!($name) {
                    return Some($Kind::described());
                })*
                None
            }
        }
    };
}

// Rustfmt finds no modules in a macro: the Makefile names their files to it.
encoders! {
    /// Changes since the last sent value, with 1 to 10 bits.
    change_events: ChangeEvents,
    /// Plain crossings of levels.
    level_crossing: LevelCrossing,
    /// A threshold and a pair of Izhikevich neurons.
    threshold_izhikevich: ThresholdIzhikevich,
    /// The FA-1 afferent of equations 5.1 to 5.5.
    fa1: Fa1,
    /// The SA-1 afferent, whose rate follows the force as long as a taxel is pressed.
    sa1: Sa1,
    /// The SA-2 afferent, which fires steadily under a held load.
    sa2: Sa2,
    /// The FA-2 afferent, which responds to vibration and to the moment of contact.
    fa2: Fa2,
    /// Afferents of all four types in places of their own.
    skin: Skin,
    /// How many taxels are loaded.
    contact_area: ContactArea,
    /// How large a touch is, how hard, and where its centre has gone.
    moments: Moments,
}

impl Encoder {
    /// Reads an encoder from JSON and checks every parameter; what is left out has its default.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn from_json(json: &str) -> Result<Self> {
        let mut given: Map<String, Value> =
            reading::from_text(json).map_err(|unfit| Error::Problem(unfit.of("encoder")))?;
        let names = NAMES.join(", ");
        let name = match given.remove("name") {
            Some(Value::String(name)) => name,
            Some(other) => return Err(problem!("encoder {other}: must be one of {names}")),
            None => return Err(problem!("encoder without a name: must be one of {names}")),
        };
        let encoder = Self::read(&name, given.into())
            .ok_or_else(|| problem!("encoder {name}: must be one of {names}"))?
            .map_err(|unfit| Error::Problem(unfit.of(&format!("encoder {name}"))))?;
        encoder.check()?;
        Ok(encoder)
    }

    /// The encoder with all its parameters, as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Numbers were checked to be finite, and nothing else in here can fail to be written.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Checks every parameter, for encoders that were not read from JSON.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter, its value and what would be right.
    pub fn check(&self) -> Result<()> {
        self.law().check()
    }

    /// Begins to encode what an array feels.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter makes no sense, or an encoder that reads a tare has none or another array's.
    pub fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        self.check()?;
        self.law().stream(array)
    }

    /// How much later than the touch itself a spike comes, ms: what the encoder's own rule costs.
    #[must_use]
    pub fn latency_ms(&self) -> f64 {
        self.law().latency_ms()
    }

    /// The number of spike trains that the encoder makes of an array.
    #[must_use]
    pub fn trains(&self, array: &Array) -> usize {
        self.law().trains(array)
    }

    /// Whether its spikes carry a signed value, so that a neuron receives each train as two, ON and OFF.
    #[must_use]
    pub fn signed(&self) -> bool {
        self.law().signed()
    }

    /// The same encoder with this tare; one that reads none stays as it is.
    #[must_use]
    pub fn with_tare(&self, tare: &Tare) -> Self {
        let mut with = self.clone();
        with.law_mut().set_tare(tare);
        with
    }

    /// Encodes a whole recording of events.
    ///
    /// The window begins at the first stamp and ends one period and the latency after the last, with the last values
    /// held until then.
    ///
    /// # Errors
    ///
    /// As [`Encoder::stream`] and [`Stream::push_events`]; `Problem` too where an event lies too far behind one before
    /// it ([`EventsView::check_order`]); `Interrupted` if asked to stop.
    pub fn encode_events(&self, events: EventsView<'_>, stop: Stop<'_>) -> Result<SpikeTrains> {
        /// Events between two checks of `stop`.
        const PIECE: usize = 65_536;
        let mut stream = self.stream(events.array)?;
        events.check()?;
        events.check_order()?;
        let mut out = vec![];
        for piece in events.pieces(PIECE) {
            stop.check()?;
            stream.push_events(piece, &mut out)?;
        }
        collect(stream, out, events.t.first().copied())
    }

    /// Encodes a whole recording of pictures.
    ///
    /// # Errors
    ///
    /// As [`Encoder::stream`], [`FramesView::check`] and [`Stream::push_frame`]; `Interrupted` if asked to stop.
    pub fn encode_frames(&self, frames: FramesView<'_>, stop: Stop<'_>) -> Result<SpikeTrains> {
        let mut stream = self.stream(frames.array)?;
        frames.check()?;
        let mut out = vec![];
        for (k, (t, picture)) in frames.iter().enumerate() {
            if k % 64 == 0 {
                stop.check()?;
            }
            stream.push_frame(t, picture, &mut out)?;
        }
        collect(stream, out, frames.t.first().copied())
    }
}

fn collect(mut stream: Box<dyn Stream>, mut out: Vec<Spike>, first: Option<i64>) -> Result<SpikeTrains> {
    let start = first.map_or(0.0, ms);
    let end = stream.finish(&mut out).unwrap_or(start);
    SpikeTrains::from_spikes(&out, stream.trains(), stream.signed(), start, end)
}
