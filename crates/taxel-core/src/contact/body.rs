//! A body and its motion.

use serde::{Deserialize, Serialize};

use super::BodyShape;
use super::within;
use crate::allowed::Range;
use crate::{Error, Result};

/// The material of a body, which gives its mass where none is stated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Material {
    /// 7.85 g/cm^3.
    Steel,
    /// 2.5 g/cm^3.
    Glass,
    /// 1.2 g/cm^3, solid.
    Rubber,
    /// 1.05 g/cm^3, solid polystyrene.
    Plastic,
    /// 0.6 g/cm^3.
    Wood,
}

impl Material {
    fn grams_per_mm3(self) -> f64 {
        1e-3 * match self {
            Self::Steel => 7.85,
            Self::Glass => 2.5,
            Self::Rubber => 1.2,
            Self::Plastic => 1.05,
            Self::Wood => 0.6,
        }
    }
}

/// A body over the array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Its shape from below.
    pub shape: BodyShape,
    /// Where its middle first touches, mm right of the first taxel.
    pub x_mm: f64,
    /// Where, mm below the first taxel.
    pub y_mm: f64,
    /// g; of a solid body of `material` where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_g: Option<f64>,
    /// What it is made of, where no mass is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<Material>,
    /// Stiffness of a body that deforms, as a hollow ball does, N/mm; rigid where it is left out. A tennis ball has some 25.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness_n_mm: Option<f64>,
    /// Friction of sliding on the foam, as a share of the force. A guess.
    #[serde(default = "sliding", skip_serializing_if = "is_sliding")]
    pub friction: f64,
    /// Friction of rolling, as a share of the force: the loss in foam that recovers late. A guess.
    #[serde(default = "rolling", skip_serializing_if = "is_rolling")]
    pub rolling_friction: f64,
    /// How long after the scene's beginning its motion begins, ms.
    #[serde(default, skip_serializing_if = "is_at_once")]
    pub after_ms: f64,
    /// Its motion.
    pub motion: Move,
}

fn sliding() -> f64 {
    0.6
}

fn rolling() -> f64 {
    0.03
}

fn is_sliding(value: &f64) -> bool {
    *value == sliding()
}

fn is_rolling(value: &f64) -> bool {
    *value == rolling()
}

fn is_at_once(value: &f64) -> bool {
    *value == 0.0
}

/// The motion of a body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Move {
    /// It falls, and bounces.
    Dropped {
        /// From how high above where it touches, mm.
        height_mm: f64,
        /// What happens to it after the fall.
        #[serde(default)]
        ending: Ending,
    },
    /// A hand presses it into the foam and lifts it.
    Pressed(Press),
    /// It is set down and rolls.
    Rolled(Along),
    /// It is set down and slides; a round one begins to roll where friction makes it.
    Slid(Along),
}

/// What happens to a body after its fall.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Ending {
    /// After some impacts a hand catches the body at the top of its flight, presses it into the foam and lifts it.
    Caught {
        /// Number of impacts before the catch, the first one included.
        after: u32,
        /// What the hand does then.
        press: Press,
    },
    /// A hand lifts the body after a while, without a catch.
    LeftToRest {
        /// From the drop to the lift, ms.
        rest_ms: f64,
        /// How fast the hand lifts, mm/s.
        lift_mm_s: f64,
    },
}

impl Default for Ending {
    fn default() -> Self {
        Self::LeftToRest { rest_ms: 1_000.0, lift_mm_s: 50.0 }
    }
}

/// A press by hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Press {
    /// Force while held, N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_n: Option<f64>,
    /// Depth while held, mm: in place of the force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_mm: Option<f64>,
    /// How fast the hand goes down and up, mm/s.
    pub speed_mm_s: f64,
    /// How long it holds, ms.
    pub hold_ms: f64,
    /// Before it, ms: between the catch and the press.
    #[serde(default)]
    pub wait_ms: f64,
}

/// A way along the foam.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Along {
    /// How fast it begins, mm/s.
    pub speed_mm_s: f64,
    /// Which way: from the rows' direction (x) towards the columns' (y), degrees.
    #[serde(default)]
    pub toward_deg: f64,
    /// For how long, ms; then a hand lifts it.
    pub for_ms: f64,
    /// A hand presses the body with so many N, and its speed stays constant; where this is left out, the body lies on
    /// the foam by its weight, and friction slows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub press_n: Option<f64>,
}

impl Body {
    /// Its mass, g, where that is known.
    #[must_use]
    pub fn mass_g(&self) -> Option<f64> {
        self.mass_g.or_else(|| Some(self.material?.grams_per_mm3() * self.shape.volume_mm3()?))
    }

    /// Its least duration, ms: waits and holds, without the time of a hand's way or of a bounce.
    pub(super) fn least_ms(&self) -> f64 {
        let held = |press: &Press| press.wait_ms + press.hold_ms;
        let moving = match &self.motion {
            Move::Dropped { ending: Ending::Caught { press, .. }, .. } => held(press),
            Move::Dropped { ending: Ending::LeftToRest { rest_ms, .. }, .. } => *rest_ms,
            Move::Pressed(press) => held(press),
            Move::Rolled(along) | Move::Slid(along) => along.for_ms,
        };
        self.after_ms + moving
    }

    /// Checks that it makes sense; `path` names it.
    ///
    /// # Errors
    ///
    /// `Scene`, naming the parameter.
    pub fn check(&self, path: &str) -> Result<()> {
        self.shape.check(&format!("{path}.shape"))?;
        within(path, "x_mm", self.x_mm, "mm", Range::FINITE)?;
        within(path, "y_mm", self.y_mm, "mm", Range::FINITE)?;
        if let Some(mass) = self.mass_g {
            within(path, "mass_g", mass, "g", Range::ABOVE_0)?;
        }
        if let Some(stiffness) = self.stiffness_n_mm {
            within(path, "stiffness_n_mm", stiffness, "N/mm", Range::ABOVE_0)?;
        }
        within(path, "friction", self.friction, "", Range::within(0.0, 10.0))?;
        within(path, "rolling_friction", self.rolling_friction, "", Range::within(0.0, 10.0))?;
        within(path, "after_ms", self.after_ms, "ms", WAIT)?;
        let moves = |name: &str| format!("{path}.motion.{name}");
        match &self.motion {
            Move::Dropped { height_mm, ending } => {
                let path = moves("dropped");
                within(&path, "height_mm", *height_mm, "mm", Range::ABOVE_0.at_most(2_000.0))?;
                match ending {
                    Ending::Caught { after, press } => {
                        within(&path, "after", f64::from(*after), "impacts", Range::FROM_1)?;
                        press.check(&path)?;
                    }
                    Ending::LeftToRest { rest_ms, lift_mm_s } => {
                        within(&path, "rest_ms", *rest_ms, "ms", WAIT)?;
                        within(&path, "lift_mm_s", *lift_mm_s, "mm/s", HAND)?;
                    }
                }
            }
            Move::Pressed(press) => press.check(&moves("pressed"))?,
            Move::Rolled(along) => {
                along.check(&moves("rolled"))?;
                if self.shape.turns().0 + self.shape.turns().1 == 0.0 {
                    return Err(Error::scene(format!(
                        "{path}: only a sphere or a cylinder can roll; use the motion slid"
                    )));
                }
            }
            Move::Slid(along) => along.check(&moves("slid"))?,
        }
        let free = match &self.motion {
            Move::Dropped { .. } => true,
            Move::Rolled(along) | Move::Slid(along) => along.press_n.is_none(),
            Move::Pressed(_) => false,
        };
        if free && self.mass_g().is_none() {
            return Err(Error::scene(format!(
                "{path}: mass_g is missing: a body that moves freely needs mass_g{}",
                if self.shape.volume_mm3().is_some() { ", or a material" } else { "" }
            )));
        }
        Ok(())
    }
}

/// Waits, ms, and speeds of a hand, mm/s.
pub(super) const WAIT: Range = Range::within(0.0, 60_000.0);
const HAND: Range = Range::within(1.0, 2_000.0);

impl Press {
    fn check(&self, path: &str) -> Result<()> {
        match (self.peak_n, self.depth_mm) {
            (Some(force), None) => within(path, "peak_n", force, "N", Range::ABOVE_0.at_most(2_000.0))?,
            (None, Some(depth)) => within(path, "depth_mm", depth, "mm", Range::ABOVE_0)?,
            _ => return Err(Error::scene(format!("{path}: must have either peak_n or depth_mm"))),
        }
        within(path, "speed_mm_s", self.speed_mm_s, "mm/s", HAND)?;
        within(path, "hold_ms", self.hold_ms, "ms", WAIT)?;
        within(path, "wait_ms", self.wait_ms, "ms", WAIT)
    }
}

impl Along {
    fn check(&self, path: &str) -> Result<()> {
        within(path, "speed_mm_s", self.speed_mm_s, "mm/s", Range::within(1.0, 10_000.0))?;
        within(path, "toward_deg", self.toward_deg, "degrees", Range::FINITE)?;
        within(path, "for_ms", self.for_ms, "ms", WAIT)?;
        self.press_n.map_or(Ok(()), |force| within(path, "press_n", force, "N", Range::ABOVE_0.at_most(2_000.0)))
    }
}
