"""Manoeuvres with figures of their own: stops (mean fully developed deceleration) and coast-downs (road load)."""
