"""What stages depend on: the code that they import, and nothing that has no effect."""

import ast
import sys
from importlib import import_module

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


def test_meaning_is_code_without_comments_and_docstrings():
    for change in (*SAID, *RUN):
        assert TEXT.replace(*change) != TEXT
        assert (meaning(TEXT.replace(*change)) == meaning(TEXT)) == (change in SAID), change


def effect(text):
    """The program without strings that stand alone, which have no effect."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(body := getattr(node, "body", None), list):
            node.body = [part for part in body if not is_docstring(part)]
    return ast.dump(tree)


def is_docstring(node):
    return isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)


def test_meaning_of_all_modules_keeps_what_is_run():
    compared = 0
    for path in sorted([*(ROOT / "pedpred").rglob("*.py"), *(ROOT / "stages").glob("*.py")]):
        try:
            kept = effect(meaning(path.read_text()))
        except SyntaxError:  # a function or class of a docstring alone
            continue
        assert kept == effect(path.read_text()), path
        compared += 1
    assert compared > 100


def test_files_behind_a_module_hold_what_it_uses():
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


def test_network_is_in_the_list_of_its_architecture_alone():
    for name in ARCHITECTURES:
        network = ROOT / f"pedpred/models/{name}/network.py"
        assert {path for path, files in listings().items() if network in files} == {CODE / "models" / name}


def test_list_of_code_has_a_line_per_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code.write_code()
    written = {path.relative_to(tmp_path) for path in (tmp_path / CODE).rglob("*") if path.is_file()}
    assert written == listings().keys() >= {CODE / path.stem for path in scripts()}
    named = [line.split()[1] for line in (tmp_path / CODE / "fetch").read_text().splitlines()]
    assert named == ["pedpred/sources/archives.py", "pedpred/sources/mirrors.py", "stages/fetch.py"]
