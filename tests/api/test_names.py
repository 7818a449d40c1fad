"""The public names: what is told to type checkers is what Python gives, and each example in a docstring holds."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
from pathlib import Path
from typing import Any

import pytest

import wayfarer
from wayfarer.experiments.settings import NAMES, SETTINGS_LINE, CampaignSettings, sentences

ROOT = Path(wayfarer.__file__).parent


def source_of(module: str) -> ast.Module:
    return ast.parse((ROOT.parent / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8"))


def definition(name: str) -> ast.ClassDef | ast.FunctionDef:
    found = next(node for node in source_of(wayfarer._MODULE_OF[name]).body if getattr(node, "name", "") == name)
    assert isinstance(found, ast.ClassDef | ast.FunctionDef)
    return found


def test_type_checkers_are_told_the_names_that_there_are() -> None:
    guarded = next(node for node in source_of("wayfarer.__init__").body if isinstance(node, ast.If))
    told = {
        alias.name: node.module for node in guarded.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert told == wayfarer._MODULE_OF
    assert sorted(wayfarer.__all__) == sorted(told)


def test_names_are_offered_and_others_are_refused_in_a_line() -> None:
    assert set(wayfarer.__all__) <= set(dir(wayfarer))
    with pytest.raises(AttributeError, match=r"^module 'wayfarer' has no attribute 'run_campain'$"):
        wayfarer.run_campain  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize("name", ["run_campaign", "run_sweep", "run_trial"])
def test_settings_of_a_campaign_are_in_help_and_signature_with_their_sentences(name: str) -> None:
    public = getattr(wayfarer, name)
    parameters = inspect.signature(public).parameters
    told = " ".join((inspect.getdoc(public) or "").split())
    for setting, sentence in sentences(CampaignSettings).items():
        if setting in NAMES and setting not in {"algorithms", "trials"}:
            assert parameters[setting].kind is inspect.Parameter.KEYWORD_ONLY
            assert f"{setting}: {sentence}" in told
    assert "settings" not in parameters
    with pytest.raises(TypeError, match="unexpected keyword argument 'slip_mean'"):
        public(**({"values": {}} if name == "run_sweep" else {}), slip_mean=3)


@pytest.mark.parametrize("name", wayfarer.__all__)
def test_help_of_a_public_name_says_all_that_its_source_says(name: str) -> None:
    """What is compiled keeps only docstrings of public classes (``wayfarer.__getattr__``), none of methods."""
    source, public = definition(name), getattr(wayfarer, name)
    shown, written = inspect.getdoc(public) or "", ast.get_docstring(source) or ""
    before, settings, after = written.partition(SETTINGS_LINE.lstrip())
    assert shown == written if not settings else shown.startswith(before.rstrip()) and shown.endswith(after)
    for each in source.body if isinstance(source, ast.ClassDef) else ():
        if isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
            method = inspect.getattr_static(public, each.name)
            assert inspect.getdoc(method) == ast.get_docstring(each), each.name
            told: Any = method.fget if isinstance(method, property) else getattr(method, "__func__", method)
            names = [*each.args.posonlyargs, *each.args.args, *each.args.kwonlyargs]
            assert [argument.arg for argument in names] == [
                parameter.name
                for parameter in inspect.signature(told).parameters.values()
                if parameter.kind not in {parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD}
            ]


@pytest.mark.parametrize("name", wayfarer.__all__)
def test_example_in_the_docstring_holds(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "field_logs").symlink_to(Path(__file__).parents[2] / "field_logs")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {each: getattr(wayfarer, each) for each in wayfarer.__all__}
    example = doctest.DocTestParser().get_doctest(inspect.getdoc(names[name]) or "", names, name, None, None)
    assert example.examples
    said: list[str] = []
    doctest.DocTestRunner().run(example, out=said.append)
    assert not said, "".join(said)


def test_documentation_says_what_works_in_at_most_12_lines_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = next((Path(__file__).parents[2] / "docs").rglob("from-python.md")).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert len(blocks) == 4
    assert max(len(block.splitlines()) for block in blocks) <= 12
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for block in blocks:
        quickly = block.replace("trials=100", "trials=1").replace("jobs=2", "jobs=1")
        exec(compile(quickly, "from-python.md", "exec"), names)
    assert set(names["gains"]["algorithm"]) == {"forest-pledge", "pledge"}
