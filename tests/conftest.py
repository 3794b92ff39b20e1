"""What holds for all tests."""

import signal

from hypothesis import HealthCheck, settings

# A shell starts what runs in the background with Ctrl-C ignored, and children inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# No verdict may hang on how fast a machine is: pytest's time limit is for what hangs.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")
