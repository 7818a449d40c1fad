"""How often somebody may ask for something."""

from __future__ import annotations

from wayfarer.control.rate import RateLimiter


def test_allowance_is_used_up_and_comes_back() -> None:
    allowance = RateLimiter(5, 2.0)
    assert [allowance.take(10.0) for _ in range(6)] == [True] * 5 + [False]
    assert [allowance.take(11.0) for _ in range(3)] == [True, True, False]
    assert [allowance.take(100.0) for _ in range(6)] == [True] * 5 + [False], "never more than at first"
