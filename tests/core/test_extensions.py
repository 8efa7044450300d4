"""Packages outside extend robotrue by entry points; ``examples/extension`` is one."""

from __future__ import annotations

from pathlib import Path

import pytest

from extension_example import PACKAGE, WarmDrives, forget_extensions, installed_example
from robotrue.calibration.terms.term_registry import further_terms, term_of
from robotrue.errors import ArchiveError, ConfigurationError
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.program.posts import choose_post
from robotrue.robot.presets import preset, preset_names


def test_the_example_brings_a_term_a_robot_and_a_layout(tmp_path: Path) -> None:
    sheet = tmp_path / "export.csv"
    axes = ",".join(f"Axis {k}" for k in range(1, 7))
    sheet.write_text(f"{axes},Point X,Point Y,Point Z\n0,10,20,30,40,50,100,200,300\n")
    site = tmp_path / "site"
    site.mkdir()
    own = further_terms()
    with installed_example(site):
        assert further_terms() == (*own, WarmDrives)
        assert "Example E6" in preset_names()
        assert preset("example e6").dof == 6
        assert read_measurements(sheet).position.tolist() == [[0.1, 0.2, 0.3]]
    assert further_terms() == own
    assert WarmDrives not in own
    assert "Example E6" not in preset_names()
    with pytest.raises(ArchiveError, match="warm-drives"):
        term_of(WarmDrives.name)


def test_the_post_of_the_example_is_chosen_by_name_and_not_by_a_suffix_of_ours(
    tmp_path: Path,
) -> None:
    with installed_example(tmp_path):
        post = choose_post(Path("job.src"), name="krl_spindle")
        assert post.source.parent == PACKAGE / "src" / "robotrue_example" / "posts"
        assert "spindle_right" in post.blocks["moves"].events
        assert choose_post(Path("job.src")).stated.name == "krl"
    with pytest.raises(ConfigurationError, match="no post is called 'krl_spindle'"):
        choose_post(Path("job.src"), name="krl_spindle")


@pytest.mark.parametrize(
    ("group", "text", "why"),
    [
        ("robotrue.terms", "raise ValueError('broken')", "cannot be imported: broken"),
        ("robotrue.terms", "THING = 5", "is int, expected a type"),
        ("robotrue.terms", "THING = int", "is int, expected a subclass of Term"),
        ("robotrue.robots", "THING = 'folder'", "is str, expected a Path"),
        (
            "robotrue.robots",
            "from pathlib import Path\nTHING = Path('nowhere')",
            "is nowhere, expected a folder of TOML files",
        ),
    ],
)
def test_a_package_that_cannot_be_used_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, group: str, text: str, why: str
) -> None:
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    module = f"broken_{abs(hash((group, text)))}"
    (info / "entry_points.txt").write_text(f"[{group}]\nbroken = {module}:THING\n")
    (tmp_path / f"{module}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    forget_extensions()
    ask = further_terms if group == "robotrue.terms" else preset_names
    try:
        with pytest.raises(ConfigurationError, match=f"entry point .* of {group} {why}"):
            ask()
    finally:
        monkeypatch.undo()
        forget_extensions()
