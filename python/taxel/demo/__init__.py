"""The main job, shown: scenes on the emulated board, heard, recorded, said and judged."""
