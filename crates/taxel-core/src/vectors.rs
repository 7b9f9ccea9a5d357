//! Vector instructions: the sets of this machine, functions compiled for each set, and vectors of eight numbers.
//!
//! There are two macros. `wide!` compiles a plain loop for each vector width without changing the arithmetic, so
//! every machine computes the same bits. `kernel!` compiles a function over `Vector`s, whose `Vector::add_product`
//! rounds once where the machine has fused multiply-add, so its sums differ between machines in the last digits.

mod aligned;
mod eight;
#[cfg(target_arch = "x86_64")]
mod front;
mod instructions;
mod products;

pub(crate) use aligned::Aligned;
pub(crate) use eight::{LANES, Vector, lines, lines_mut};
#[cfg(target_arch = "x86_64")]
pub(crate) use eight::{Ymm, Zmm};
#[cfg(target_arch = "x86_64")]
pub(crate) use front::TO_FRONT;
pub use instructions::Instructions;
pub(crate) use instructions::{by_width, kernel, wide};
pub use products::dot;
pub(crate) use products::{add, add_lines, times};
