"""Takes nodes and a period and gives them time: clocks, the fixed-rate loop, virtual time, processes."""
