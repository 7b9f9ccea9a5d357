//! The problem statement, equations 6.9 to 6.14, for all learners: its rows, their times, and its objective.
//!
//! `rows` names and computes any row (6.9, 6.10), `targets` stores those of the targets, `silence` evaluates all
//! others, `objective` has the terms of 6.14 (6.11 is a part of it), `program` its value over rows, `certificate` proofs
//! of infeasibility.

mod bounds;
mod certificate;
mod continuous;
mod examples;
mod grid;
mod objective;
mod peak;
mod program;
mod relaxed;
mod rows;
mod silence;
mod targets;

pub use bounds::{Bounds, OneOrEach};
pub(crate) use bounds::{bounds_of, check_bounds};
pub use certificate::Certificate;
pub(crate) use examples::{check_example, check_silence};
pub use examples::{check_examples, check_pattern, check_some_target, check_trains};
pub(crate) use objective::{Choice, Objective, relative_gap};
pub use objective::{Divisor, DivisorC, DivisorD, FormB, Norm, Parts, Sides};
pub(crate) use peak::{SilencePeak, exceeds, largest};
pub(crate) use program::{Point, Program, Proof, Rows};
pub(crate) use relaxed::Relaxed;
pub use rows::{Margin, Row, StatedRow, Statement};
pub(crate) use silence::Silence;
pub(crate) use targets::Targets;
