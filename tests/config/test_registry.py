"""Finding algorithms and drivers: built in, installed, or by ``"module:attribute"``."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from tests import fake_plugins
from tests.simhal.third_party_compass import XC9
from wayfarer.config import registry
from wayfarer.config.registry import algorithm_names, driver_names, find_algorithm, find_driver
from wayfarer.errors import BadInput, UnknownName
from wayfarer.escape.catalogue import BUILT_IN, CATALOGUE


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third party's package is installed: one algorithm and one driver that work, and some that do not."""
    points = [
        EntryPoint("spiral", "tests.fake_plugins:spiral", registry.ALGORITHM_GROUP),
        EntryPoint("pledge", "tests.fake_plugins:spiral", registry.ALGORITHM_GROUP),
        EntryPoint("gone", "no_such_package:it", registry.ALGORITHM_GROUP),
        EntryPoint("odd", "json:JSONDecoder", registry.ALGORITHM_GROUP),
        EntryPoint("reader", "tests.simhal.third_party_compass:XC9", registry.DRIVER_GROUP),
    ]

    def entry_points(*, group: str) -> list[EntryPoint]:
        return [point for point in points if point.group == group]

    monkeypatch.setattr("importlib.metadata.entry_points", entry_points)
    monkeypatch.setattr(registry, "entry_points", entry_points)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_algorithm(name: str) -> None:
    assert find_algorithm(name) is BUILT_IN[name]


@pytest.mark.usefixtures("installed")
def test_installed_names_come_once_and_after_the_built_in_ones_which_they_cannot_replace() -> None:
    assert algorithm_names() == [*BUILT_IN, "gone", "odd", "spiral"]
    assert algorithm_names()[:10] == list(CATALOGUE)
    assert "reader" in driver_names()
    assert find_algorithm("pledge") is CATALOGUE["pledge"]


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("name", ["spiral", "tests.fake_plugins:spiral"])
def test_third_party_s_algorithm_says_where_it_comes_from(name: str) -> None:
    found = find_algorithm(name)
    assert (found.name, found.origin) == (name, "tests.fake_plugins:spiral")
    assert found.summary == fake_plugins.spiral.summary


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("name", ["reader", "tests.simhal.third_party_compass:XC9"])
def test_third_party_s_driver(name: str) -> None:
    assert find_driver(name) is XC9


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("no_such_package:it", "cannot import no_such_package .* is it installed?"),
        ("gone", "cannot import no_such_package"),
        ("json:nothing", "module json has no 'nothing'"),
        ("json:", "'json:': nothing in it fits: no class is in it"),
        ("json:dumps", "json:dumps is a function, neither a class nor a wayfarer.escape.catalogue.Algorithm"),
        ("odd", r"'odd': json:JSONDecoder lacks decide\(\), memory\(\), reset\(\)"),
        (":it", "':it'"),
        (".relative:it", "'.relative:it'"),
    ],
)
def test_algorithm_that_cannot_be_had_is_bad_input(name: str, text: str) -> None:
    with pytest.raises(BadInput, match=text) as caught:
        find_algorithm(name)
    assert "\n" not in str(caught.value)


def test_module_that_fails_while_it_is_imported_is_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "half_written_plugin.py").write_text("def broken(:\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "half_written_plugin", raising=False)
    with pytest.raises(BadInput, match="half_written_plugin"):
        find_algorithm("half_written_plugin:it")


def test_unknown_names_offer_the_nearest() -> None:
    with pytest.raises(UnknownName, match="unknown algorithm 'forest-plege': did you mean forest-pledge"):
        find_algorithm("forest-plege")
    with pytest.raises(UnknownName, match="unknown driver 'zzzz'"):
        find_driver("zzzz")
