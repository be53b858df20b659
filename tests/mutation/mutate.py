"""Mutation run: every small change of a safety-relevant module has to fail a test, or stand in `survivors.toml`.

    python tests/mutation/mutate.py                      # all modules of modules.toml
    python tests/mutation/mutate.py dbc/e2e.py           # some
    python tests/mutation/mutate.py --changed            # those that have changed since they passed (passed.toml)

The mutants are those of cosmic-ray's operators (`mutants`); each meets the tests that `modules.toml` names for its
module (`trial`). A test that fails, an import that fails and tests that do not end kill a mutant. Exit code 1 where a
survivor is not listed.
"""

import argparse
import importlib
import sys
import tomllib
from pathlib import Path
from typing import Any

from mutants import ROOT, mutants
from trial import survivors

from hil.validation.blind_trials.sources import digest

HERE = Path(__file__).parent
HEAVY = ("numpy", "numba", "numba.extending", "cantools", "can", "hypothesis", "scipy.stats")


def state(module: dict[str, Any]) -> str:
    """Digits that differ when the module, its tests or the run itself are changed."""
    tests = [ROOT / test for test in module["tests"]]
    files = {file for test in tests for file in ([*test.glob("*.py")] if test.is_dir() else [test])}
    files |= {file.parent / "conftest.py" for file in files if (file.parent / "conftest.py").exists()}
    said = "".join(file.read_text("utf-8") for file in files)
    files |= {file for file in (ROOT / "tests/support").glob("*.py") if f"from {file.stem} import" in said}
    ours = (HERE / "mutants.py", HERE / "trial.py")
    return digest([ROOT / module["path"], *sorted(files), *ours])[:16]


def run(module: dict[str, Any], listed: list[str], workers: int) -> bool:
    """Mutate one module; whether every survivor is listed."""
    path = module["path"]
    every = list(mutants(path))
    found = survivors(path, module["tests"], [mutant.source for mutant in every], workers)
    if found is None:
        print(f"{path}: its tests fail as it is; mend them first: pytest {' '.join(module['tests'])}")
        return False
    alive = [every[i].name for i in found]
    new = [name for name in alive if name not in listed]
    print(
        f"{path}: {len(every)} mutants, {len(every) - len(alive)} killed, {len(alive)} survive, {len(new)} not listed",
        flush=True,
    )
    for name in new:
        print(f"  NOT LISTED  {name}")
    for name in listed:
        if name.startswith(f"{path}: ") and name not in alive:
            print(f"  listed, but killed or gone: {name}")
    return not new


def main() -> int:
    """Run the command."""
    modules = tomllib.loads((HERE / "modules.toml").read_text("utf-8"))["module"]
    parser = argparse.ArgumentParser(description="mutate safety-relevant modules; every survivor has to be listed")
    parser.add_argument("path", nargs="*", help=f"of {', '.join(m['path'] for m in modules)}; all by default")
    parser.add_argument("--changed", action="store_true", help="only modules that have changed since they passed")
    parser.add_argument("--workers", type=int, default=2)
    args = parser.parse_args()
    if unknown := set(args.path) - {m["path"] for m in modules}:
        parser.error(f"{', '.join(sorted(unknown))}: not in modules.toml")
    passed_file = HERE / "passed.toml"
    passed = tomllib.loads(passed_file.read_text("utf-8")) if passed_file.exists() else {}
    groups = tomllib.loads((HERE / "survivors.toml").read_text("utf-8")).get("group", [])
    listed = [f"{group['path']}: {name}" for group in groups for name in group["names"]]
    for name in HEAVY:
        importlib.import_module(name)
    good = True
    for module in modules:
        path = module["path"]
        if args.path and path not in args.path:
            continue
        now = state(module)
        if args.changed and passed.get(path, now) == now:
            print(f"{path}: passed as it is" if path in passed else f"{path}: LEFT OUT, no run has passed yet")
            continue
        if run(module, listed, args.workers):
            passed[path] = now
            passed_file.write_text("".join(f'"{p}" = "{s}"\n' for p, s in sorted(passed.items())), "utf-8")
        else:
            good = False
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
