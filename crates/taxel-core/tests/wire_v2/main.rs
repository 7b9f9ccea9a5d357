//! Tests of version 2 of the wire between the emulated board and the decoder, with every fault of a network.

mod board;
mod faults;
mod instructions;
mod scenes;
mod streams;
