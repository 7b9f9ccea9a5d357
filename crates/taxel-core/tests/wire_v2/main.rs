//! Version 2 of the wire between the emulated board and the decoder, under every fault that a network knows.

mod board;
mod faults;
mod instructions;
mod scenes;
mod streams;
mod vectors;
