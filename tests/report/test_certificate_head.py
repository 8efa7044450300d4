"""The head of a certificate: what is stated stands on the first page, a mistake is named."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import replace

import pytest
from certificate_fakes import make_facts

from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.report.certificate import Parameter, certificate_content
from robotrue.report.certificate_head import CertificateHead, read_certificate_head
from robotrue.report.json import report_json
from robotrue.report.page import report_html
from robotrue.report.pdf import report_pdf


def png_chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


PNG = (
    b"\x89PNG\r\n\x1a\n"
    + png_chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0))
    + png_chunk(b"IDAT", zlib.compress(b"\0\xff\0\0"))
    + png_chunk(b"IEND", b"")
)
TEXT = """
[report]
number = "K-17"
issued = 2026-11-24
measured = 2026-11-20
customer = "Shop 4"
robot_serial = "871234"
temperature_degC = 21.5
temperature_span_degC = 0.8
logo = "logo.png"
operator = "N. N."
"""


@pytest.fixture
def stated(tmp_path):
    (tmp_path / "logo.png").write_bytes(PNG)
    (tmp_path / "report.toml").write_text(TEXT)
    return tmp_path / "report.toml"


def test_what_is_stated_stands_at_the_top_of_page_and_print(stated):
    head = read_certificate_head(stated, ["customer=Shop 5", "load_kg=12.5"])
    content = certificate_content(replace(make_facts(), head=head), tolerance=2e-4)
    lines = {line.key: line.value for line in content.head}
    assert lines["certificate"] == "K-17"
    assert lines["customer"] == "Shop 5"
    assert lines["payload"] == "12.5 kg"
    assert lines["temperature"] == "21.5 ± 0.8 °C"
    assert lines["decision rule"].startswith("Conforms where 95 %")
    page = report_html(content)
    assert page.index("K-17") < page.index("<section>")
    assert 'src="data:image/png;base64,' in page
    assert "measured by: N. N." in page
    assert json.loads(report_json(content))["head"]["customer"] == "Shop 5"
    assert report_pdf(content).startswith(b"%PDF")


def test_without_a_tolerance_the_certificate_states_no_conformity():
    rule = certificate_content(make_facts()).head[-1]
    assert rule.value.startswith("No tolerance agreed")
    assert certificate_content(make_facts()).signers == ()


def test_a_customer_reads_words_and_no_row_of_a_prior():
    rows = [
        Parameter(name="theta3", value=0.1, sd=0.01, unit="deg", known="seen"),
        Parameter(name="tool_rz", value=0.0, sd=1.0, unit="deg", known="prior only"),
        Parameter(name="base_x", value=0.2, sd=0.1, unit="mm", known="weakly seen"),
    ]
    content = certificate_content(replace(make_facts(), parameters=tuple(rows)))
    section = next(s for s in content.sections if s.title == "Identified parameters")
    table = section.blocks[0]
    assert [row[0] for row in table.rows] == ["zero, axis 3", "base, x"]
    assert table.caption.endswith("1 parameter that the data do not determine is left out.")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("custmer=Shop", "no 'custmer'"),
        ("number", "states no value"),
        ("issued=soon", "issued is 'soon'"),
        ("country=Germany", "two capital letters"),
        ("load_kg=-1", "load_kg is -1"),
        ("measured_until=2026-01-01", "expected no earlier"),
        ("logo=nowhere.gif", "cannot read"),
    ],
)
def test_a_mistake_is_named(line, message):
    def certify():
        head = read_certificate_head(None, [line])
        return certificate_content(replace(make_facts(), head=head))

    with pytest.raises(RobotrueError, match=message):
        certify()


def test_a_file_without_the_table_is_refused(tmp_path):
    (tmp_path / "a.toml").write_text("[robot]\n")
    with pytest.raises(ConfigurationError, match=r"no \[report\] table"):
        read_certificate_head(tmp_path / "a.toml", [])


def test_an_empty_head_is_the_default():
    assert read_certificate_head(None, []) == CertificateHead()


def test_a_damaged_logo_is_named_in_the_pdf(stated):
    (stated.parent / "logo.png").write_bytes(PNG[:-20])
    head = read_certificate_head(stated, [])
    with pytest.raises(ConfigurationError, match=r"the PDF cannot be laid out: .*image"):
        report_pdf(certificate_content(replace(make_facts(), head=head)))
