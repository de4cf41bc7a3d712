"""House rules that run: lengths, names, banned calls, debts, documents. The message names what to write instead."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "ahgateway"
TESTS = ROOT / "tests"
FILE_LINES_MAX = 600
BODY_LINES_MAX = 60
LAW_LINES_MAX = 90
"""A law is written once, in the order of the specification; cut into pieces, its order could not be read."""

VAGUE_NAMES = {"utils", "util", "helpers", "helper", "common", "manager", "handler", "misc", "base_utils"}

ASSUMED_MAX = {
    "core": 45,
    "codec": 8,
    "transports": 12,
    "fake": 16,
    "lockstep": 16,
    "plants": 2,
    "schema": 6,
    "apps": 6,
    "cli": 4,
    "tui": 2,
}
"""Most lines that say ASSUMED on each floor: each is a debt that only a PLC can pay. Lower a number when one is."""


def sources(*roots: Path) -> list[Path]:
    return [path for root in roots for path in sorted(root.rglob("*.py")) if "__pycache__" not in path.parts]


def name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def documents() -> list[Path]:
    roots = [ROOT / "README.md", ROOT / "CHANGELOG.md", TESTS / "README.md"]
    return [path for path in [*roots, *sorted((ROOT / "docs").rglob("*.md"))] if path.exists()]


def functions(path: Path) -> Iterator[tuple[str, int]]:
    """Every function with its body's lines, docstring not counted."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            if body and node.end_lineno is not None:
                yield node.name, node.end_lineno - body[0].lineno + 1


def test_no_file_is_longer_than_600_lines() -> None:
    long = {name(path): len(path.read_text(encoding="utf-8").splitlines()) for path in sources(PACKAGE, TESTS)}
    assert {} == {path: lines for path, lines in long.items() if lines > FILE_LINES_MAX}


def test_no_function_is_longer_than_60_lines_but_a_law() -> None:
    long = []
    for path in sources(PACKAGE, TESTS):
        law = path.is_relative_to(PACKAGE / "core" / "controllers")
        for function, lines in functions(path):
            if lines > (LAW_LINES_MAX if law and function == "step" else BODY_LINES_MAX):
                long.append(f"{name(path)}: {function} has {lines} lines")
    assert [] == long


def test_no_module_has_a_name_that_says_nothing() -> None:
    assert [] == [name(path) for path in sources(PACKAGE, TESTS) if path.stem in VAGUE_NAMES]


def test_no_two_test_files_have_one_name() -> None:
    counts = Counter(path.name for path in sources(TESTS) if path.name.startswith("test_"))
    assert [] == [file for file, count in counts.items() if count > 1]


BELOW_CLI = [path for path in sources(PACKAGE) if not path.is_relative_to(PACKAGE / "cli")]
BANNED = [
    (BELOW_CLI, r"(?<![\w.])print\(", "return data; only cli prints", set()),
    (
        BELOW_CLI,
        r"\btime\.(time|monotonic|perf_counter)(_ns)?\(|datetime\.(now|utcnow|today)\(",
        "take a Clock",
        {"ahgateway/clock.py"},
    ),
    (sources(PACKAGE), r"(?m)^\s*(import|from) click\b", "typer carries its own click", set()),
    (sources(PACKAGE, TESTS), r"\b(TO" r"DO|FIX" r"ME|XX" r"X)\b", "do it, or write the decision down", set()),
    (sources(PACKAGE), r"NotImplemented" r"Error", "leave it out until it works", set()),
    (sources(PACKAGE, TESTS), r"unittest\." r"mock|Magic" r"Mock", "write a fake", set()),
    (sources(PACKAGE, TESTS), r"pytest\.(mark\.)?(import" r"or)?(skip|xf" r"ail)", "no skips", {"tests/conftest.py"}),
    (sources(PACKAGE, TESTS), r"[\"'](/ho" r"me|/ro" r"ot|/wo" r"rk|/op" r"t)/", "no path of one machine", set()),
]  # fmt: skip


@pytest.mark.parametrize(
    ("paths", "pattern", "instead", "allowed"), BANNED, ids=[instead for _, _, instead, _ in BANNED]
)
def test_banned(paths: list[Path], pattern: str, instead: str, allowed: set[str]) -> None:
    found = []
    for path in paths:
        for match in re.finditer(pattern, path.read_text(encoding="utf-8")):
            line = match.string.count("\n", 0, match.start()) + 1
            found.append(f"{name(path)}:{line}: {match.group().strip()}: {instead}")
    assert [] == [line for line in found if line.partition(":")[0] not in allowed]


def test_no_test_sleeps_in_real_time() -> None:
    """Only conformance and bench may meet the wall clock."""
    found = []
    for path in sources(TESTS):
        if path.is_relative_to(TESTS / "conformance") or path.is_relative_to(TESTS / "bench"):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "sleep":
                idle = bool(node.args) and isinstance(node.args[0], ast.Constant) and node.args[0].value == 0
                if not idle and isinstance(node.func.value, ast.Name) and node.func.value.id in {"time", "asyncio"}:
                    found.append(f"{name(path)}:{node.lineno}")
    assert [] == found


def test_assumptions_do_not_grow_unnoticed() -> None:
    counts = Counter[str]()
    for path in sources(PACKAGE):
        floor = path.relative_to(PACKAGE).parts[0]
        counts[floor] += len(re.findall(r"\bASSUMED\b", path.read_text(encoding="utf-8")))
    assert {} == {floor: count for floor, count in counts.items() if count > ASSUMED_MAX.get(floor, 0)}, dict(counts)


@pytest.mark.parametrize("path", documents(), ids=name)
def test_a_document_has_exactly_one_title(path: Path) -> None:
    text = re.sub(r"(?ms)^(```|~~~).*?^\1", "", path.read_text(encoding="utf-8"))
    assert 1 == len(re.findall(r"(?m)^# \S", text))


@pytest.mark.parametrize("path", documents(), ids=name)
def test_links_between_documents_lead_somewhere(path: Path) -> None:
    targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8"))
    assert [] == [target for target in targets if not (path.parent / target).exists()]


def test_every_page_is_linked_from_a_table_of_contents() -> None:
    linked = set()
    for contents in (ROOT / "README.md", ROOT / "docs" / "README.md", ROOT / "docs" / "decisions" / "README.md"):
        if contents.exists():
            for target in re.findall(r"\]\(([^)#:\s]+)", contents.read_text(encoding="utf-8")):
                linked.add((contents.parent / target).resolve())
    pages = [path for path in (ROOT / "docs").rglob("*.md") if path != ROOT / "docs" / "README.md"]
    assert [] == [name(path) for path in pages if path.resolve() not in linked]
