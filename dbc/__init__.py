"""The contract on the wire: frames, brake.dbc, bench.dbc, codec, end-to-end protection."""
