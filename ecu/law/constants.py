"""Constants of nature that the control law needs."""

GRAVITY_MPS2 = 9.80665
"""Standard gravity (ISO 80000-3). The plant rounds it to 9.81, 0.03 % more: far below what mass and grade are known
to."""
