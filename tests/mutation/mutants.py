"""The mutants of a module: every single change that cosmic-ray's operators make of it."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

ROOT = Path(__file__).parents[2]
# By identity instead of equality, and the other way round: the same for None and the enums of these modules.
_SAME = re.compile(r"_(\w+_Is(Not)?|Is_Eq|IsNot_NotEq)$")
# Arithmetic by operators on bits: not for floats, and mostly the same for indices of arrays that begin at 4 k.
_BITS = re.compile(r"_(Add|Sub|Mul|Div|FloorDiv|Mod|Pow)_(BitAnd|BitOr|BitXor|LShift|RShift)$")
# How a function is compiled or cached; what it computes is the same without.
_DECORATORS = re.compile(r"@(helper|entry|shared|cache|lru_cache\(.*\))$")


@dataclass(frozen=True)
class Mutant:
    """One change of a module: its name (stable as long as the lines are), and the whole mutated source."""

    name: str
    source: str


def mutants(path: str) -> Iterator[Mutant]:
    """All mutants of a module that compile, each text once; type annotations stay as they are."""
    source = (ROOT / path).read_text("utf-8")
    tree, meaning = get_ast(source), _unannotated(source)
    seen, names = {source}, Counter[str]()
    for operator_name in operator_names():
        kind = get_operator(operator_name)
        if kind.arguments() or _SAME.search(operator_name) or _BITS.search(operator_name):
            continue
        operator = kind()
        positions = sum(1 for node in ast_nodes(tree) for _ in operator.mutation_positions(node))
        for occurrence in range(positions):
            mutated = mutate_code(source, operator, occurrence)
            if mutated is None or mutated in seen:
                continue
            seen.add(mutated)
            gone, come = _change(source.splitlines(), mutated.splitlines())
            if (_DECORATORS.match(gone) and not come) or _unannotated(mutated) in (meaning, None):
                continue
            if gone.replace("strict=True", "strict=False") == come:
                continue  # zip's own check of equal lengths
            name = f"{path}: {gone} -> {come}"
            names[name] += 1
            yield Mutant(name if names[name] == 1 else f"{name} ({names[name]})", mutated)


def _change(before: list[str], after: list[str]) -> tuple[str, str]:
    """The lines that differ, those of before and those of after."""
    while before and after and before[0] == after[0]:
        before, after = before[1:], after[1:]
    while before and after and before[-1] == after[-1]:
        before, after = before[:-1], after[:-1]
    return " ".join(map(str.strip, before)).strip(), " ".join(map(str.strip, after)).strip()


def _unannotated(source: str) -> str | None:
    """What a source means, but for its type annotations; None where it is no Python."""
    try:
        tree = ast.parse(source)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.arg | ast.AnnAssign):
            node.annotation = ast.Constant(None)
        elif isinstance(node, ast.FunctionDef):
            node.returns = None
    return ast.dump(tree)
