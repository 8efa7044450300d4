"""Calibrate and compensate a program through the HTTP interface of the workbench.

    python examples/http_client.py http://127.0.0.1:8080 cell.toml calibration.csv part.src

Requires only Python. BENCH_TOKEN holds the token of ``robotrue serve --token-env``.
"""

from __future__ import annotations

import json
import os
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any


class Bench:
    """Client of a workbench."""

    def __init__(self, address: str, token: str = "") -> None:
        self.address = address.rstrip("/")
        self.headers = {"Authorization": f"Bearer {token}"} if token else {}

    def ask(self, method: str, path: str, body: bytes | None = None, kind: str = "") -> bytes:
        """Returns the body of the answer; an error ends the program with its message."""
        headers = self.headers | ({"Content-Type": kind} if kind else {})
        request = urllib.request.Request(  # noqa: S310
            self.address + path, data=body, method=method, headers=headers
        )
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:  # noqa: S310
                return bytes(answer.read())
        except urllib.error.HTTPError as refused:
            problem = json.loads(refused.read())
            raise SystemExit(f"{problem['title']}: {problem.get('detail', '')}") from None

    def post(self, path: str, **document: Any) -> dict[str, Any]:
        """Returns the JSON answer to a JSON request."""
        body = json.dumps(document).encode()
        return dict(json.loads(self.ask("POST", path, body, "application/json")))

    def send(self, path: Path) -> str:
        """Uploads a file and returns its id."""
        where = f"/api/files?name={urllib.parse.quote(path.name)}"
        answer = self.ask("POST", where, path.read_bytes(), "application/octet-stream")
        return str(json.loads(answer)["id"])

    def done(self, kind: str, **parameters: Any) -> dict[str, Any]:
        """Queues a job, waits for its end and returns its result."""
        job = self.post("/api/jobs", kind=kind, parameters=parameters)
        while not job["over"]:
            time.sleep(0.5)
            job = json.loads(self.ask("GET", f"/api/jobs/{job['id']}"))
        if job["state"] != "done":
            raise SystemExit(f"{kind}: {job['error']['message']}")
        return dict(job["result"])


def main(address: str, *files: str) -> None:
    cell_file, measured_file, program_file = map(Path, files)
    bench = Bench(address, os.environ.get("BENCH_TOKEN", ""))
    cell = bench.post("/api/cells", uploads=[bench.send(cell_file)])
    measured = bench.post("/api/measurements", uploads=[bench.send(measured_file)], cell=cell["id"])
    print(f"{measured['poses']} poses in {cell['name']}")
    model = bench.done("calibrate", cell=cell["id"], measurements=[measured["id"]])["model"]
    program = bench.post("/api/programs", uploads=[bench.send(program_file)])
    made = bench.done("compensate", program=program["id"], model=model["id"])
    print(f"{made['compensated']} of {made['targets']} targets compensated")
    after = json.loads(bench.ask("GET", f"/api/items/program/{made['program']['id']}"))
    for each in after["attachments"]:
        if each["role"] == "program":
            Path(f"compensated_{each['name']}").write_bytes(bench.ask("GET", each["href"]))
            print(f"compensated_{each['name']} written")


if __name__ == "__main__":
    main(*sys.argv[1:])
