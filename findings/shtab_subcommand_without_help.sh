#!/usr/bin/env bash
# shtab 1.13.0 leaves a subcommand out of its completion scripts, without a word, where add_parser(NAME) was called
# without help=, though argparse runs and lists it. argparse keeps such a parser in `choices` of the subparsers' action,
# but makes the pseudo-action by which shtab knows public names only where there is a help text.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet shtab==1.13.0
"$folder/venv/bin/python" - <<'PY'
import argparse

import shtab

parser = argparse.ArgumentParser(prog="tool")
commands = parser.add_subparsers(dest="command")
commands.add_parser("measure", description="Measure.").add_argument("--channel")
commands.add_parser("report", help="write a report").add_argument("--pages")
print("argparse runs it:", parser.parse_args(["measure", "--channel", "1"]))
print("argparse lists it:", parser.format_usage().strip())
for shell in ("bash", "zsh"):
    script = shtab.complete(parser, shell=shell)
    print(f"{shell}: measure {'is' if 'measure' in script else 'is not'} in the script, report "
          f"{'is' if 'report' in script else 'is not'}")
    if "measure" in script or "report" not in script:
        raise SystemExit("the script has it now: the finding no longer holds")
PY
