"""Head of a certificate: number, dates, customer, robot, instrument, place.

Stated in a ``[report]`` table of a TOML file, or key by key; every key may be left out.
"""

from __future__ import annotations

import base64
import datetime
import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

from robotrue.core.document_decoder import decode
from robotrue.core.files import read_bytes, read_toml
from robotrue.errors import ConfigurationError
from robotrue.report.content import Fact
from robotrue.report.labels import fact
from robotrue.report.words import ReportTexts

TABLE: Final = "report"
EXAMPLE: Final = '[report]\nnumber = "K-2026-017"\ncustomer = "Shop 4"\nrobot_serial = "871234"'
LOGOS: Final = {".png": "image/png", ".svg": "image/svg+xml"}
_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class CertificateHead:
    """Head of a certificate; the names are the keys of the ``[report]`` table.

    Attributes:
        number: Of the certificate.
        issued: Date of issue.
        measured: First day of the measurement.
        measured_until: Its last day; the first one if not stated.
        laboratory: Calibration laboratory.
        laboratory_address: Street and town.
        country: Two letters of ISO 3166-1, of the laboratory.
        customer: Recipient of the certificate.
        customer_address: Street and town.
        robot_maker: Of the arm.
        robot_type: As on the name plate.
        robot_serial: Serial number of the arm.
        controller: Type of the controller.
        controller_serial: Its serial number.
        instrument_maker: Of the instrument that measured.
        instrument_type: As on the name plate.
        instrument_serial: Its serial number.
        instrument_certificate: Number of the instrument's certificate.
        instrument_due: Date its next calibration is due.
        place: Place of the measurement.
        temperature_degC: Of the air.
        temperature_span_degC: Largest deviation from it while measuring.
        load_kg: Payload while measuring.
        speed_mm_per_s: Of the tool point between poses.
        operator: Name of the operator.
        approved_by: Second signer after the operator.
        logo: PNG or SVG file for the first page.
    """

    number: str = ""
    issued: datetime.date | None = None
    measured: datetime.date | None = None
    measured_until: datetime.date | None = None
    laboratory: str = ""
    laboratory_address: str = ""
    country: str = ""
    customer: str = ""
    customer_address: str = ""
    robot_maker: str = ""
    robot_type: str = ""
    robot_serial: str = ""
    controller: str = ""
    controller_serial: str = ""
    instrument_maker: str = ""
    instrument_type: str = ""
    instrument_serial: str = ""
    instrument_certificate: str = ""
    instrument_due: datetime.date | None = None
    place: str = ""
    temperature_degC: float | None = None
    temperature_span_degC: float | None = None
    load_kg: float | None = None
    speed_mm_per_s: float | None = None
    operator: str = ""
    approved_by: str = ""
    logo: Path | None = None

    def __post_init__(self) -> None:
        """Checks dates, country and signs."""
        days = (self.measured, self.measured_until)
        if days[1] is not None and (days[0] is None or days[1] < days[0]):
            raise ConfigurationError(
                f"measured_until is {days[1]}, expected no earlier than measured, {days[0]}.",
                hint="state the first day as measured.",
            )
        if self.country and not (
            len(self.country) == 2 and self.country.isascii() and self.country.isupper()
        ):
            raise ConfigurationError(
                f"country is {self.country!r}, expected two capital letters of ISO 3166-1.",
                hint='country = "DE"',
            )
        for name in ("temperature_span_degC", "load_kg", "speed_mm_per_s"):
            value = getattr(self, name)
            if value is not None and not value >= 0.0:
                raise ConfigurationError(f"{name} is {value:g}, expected 0 or more.")


def read_certificate_head(path: Path | None, stated: Sequence[str]) -> CertificateHead:
    """Returns the head of a certificate.

    Args:
        path: TOML file with a ``[report]`` table, such as cell.toml; None without.
        stated: ``KEY=VALUE``, which win over the file.

    Raises:
        ConfigurationError: No such table or key, or a value that is not allowed.
        FormatError: The file is no TOML.
    """
    values: dict[str, object] = {}
    if path is not None:
        tables, _ = read_toml(path, example=EXAMPLE)
        table = tables.get(TABLE)
        if not isinstance(table, dict):
            raise ConfigurationError("no [report] table.", source=path, hint=EXAMPLE)
        values |= table
    for text in stated:
        key, sign, value = text.partition("=")
        if not sign:
            raise ConfigurationError(
                f"{text!r} states no value, expected KEY=VALUE.", hint="number=K-2026-017"
            )
        values[key.strip()] = value.strip()
    _check_keys(values, path)
    if path is not None and isinstance(values.get("logo"), str):
        values["logo"] = path.parent / str(values["logo"])
    return decode(
        CertificateHead, values, key=TABLE, error=ConfigurationError, source=path, hint=EXAMPLE
    )


def list_head_facts(head: CertificateHead, t: ReportTexts) -> tuple[Fact, ...]:
    """Returns the lines of the head that are stated, in reading order."""
    return tuple(fact(t, f"head.{key}", value) for key, value in _list_lines(head) if value)


def list_signers(head: CertificateHead, t: ReportTexts) -> tuple[Fact, ...]:
    """Returns the fields to sign: role and name; none for a head that states nothing."""
    if head == CertificateHead():
        return ()
    return (fact(t, "head.operator", head.operator), fact(t, "head.approved_by", head.approved_by))


def read_logo(head: CertificateHead) -> str:
    """Returns the logo as a ``data:`` address; empty without.

    Raises:
        ConfigurationError: Neither PNG nor SVG, or another format than its suffix.
        FormatError: The file cannot be read.
    """
    if head.logo is None:
        return ""
    kind, data = LOGOS.get(head.logo.suffix.lower()), read_bytes(head.logo)
    if kind is None or (kind == "image/png") != data.startswith(_SIGNATURE):
        raise ConfigurationError(
            "the logo is no PNG or SVG image.", source=head.logo, hint='logo = "logo.png"'
        )
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _check_keys(values: Mapping[str, object], path: Path | None) -> None:
    known = [field.name for field in fields(CertificateHead)]
    for key in values:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            raise ConfigurationError(
                f"the head of a certificate has no {key!r}, expected one of {', '.join(known)}.",
                source=path,
                hint=f"{near[0]} = ..." if near else EXAMPLE,
            )


def _list_lines(head: CertificateHead) -> Iterator[tuple[str, str]]:
    """Key of the label and text of each line."""
    until = head.measured_until
    yield "number", head.number
    yield "issued", str(head.issued or "")
    yield "measured", " – ".join(str(day) for day in (head.measured, until) if day is not None)
    yield "laboratory", _join(head.laboratory, head.laboratory_address, head.country)
    yield "customer", _join(head.customer, head.customer_address)
    yield "robot", _join(head.robot_maker, head.robot_type)
    yield "robot_serial", head.robot_serial
    yield "controller", _join(head.controller, head.controller_serial)
    yield "instrument", _join(head.instrument_maker, head.instrument_type)
    yield "instrument_serial", head.instrument_serial
    yield "instrument_certificate", head.instrument_certificate
    yield "instrument_due", str(head.instrument_due or "")
    yield "place", head.place
    yield "temperature", _describe_temperature(head)
    yield "load", "" if head.load_kg is None else f"{head.load_kg:g} kg"
    yield "speed", "" if head.speed_mm_per_s is None else f"{head.speed_mm_per_s:g} mm/s"


def _join(*parts: str) -> str:
    return ", ".join(part for part in parts if part)


def _describe_temperature(head: CertificateHead) -> str:
    if head.temperature_degC is None:
        return ""
    span = head.temperature_span_degC
    return f"{head.temperature_degC:g}{'' if span is None else f' ± {span:g}'} °C"
