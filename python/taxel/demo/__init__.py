"""The demo: scenes on the emulated board, recorded, detected and scored."""
