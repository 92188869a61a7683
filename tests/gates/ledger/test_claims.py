"""The caveat ledger: kinds are honest, every entry has a place, and no entry can judge anything."""

import dataclasses
import importlib
import json
import pkgutil
import re
import typing
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, TypeAdapter, ValidationError

import gates
from gates.criterion import Criterion, Measured
from gates.ledger.claims import KINDS, LEDGER, Claim, Ledger, claims_of, ledger_text, read_ledger
from gates.need.gate import GATE as NEED
from gates.proof import SPECS
from gates.report import Answer, GateReport, StrictModel
from gates.run_commands import ledger as command
from gates.settings import GateSettings, Limit, Limits, read_limits
from genpolicy.errors import BadInputError, ConfigError

ROOT = Path(__file__).parents[3]
ENTRY = {
    "id": "gain", "kind": "source_specific", "source": "a study", "locator": "table 1",
    "claim": "46.9 % better", "does_not_show": "here",
}  # fmt: skip


def written(tmp_path, *entries, **head):
    path = tmp_path / "ledger.yaml"
    path.write_text(yaml.safe_dump({"schema_version": 1, "claims": list(entries), **head}))
    return path


def settings_models():
    """Every strict model of the gates, settings and limits among them, but the ledger's own."""
    for module in pkgutil.walk_packages(gates.__path__, "gates."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    found, left = set(), [StrictModel]
    while left:
        new = [m for m in left.pop().__subclasses__() if m.__module__.startswith("gates.")]
        found |= set(new)
        left += new
    return sorted(found - {Claim, Ledger}, key=lambda model: model.__name__)


def types_in(annotation):
    """Every type that an annotation names, however deep."""
    if not isinstance(annotation, list):  # the parameters of a callable
        yield annotation
    for part in annotation if isinstance(annotation, list) else typing.get_args(annotation):
        yield from types_in(part)


def test_every_kind_is_there_and_the_gain_of_46_is_the_sources_own():
    every = read_ledger().claims
    assert {claim.kind for claim in every} == set(KINDS)
    by_id = {claim.id: claim for claim in every}
    assert by_id["diffusion_policy_gain"].kind == "source_specific"
    assert "46.9 %" in by_id["diffusion_policy_gain"].claim
    assert by_id["flow_policy_speed"].kind == by_id["manicm_speed"].kind == "abstract_only"


def test_every_reference_of_the_chapter_has_an_entry():
    cited = {
        int(n) for claim in read_ledger().claims for n in re.findall(r"\[(\d+)\]", claim.source)
    }
    assert cited == set(range(1, 18))


def test_only_what_the_chapter_inspected_is_said_to_be_inspected():
    """Chapter 6, section 10, by hand, and section 4 for the system boundary of [17]."""
    inspected = {"[1]", "[2]", "[4]", "[5]", "[17]"}
    own = claims_of(read_ledger(), "source_specific")
    for claim in own:
        cited = set(re.findall(r"\[\d+\]", claim.source))
        words = "as inspected by" if cited <= inspected else "names no inspected place"
        assert words in claim.locator, claim.id
    assert {word for claim in own for word in re.findall(r"\[\d+\]", claim.source)} > inspected


def test_nothing_of_a_paper_is_matched_and_what_is_names_a_criterion_that_exists():
    for claim in claims_of(read_ledger(), "matched"):
        assert "[" not in claim.source
        report, _, criterion = claim.locator.partition(": ")
        gate = report.removeprefix("reports/gate_").removesuffix(".json").upper()
        assert criterion in {item.id for item in SPECS[gate].criteria}


@pytest.mark.parametrize(
    ("kind", "locator"), [("matched", "table 1"), ("source_specific", "reports/gate_d.json: x")]
)
def test_a_paper_cannot_be_called_matched(tmp_path, kind, locator):
    with pytest.raises(ConfigError, match="a claim is matched if a report of this ladder"):
        read_ledger(written(tmp_path, ENTRY | {"kind": kind, "locator": locator}))


@pytest.mark.parametrize(
    "entry",
    [
        ENTRY | {"claim": 46.9},
        ENTRY | {"claim": True},
        ENTRY | {"locator": ""},
        ENTRY | {"source": "  "},
        ENTRY | {"kind": "ranked"},
        ENTRY | {"limit": "0.5"},
        ENTRY | {"id": "A gain"},
        {name: value for name, value in ENTRY.items() if name != "locator"},
    ],
)
def test_an_entry_of_another_form_is_refused(tmp_path, entry):
    with pytest.raises(ConfigError, match=re.escape(LEDGER)) as caught:
        read_ledger(written(tmp_path, entry))
    assert caught.value.exit_code == 2


def test_a_second_entry_of_one_name_and_an_empty_ledger_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="twice: gain"):
        read_ledger(written(tmp_path, ENTRY, ENTRY))
    with pytest.raises(ConfigError):
        read_ledger(written(tmp_path))
    assert len(read_ledger(written(tmp_path, ENTRY)).claims) == 1


def test_no_field_of_a_claim_is_a_number():
    """A number that is text cannot be compared with anything."""
    properties = Claim.model_json_schema()["properties"]
    assert {entry.get("type") for entry in properties.values()} == {"string"}


def test_no_setting_limit_or_report_has_a_field_that_takes_a_claim():
    models = settings_models()
    assert {spec.settings for spec in SPECS.values()} <= set(models)
    assert {Answer, GateReport, GateSettings} <= set(models)
    of_models = {
        kind
        for model in models
        for field in model.model_fields.values()
        for kind in types_in(field.annotation)
    }
    of_classes = {
        kind
        for plain in (Limit, Limits, Measured, Criterion)
        for hint in typing.get_type_hints(plain).values()
        for kind in types_in(hint)
    }
    assert all(dataclasses.is_dataclass(plain) for plain in (Limit, Limits, Measured, Criterion))
    assert not {Claim, Ledger, BaseModel, StrictModel} & (of_models | of_classes)


def test_no_number_of_a_setting_takes_the_text_of_a_claim():
    """Strict models read no number from text, so that copying a claim's words sets nothing."""
    claim = read_ledger().claims[1]
    annotations = [f.annotation for m in settings_models() for f in m.model_fields.values()]
    numeric = [
        a for a in annotations if {float, int} & (kinds := {*types_in(a)}) and str not in kinds
    ]
    assert len(numeric) > 10
    for annotation in numeric:
        for text in (claim.claim, "46.9", claim.model_dump()):
            with pytest.raises(ValidationError):
                TypeAdapter(annotation).validate_python(text, strict=True)


@pytest.mark.parametrize("limit", [ENTRY, "46.9", "46.9 % better", ["46.9", "a study"]])
def test_a_limit_is_no_claim_and_no_text_of_one(limit):
    params = {"gate_a": {"limits": {"model": {"told_share": [limit, "a paper says so"]}}}}
    with pytest.raises(ConfigError, match="told_share"):
        read_limits(params, "A", NEED.criteria)
    params["gate_a"]["limits"]["model"]["told_share"] = limit
    with pytest.raises(ConfigError, match="told_share"):
        read_limits(params, "A", NEED.criteria)


def test_no_limit_of_the_ladder_is_a_number_of_the_ledger():
    """By its reason: none names a source of the ledger."""
    params = (ROOT / "params.yaml").read_text().lower()
    names = ("diffusion policy", "flowpolicy", "manicm", "pointflowmatch", "46.9", "139", "107")
    assert [name for name in names if name in params] == []


def test_the_command_shows_kind_after_kind_and_the_same_as_json(capsys):
    assert command() == 0
    out = capsys.readouterr().out
    assert [out.index(f"{kind}: ") for kind in KINDS] == sorted(
        out.index(f"{kind}: ") for kind in KINDS
    )
    assert out.strip() == ledger_text(read_ledger().claims)
    assert command(kind="abstract_only", as_json=True) == 0
    found = json.loads(capsys.readouterr().out)
    assert [entry["id"] for entry in found] == ["flow_policy_speed", "manicm_speed"]


def test_an_unknown_kind_lists_the_kinds():
    with pytest.raises(BadInputError, match="source_specific") as caught:
        claims_of(read_ledger(), "proven")
    assert caught.value.exit_code == 2


def test_each_claim_stands_below_its_own_kind_once():
    claims = read_ledger().claims
    lines = ledger_text(claims).splitlines()
    heads = {f"{kind}: {sum(c.kind == kind for c in claims)}": kind for kind in KINDS}
    kind, found = "", {}
    for line in lines:
        kind = heads.get(line, kind)
        if line.startswith("  ") and line[2] != " ":
            found[line.split(" · ")[0].strip()] = kind
    assert found == {claim.id: claim.kind for claim in claims}


TOLD = """\
source_specific: 1
  gain · a study
    says: 46.9 % better
    where: table 1
    does not show: that another task, another robot or another policy gains by
      as much, or at all
abstract_only: 2
  faster · an abstract
    says: 46.9 % better
    where: table 1
    does not show: here
  slower · a study
    says: 46.9 % better
    where: table 1
    does not show: here"""


def test_claims_are_told_by_kind_in_lines_of_a_terminal(tmp_path):
    long = "that another task, another robot or another policy gains by as much, or at all"
    entries = (
        ENTRY | {"id": "faster", "kind": "abstract_only", "source": "an abstract"},
        ENTRY | {"does_not_show": long},
        ENTRY | {"id": "slower", "kind": "abstract_only"},
    )
    assert ledger_text(read_ledger(written(tmp_path, *entries)).claims) == TOLD
    assert len(read_ledger(written(tmp_path, ENTRY)).claims) == 1


def test_a_line_of_a_claim_is_as_wide_as_a_terminal(tmp_path):
    """Of 80 signs one line, of 81 two."""
    for signs, lines in ((80, 5), (81, 6)):
        says = "x" * 30 + " " + "y" * (signs - 30 - 1 - len("    says: "))
        own = read_ledger(written(tmp_path, ENTRY | {"claim": says})).claims
        assert len(ledger_text(own).splitlines()) == lines
