"""The tests of my_algorithm.py: pytest test_my_algorithm.py."""

import asyncio
from pathlib import Path

import pytest
from my_algorithm import MyAlgorithm

import wayfarer
from wayfarer.testing import Check, checks_of

FILE = Path(__file__).with_name("my_algorithm.py")


@pytest.mark.parametrize("check", checks_of("algorithm", MyAlgorithm), ids=str)
def test_it_keeps_each_promise_of_an_algorithm(check: Check) -> None:
    asyncio.run(check.run())


def test_it_gets_out_of_most_forests() -> None:
    results = wayfarer.run_campaign(f"{FILE}:MyAlgorithm", trials=5, budget_m=200)  # a weak one takes seconds to fail
    outcomes = [row["outcome"] for row in results.trials]
    assert outcomes.count("escaped") >= 4, outcomes
