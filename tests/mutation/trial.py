"""Whether the tests of a module notice that it has been changed.

A mutant first meets tests that are collected already: the code of its functions is put in the place of the original's,
in a child process. What survives that, or changes more than the inside of functions, meets the tests again with
everything imported anew: this is what counts as survival. Functions that call into the mutated module run as plain
Python, so that nothing which was compiled, or is in numba's cache on the disk, stands in for them.
"""

import ast
import gc
import importlib.abc
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
import pytest
from _pytest.main import pytest_runtestloop
from hypothesis import Phase, settings

ROOT = Path(__file__).parents[2]
PACKAGES = ("dbc", "ecu", "plant", "hil")
LIMIT_S = 60.0  # of processor time, for the tests of one mutant: many times what they take
PLUGINS = ("-p", "pytest_timeout", "-p", "no:cacheprovider")
PYTEST = ("-x", "-q", "--assert=plain", "-W", "ignore::pytest.PytestAssertRewriteWarning", "-m", "not slow", *PLUGINS)
KILLED, SURVIVED, NOT_TRIED = 0, 7, 8
_FORK = multiprocessing.get_context("fork")


def name_of(path: str) -> str:
    """Name of the module in a file of the repository."""
    return path.removesuffix(".py").replace("/", ".")


@cache
def importers(name: str) -> frozenset[str]:
    """The modules that import a module, or one that does."""
    imported = {}
    for package in PACKAGES:
        for file in (ROOT / package).rglob("*.py"):
            imported[name_of(file.relative_to(ROOT).as_posix())] = _imported(ast.parse(file.read_text("utf-8")))
    found = {name}
    while more := {module for module, names in imported.items() if names & found} - found:
        found |= more
    return frozenset(found - {name})


def _imported(tree: ast.AST) -> set[str]:
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


class _Importer(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports a module from the given source, and the modules that use it uncompiled."""

    def __init__(self, path: str, source: str) -> None:
        self._name, self._path, self._source = name_of(path), ROOT / path, source
        self._plain = {self._name} | importers(self._name)

    def find_spec(self, name: str, path: Any, _target: Any = None) -> ModuleSpec | None:
        if name not in self._plain:
            return None
        spec = PathFinder.find_spec(name, path)
        if spec is not None:
            spec.loader, spec.loader_state = self, spec.loader
        return spec

    def exec_module(self, module: ModuleType) -> None:
        jit, numba.config.DISABLE_JIT = numba.config.DISABLE_JIT, 1
        try:
            if module.__name__ == self._name:
                exec(compile(self._source, str(self._path), "exec"), module.__dict__)  # noqa: S102 - ours, mutated
            else:
                module.__spec__.loader_state.exec_module(module)
        finally:
            numba.config.DISABLE_JIT = jit


def _prepare(path: str, source: str) -> None:
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    os.environ["CI"] = "1"  # hypothesis draws the same examples every time
    settings.register_profile("mutation", phases=(Phase.explicit, Phase.generate))  # what fails need not be made small
    settings.load_profile("mutation")  # and the profile of the tests inherits that
    os.chdir(ROOT)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    sys.meta_path.insert(0, _Importer(path, source))


def _in_child(work: Callable[[], int]) -> int:
    """Exit code of a function in a process of its own, with its share of processor time; below 0 where ended."""
    child = os.fork()
    if child == 0:
        code = KILLED
        try:
            signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
            code = work()
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _afresh(path: str, source: str, tests: Sequence[str]) -> bool:
    """Whether all tests pass with a source in the place of a module, everything imported anew."""

    def work() -> int:
        _prepare(path, source)
        return SURVIVED if pytest.main([*PYTEST, *tests]) == pytest.ExitCode.OK else KILLED

    return _in_child(work) == SURVIVED


def _functions(name: str, namespace: dict[str, Any]) -> dict[str, FunctionType]:
    """Functions of a module by their qualified names; caches of them are emptied."""
    found: dict[str, FunctionType] = {}

    def look(value: Any) -> None:
        for part in (value, *(getattr(value, f, None) for f in ("fget", "fset", "__func__", "__wrapped__"))):
            if hasattr(part, "cache_clear"):
                part.cache_clear()
            if isinstance(part, FunctionType) and part.__module__ == name:
                found.setdefault(part.__qualname__, part)

    for value in list(namespace.values()):
        look(value)
        if isinstance(value, type) and value.__module__ == name:
            for member in vars(value).values():
                look(member)
    return found


def _outside(tree: ast.AST) -> str:
    """A module without the inside of its functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.body = [ast.Pass()]
    return ast.dump(tree)


class _Trials:
    """Plugin of pytest that lets mutants meet the collected tests, instead of running them once."""

    def __init__(self, path: str, sources: Sequence[str], send: Callable[[Any], None]) -> None:
        self._path, self._sources, self._send = path, sources, send
        self._outside = _outside(ast.parse((ROOT / path).read_text("utf-8")))

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        passed = self._passes(session)  # as it is; compiles and loads everything, too
        self._send(passed and len(session.items) > 0)
        gc.freeze()
        if passed:
            for source in self._sources:
                self._send(_in_child(lambda source=source: self._meet(session, source)) not in (SURVIVED, NOT_TRIED))
        return True

    def _passes(self, session: pytest.Session) -> bool:
        try:
            pytest_runtestloop(session)
        except (session.Failed, session.Interrupted):
            return False
        return not session.testsfailed

    def _meet(self, session: pytest.Session, source: str) -> int:
        if _outside(ast.parse(source)) != self._outside:
            return NOT_TRIED
        name = name_of(self._path)
        new: dict[str, Any] = {"__name__": name, "__file__": str(ROOT / self._path)}
        numba.config.DISABLE_JIT = 1
        exec(compile(source, str(ROOT / self._path), "exec"), new)  # noqa: S102 - ours, mutated
        numba.config.DISABLE_JIT = 0
        originals, changed = _functions(name, vars(sys.modules[name])), _functions(name, new)
        for qualified, function in changed.items():
            originals[qualified].__code__ = function.__code__
        return SURVIVED if self._passes(session) else KILLED


def _worker(path: str, tests: Sequence[str], sources: Sequence[str], collected: bool, pipe: Any) -> None:
    if collected:
        _prepare(path, (ROOT / path).read_text("utf-8"))
        pytest.main([*PYTEST, *tests], plugins=[_Trials(path, sources, pipe.send)])
    else:
        for source in sources:
            pipe.send(not _afresh(path, source, tests))
    pipe.close()


def _shared_out(
    path: str, tests: Sequence[str], sources: Sequence[str], collected: bool, workers: int
) -> Iterator[list[bool]]:
    running = []
    for first in range(workers):
        ours, theirs = _FORK.Pipe(duplex=False)
        process = _FORK.Process(target=_worker, args=(path, tests, sources[first::workers], collected, theirs))
        process.start()
        theirs.close()
        running.append((process, ours))
    for process, ours in running:
        answers: list[bool] = []
        try:
            while True:
                answers.append(ours.recv())
        except EOFError:
            process.join()
        yield answers


def survivors(path: str, tests: Sequence[str], sources: Sequence[str], workers: int) -> list[int] | None:
    """Which of the mutated sources no test notices; None where the tests fail with the module as it is."""
    importers(name_of(path))  # once for all children
    if not _afresh(path, (ROOT / path).read_text("utf-8"), tests):
        return None
    alive = list(range(len(sources)))
    for collected in (True, False):
        left: list[int] = []
        shares = _shared_out(path, tests, [sources[i] for i in alive], collected, workers)
        for first, answers in enumerate(shares):
            if collected and not (answers and answers.pop(0)):
                return None
            share = alive[first::workers]
            if len(answers) != len(share):
                raise RuntimeError(f"{path}: {len(answers)} of {len(share)} mutants were tried; a worker has ended")
            left += [i for i, killed in zip(share, answers, strict=True) if not killed]
        alive = sorted(left)
    return alive
