"""What all tests share: examples are drawn the same each time, and a busy machine is no failure."""

from hypothesis import settings

settings.register_profile("taxel", deadline=None, derandomize=True)
settings.load_profile("taxel")
