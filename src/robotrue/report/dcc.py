"""The certificate as a Digital Calibration Certificate of the PTB, schema 3.3.0 (https://ptb.de/dcc).

Numbers are in the units of the Digital SI (https://ptb.de/si): millimetres and degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.provenance import simulation_mark
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.report.certificate import CertificateFacts
from robotrue.report.words import Lang, ReportTexts
from robotrue.validation.report import ValidationReport
from robotrue.version import __version__

SCHEMA: Final = "3.3.0"
DCC: Final = "https://ptb.de/dcc"
SI: Final = "https://ptb.de/si"
XSI: Final = "http://www.w3.org/2001/XMLSchema-instance"
REQUIRED: Final = (
    "number", "measured", "laboratory", "laboratory_address", "country", "customer",
    "customer_address", "robot_type", "robot_serial", "operator",
)  # fmt: skip
"""Keys of the head without which the schema has no valid certificate."""
COVERAGE: Final = (2.0, 0.95)
_MM: Final = r"\milli\metre"
_ONE: Final = r"\one"


def dcc_xml(
    facts: CertificateFacts, *, tolerance: float | None = None, lang: Lang = DEFAULT_LANG
) -> bytes:
    """Returns the certificate as XML; equal facts give equal bytes.

    Args:
        facts: With a check and the keys :data:`REQUIRED` of the head.
        tolerance: m; states whether 95 % of the held-out poses keep it.
        lang: Language of the names.

    Raises:
        ConfigurationError: The head lacks a required key, or nothing was checked.
    """
    if facts.check is None:
        raise ConfigurationError(
            "a Digital Calibration Certificate states measured results, and no check was made.",
            hint="add a file of measured poses after the model.",
        )
    missing = [key for key in REQUIRED if not getattr(facts.head, key)]
    if missing:
        raise ConfigurationError(
            f"a Digital Calibration Certificate needs {', '.join(missing)} in its head.",
            hint=f'{missing[0]} = "..." in [report], or --detail {missing[0]}=...',
        )
    for prefix, address in (("dcc", DCC), ("si", SI), ("xsi", XSI)):
        ET.register_namespace(prefix, address)
    writer = _Writer(facts, ReportTexts(lang=lang))
    root = _dcc(
        "digitalCalibrationCertificate",
        _dcc("administrativeData", *writer.administrative_data(facts.check, tolerance)),
        _dcc("measurementResults", writer.measurement_results(facts.check)),
    )
    root.set("schemaVersion", SCHEMA)
    root.set(f"{{{XSI}}}schemaLocation", f"{DCC} {DCC}/v{SCHEMA}/dcc.xsd")
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


@dataclass(frozen=True, slots=True)
class _Writer:
    """Writes the parts of a certificate in the order of the schema.

    Attributes:
        facts: What the certificate is made of.
        t: Words.
    """

    facts: CertificateFacts
    t: ReportTexts

    def administrative_data(
        self, check: ValidationReport, tolerance: float | None
    ) -> Iterator[ET.Element]:
        head = self.facts.head
        yield _dcc("dccSoftware", self._software())
        yield _dcc("coreData", *self._core_data())
        item = _dcc(
            "item",
            self._name("name", self.facts.robot),
            *self._manufacturer(head.robot_maker),
            _text("model", head.robot_type),
            _dcc("identifications", *self._identifications("robot_serial", "controller_serial")),
        )
        yield _dcc("items", item)
        laboratory = self._contact(
            "contact", head.laboratory, head.laboratory_address, head.country
        )
        yield _dcc("calibrationLaboratory", laboratory)
        yield _dcc("respPersons", *self._persons())
        yield self._contact("customer", head.customer, head.customer_address)
        yield _dcc("statements", *self._statements(check, tolerance))

    def measurement_results(self, check: ValidationReport) -> ET.Element:
        """The result with its method, software, instrument and conditions, which PTB requires."""
        description = self._contents(self.t("cert.subtitle", method=self.facts.method))
        return _dcc(
            "measurementResult",
            self._name("name", self.t("cal.section")),
            _dcc("description", *description),
            _dcc("usedMethods", _dcc("usedMethod", self._name("name", self.facts.method))),
            _dcc("usedSoftware", self._software()),
            *self._instruments(),
            _dcc("influenceConditions", *self._conditions()),
            _dcc("results", self._summary(check), self._poses(check)),
        )

    def _software(self) -> ET.Element:
        return _dcc("software", self._name("name", "robotrue"), _text("release", f"v{__version__}"))

    def _instruments(self) -> Iterator[ET.Element]:
        head = self.facts.head
        if head.instrument_type or head.instrument_serial:
            numbers = list(self._identifications("instrument_serial", "instrument_certificate"))
            instrument = _dcc(
                "measuringEquipment",
                self._name("name", head.instrument_type or self.t("head.instrument")),
                *self._manufacturer(head.instrument_maker),
                *([_dcc("identifications", *numbers)] if numbers else []),
            )
            yield _dcc("measuringEquipments", instrument)

    def _core_data(self) -> Iterator[ET.Element]:
        head, lang = self.facts.head, self.t.lang
        yield _text("countryCodeISO3166_1", head.country)
        yield _text("usedLangCodeISO639_1", lang)
        yield _text("mandatoryLangCodeISO639_1", lang)
        yield _text("uniqueIdentifier", head.number)
        yield _text("beginPerformanceDate", str(head.measured))
        yield _text("endPerformanceDate", str(head.measured_until or head.measured))
        yield _text("performanceLocation", "other" if head.place else "laboratory")
        if head.issued is not None:
            yield _text("issueDate", str(head.issued))

    def _statements(self, check: ValidationReport, tolerance: float | None) -> Iterator[ET.Element]:
        mark = simulation_mark(self.facts.simulated, self.t("page.simulated"))
        places = [self.facts.head.place] if self.facts.head.place else []
        for text in (mark, *places, self.t("cert.no_accreditation")):
            if text:
                yield _dcc("statement", _dcc("declaration", *self._contents(text)))
        if tolerance is None:
            rule = self.t("cert.no_rule")
            yield _dcc("statement", _dcc("declaration", *self._contents(rule)))
        else:
            rule = self.t("cert.rule", tolerance=tolerance / MM)
            kept = check.after.p95 <= tolerance
            yield _dcc(
                "statement",
                _dcc("declaration", *self._contents(rule)),
                _text("conformity", "pass" if kept else "fail"),
            )

    def _conditions(self) -> Iterator[ET.Element]:
        head = self.facts.head
        stated = {
            key: _dcc("quantity", _real(value, unit))
            for key, value, unit in (
                ("temperature", head.temperature_degC, r"\degreecelsius"),
                ("temperature_span", head.temperature_span_degC, r"\kelvin"),
                ("load", head.load_kg, r"\kilogram"),
                ("speed", head.speed_mm_per_s, r"\milli\metre\second\tothe{-1}"),
            )
            if value is not None
        }
        unknown = {"temperature": _dcc("text", *self._contents(self.t("head.not_stated")))}
        for key, value in (stated or unknown).items():
            name = self._name("name", self.t(f"head.{key}"))
            yield _dcc("influenceCondition", name, _dcc("data", value))

    def _summary(self, check: ValidationReport) -> ET.Element:
        before, after = check.before_aligned or check.before, check.after
        quantities = [
            self._quantity(f"{self.t(key)}, {self.t(when)}", size / MM, _MM)
            for when, errors in (("before", before), ("after", after))
            for key, size in (
                ("cal.mean_error", errors.mean),
                ("cal.p95", errors.p95),
                ("cal.largest", errors.max),
            )
        ]
        quantities.append(self._quantity(self.t("cert.U"), self.facts.budget.expanded / MM, _MM))
        quantities.append(self._quantity(self.t("cal.hold"), check.coverage.share, _ONE))
        name = self._name("name", self.t("cal.table"))
        return _dcc("result", name, _dcc("data", *quantities))

    def _poses(self, check: ValidationReport) -> ET.Element:
        """Measured position and error after compensation, with its expanded uncertainty."""
        expanded = COVERAGE[0] * np.sqrt(np.einsum("nii->ni", check.covariance))
        quantities = []
        for k, axis in enumerate("xyz"):
            at = _real_list(check.position[:, k] / MM, _MM)
            name = self._name("name", f"{self.t('cal.section')}: {axis}")
            quantities.append(_dcc("quantity", name, at, refType="basic_referenceValue"))
        for k, axis in enumerate("xyz"):
            error = _real_list(check.errors_after[:, k] / MM, _MM, expanded[:, k] / MM)
            name = self._name("name", f"{self.t('after')}: {axis}")
            quantities.append(_dcc("quantity", name, error, refType="basic_measurementError"))
        table = _dcc("list", *quantities, refType="basic_calibrationResult")
        return _dcc("result", self._name("name", self.t("cal.points_title")), _dcc("data", table))

    def _quantity(self, name: str, value: float, unit: str) -> ET.Element:
        return _dcc("quantity", self._name("name", name), _real(value, unit))

    def _persons(self) -> Iterator[ET.Element]:
        head = self.facts.head
        people = [("operator", head.operator), ("approved_by", head.approved_by)]
        signer = "approved_by" if head.approved_by else "operator"
        for role, person in people:
            if person:
                yield _dcc(
                    "respPerson",
                    _dcc("person", self._name("name", person)),
                    _text("role", self.t(f"head.{role}")),
                    _text("mainSigner", str(role == signer).lower()),
                )

    def _identifications(self, *keys: str) -> Iterator[ET.Element]:
        for key in keys:
            value = getattr(self.facts.head, key)
            if value:
                name = self._name("name", self.t(f"head.{key}"))
                issuer = _text("issuer", "manufacturer" if key.endswith("serial") else "other")
                yield _dcc("identification", issuer, _text("value", value), name)

    def _manufacturer(self, maker: str) -> Iterator[ET.Element]:
        if maker:
            yield _dcc("manufacturer", self._name("name", maker))

    def _contact(self, tag: str, name: str, address: str, country: str = "") -> ET.Element:
        place = [_dcc("further", *self._contents(address))]
        if country:
            place.insert(0, _text("countryCode", country))
        return _dcc(tag, self._name("name", name), _dcc("location", *place))

    def _name(self, tag: str, text: str) -> ET.Element:
        return _dcc(tag, *self._contents(text))

    def _contents(self, text: str) -> Iterator[ET.Element]:
        content = _text("content", text)
        content.set("lang", self.t.lang)
        yield content


def _dcc(tag: str, *children: ET.Element, **attributes: str) -> ET.Element:
    element = ET.Element(f"{{{DCC}}}{tag}", attributes)
    element.extend(children)
    return element


def _text(tag: str, text: str, space: str = DCC) -> ET.Element:
    element = ET.Element(f"{{{space}}}{tag}")
    element.text = text
    return element


def _si(tag: str, *children: ET.Element) -> ET.Element:
    element = ET.Element(f"{{{SI}}}{tag}")
    element.extend(children)
    return element


def _real(value: float, unit: str) -> ET.Element:
    return _si("real", _text("value", f"{value:.6g}", SI), _text("unit", unit, SI))


def _real_list(values: Array, unit: str, expanded: Array | None = None) -> ET.Element:
    parts = [_text("valueXMLList", _print_list(values), SI), _text("unitXMLList", unit, SI)]
    if expanded is not None:
        k, probability = COVERAGE
        parts.append(
            _si(
                "measurementUncertaintyUnivariateXMLList",
                _si(
                    "expandedMUXMLList",
                    _text("valueExpandedMUXMLList", _print_list(expanded), SI),
                    _text("coverageFactorXMLList", f"{k:g}", SI),
                    _text("coverageProbabilityXMLList", f"{probability:g}", SI),
                ),
            )
        )
    return _si("realListXMLList", *parts)


def _print_list(values: Array) -> str:
    return " ".join(f"{float(value):.6f}" for value in values)
