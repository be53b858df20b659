"""For all tests: how long an example takes says nothing on a shared machine, and the first one compiles."""

from hypothesis import HealthCheck, settings

pytest_plugins = ["drawn", "shared"]
settings.register_profile("brakebench", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("brakebench")
