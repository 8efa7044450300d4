"""The Digital Calibration Certificate: the structure of schema 3.3.0, and a public reader."""

from __future__ import annotations

import os
import re
import warnings
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from certificate_fakes import make_facts

from robotrue.errors import ConfigurationError
from robotrue.report.certificate_head import read_certificate_head
from robotrue.report.dcc import DCC, REQUIRED, SI, dcc_xml

CHILDREN: dict[str, str] = {
    "digitalCalibrationCertificate": "administrativeData measurementResults comment? document?",
    "administrativeData": "dccSoftware refTypeDefinitions? coreData items calibrationLaboratory "
    "respPersons customer statements?",
    "dccSoftware": "software+",
    "software": "name release type? description?",
    "coreData": "countryCodeISO3166_1 usedLangCodeISO639_1+ mandatoryLangCodeISO639_1+ "
    "uniqueIdentifier identifications? receiptDate? beginPerformanceDate endPerformanceDate "
    "performanceLocation issueDate? reportAmendedSubstituted? previousReport?",
    "items": "name? equipmentClass* description? owner? manufacturer? identifications? item+",
    "item": "name equipmentClass* description? owner? installedSoftwares? manufacturer? model? "
    "identifications itemQuantities? subItems?",
    "identifications": "identification+",
    "identification": "issuer value name?",
    "manufacturer": "name eMail? phone? fax? link? location? descriptionData?",
    "calibrationLaboratory": "calibrationLaboratoryCode? contact cryptElectronicSeal? "
    "cryptElectronicSignature? cryptElectronicTimeStamp?",
    "contact": "name eMail? phone? fax? link? location descriptionData?",
    "customer": "name eMail? phone? fax? link? location descriptionData?",
    "person": "name eMail? phone? fax? link? location? descriptionData?",
    "respPersons": "respPerson+",
    "respPerson": "person description? role? mainSigner? cryptElectronicSeal? "
    "cryptElectronicSignature? cryptElectronicTimeStamp?",
    "statements": "statement+",
    "statement": "name? description? countryCodeISO3166_1* convention? traceable? norm* "
    "reference* link* declaration? valid? date? period? respAuthority? conformity? data? "
    "nonSIDefinition? nonSIUnit? location?",
    "measurementResults": "measurementResult+",
    "usedMethods": "usedMethod+",
    "usedMethod": "name description? norm* reference* link* usedMethodQuantities?",
    "measuringEquipments": "name? equipmentClass* description? owner? identifications? "
    "measuringEquipment+",
    "measuringEquipment": "name equipmentClass* description? certificate? manufacturer? model? "
    "identifications? measuringEquipmentQuantities? installedSoftware?",
    "influenceConditions": "influenceCondition+",
    "influenceCondition": "name description? status? certificate? data",
    "measurementResult": "name description? usedMethods usedSoftware measuringEquipments? "
    "influenceConditions results measurementMetaData?",
    "results": "result+",
    "result": "name description? data",
    "quantity": "name? description? (real|realListXMLList) relativeUncertainty? usedMethods? "
    "usedSoftware? measuringEquipments? influenceConditions? measurementMetaData?",
    "list": "name? description? quantity+",
    "name": "content+",
    "description": "content+",
    "declaration": "content+",
    "text": "content+",
    "further": "content+",
    "real": "label? quantityTypeQUDT? value unit significantDigit? dateTime? "
    "measurementUncertaintyUnivariate?",
    "realListXMLList": "labelXMLList? quantityTypeQUDTXMLList? valueXMLList unitXMLList "
    "significantDigitXMLList? dateTimeXMLList? measurementUncertaintyUnivariateXMLList?",
    "measurementUncertaintyUnivariateXMLList": "expandedMUXMLList",
    "expandedMUXMLList": "valueExpandedMUXMLList coverageFactorXMLList "
    "coverageProbabilityXMLList distributionXMLList?",
}
"""Children of each element that a certificate of ours may have, in the order of the schema.

From schema 3.3.0 of the Digital Calibration Certificate and 2.2.1 of the Digital SI. Method,
software and conditions of a result are required by PTB's Schematron rules (package dcclib).
"""
VALUES = {
    "release": r"[a-zA-Z] ?(\d{1,3}\.){0,3}\d{1,3}",
    "countryCodeISO3166_1": "[A-Z]{2}",
    "usedLangCodeISO639_1": "[a-z]{2}",
    "mandatoryLangCodeISO639_1": "[a-z]{2}",
    "uniqueIdentifier": r"\S+(\s+\S+)*",
    "beginPerformanceDate": r"\d{4}-\d\d-\d\d",
    "endPerformanceDate": r"\d{4}-\d\d-\d\d",
    "issueDate": r"\d{4}-\d\d-\d\d",
    "performanceLocation": "laboratory|customer|laboratoryBranch|customerBranch|other",
    "issuer": "manufacturer|calibrationLaboratory|customer|owner|other",
    "mainSigner": "true|false",
    "conformity": "pass|fail|conditionalPass|conditionalFail|noPass|noFail",
    "model": r"\S+(\s+\S+)*",
    "unit": r"(\\[a-z]+(\{-?\d+\})?)+",
}
STATED = [
    "number=K-17", "measured=2026-11-20", "laboratory=Robot group", "laboratory_address=Hall 3",
    "country=DE", "customer=Shop 4", "customer_address=Street 1", "robot_type=KR 160",
    "robot_serial=871234", "operator=N. N.", "temperature_degC=21.5", "speed_mm_per_s=100",
    "instrument_type=tracker", "place=cell 2", "robot_maker=KUKA", "instrument_serial=5512",
]  # fmt: skip


@pytest.fixture(scope="module")
def certified():
    return replace(make_facts(), head=read_certificate_head(None, STATED))


def names(element: ET.Element) -> list[str]:
    return [child.tag.rpartition("}")[2] for child in element]


def check_structure(element: ET.Element) -> int:
    """Checks children and values of an element and all below it; returns how many it has seen."""
    tag = element.tag.rpartition("}")[2]
    if tag in CHILDREN:
        parts = re.sub(r"(\w+|\([^)]*\))([?*+]?)", r"(?:\1,)\2", CHILDREN[tag]).replace(" ", "")
        pattern = re.sub(r"\((\w+\|\w+)\),", r"(?:\1),", parts)
        assert re.fullmatch(pattern, "".join(f"{n}," for n in names(element))), tag
    if tag in VALUES:
        assert re.fullmatch(VALUES[tag], element.text or ""), (tag, element.text)
    return 1 + sum(map(check_structure, element))


def with_required_keys_only(certified):
    stated = [each for each in STATED if each.partition("=")[0] in REQUIRED]
    return replace(certified, head=read_certificate_head(None, stated))


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_the_structure_is_that_of_the_schema(certified, lang):
    root = ET.fromstring(dcc_xml(certified, tolerance=2e-4, lang=lang))  # noqa: S314  our own
    assert root.tag == f"{{{DCC}}}digitalCalibrationCertificate"
    assert root.get("schemaVersion") == "3.3.0"
    assert check_structure(root) > 150


def test_conditions_that_are_not_stated_are_named_as_such(certified):
    root = ET.fromstring(dcc_xml(with_required_keys_only(certified)))  # noqa: S314  our own
    check_structure(root)
    (condition,) = root.iter(f"{{{DCC}}}influenceCondition")
    assert [text for text in condition.itertext() if text.strip()] == ["temperature", "not stated"]


def test_ids_are_referred_to(certified):
    root = ET.fromstring(dcc_xml(certified))  # noqa: S314  our own
    referred = {name for each in root.iter() for name in each.get("refId", "").split()}
    assert {each.get("id") for each in root.iter()} - {None} == referred


def test_rules_of_ptb_find_no_error(certified):
    schematron = pytest.importorskip("dcclib.validation.schematron", reason="pip install dcclib")
    rules = schematron.SchematronValidator.for_dcc()
    for facts in (certified, with_required_keys_only(certified)):
        found = rules.validate_str(dcc_xml(facts, tolerance=2e-4).decode())
        reports = (*found.failed_assertions, *found.successful_reports)
        assert [each.text for each in reports if each.role != "information"] == []


def test_a_child_out_of_order_is_noticed(certified):
    root = ET.fromstring(dcc_xml(certified))  # noqa: S314  our own
    data = root[0]
    data[:] = [data[1], data[0], *data[2:]]
    with pytest.raises(AssertionError):
        check_structure(root)


def test_it_is_valid_by_the_schema_itself(certified, tmp_path):
    schema = os.environ.get("ROBOTRUE_DCC_XSD")
    if not schema:
        pytest.skip("set ROBOTRUE_DCC_XSD to dcc.xsd of https://ptb.de/dcc/v3.3.0/")
    etree = pytest.importorskip("lxml.etree")
    validator = etree.XMLSchema(etree.parse(schema))
    validator.assertValid(etree.fromstring(dcc_xml(certified, tolerance=2e-4)))


def test_a_public_reader_reads_the_numbers_back(certified):
    from dccXMLJSONConv.dccConv import XMLToJson

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read = XMLToJson(dcc_xml(certified, tolerance=2e-4).decode())
    root = read["dcc:digitalCalibrationCertificate"]
    core = root["dcc:administrativeData"]["dcc:coreData"]
    assert core["dcc:uniqueIdentifier"] == {"#text": "K-17"}
    results = root["dcc:measurementResults"]["dcc:measurementResult"]["dcc:results"]["dcc:result"]
    mean = results[0]["dcc:data"]["dcc:quantity"][3]["si:real"]
    assert float(mean["si:value"]["#text"]) == pytest.approx(
        certified.check.after.mean * 1e3, rel=1e-5
    )
    column = results[1]["dcc:data"]["dcc:list"]["dcc:quantity"][4]["si:realListXMLList"]
    values = np.array(str(column["si:valueXMLList"]["#text"]).split(), dtype=float)
    assert values == pytest.approx(certified.check.errors_after[:, 1] * 1e3, abs=1e-6)


def test_simulated_data_and_conformity_are_stated(certified):
    text = dcc_xml(certified, tolerance=1e-9).decode()
    assert "SIMULATED DATA" in text
    assert "<dcc:conformity>fail</dcc:conformity>" in text
    assert "conformity>" not in dcc_xml(certified).decode()
    assert f'xmlns:si="{SI}"' in text


def test_what_the_schema_needs_is_asked_for_by_name(certified):
    with pytest.raises(ConfigurationError, match="needs operator in its head"):
        dcc_xml(replace(certified, head=replace(certified.head, operator="")))
    assert all(hasattr(certified.head, key) for key in REQUIRED)
    with pytest.raises(ConfigurationError, match="no check was made"):
        dcc_xml(replace(certified, check=None))
