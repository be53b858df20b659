"""Takes messages in SI units and gives frames, and the way back: the contract on the wire, `brake.dbc`, `bench.dbc`."""
