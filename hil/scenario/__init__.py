"""Takes TOML files and gives validated values: scenarios, parameter sets, effects, tyre files.

The scenarios that come with brakebench are in the folder `library`.
"""
