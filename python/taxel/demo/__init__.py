"""The main job, shown: scenes on the emulated board, recorded, detected and judged."""
