//! Simulated touch: the effect of a ball on foam on the taxels beneath, frame by frame.
//!
//! Bodies ([`body`], [`shape`]) move over foam as a [`scene`] describes ([`motion`], `trajectory`); the
//! reaction force follows a law that is tabulated once ([`push`]). The foam is an elastic layer that is bonded to the
//! board ([`bonded`]). Fabric, amplifier and ramp convert stress at its base to ticks of the converter ([`sensor`]); a
//! [`stage`] plays scenes as frames. The times of touches are known to a fraction of a frame, so that detections can be
//! scored against them.

use crate::allowed::{Parameter, Range};
use crate::{Array, Error, Result};

pub mod act;
pub mod body;
pub mod bonded;
pub mod foam;
pub mod layer;
pub mod motion;
pub mod narrow;
pub mod push;
pub mod scene;
pub mod sensor;
pub mod shape;
pub mod stage;
pub mod touch;
mod trajectory;
mod waves;

pub use act::{Act, FrameSequence};
pub use body::{Along, Body, Ending, Material, Move, Press};
pub use bonded::Bonded;
pub use foam::Foam;
pub use motion::Motion;
pub use narrow::Narrow;
pub use push::Push;
pub use scene::Scene;
pub use sensor::{Sensor, Taxels};
pub use shape::BodyShape;
pub use stage::{Prepared, Stage};
pub use touch::{Contact, TouchKind};
pub use trajectory::Track;

/// The pitch of an array that a scene is played on, mm.
fn pitch_of(array: &Array) -> Result<f64> {
    array.square_pitch("a scene").map_err(scene)
}

/// Checks that a value of a scene is within its range; `path` names its owner in the error.
fn within(path: &str, name: &'static str, value: f64, unit: &'static str, range: Range) -> Result<()> {
    of_scene(path, Parameter { name, unit, range }.check(&value))
}

/// The outcome of a check as that of a scene; `path` names its owner in the error.
fn of_scene(path: &str, outcome: Result<()>) -> Result<()> {
    outcome.map_err(|error| scene(error).in_part(path))
}

/// The same error as one of the scene.
fn scene(error: Error) -> Error {
    if let Error::Problem(reason) = error { Error::Scene(reason) } else { error }
}
