"""``brakebench completion``: a script that completes the command line in a shell, made from the parsers themselves."""

import argparse
import shlex
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from hil.errors import BrakebenchError
from hil.extras import missing

SHELLS = ("bash", "zsh", "fish")


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "completion",
        description="Print a script that completes commands, options, scenarios, faults and files in a shell. It is "
        "complete in itself: no Python is started while you type. Make it anew after an update.",
        epilog="bash: brakebench completion bash > ~/.local/share/bash-completion/completions/brakebench; "
        'zsh: brakebench completion zsh > "${fpath[1]}/_brakebench"; '
        "fish: brakebench completion fish > ~/.config/fish/completions/brakebench.fish",
    )
    parser.add_argument("shell", choices=SHELLS, help="the shell")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    if lacks := missing("shtab"):
        raise BrakebenchError(f"completion {lacks}")
    import shtab

    from hil.cli.main import COMMANDS, build_parser

    parser = build_parser(list(COMMANDS))
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):  # shtab leaves out commands without a help
            action._choices_actions = [action._ChoicesPseudoAction(*one) for one in _listed(action, COMMANDS)]
    scenarios, faults = _scenarios(), _words("fault", _fault_names())
    for action in _actions(parser):
        found = _completed(action, scenarios, faults, shtab.FILE, shtab.DIRECTORY)
        if found is not None and not action.choices:
            action.complete = found  # type: ignore[attr-defined]  # where shtab looks for it
    print(shtab.complete(parser, args.shell))
    return 0


def _listed(
    action: "argparse._SubParsersAction[argparse.ArgumentParser]", told: Mapping[str, str]
) -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Each command with what it does, in a line."""
    for name, below in action.choices.items():
        below.description = told[name]
        yield name, (), told[name]


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of the commands below it."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from _actions(below)
        elif action.nargs != 0:
            yield action


def _completed(action: argparse.Action, scenarios: Any, faults: Any, files: Any, folders: Any) -> Any:
    """What completes an argument, by what it is called; None for a value that nobody can guess."""
    shown = action.metavar if isinstance(action.metavar, str) else ""
    if action.dest == "scenario":
        return scenarios
    if action.dest in ("fault", "only"):
        return faults
    if shown in ("DIR", "FOLDER"):
        return folders
    file_like = any(word in shown for word in ("FILE", "LOG", "MAP", "FMU", "DBC")) or shown in ("IN", "OUT")
    return files if file_like or action.type is Path else None


def _scenarios() -> dict[str, Any]:
    """Scenarios of the library, and files."""
    from hil.scenario.scenario import scenario_names

    return _words("scenario", scenario_names(), files=True)


def _fault_names() -> list[str]:
    from hil.faults.catalogue import FAULTS

    return [kind.name for kind in FAULTS]


def _words(kind: str, words: Iterable[str], files: bool = False) -> dict[str, Any]:
    """Complete one of these words, or a file as well, as shtab wants it."""
    listed = " ".join(words)
    name = f"_brakebench_{kind}"
    bash = f'{name}() {{\n  compgen -W {shlex.quote(listed)} -- "$1"\n'
    bash += '  _shtab_compgen_files "$1"\n}' if files else "}"
    fish = f"(printf '%s\\n' {listed}" + ("; __fish_complete_path (commandline -ct))" if files else ")")
    more = " 'files:file:_files'" if files else ""
    zsh = f"{name}() {{\n  _alternative '{kind}s:{kind}:({listed})'{more}\n}}"
    return {"bash": name, "zsh": name, "fish": fish, "preamble": {"bash": bash, "zsh": zsh}}
