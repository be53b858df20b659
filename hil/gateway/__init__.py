"""Other cars' messages: translated from and to ours, and sent for nodes that are not there."""
