"""Campaigns: thousands of runs in virtual time over parameters, effects, faults and seeds, nothing lost on the way."""
