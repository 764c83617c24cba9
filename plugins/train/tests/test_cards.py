"""Tests of model cards: their facts are those of the checkpoint's header and of the reports."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_motion import write_adapter, write_base

from humanclaw.motion import AdapterConfig, Card, read_header, shipped_base
from humanclaw_train.cards import CARD, REPORT, card, write
from humanclaw_train.eval.fidelity import FidelityReport, Ratio, Row
from humanclaw_train.eval.rollouts import adapters, file_digest

SKILLS = Path(__file__).parents[3] / "skills"
RECIPE = {"name": "sit_in_place", "size": "lite", "batch": 64, "minutes": 7.5, "steps": 0, "done_steps": 4321}


@pytest.fixture
def weights(tmp_path):
    """Return a folder with a base and an adapter of sit_in_place; 25 of 100 chunks are real."""
    data = {"chunks": 100, "real": 25, "sources": {"HDM05": 25, "composed": 75}}
    licences = ("HDM05: CC BY-SA 3.0",)
    base = write_base(tmp_path / "base.safetensors", card=Card(RECIPE, data, licences))
    path = tmp_path / "sit_in_place" / "adapter.safetensors"
    config = AdapterConfig("sit_in_place", "mlp", ("h",), (0.5,), (0.3,))
    about = Card(RECIPE, {**data, "params_low": [0.19], "params_high": [0.81]}, licences)
    write_adapter(path, base, config, card=about)
    return tmp_path


def _report(weights: Path, base: str | None = None) -> FidelityReport:
    adapter = weights / "sit_in_place" / "adapter.safetensors"
    row = Row(
        "sit_in_place",
        Ratio(1.0123, 0.0456, 0.9876, 0.3, 600),
        Ratio(1.0777, 0.02, 1, 2, 200),
        adapter=file_digest(adapter),
    )
    return FidelityReport(base or read_header(adapter)["base"], "euler, 4 steps", 200, 0, 17.4, (row,))


def test_the_card_of_a_ninth_skill_says_nothing_of_how_ours_were_made(tmp_path):
    base = write_base(tmp_path / "base.safetensors", card=Card(RECIPE, {}, ()))
    path = tmp_path / "stroll" / "adapter.safetensors"
    data = {"chunks": 40, "real": 40, "sources": {"My own walks": 40}}
    about = Card(RECIPE, {**data, "params_low": [0.1], "params_high": [0.5]}, ("My own walks: CC0",))
    write_adapter(path, base, AdapterConfig("stroll", "mlp", ("ahead",), (0.3,), (0.2,)), card=about)
    (path.parent / "card.toml").write_text('limits = ["It never hurries."]')
    text = card(path)
    assert "40 real chunks (100 %)" in text
    assert "* It never hurries." in text
    assert "SI: ahead 0.1 to 0.5." in text
    for claim in ("compose", "sitting", "stairs", "keyed"):
        assert claim not in text


def test_weights_of_share_alike_data_are_share_alike(humanclaw, weights, capsys):
    folder = weights / "sit_in_place"
    assert "distribute them under CC BY-SA 3.0" in card(folder / "adapter.safetensors")
    project = weights / "pyproject.toml"
    for licence, warned in (("Apache-2.0", True), ("Apache-2.0 AND CC-BY-SA-3.0", False)):
        project.write_text(f'[project]\nname = "mine"\nlicense = "{licence}"\n')
        assert humanclaw("cards", "--skill", str(folder), "--base", str(weights / "base.safetensors")) == 0
        said = capsys.readouterr().err
        assert ('Write license = "Apache-2.0 AND CC-BY-SA-3.0"' in said) == warned


def test_licences_of_the_same_data_are_told_on_the_card_of_the_base():
    owner = "NSF EIA-0196217"
    assert owner in card(shipped_base())
    text = card(adapters([SKILLS])["walk"])
    assert "Motion Capture Database 355, ReActIdle 0. Licences: see the base's card." in text
    assert owner not in text


def test_a_card_tells_the_figures_of_the_header(weights):
    text = card(weights / "sit_in_place" / "adapter.safetensors")
    for fact in (
        "25 real chunks (25 %), 75 synthetic",
        "4,321 steps of 64",
        "CC BY-SA 3.0",
        "SI: h 0.19 to 0.81.",
    ):
        assert fact in text
    assert f"`{read_header(weights / 'base.safetensors')['digest']}`" in text
    assert "Documentation Mocap Database HDM05" in text
    assert "mocap.cs.cmu.edu" not in text  # Data that was not used.


def test_a_card_quotes_the_report_on_its_own_weights_and_no_other(weights):
    path = weights / "sit_in_place" / "adapter.safetensors"
    text = card(path, _report(weights))
    assert "* generated: 1.012 ± 0.046 (0.3)" in text
    assert "* simulated: 1.078 ± 0.020 (2.0)" in text
    assert "1.012" not in card(path, _report(weights, base="of another base"))
    assert "Not measured for these weights" in card(path)


def test_a_card_quotes_the_uncommanded_travel_of_its_skill(weights):
    report = _report(weights)
    besides = {"hips.forward": (-0.312, 0.105), "heading.left": (0.0, 0.0)}
    report = replace(report, rows=(replace(report.rows[0], uncommanded=besides),))
    text = card(weights / "sit_in_place" / "adapter.safetensors", report)
    assert "after walking: ahead -31.2 / +10.5 cm." in text


@pytest.mark.parametrize(
    ("licence", "shown"), [("Apache-2.0", "apache-2.0"), ("Apache-2.0 AND CC-BY-SA-3.0", "other"), ("", "unknown")]
)
def test_the_front_matter_names_the_licence_of_the_package(weights, licence, shown):
    (weights / "pyproject.toml").write_text(f'[project]\nlicense = "{licence}"\n')
    assert card(weights / "sit_in_place" / "adapter.safetensors").startswith(f"---\nlicense: {shown}\n")


def test_only_the_shipped_base_says_what_is_synthetic_there(weights):
    claim = "All sitting, all regular stairs"
    assert claim in card(shipped_base())
    for name in ("base.safetensors", "sit_in_place/adapter.safetensors"):
        assert claim not in card(weights / name)


def test_cards_are_written_once_and_found_stale_when_a_report_comes(humanclaw, weights, capsys):
    arguments = ["--base", str(weights / "base.safetensors"), "--adapters", str(weights)]
    assert humanclaw("cards", *arguments, "--check") == 1
    assert not (weights / CARD).exists()
    assert humanclaw("cards", *arguments) == 0
    assert humanclaw("cards", *arguments, "--check") == 0
    _report(weights).save(weights / REPORT)
    assert humanclaw("cards", *arguments, "--check") == 1
    assert "out of date" in capsys.readouterr().out


def test_without_folders_the_cards_are_those_of_the_installed_skills(humanclaw, weights, capsys):
    assert humanclaw("cards", "--base", weights / "base.safetensors", "--check") == 1
    stale = [line.removeprefix("out of date: ") for line in capsys.readouterr().out.splitlines()]
    assert stale[0] == str(weights / CARD)
    assert {Path(line).parent.name for line in stale} > {"walk", "sit_in_place", "stop"}


def test_a_broken_report_is_an_error_and_nothing_is_written(humanclaw, weights):
    (weights / REPORT).write_text(json.dumps([]))
    assert humanclaw("cards", "--base", str(weights / "base.safetensors"), "--adapters", str(weights)) == 2
    assert not (weights / CARD).exists()


def test_the_shipped_cards_are_those_of_the_shipped_weights():
    assert write([shipped_base(), *adapters([SKILLS]).values()], shipped_base(), check=True) == []
