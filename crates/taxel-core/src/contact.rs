//! Simulated touch: bodies on foam, and the readings of the taxels beneath, frame by frame.
//!
//! Bodies ([`body`], [`shape`]) move over foam as a [`scene`] describes ([`motion`], `trajectory`, [`track`]), pushed
//! back by a law that is tabulated once ([`push`]). The foam under them has one of two models, which a scene chooses: `layer`, foam bonded to the
//! board, for any bodies ([`bonded`]); `columns`, independent columns whose pressure the layer smooths, for one ball that
//! moves straight up and down on foam that hardly widens (Poisson ratio up to 0.1): there it lies within a few per cent
//! of the layer, and is the fastest ([`foam`], [`footprint`]). Fabric, amplifier and ramp turn stress at the foam's base
//! into ticks of the converter ([`sensor`]); a [`stage`] plays scenes into frames. The touch itself is known to a
//! fraction of a frame, so that detections can be held against it.

use crate::allowed::{Parameter, Range};
use crate::{Error, Result};

pub mod act;
pub mod body;
pub mod bonded;
pub mod foam;
pub mod footprint;
pub mod layer;
pub mod motion;
pub mod narrow;
pub mod push;
pub mod scene;
pub mod sensor;
pub mod shape;
pub mod stage;
pub mod touch;
pub mod track;
mod trajectory;
mod waves;

pub use act::{Act, Pictures};
pub use body::{Along, Body, Ending, Material, Move, Press};
pub use bonded::Bonded;
pub use foam::Foam;
pub use footprint::Footprint;
pub use motion::Motion;
pub use narrow::Narrow;
pub use push::Push;
pub use scene::{Scene, Surface};
pub use sensor::{Sensor, Taxels};
pub use shape::Shape;
pub use stage::{Prepared, Stage};
pub use touch::{Contact, TouchKind};
pub use track::Track;

/// Refuses a value of a scene that lies outside its range; `place` names its owner.
fn within(place: &str, name: &'static str, value: f64, unit: &'static str, range: Range) -> Result<()> {
    Parameter { name, unit, range }.check(&value).map_err(|error| match error {
        Error::Problem(text) => Error::Scene(format!("{place}: {text}")),
        other => other,
    })
}
