//! Spikes to spikes: the SRM0 neuron.
