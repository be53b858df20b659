"""Compiled code on disk: kept by Numba, and made anew where its files cannot be read.

A power cut, or a killed virtual machine, leaves files empty or short. Numba 0.68 then raises what unpickling raises at
every later start until somebody deletes them.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def cached(function: F, stamp: str | None = None, **options: Any) -> F:
    """Compile a function that Python calls: kept on disk, without the global interpreter lock.

    Parameters
    ----------
    stamp : what the file on disk must be made of; by default its source file's age and size.
    options : of ``numba.njit``, beside ``error_model="numpy"``.
    """
    compiled = njit(cache=True, nogil=True, **({"error_model": "numpy"} | options))(function)
    files = getattr(getattr(compiled, "_cache", None), "_cache_file", None)  # absent when numba is switched off
    if files is not None:
        if stamp is not None:
            files._source_stamp = stamp
        files._load_index = _or(files._load_index, dict)
        files._load_data = _or(files._load_data, _absent)
    return cast(F, compiled)


def _or(read: Callable[..., Any], otherwise: Callable[[], Any]) -> Callable[..., Any]:
    """Read a file, or what takes the place of one that cannot be unpickled."""

    def read_or(*names: str) -> Any:
        try:
            return read(*names)
        except OSError:
            raise
        except Exception:  # unpickling raises almost anything
            return otherwise()

    return read_or


def _absent() -> Any:
    raise FileNotFoundError  # for which Numba compiles
