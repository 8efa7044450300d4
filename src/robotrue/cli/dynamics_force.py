"""``robotrue dynamics force``: the force of milling, and its coefficients from slots."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Final

import numpy as np

from robotrue.app.outputs import CSV, CUTTING, check_output
from robotrue.cli.console import emit_facts, emit_json, emit_table, say, say_mark
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance, mark_line, read_provenance
from robotrue.core.toml_text import read_toml
from robotrue.core.units import MM
from robotrue.dynamics.coefficients import (
    CuttingTest,
    IdentifiedCoefficients,
    check_axes_agree,
    identify_coefficients,
)
from robotrue.dynamics.cutter import Cutter, CutterEngagement, CuttingCoefficients
from robotrue.dynamics.cutting_data import coefficient_keys, cutting_data
from robotrue.dynamics.force import ForceRecord
from robotrue.dynamics.formats.column_table import read_column_table, table_bytes
from robotrue.dynamics.formats.force_csv import write_force_csv
from robotrue.dynamics.formats.registry import read_force
from robotrue.dynamics.milling_force import CALCULATED, force_over_time, mean_force
from robotrue.dynamics.path_force import MillingAlongPath
from robotrue.dynamics.spectrum import spindle_lines
from robotrue.errors import ConfigurationError, FormatError

_EXAMPLE: Final = "docs/howto/predict-the-dynamic-error.md"
_SLOTS: Final = ("feed_per_tooth_mm", "fx_mean_N", "fy_mean_N", "fz_mean_N")
_ALONG: Final = ("path_mm", "depth_mm", "width_mm")
_SHOWN: Final = 8


def run(
    cut_path: Path,
    output: Path | None,
    *,
    slots: Path | None,
    along: Path | None,
    measured: Path | None,
    rate: float,
    duration: float,
    as_json: bool,
) -> None:
    """Predicts or identifies; writes what was asked for."""
    given = [path for path in (slots, along, measured) if path is not None]
    if len(given) > 1:
        raise ConfigurationError(
            "--slots, --along and --measured are different jobs; one at a time."
        )
    if output is not None:
        check_output(output, [cut_path, *given])
        (CSV if slots is None else CUTTING)(output)
    stated, _ = read_toml(cut_path, example=_EXAMPLE)
    cutter, cut, coefficients = cutting_data(stated, where=str(cut_path), slots=slots is not None)
    if slots is not None:
        document = _identify(slots, cutter, cut, stated, output)
    elif along is not None:
        document = _along(along, cutter, cut, coefficients, output)
    else:
        document = _predict(cutter, cut, coefficients, rate, duration, output, measured)
    origin = CALCULATED if slots is None else read_provenance(slots)
    say_mark(origin)
    if as_json:
        emit_json(document, origin)
    else:
        _show(document, origin)


def _predict(
    cutter: Cutter,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    rate: float,
    duration: float,
    output: Path | None,
    measured: Path | None,
) -> dict[str, Any]:
    record = force_over_time(cutter, cut, coefficients, rate=rate, duration=duration)
    mean = mean_force(cutter, cut, coefficients)
    found = {
        "mean_N": mean,
        "min_N": record.force.min(axis=0),
        "max_N": record.force.max(axis=0),
        "tooth_passing_Hz": cut.spindle * cutter.teeth,
        **_lines(record, cut, cutter),
    }
    if measured is not None:
        real, odd = read_force(measured)
        check_axes_agree(real.force.mean(axis=0), mean, str(measured))
        for remark in odd:
            say(f"note: {remark}")
        found["measured"] = {
            "mean_N": real.force.mean(axis=0),
            "min_N": real.force.min(axis=0),
            "max_N": real.force.max(axis=0),
            **_lines(real, cut, cutter),
        }
    if output is not None:
        write_force_csv(output, record)
        say(f"{len(record)} samples written to {output}")
    return found


def _lines(record: ForceRecord, cut: CutterEngagement, cutter: Cutter) -> dict[str, Any]:
    lines = spindle_lines(record, spindle=cut.spindle, teeth=cutter.teeth)
    return {
        "tooth_share": lines.tooth_share,
        "runout_share": lines.runout_share,
        "lines": [
            {"Hz": float(f), "tooth": bool(t), "amplitude_N": np.abs(a)}
            for f, t, a in zip(
                lines.frequency[:_SHOWN], lines.is_tooth, lines.amplitude, strict=False
            )
        ],
    }


def _identify(
    slots: Path, cutter: Cutter, cut: CutterEngagement, stated: dict[str, Any], output: Path | None
) -> dict[str, Any]:
    table = read_column_table(slots)
    columns = _columns(table.names, _SLOTS, ("depth_mm", "width_mm"), slots, table.header_line)
    values = {name: table.column(name) for name in columns}
    tests = []
    for k in range(len(table.values)):
        one = CutterEngagement(
            mode=cut.mode,
            depth=values["depth_mm"][k] * MM if "depth_mm" in values else cut.depth,
            width=values["width_mm"][k] * MM if "width_mm" in values else cut.width,
            feed_per_tooth=values["feed_per_tooth_mm"][k] * MM,
            spindle=cut.spindle,
        )
        tests.append(CuttingTest(cut=one, force=np.array([values[n][k] for n in _SLOTS[1:]])))
    found = identify_coefficients(cutter, tests)
    keys = coefficient_keys(found.coefficients)
    if output is not None:
        text = "".join(
            f"{key} = {_toml(value)}\n"
            for key, value in ({"feed_per_tooth_mm": tests[-1].cut.feed_per_tooth / MM} | stated
                               | {k: round(v, 6) for k, v in keys.items()}).items()
        )  # fmt: skip
        tomllib.loads(text)
        write_atomic(output, text.encode())
        say(f"cutting data written to {output}")
    return {
        "tests": len(tests),
        "coefficients": keys,
        "deviations": _deviations(found),
        "noise_N": found.noise,
        "residual_N": found.residual,
    }


def _deviations(found: IdentifiedCoefficients) -> dict[str, float]:
    sizes = found.deviation.copy()
    sizes[0] = max(sizes[0], 1e-300)
    t, r, a, te, re, ae = sizes.tolist()
    return coefficient_keys(
        CuttingCoefficients(
            tangential=t, radial=r, axial=a, tangential_edge=te, radial_edge=re, axial_edge=ae
        )
    )


def _along(
    along: Path,
    cutter: Cutter,
    cut: CutterEngagement,
    coefficients: CuttingCoefficients,
    output: Path | None,
) -> dict[str, Any]:
    table = read_column_table(along)
    _columns(table.names, _ALONG, (), along, table.header_line)
    lengths, depth, width = (table.column(name) * MM for name in _ALONG)
    model = MillingAlongPath(
        cutter=cutter, coefficients=coefficients, cut=cut, along=lengths, depth=depth, width=width
    )
    force = model.at(lengths)
    if output is not None:
        rows = np.column_stack([lengths / MM, force])
        text = table_bytes(["path_mm", "fx_N", "fy_N", "fz_N"], rows)
        write_atomic(output, mark_line(CALCULATED).encode() + text)
        say(f'{len(rows)} rows written to {output}: axes = "path" in `compensate --force`')
    size = np.linalg.norm(force, axis=1)
    return {
        "rows": len(force),
        "path_mm": lengths,
        "force_N": force,
        "largest_N": float(size.max()),
        "mean_N": force.mean(axis=0),
    }


def _columns(
    names: tuple[str, ...], needed: tuple[str, ...], allowed: tuple[str, ...], path: Path, line: int
) -> tuple[str, ...]:
    for name in needed:
        if name not in names:
            raise FormatError(
                f"no column {name}; expected {','.join(needed)}.", source=path, line=line
            )
    for name in names:
        if name not in needed and name not in allowed:
            raise FormatError(
                f"column {name!r} is not known; expected {', '.join((*needed, *allowed))}.",
                source=path,
                line=line,
                hint="remove the column.",
            )
    return names


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(value) if isinstance(value, int) else repr(float(value))


def _show(d: dict[str, Any], origin: Provenance) -> None:
    def three(values: Array) -> str:
        return "  ".join(f"{v:8.2f}" for v in values)

    if "coefficients" in d:
        emit_table(
            f"cutting coefficients of {d['tests']} tests, mean forces {d['noise_N']:.2g} N off",
            ("", "value", "+- (1 sigma)"),
            [(k, f"{v:.4g}", f"{d['deviations'][k]:.2g}") for k, v in d["coefficients"].items()],
            provenance=origin,
        )
        return
    if "rows" in d:
        emit_facts(
            "mean force along the path",
            [("rows", str(d["rows"])), ("largest", f"{d['largest_N']:.1f} N")],
            origin,
        )
        return
    sides = (("milling model", d, origin), ("measured", d.get("measured"), None))
    for title, one, of_it in sides:
        if one is None:
            continue
        emit_facts(
            f"force on the tool, {title}: along the feed, to its left, along the tool (N)",
            [
                ("mean", three(one["mean_N"])),
                ("least", three(one["min_N"])),
                ("largest", three(one["max_N"])),
                ("mean square on tooth lines", f"{100.0 * one['tooth_share']:.1f} %"),
                ("on other spindle lines", f"{100.0 * one['runout_share']:.1f} %"),
                *(
                    (f"{line['Hz']:g} Hz{' (teeth)' if line['tooth'] else ''}",
                     three(line["amplitude_N"]))
                    for line in one["lines"]
                ),
            ],
            of_it,
        )  # fmt: skip
