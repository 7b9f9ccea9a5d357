//! The emulated board, as a state machine.
