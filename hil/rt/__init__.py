"""Time: clocks and the fixed-rate loop."""
