"""``robotrue simulate drill`` beside ``drill fit`` and ``drill run``, each a process of its own."""

import json
import os
import re
import signal
import subprocess
import sys

import pytest

RUN = "from robotrue.cli.main import run; run()"


def started(*arguments):
    return subprocess.Popen(  # noqa: S603 - this interpreter
        [sys.executable, "-c", RUN, *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip


def test_a_whole_practice(cli, tmp_path):
    place = tmp_path / "practice"
    written = cli("simulate", "drill", "--write", str(place), "--seed", "4", "--json").document
    assert written["simulated"]
    foot, campaign, test = written["files"]
    model = str(tmp_path / "drill.robotrue")
    kind = ("--kind", "interactions")
    assert cli("drill", "fit", foot, campaign, "-o", model, *kind).code == 0
    judged = cli("drill", "evaluate", model, test, "--json").document
    assert judged["ours"]["p95_deg"] < 0.05 < judged["uncorrected"]["mean_deg"]

    journal = tmp_path / "holes.jsonl"
    desk = started("drill", "run", model, "--journal", journal, "--from", "udp://127.0.0.1:0",
                   "--quiet-ms", "60")  # fmt: skip
    try:
        found = re.search(r"udp://127\.0\.0\.1:\d+", desk.stderr.readline())
        head = started("simulate", "drill", "--seed", "4", "--holes", "3", "--pause-s", "0",
                       "--to", found[0], "--json")  # fmt: skip
        out, err = head.communicate(timeout=60)
        assert head.returncode == 0, err
    finally:
        desk.send_signal(signal.SIGTERM)
        desk.communicate(timeout=20)
    figures = json.loads(out)
    assert figures["simulated"] == "drilling head"
    assert (figures["moved"], figures["refused"], figures["without_answer"]) == (3, 0, 0)
    assert figures["tilt_left_max_deg"] < 0.05 < figures["tilt_before_mean_deg"]
    assert err.count("simulated hole") == 3
    lines = [json.loads(line) for line in journal.read_text().splitlines()]
    assert [line["kind"] for line in lines] == ["answer", "reference"] * 3
    assert all("simulated" in line["truth"] for line in lines if line["kind"] == "reference")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--to", "tcp://127.0.0.1:9"), "--to tcp://, expected udp://"),
        (("--holes", "0"), "0 holes"),
        (("--damaged", "1.5"), "1.5 of the datagrams damaged"),
        (("--write", "/nowhere/deeper/still"), "cannot make the folder"),
    ],
)
def test_refused(cli, arguments, message):
    found = cli("simulate", "drill", *arguments)
    assert found.code == 1
    assert message in found.err


def test_nobody_answers(cli):
    found = cli("simulate", "drill", "--to", "udp://127.0.0.1:9", "--holes", "5")
    assert found.code == 1
    assert "no answer from udp://127.0.0.1:9" in found.err
