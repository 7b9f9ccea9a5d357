//! Simulated touch: what a ball on foam does to the taxels beneath, frame by frame.
//!
//! A rigid ball sinks into independent columns of foam ([`foam`]); the foam's lower face, where the taxels lie, feels
//! the surface's pressure smoothed by the layer ([`layer`], [`footprint`]); fabric, amplifier and ramp turn force into
//! ticks of the converter ([`sensor`]). A [`scene`] says what happens, a [`stage`] plays scenes into frames. The touch
//! itself is known to a fraction of a frame, so that detections can be held against it.
//!
//! Good for foam that does not widen when pressed (Poisson ratio near 0): there the columns, smoothed by the layer and
//! scaled to the right force, lie within a few per cent of the bonded layer's full solution.

pub mod bonded;
pub mod foam;
pub mod footprint;
pub mod layer;
pub mod motion;
pub mod scene;
pub mod sensor;
pub mod stage;
mod waves;

pub use bonded::Bonded;
pub use foam::Foam;
pub use footprint::Footprint;
pub use motion::{Contact, Kind, Motion};
pub use scene::{Ball, Ending, Press, Scene};
pub use sensor::{Sensor, Taxels};
pub use stage::{Act, Pictures, Prepared, Stage};
