//! Weights from examples.
