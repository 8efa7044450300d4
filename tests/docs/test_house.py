"""The measures of the source tree, on small trees whose values are counted by hand."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture
def scripts(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The modules of the folder ``scripts``, importable while a test runs."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    yield
    for name in ("house_tree", "house_circles", "house_measures", "house", "defaults"):
        sys.modules.pop(name, None)


def tree_of(files: dict[str, str]) -> list[Any]:
    """Returns source files of a tree, by paths below ``src/robotrue``."""
    from house_tree import SourceFile

    return [
        SourceFile(path=f"src/robotrue/{path}", text=text, tree=ast.parse(text))
        for path, text in files.items()
    ]


def test_a_circle_through_an_import_in_a_function_is_found(scripts: None) -> None:
    """Fails when imports inside functions do not count, or when a chain counts as a circle."""
    from house_circles import find_circles

    files = tree_of(
        {
            "a/one.py": "from robotrue.a import two\n",
            "a/two.py": "def f():\n    from robotrue.b.three import x\n    return x\n",
            "b/three.py": "import robotrue.a.one\nfrom robotrue.b.four import y\n",
            "b/four.py": "y = 1\n",
        }
    )
    assert find_circles(files) == [("robotrue.a.one", "robotrue.a.two", "robotrue.b.three")]


def test_measures_are_those_counted_by_hand(scripts: None) -> None:
    """Fails when docstrings count as lines of a function, or text counts as code or comment."""
    from house_measures import measure_house

    kernel = (
        '"""File.\n\n# no comment, Any text\n"""\n'
        "from typing import Any\n\n\n"
        "# why\n"
        "@compile_kernel(EXACT)\n"
        "def gathered(x: Any) -> Any:\n"
        '    """One.\n\n    Two.\n    """\n'
        '    y = "Any"  # Any\n'
        "    return x\n\n\n"
        "class Same:\n"
        "    @property\n"
        "    def held(self):\n"
        "        return 1\n"
    )
    house = measure_house(
        tree_of(
            {"a/kernel.py": kernel, "b/x.py": "class Same:\n    pass\n", "c/x.py": "", "d/x.py": ""}
        )
    )
    assert house.rooms == {"a": (1, 22), "b": (1, 2), "c": (1, 0), "d": (1, 0)}
    assert (house.import_lines, house.comment_lines, house.any_uses) == (1, 1, 2)
    assert (house.docstrings, house.docstring_lines) == (2, 8)
    assert (house.kernel_files, house.kernel_lines) == (1, 22)
    assert house.function_lengths["max"] == 3
    assert list(house.double_classes) == ["Same"]
    assert list(house.frequent_files) == ["x"]
    assert house.participles == ["src/robotrue/a/kernel.py:10 gathered"]


def test_an_unknown_circle_and_a_long_file_fail_the_check(scripts: None) -> None:
    """Fails when the gate lets a new circle or a file of 501 lines pass."""
    from house import KNOWN_CIRCLES, failures
    from house_measures import measure_house

    mended = len(KNOWN_CIRCLES)
    files = {
        "a/p.py": "import robotrue.a.q\n",
        "a/q.py": "import robotrue.a.p\n",
        "a/r.py": "\n" * 501,
    }
    wrong = list(failures(measure_house(tree_of(files))))
    assert sum("robotrue.a.p <-> robotrue.a.q" in line for line in wrong) == 1
    assert sum("a/r.py 501 lines" in line for line in wrong) == 1
    assert len(wrong) == 2 + mended


def test_one_default_in_an_option_a_job_a_form_and_the_settings_is_found(scripts: None) -> None:
    """Fails when a unit in the name parts two spellings, or a named constant counts twice."""
    from defaults import find_doubles

    files = tree_of(
        {
            "planning/settings.py": "DRAWN = 2000\n\nclass Settings:\n    max_shift: float = .01\n",
            "cli/commands.py": (
                "from robotrue.planning.settings import DRAWN\n\n\n"
                "def run(max_shift_mm=10.0, drawn=DRAWN, off=0.0, no=None):\n    pass\n"
            ),
            "cli/job.py": (
                "from robotrue.planning.settings import DRAWN\n\n\n"
                "def plan(asked):\n"
                "    asked.number('max_shift_mm', 20.0)\n"
                "    asked.whole('drawn', DRAWN)\n"
                "    asked.whole('turns', 3)\n"
            ),
            "web/form.py": 'TURNS = 3\nPAGE = f\'<input name="turns" value="{TURNS}">\'\n',
        }
    )
    found = find_doubles(files)
    assert {k: [s.place for s in v] for k, v in found.same.items()} == {
        "max_shift": [
            "src/robotrue/cli/commands.py:4 run",
            "src/robotrue/planning/settings.py:4 Settings",
            "src/robotrue/cli/job.py:5 number(...)",
        ],
        "turns": ["src/robotrue/cli/job.py:7 whole(...)", "src/robotrue/web/form.py:1 TURNS"],
    }
    assert list(found.different) == ["max_shift"]
