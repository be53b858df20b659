#!/usr/bin/env bash
# numba 0.68.1 loads the class of a NamedTuple anew by its unpickler each time a compiled function returns one: one
# call of numba.core.serialize._numba_unpickle for every NamedTuple in the result, nested ones included, on every call.
# A plain tuple of the same numbers costs none. In a fixed-rate loop of microseconds it is a large part of the call.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet numba==0.68.1
cd "$folder"
venv/bin/python - <<'PY'
import cProfile
import pstats
from typing import NamedTuple

from numba import njit


class Inner(NamedTuple):
    a: float
    b: float


class Outer(NamedTuple):
    inner: Inner
    c: float


@njit
def flat(x):
    return (x, x), x


@njit
def one(x):
    return Inner(x, x)


@njit
def nested(x):
    return Outer(Inner(x, x), x)


def unpickled(function, calls=1000):
    function(1.0)  # compiles
    profile = cProfile.Profile()
    profile.enable()
    for _ in range(calls):
        function(1.0)
    profile.disable()
    stats = pstats.Stats(profile).stats
    return sum(row[0] for (_, _, name), row in stats.items() if name == "_numba_unpickle") / calls


counts = {function.__name__: unpickled(function) for function in (flat, one, nested)}
print(counts)
assert counts == {"flat": 0.0, "one": 1.0, "nested": 2.0}, counts
PY
