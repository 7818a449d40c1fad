"""The tests of my_algorithm.py: pytest test_my_algorithm.py."""

from pathlib import Path

from my_algorithm import MyAlgorithm

import wayfarer
from wayfarer.testing import check_algorithm

FILE = Path(__file__).with_name("my_algorithm.py")


def test_it_keeps_the_promises_of_every_algorithm() -> None:
    check_algorithm(MyAlgorithm)


def test_it_gets_out_of_most_forests() -> None:
    results = wayfarer.run_campaign(f"{FILE}:MyAlgorithm", trials=10)
    outcomes = [row["outcome"] for row in results.trials]
    assert outcomes.count("escaped") >= 8, outcomes
