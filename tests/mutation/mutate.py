"""Mutation run: every small change of a safety-relevant module has to fail a test, or stand in `survivors.toml`.

    python tests/mutation/mutate.py                      # all modules of modules.toml
    python tests/mutation/mutate.py dbc/e2e.py           # some
    python tests/mutation/mutate.py --changed            # those that no run passed as they are (passed.toml)

The mutants are those of cosmic-ray's operators. Each meets its module's tests in a child process of its own that begins
with everything imported but the module under test. A test that fails, an import that fails and a run that does not end
within its time kill a mutant. Exit code 1 where a survivor is not listed.
"""

import argparse
import contextlib
import importlib
import importlib.abc
import importlib.util
import io
import multiprocessing
import os
import re
import signal
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from difflib import ndiff
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from hil.validation.blind_trials.sources import digest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LIMIT_S = 120  # for the tests of one mutant: many times what they take
HEAVY = ("numpy", "numba", "cantools", "hypothesis", "scipy.stats", "pytest_timeout")
IDENTITY = re.compile(
    "_Is(Not)?$"
)  # a comparison by identity: the same for the small integers and enums of these modules
PYTEST = ("-x", "-q", "--assert=plain", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow")
KILLED, SURVIVED = 0, 7


@dataclass(frozen=True)
class Mutant:
    """One change of a module: its name (stable as long as the lines are), and the whole mutated source."""

    name: str
    source: str


def mutants(path: str) -> Iterator[Mutant]:
    """All mutants of a module that compile, each text once."""
    source = (ROOT / path).read_text("utf-8")
    tree = get_ast(source)
    seen, names = {source}, Counter[str]()
    for operator_name in operator_names():
        kind = get_operator(operator_name)
        if kind.arguments() or IDENTITY.search(operator_name):
            continue
        operator = kind()
        positions = sum(1 for node in ast_nodes(tree) for _ in operator.mutation_positions(node))
        for occurrence in range(positions):
            mutated = mutate_code(source, operator, occurrence)
            if mutated is None or mutated in seen:
                continue
            seen.add(mutated)
            name = f"{path}: {_change(source, mutated)}"
            names[name] += 1
            yield Mutant(name if names[name] == 1 else f"{name} ({names[name]})", mutated)


def _change(source: str, mutated: str) -> str:
    lines = [line for line in ndiff(source.splitlines(), mutated.splitlines()) if line[:2] in ("- ", "+ ")]
    gone = " ".join(line[2:].strip() for line in lines if line[0] == "-")
    come = " ".join(line[2:].strip() for line in lines if line[0] == "+")
    return f"{gone} -> {come}"


class _Importer(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives a mutated source where a module is asked for."""

    def __init__(self, name: str, path: Path, source: str) -> None:
        self._name, self._path, self._source = name, path, source

    def find_spec(self, name: str, _path: Any, _target: Any = None) -> ModuleSpec | None:
        if name != self._name:
            return None
        return importlib.util.spec_from_loader(name, self, origin=str(self._path))

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = str(self._path)
        exec(compile(self._source, str(self._path), "exec"), module.__dict__)  # noqa: S102 - our own source, mutated


def _meet_tests(path: str, source: str, tests: Sequence[str]) -> None:
    """In the child: exit code says whether a test noticed."""
    signal.alarm(LIMIT_S)
    os.chdir(ROOT)
    sys.meta_path.insert(0, _Importer(path.removesuffix(".py").replace("/", "."), ROOT / path, source))
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        code = pytest.main(
            [*tests, "-x", "-q", "--assert=plain", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow"]
        )
    os._exit(SURVIVED if code == pytest.ExitCode.OK else KILLED)


def survives(path: str, source: str, tests: Sequence[str]) -> bool:
    """Whether all tests pass with a source in the place of a module."""
    child = multiprocessing.get_context("fork").Process(target=_meet_tests, args=(path, source, tests))
    child.start()
    child.join()
    return child.exitcode == SURVIVED


def state(module: dict[str, Any]) -> str:
    """Digits that differ when the outcome for a module may."""
    return digest([ROOT / module["path"], *(ROOT / test for test in module["tests"]), HERE / "mutate.py"])[:16]


def run(module: dict[str, Any], listed: dict[str, str], workers: int) -> bool:
    """Mutate one module; whether every survivor is listed."""
    path, tests = module["path"], module["tests"]
    if not survives(path, (ROOT / path).read_text("utf-8"), tests):
        print(f"{path}: its tests fail as it is; mend them first")
        return False
    every = list(mutants(path))
    with ThreadPoolExecutor(workers) as pool:
        alive = [
            mutant.name
            for mutant, alone in zip(every, pool.map(lambda m: survives(path, m.source, tests), every), strict=True)
            if alone
        ]
    new = [name for name in alive if name not in listed]
    gone = [name for name in listed if name.startswith(f"{path}: ") and name not in alive]
    print(
        f"{path}: {len(every)} mutants, {len(every) - len(alive)} killed, {len(alive)} survive, {len(new)} not listed"
    )
    for name in new:
        print(f"  NOT LISTED  {name}")
    for name in gone:
        print(f"  listed, but killed or gone: {name}")
    return not new


def main() -> int:
    """Run the command."""
    modules = tomllib.loads((HERE / "modules.toml").read_text("utf-8"))["module"]
    parser = argparse.ArgumentParser(description="mutate safety-relevant modules; every survivor has to be listed")
    parser.add_argument("path", nargs="*", help=f"of {', '.join(m['path'] for m in modules)}; all by default")
    parser.add_argument("--changed", action="store_true", help="only modules that no run passed as they are")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    passed_file = HERE / "passed.toml"
    passed = tomllib.loads(passed_file.read_text("utf-8")) if passed_file.exists() else {}
    listed = tomllib.loads((HERE / "survivors.toml").read_text("utf-8"))
    for name in HEAVY:
        importlib.import_module(name)
    good = True
    for module in modules:
        path, now = module["path"], state(module)
        if (args.path and path not in args.path) or (args.changed and passed.get(path) == now):
            continue
        if run(module, listed, args.workers):
            passed[path] = now
            passed_file.write_text("".join(f'"{p}" = "{s}"\n' for p, s in sorted(passed.items())), "utf-8")
        else:
            good = False
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
