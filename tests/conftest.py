"""For all tests: how long an example takes says nothing on a shared machine, and the first one compiles."""

from hypothesis import settings

settings.register_profile("brakebench", deadline=None)
settings.load_profile("brakebench")
