"""Settings of all tests."""

from hypothesis import settings

# A machine that does other work is no fault of the code: the suite's own time is watched instead.
settings.register_profile("coupled", deadline=None)
settings.load_profile("coupled")
