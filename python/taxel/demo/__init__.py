"""The demo: scenes on the emulated board, detected by a readout that comes with it, and scored."""
