//! Vector instructions: what the machine has, how a function is compiled for it, and eight numbers at once.
//!
//! Two ways in. `wide!` compiles a plain loop for each width and changes nothing else, so all machines give the same
//! bits. `kernel!` compiles a function over `Vector`s, whose `Vector::add_product` rounds once where the machine
//! fuses multiply and add, so its sums differ between machines in their last places.

mod aligned;
mod eight;
mod fetch;
#[cfg(target_arch = "x86_64")]
mod front;
mod instructions;
mod products;
mod windows;

pub(crate) use aligned::{Aligned, OnLine};
pub(crate) use eight::{LANES, Vector, lines, lines_mut};
#[cfg(target_arch = "x86_64")]
pub(crate) use eight::{Ymm, Zmm};
pub(crate) use fetch::fetch;
#[cfg(target_arch = "x86_64")]
pub(crate) use front::TO_FRONT;
pub use instructions::Instructions;
pub(crate) use instructions::{by_width, kernel, wide};
pub(crate) use products::{add, add_lines, dot, times};
pub(crate) use windows::{ROW, WIDE, Windows};
