"""What all tests share: examples are drawn the same each time, and a busy machine is no failure."""

from hypothesis import settings

settings.register_profile("taxel", deadline=None, derandomize=True)
settings.load_profile("taxel")

#: Scripts that made kept data are no tests: they need what made it.
collect_ignore_glob = ["data/*"]
