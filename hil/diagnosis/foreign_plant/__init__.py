"""Somebody else's plant as an FMU over measured logs: what it gets wrong, channel by channel. Names no cause.

`residuals` replays it (`replay`) and compares (`compare`); `page` shows.
"""
