"""Tests of model cards: their facts are those of the checkpoint's header and of the reports."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from safetensors.numpy import load_file
from tiny_motion import write_adapter, write_base

from humanclaw.motion import AdapterConfig, Card, read_header, shipped_base
from humanclaw_train.cards import CARD, REPORT, card, main, write
from humanclaw_train.fidelity import FidelityReport, Ratio, Row
from humanclaw_train.first_steps import FirstSteps
from humanclaw_train.likeness import PRIOR, NaturalnessRow
from humanclaw_train.naturalness import NaturalnessReport
from humanclaw_train.rollouts import adapters, file_digest

SKILLS = Path(__file__).parents[3] / "skills"
SHIPPED = [shipped_base(), *sorted(SKILLS.glob("*/*/*/adapter.safetensors"))]
RECIPE = {"name": "sit_in_place", "size": "lite", "batch": 64, "minutes": 7.5, "steps": 0, "done_steps": 4321}


@pytest.fixture
def weights(tmp_path):
    """Return a folder with a base and an adapter of sit_in_place; 25 of 100 chunks are real."""
    data = {"chunks": 100, "real": 25, "sources": {"HDM05": 25, "composed": 75}}
    licences = ("HDM05: CC BY-SA 3.0",)
    base = write_base(tmp_path / "base.safetensors", card=Card(RECIPE, data, licences))
    path = tmp_path / "sit_in_place" / "adapter.safetensors"
    config = AdapterConfig("sit_in_place", "mlp", ("h",), (0.5,), (0.3,))
    told = Card(RECIPE, {**data, "params_low": [0.19], "params_high": [0.81]}, licences)
    write_adapter(path, base, config, card=told)
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
    told = Card(RECIPE, {**data, "params_low": [0.1], "params_high": [0.5]}, ("My own walks: CC0",))
    write_adapter(path, base, AdapterConfig("stroll", "mlp", ("ahead",), (0.3,), (0.2,)), card=told)
    (path.parent / "card.toml").write_text('limits = ["It never hurries."]')
    text = card(path)
    assert "40 real (100 %)" in text
    assert "* It never hurries." in text
    assert "* ahead: 0.1 to 0.5, 0.3 ± 0.2" in text
    for claim in ("compose", "sitting", "stairs", "keyed"):
        assert claim not in text


def test_weights_of_share_alike_data_are_share_alike_and_their_package_is_told_so(weights, capsys):
    folder = weights / "sit_in_place"
    assert "distribute them under CC BY-SA 3.0" in card(folder / "adapter.safetensors")
    project = weights / "pyproject.toml"
    for licence, warned in (("Apache-2.0", True), ("Apache-2.0 AND CC-BY-SA-3.0", False)):
        project.write_text(f'[project]\nname = "mine"\nlicense = "{licence}"\n')
        assert main(["--skill", str(folder), "--base", str(weights / "base.safetensors")]) == 0
        said = capsys.readouterr().err
        assert ('Write license = "Apache-2.0 AND CC-BY-SA-3.0"' in said) == warned


def test_a_card_tells_the_figures_of_the_header(weights):
    text = card(weights / "sit_in_place" / "adapter.safetensors")
    for fact in (
        "100 chunks",
        "25 real (25 %)",
        "75 synthetic (75 %)",
        "4,321 steps of 64",
        "CC BY-SA 3.0",
        "* h: 0.19 to 0.81, 0.5 ± 0.3",
    ):
        assert fact in text
    assert f"`{read_header(weights / 'base.safetensors')['digest']}`" in text
    assert "Documentation Mocap Database HDM05" in text
    assert "mocap.cs.cmu.edu" not in text  # Data that was not used.


def test_a_card_counts_the_parameters_of_the_model(weights):
    path = weights / "base.safetensors"
    own = (tensor for name, tensor in load_file(path).items() if name.startswith("model."))
    assert f"{sum(tensor.size for tensor in own):,}" in card(path)


def test_a_card_quotes_the_report_on_its_own_weights_and_no_other(weights):
    path = weights / "sit_in_place" / "adapter.safetensors"
    text = card(path, _report(weights))
    assert "* generated: 1.012 ± 0.046 (0.3)" in text
    assert "* simulated in half-physics: 1.078 ± 0.020 (2.0)" in text
    assert "1.012" not in card(path, _report(weights, base="of another base"))
    assert "Not measured for these weights" in card(path)


def test_a_card_quotes_likeness_and_uncommanded_travel_of_its_own_weights(weights):
    path = weights / "sit_in_place" / "adapter.safetensors"
    row = NaturalnessRow("sit_in_place", "generated", 600, 1.0, 0.1, 0.0, 96.0, 0.005, frechet=3.25)
    other = replace(row, skill=PRIOR, frechet=7.75)
    digests = {"sit_in_place": file_digest(path)}
    first = {"sit_in_place": FirstSteps(750, 0.1, 1.26, 2.0, 0)}
    likeness = NaturalnessReport(read_header(path)["base"], "euler", digests, (other, row), first)
    besides = {"hips.forward": (-0.312, 0.105), "heading.left": (0.0, 0.0)}
    report = _report(weights)
    report = replace(report, rows=(replace(report.rows[0], uncommanded=besides),))
    text = card(path, report, likeness)
    assert "| 3.2 |" in text
    assert "7.8" not in text
    assert "slides by 1.3 cm at the 99th percentile of 750 bodies" in text
    assert "the least to be hoped for" not in text
    assert "| sit_in_place | - | -31.2 / +10.5 | +0.0 / +0.0 |" in text
    assert "7.8" in card(weights / "base.safetensors", report, likeness)
    assert "Likeness" not in card(path, report, replace(likeness, adapters={"sit_in_place": "others"}))


def test_a_card_names_the_clips_that_nothing_was_trained_on_or_says_that_there_are_none(weights):
    path = weights / "sit_in_place" / "adapter.safetensors"
    row = NaturalnessRow("sit_in_place", "generated", 600, 1.0, 0.1, 0.0, 96.0, 0.005, frechet=3.25)

    def of(row):
        digests = {"sit_in_place": file_digest(path)}
        return " ".join(
            card(path, None, NaturalnessReport(read_header(path)["base"], "euler", digests, (row,), {})).split()
        )

    apart = of(replace(row, unseen=("CMU: 03_04", "CMU: 12_01")))
    assert "against CMU: 03_04, 12_01, **held out from training**" in apart
    assert "held out from training" not in of(row)
    assert "show too little of it" in of(row)


def test_only_the_shipped_base_says_what_is_synthetic_there(weights):
    claim = "All sitting, all regular stairs"
    assert claim in card(shipped_base())
    for name in ("base.safetensors", "sit_in_place/adapter.safetensors"):
        assert claim not in card(weights / name)


@pytest.mark.parametrize(("sources", "said"), [({"composed": 40}, True), ({"HDM05": 1, "composed": 39}, False)])
def test_a_card_says_if_no_real_motion_shows_the_skill(tmp_path, sources, said):
    base = write_base(tmp_path / "base.safetensors", card=Card(RECIPE, {}, ()))
    data = {"chunks": 40, "real": sources.get("HDM05", 0), "sources": sources}
    config = AdapterConfig("sit_in_place", "mlp", ("h",), (0.5,), (0.3,))
    path = write_adapter(tmp_path / "adapter.safetensors", base, config, card=Card(RECIPE, data, ()))
    assert ("No real motion is among them" in card(path)) == said


def test_cards_are_written_once_and_found_stale_when_a_report_comes(weights, capsys):
    arguments = ["--base", str(weights / "base.safetensors"), "--adapters", str(weights)]
    assert main([*arguments, "--check"]) == 1
    assert not (weights / CARD).exists()
    assert main(arguments) == 0
    assert main([*arguments, "--check"]) == 0
    _report(weights).save(weights / REPORT)
    assert main([*arguments, "--check"]) == 1
    assert "out of date" in capsys.readouterr().out


def test_without_folders_the_cards_are_those_of_the_installed_skills(weights, capsys):
    path = weights / "sit_in_place" / "adapter.safetensors"
    assert main(["--base", str(weights / "base.safetensors")], installed=lambda: {"sit_in_place": path}) == 0
    written = [line.removeprefix("wrote: ") for line in capsys.readouterr().out.splitlines()]
    assert written == [str(weights / CARD), str(path.with_name(CARD))]


def test_a_broken_report_is_an_error_and_nothing_is_written(weights):
    (weights / REPORT).write_text(json.dumps([]))
    assert main(["--base", str(weights / "base.safetensors"), "--adapters", str(weights)]) == 2
    assert not (weights / CARD).exists()


def test_the_shipped_cards_are_those_of_the_shipped_weights():
    assert write([shipped_base(), *adapters([SKILLS]).values()], shipped_base(), check=True) == []


@pytest.mark.parametrize("checkpoint", SHIPPED, ids=lambda path: path.parent.name)
def test_every_shipped_checkpoint_has_its_shares_and_licences_on_the_card_beside_it(checkpoint):
    told = read_header(checkpoint)["card"]
    text = checkpoint.with_name(CARD).read_text("utf-8")
    assert f"{told['data']['real']:,} real" in text
    assert f"{told['data']['chunks'] - told['data']['real']:,} synthetic" in text
    assert all(licence in text for licence in told["licences"])
