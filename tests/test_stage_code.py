"""What stages depend on: the code that they import, and nothing that has no effect."""

import ast
import sys
from importlib import import_module

import pytest

from pedpred.models import ARCHITECTURES
from stages import code
from stages.code import CODE, ROOT, UNRELATED, code_behind, files_of, listings, meaning, scripts

TEXT = '''"""Title."""
import math  # why


def half(x):
    """Return a half.

    A string # without a comment.
    """
    # in detail
    text = "# no comment"
    return math.floor(x) / 2, text, """
    # kept

    two lines below  
    """


LIMIT = 3
"""Of x."""
'''
SAID = [("Title", "Name"), ("# why", "# because"), ("# in detail", ""), ("Return a half.", "Halve.")]
SAID += [("Of x", "Most"), ("\n\n\n", "\n\n# more\n")]
RUN = [("/ 2", "/ 3"), ("# no comment", "# a comment"), ("= 3", "= 4")]
RUN += [("# kept", "# lost"), ("kept\n\n", "kept\n"), ("below  ", "below")]
FILES = sorted([*(ROOT / "pedpred").rglob("*.py"), *(ROOT / "stages").glob("*.py")])


@pytest.mark.parametrize("change", SAID)
def test_comment_or_docstring_changes_nothing(change):
    assert TEXT.replace(*change) != TEXT
    assert meaning(TEXT.replace(*change)) == meaning(TEXT)


@pytest.mark.parametrize("change", RUN)
def test_code_or_string_changes_something(change):
    assert meaning(TEXT.replace(*change)) != meaning(TEXT)


class WithoutDocstrings(ast.NodeTransformer):
    """Leaves out strings that stand alone, which have no effect."""

    def visit_Expr(self, node):
        match node:
            case ast.Expr(ast.Constant(str())):
                return None
        return node


def effect(text):
    return ast.dump(WithoutDocstrings().visit(ast.parse(text)))


def with_bodies(text):
    """The same program, which still is one without its docstrings."""
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        match node:
            case (
                ast.FunctionDef(body=[ast.Expr(ast.Constant(str()))])
                | ast.ClassDef(body=[ast.Expr(ast.Constant(str()))])
            ):
                lines[node.end_lineno - 1] += f"\n{' ' * node.body[0].col_offset}pass"
    return "\n".join(lines)


def test_all_that_is_run_is_left():
    for path in FILES:
        text = with_bodies(path.read_text())
        assert effect(meaning(text)) == effect(text), path


def test_what_a_module_uses_is_among_the_files_behind_it():
    """Also what it imports inside functions, by public names of packages, or on first use."""
    for script in scripts():
        import_module(f"stages.{script.stem}")
    modules = {m.__file__: m for name, m in sys.modules.items() if name.startswith(("pedpred.", "stages."))}
    for file, module in modules.items():
        homes = {getattr(value, "__module__", None) for value in vars(module).values()}
        homes = {home for home in homes if home in sys.modules and home.startswith("pedpred.")}
        used = {sys.modules[home].__file__ for home in homes}
        assert used & modules.keys() <= {str(path) for path in code_behind(ROOT / file)}, file


def test_stage_depends_on_the_files_beside_its_code():
    names = {str(path.relative_to(ROOT)) for path in files_of(ROOT / "stages/report.py")}
    assert {"pedpred/report/page/page.html", "pedpred/report/page/replay.js", "stages/report.py"} <= names
    assert not {str(path.relative_to(ROOT)) for path in UNRELATED} & names


@pytest.mark.parametrize("name", ARCHITECTURES)
def test_network_is_in_the_list_of_its_architecture_alone(name):
    network = ROOT / f"pedpred/models/{name}/network.py"
    assert {path for path, files in listings().items() if network in files} == {CODE / "models" / name}


def test_list_of_code_has_a_line_per_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code.write_code()
    written = {path.relative_to(tmp_path) for path in (tmp_path / CODE).rglob("*") if path.is_file()}
    assert written == listings().keys() >= {CODE / path.stem for path in scripts()}
    assert [line.split()[1] for line in (tmp_path / CODE / "fetch").read_text().splitlines()] == [
        "pedpred/sources/archives.py",
        "pedpred/sources/mirrors.py",
        "stages/fetch.py",
    ]
