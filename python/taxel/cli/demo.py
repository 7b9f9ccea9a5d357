"""``taxel demo``: the main job, shown."""
