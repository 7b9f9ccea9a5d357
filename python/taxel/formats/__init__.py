"""Files of other makers and programs: a module for each kind, with `knows(path)` and `read(path, layout)`.

`taxel.open` tries them in the order of `taxel.recording.kinds.kinds`.
"""

__all__: list[str] = []
