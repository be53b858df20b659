"""Blind trials of the study against the hidden car: the one place that knows both."""
