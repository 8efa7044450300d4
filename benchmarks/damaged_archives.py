"""Damaged and forged model files of every kind: read as they were, or refused by one error.

    python benchmarks/damaged_archives.py [--mutants 20000] [--seed 0]

Damage: flipped bytes, pieces cut out or doubled, ends cut off, entries of the zip changed. Forgery:
contents changed and the hash made right. A traceback is any error but ``ArchiveError``. Of forged
arrays that no model has (NaN, infinity, numbers times 1e30, limits swapped, other shapes and
types) it also counts those that are accepted.
"""

from __future__ import annotations

import argparse
import io
import json
import struct
import sys
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robotrue.calibration.archive import open_model
from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.calibration.deng2022.committee import single
from robotrue.calibration.deng2022.joined import Expert, PoseModel
from robotrue.calibration.deng2022.readings import DengReadings
from robotrue.calibration.terms.backlash import Backlash
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.smooth import SmoothBasis, SmoothResidual
from robotrue.cell.cell import Cell
from robotrue.core.archive import Archive, _content_hash, archive_bytes, archive_from
from robotrue.core.regions import CylinderRegion
from robotrue.core.units import DEG, MM
from robotrue.drilling.foot_model import fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.model_archive import from_archive as drilling_from
from robotrue.drilling.model_archive import to_archive as drilling_archive
from robotrue.dynamics.deviation import DeviationModel, DeviationSettings, deviation_from_archive
from robotrue.dynamics.deviation_physics import CompliantArm, StaticCompliance
from robotrue.dynamics.flange_sensor import HeldTool, held_tool_from_archive
from robotrue.dynamics.modal import ModalModel, modal_model_from_archive
from robotrue.dynamics.paper_learners import SupportVectors, components_of
from robotrue.dynamics.paper_regression import PaperModel, paper_from_archive
from robotrue.dynamics.windows import WindowSet
from robotrue.errors import ArchiveError
from robotrue.robot.presets import preset
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign
from robotrue.store.model_file import pack_cell, unpack_cell

Contents = tuple[dict, dict[str, np.ndarray]]
UNKNOWN = {"p_pivot_tip", "measured", "static", "stiffness"}
"""Arrays in which NaN or infinity mean "not known" or "stiff"."""


def samples() -> dict[str, bytes]:
    """A small file of every kind of model the product writes."""
    random = np.random.default_rng(0)
    robot = preset("kuka-kr160")
    dof, size = robot.dof, len(robot.errors)
    root = 1e-4 * random.normal(size=(size, size))
    rigid = CalibratedModel(
        robot=robot, errors=1e-4 * random.normal(size=size), covariance=root @ root.T,
        repeatability=2e-5, white=1e-5, T_tracker_base={0: np.eye(4)}, summary={"method": "x"},
    )  # fmt: skip
    ripple = Ripple(dof=dof, cycles=np.array([1.0, 2.0]))
    basis = SmoothBasis(centres=random.normal(size=(4, 2 * dof)), scale=np.ones(2 * dof))
    smooth = SmoothResidual(basis=basis, amplitude=1e-5)
    learned = replace(
        rigid, terms=(ripple, Backlash(dof=dof), smooth),
        values=1e-5 * random.normal(size=ripple.size + dof + smooth.size),
        columns=np.arange(8.0), root=1e-5 * random.normal(size=(5, 8)), inflation=1.1,
    )  # fmt: skip
    inputs = random.uniform(-1.0, 1.0, (20, 6))
    region = CylinderRegion(angle=(-1.0, 1.0), radius=(0.5, 1.5), height=(0.0, 1.0))
    committee = single(inputs, 1e-4 * random.normal(size=(20, 3)), DengReadings())
    posed = PoseModel(
        robot=robot, experts=(Expert(region=region, committee=committee, white=1e-5),),
        reference=np.zeros(3), outside="nearest", summary={},
    )  # fmt: skip
    windows = WindowSet(
        passes=("p",) * 8 + ("q",) * 8, joints=np.tile([0.1, -1.5, 1.5, 0.2, 0.5, 0.1], (16, 1))
        + random.normal(0.0, 0.02, (16, 6)), force=random.normal(0.0, 100.0, (16, 3)),
        force_peak=np.full(16, 200.0), force_mean=np.full(16, 50.0), source="x",
        predicted=1e-4 * random.normal(size=16), measured=1e-4 * random.normal(size=16),
    )  # fmt: skip
    bent = DeviationModel(
        arm=CompliantArm(
            robot=robot, stiffness=np.full(dof, 1e6), direction=np.array([0.0, 1.0, 0.0])
        ),
        settings=DeviationSettings(), windows=windows,
        theta=np.log([1e-5, 0.3, 1e-5, 0.1, 1e-5, 0.5]),
        row=StaticCompliance(value=np.full(3, 1e-7), sd=np.full(3, 1e-8)),
    )  # fmt: skip
    components = components_of(np.column_stack([windows.joints, random.normal(size=(16, 2))]))
    paper = PaperModel(
        arm=bent.arm, windows=windows, held_out=1e-6,
        components=components,
        machine=SupportVectors(
            vectors=random.normal(size=(5, components.count)),
            weights=random.normal(size=5), intercept=0.1,
            penalty=10.0, gamma=0.1, tube=0.2,
        ),
    )  # fmt: skip
    vector = np.array([0.1, 0.2, 0.3])
    tool = HeldTool(
        mass=12.0, centre=vector, weight_in_base=117.0 * vector, force_offset=vector,
        moment_offset=vector, mass_sd=0.01, centre_sd=vector, force_offset_sd=vector,
        condition=2.2, force_noise=0.1, moment_noise=0.01,
    )  # fmt: skip
    modal = ModalModel(
        poles=np.array([-5.0 + 100.0j, -9.0 + 300.0j]),
        residues=1e-6 * random.normal(size=(2, 1, 1)) * (1.0 + 1.0j),
        upper=np.full((1, 1), 1e-8), lower=np.full((1, 1), 1e-3), static=np.full((1, 1), 1e-6),
        response_axes=("y",), excitation_axes=("y",), valid=(5.0, 200.0), source="x",
    )  # fmt: skip
    cell = {"cell": pack_cell(Cell(robot=robot, source="x.toml", digest="0" * 64))}
    out = {}
    for name, model in (("rigid", rigid), ("learned", learned), ("deng", posed)):
        whole = model.to_archive()
        document = {**whole.document, **cell}
        out[name] = Archive(
            kind=whole.kind, schema=whole.schema, document=document, arrays=whole.arrays
        )
    out |= {"deviation": bent.to_archive(), "paper": paper.to_archive()}
    out |= {"tool": tool.to_archive(source="x")}
    out["modal"] = modal.to_archive()
    machine, head = drilling_machine(1), Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
    campaign = random_campaign(machine, 20, random, largest=3.0 * DEG)
    for kind in ("interactions", "physics"):
        out[f"drill {kind}"] = drilling_archive(
            fit_model(machine.foot, head, campaign, kind=kind)[0]
        )
    return {name: archive_bytes(archive) for name, archive in out.items()}


READERS: dict[str, Callable[[Archive], object]] = {
    "drilling-normal": drilling_from,
    "held-tool": held_tool_from_archive,
    "modal-model": modal_model_from_archive,
    "dynamic-deviation": deviation_from_archive,
    "jin2022-deviation": paper_from_archive,
}


def read(name: str, data: bytes) -> object:
    """The model in a file, as the command that takes this kind reads it."""
    archive = archive_from(data)
    if name in ("rigid", "learned", "deng"):
        model = open_model(archive)
        return unpack_cell(archive.document.get("cell", {}), model.robot)
    kind = {"tool": "held-tool", "modal": "modal-model", "deviation": "dynamic-deviation"}
    kind["paper"] = "jin2022-deviation"
    return READERS[kind.get(name, "drilling-normal")](archive)


def damaged(data: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """Damage to the bytes of a file."""
    at, kind = int(random.integers(len(data))), int(random.integers(5))
    if kind == 0:
        flipped = bytearray(data)
        for place in random.integers(len(data), size=int(random.integers(1, 5))):
            flipped[int(place)] ^= 1 << int(random.integers(8))
        return "flipped", bytes(flipped)
    if kind == 1:
        return "cut off", data[:at]
    length = int(random.integers(1, 64))
    if kind == 2:
        return "cut out", data[:at] + data[at + length :]
    if kind == 3:
        return "doubled", data[:at] + data[at : at + length] + data[at:]
    signature = (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06")[int(random.integers(3))]
    place = data.find(signature, at)
    place = data.rfind(signature) if place < 0 else place
    place += 4 + int(random.integers(26))
    value = (0, 1, 99, 255, 0x7FFFFFFF, 0xFFFFFFFF)[int(random.integers(6))]
    return "zip field", data[:place] + struct.pack("<I", value) + data[place + 4 :]


def contents(data: bytes) -> Contents:
    """Head and arrays of a whole file."""
    with zipfile.ZipFile(io.BytesIO(data)) as bundle:
        head = json.loads(bundle.read("document.json"))
        arrays = {
            name[7:-4]: np.load(io.BytesIO(bundle.read(name)))
            for name in bundle.namelist()
            if name.startswith("arrays/")
        }
    return head, arrays


def packed(head: dict, arrays: dict[str, np.ndarray], **raw: bytes) -> bytes:
    """A file with its hash made right; ``raw`` are entries put in as they are."""
    head = {key: value for key, value in head.items() if key != "content_sha256"}
    try:
        head["content_sha256"] = _content_hash(head, arrays)
        text = json.dumps(head)
    except ValueError:  # NaN in the document
        text = json.dumps(head)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as bundle:
        bundle.writestr("document.json", raw.pop("document", text.encode()))
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, array, version=(1, 0), allow_pickle=False)
            bundle.writestr(f"arrays/{name}.npy", raw.pop(name, buffer.getvalue()))
    return stream.getvalue()


def forged(data: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """Contents no model has; kinds that begin with ``array`` must not be accepted."""
    head, arrays = contents(data)
    name = sorted(arrays)[int(random.integers(len(arrays)))]
    array = arrays[name]
    kind = int(random.integers(11))
    if kind <= 2 and array.size:
        value = array.ravel().copy()
        k = int(random.integers(array.size))
        if kind == 2:
            value *= 1e30
        else:
            value[k] = (np.nan, np.inf)[kind]
        what = ("array NaN", "array infinite", "array x 1e30")[kind]
        changed = value.reshape(array.shape)
        if np.array_equal(changed, array, equal_nan=True) or name in UNKNOWN:
            what = "no harm"
        return what, packed(head, arrays | {name: changed})
    if kind == 3 and (pairs := [n for n in arrays if n.endswith(("limits", "force", "height"))]):
        name = pairs[int(random.integers(len(pairs)))]
        array = arrays[name]
        if array.shape[-1] != 2:
            return "no harm", data
        return "array limits swapped", packed(head, arrays | {name: array[..., ::-1].copy()})
    if kind == 4:
        shape = [array[None], array[..., None], np.zeros(array.size + 1), array.ravel()[:0]]
        changed = shape[int(random.integers(4))]
        if changed.shape == array.shape:
            return "no harm", data
        return "array shape", packed(head, arrays | {name: changed})
    if kind == 5:
        dtype = (np.complex128, np.int64, np.float32, np.bool_, "S8", ">f8")[
            int(random.integers(6))
        ]
        return "array type", packed(head, arrays | {name: array.astype(dtype)})
    if kind == 6:
        shape = ("(10000000000000,)", "(-1,)", "(1" + "0" * 40 + ",)", "(0, 99999999999999)", "()",
                 "((1,),)", "(True,)", "(" * 90)[int(random.integers(8))]  # fmt: skip
        text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
        raw = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + array.tobytes()
        return "array header", packed(head, arrays, **{name: raw})
    if kind == 7:
        return "missing array", packed(head, {n: v for n, v in arrays.items() if n != name})
    if kind == 8:
        deep = b"[" * int(10 ** random.uniform(2, 6))
        text = json.dumps(head).encode()
        texts = (deep, b"{" + b'"a":{' * 5000, text.replace(b"1", deep[:3000] + b"1", 1),
                 text.replace(b": 1", b": NaN", 1), text.replace(b": 0.", b": 1e999", 1),
                 text.replace(b"1", b"1" * 5000, 1), b"\xff\xfe", b"null")  # fmt: skip
        return "document text", packed(head, arrays, document=texts[int(random.integers(8))])
    tree: object = head["document"] if random.random() < 0.8 else head
    while True:
        keys = list(tree) if isinstance(tree, dict) else list(range(len(tree)))  # type: ignore[arg-type, call-overload]
        if not keys:
            return "no harm", data
        key = keys[int(random.integers(len(keys)))]
        below = tree[key]  # type: ignore[index]
        if not isinstance(below, dict | list) or random.random() < 0.4:
            break
        tree = below
    if kind == 9:
        del tree[key]  # type: ignore[attr-defined]
        return "document key missing", packed(head, arrays)
    values = (None, "x", "", -1, 0, 1e30, -1e30, 10**400, [], {}, [[]], True, [1, "a"])
    tree[key] = values[int(random.integers(len(values)))]  # type: ignore[index]
    return "document value", packed(head, arrays)


def tried(mutants: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Counts by kind and outcome, and the tracebacks."""
    files = samples()
    for name, data in files.items():
        read(name, data)
    count: Counter[str] = Counter()
    faults = []
    for k in range(mutants):
        random = np.random.default_rng([seed, k])
        name = sorted(files)[k % len(files)]
        what, data = (damaged, forged)[k // len(files) % 2](files[name], random)
        try:
            read(name, data)
            outcome = "accepted"
        except ArchiveError:
            outcome = "refused"
        except Exception:
            outcome = "TRACEBACK"
            faults.append(f"mutant {k} of {name}, {what}: {traceback.format_exc(limit=-2)}")
        count[f"{what}: {outcome}"] += 1
        if outcome == "accepted" and what.startswith("array"):
            faults.append(f"mutant {k} of {name}, {what}: accepted")
    return count, faults


def main() -> int:
    """Prints the counts; 1 where a file ended in a traceback or a forged array was accepted."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--mutants", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    count, faults = tried(asked.mutants, asked.seed)
    for line, number in sorted(count.items()):
        print(f"{number:7d}  {line}")
    ended = sum(n for line, n in count.items() if line.endswith("TRACEBACK"))
    print(f"{ended} of {asked.mutants} ended in a traceback; {len(faults) - ended} forged accepted")
    for fault in faults[:20]:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
