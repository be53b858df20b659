"""Completion in real shells."""

import os
import pty
import re
import select
import shutil
import subprocess
import sys

import pytest

pytest.importorskip("shtab", reason="the extra completion is not installed")
pytestmark = pytest.mark.slow

ASKED = [
    (["rep"], {"replay", "reproduce"}),
    (["run", "--terminal", "--vi"], {"--virtual"}),
    (["run", "stop72_"], {"stop72_blend50", "stop72_blend70"}),
    (["inject", "signal_st"], {"signal_step", "signal_stuck"}),
    (["completion", "f"], {"fish"}),
    (["run", "--without", ""], {"ecu", "plant"}),
    (["run", "mine.t"], {"mine.toml"}),
    (["explain", "--extend", "mine.t"], {"mine.toml"}),
]
BASH = """
source "$1"; shift
COMP_WORDS=(brakebench "$@") COMP_CWORD=$# COMP_LINE="brakebench $*" COMP_POINT=${#COMP_LINE} COMPREPLY=()
$(complete -p brakebench | sed -E 's/.* -F ([^ ]+).*/\\1/') brakebench "${@: -1}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scripts")
    (folder / "mine.toml").touch()
    for shell in ("bash", "zsh", "fish"):
        done = subprocess.run([sys.executable, "-m", "hil.cli.main", "completion", shell], capture_output=True)
        assert done.returncode == 0, done.stderr
        (folder / f"_{shell}").write_bytes(done.stdout)
    return folder


def test_bash(scripts):
    for words, expected in ASKED:
        done = subprocess.run(["bash", "-c", BASH, "bash", scripts / "_bash", *words], capture_output=True, cwd=scripts)
        assert set(done.stdout.decode().split()) == expected, (words, done.stderr)


@pytest.mark.skipif(shutil.which("fish") is None, reason="no fish here")
def test_fish(scripts):
    for words, expected in ASKED:
        asked = f"source {scripts}/_fish; complete -C 'brakebench {' '.join(words)}'"
        done = subprocess.run(["fish", "--no-config", "-c", asked], capture_output=True, text=True, cwd=scripts)
        assert {line.split("\t")[0] for line in done.stdout.splitlines()} == expected, (words, done.stderr)


@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh here")
def test_zsh(scripts):
    functions = scripts / "functions"
    functions.mkdir()
    shutil.copy(scripts / "_zsh", functions / "_brakebench")
    (scripts / ".zshrc").write_text(
        f"PS1='% '\nfpath=({functions} $fpath)\nautoload -Uz compinit; compinit -u -D\necho READY\n"
    )
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(scripts)
        os.execvpe("zsh", ["zsh", "-i"], os.environ | {"ZDOTDIR": str(scripts), "TERM": "xterm", "COLUMNS": "200"})

    def read_until(wanted):
        text = ""
        while not wanted(text):
            assert select.select([terminal], [], [], 20)[0], text
            text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text + os.read(terminal, 65536).decode(errors="replace"))
        return text

    try:
        read_until(lambda text: "READY" in text)
        for words, expected in ASKED:
            os.write(terminal, f"brakebench {' '.join(words)}\t\t".encode())
            read_until(lambda text, names=expected: all(name in text for name in names))
            os.write(terminal, b"\x15")  # ^U: a new line
    finally:
        os.write(terminal, b"\x15exit\n")
        os.waitpid(pid, 0)
        os.close(terminal)
