"""The heavy-tailed draws against the closed form."""

from __future__ import annotations

from random import Random
from statistics import NormalDist

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.walk import observation
from wayfarer.escape.catalogue import levy, levy_angle, levy_stride, uniform_angle
from wayfarer.escape.settings import EscapeSettings


def quantile(share: float, scale: float) -> float:
    """Levy(0, scale) has the distribution function 2 - 2 Phi(sqrt(scale / x))."""
    return scale / NormalDist().inv_cdf(1.0 - share / 2.0) ** 2


class Drawing(Random):
    """Draws one given number for ever."""

    def __init__(self, drawn: float) -> None:
        super().__init__(0)
        self.drawn = drawn

    def random(self) -> float:
        return self.drawn


@pytest.mark.parametrize("share", [0.05, 0.25, 0.5, 0.75, 0.95])
@pytest.mark.parametrize("scale", [0.05, 1.0])
def test_each_share_of_the_draws_is_below_its_quantile(share: float, scale: float) -> None:
    assert levy(Drawing(1.0 - share), scale) == pytest.approx(quantile(share, scale))


@pytest.mark.parametrize("drawn", [0.0, 2.0**-53, 2.0**-52, 0.5, 1.0 - 2.0**-53], ids=str)
def test_no_draw_of_the_generator_raises(drawn: float) -> None:
    assert levy(Drawing(drawn), 1.0) > 0.0


@pytest.mark.parametrize(("share", "angle_deg", "stride_m"), [(0.7, 10.0, 0.6), (0.8, 15.6, 0.78), (0.95, 50.0, 10.0)])
def test_draws_are_the_paper_s(share: float, angle_deg: float, stride_m: float) -> None:
    """Lévy(0, 1) in degrees, and in the pixels of 0.05 m of the released simulator; both clipped."""
    drawing, settings = Drawing(1.0 - share), EscapeSettings()
    assert levy_angle(observation(), settings, drawing) == pytest.approx(angle_deg, rel=0.01)
    assert levy_stride(settings, drawing) == pytest.approx(stride_m, rel=0.01)


@given(st.integers(0, 2**32))
def test_strides_stay_within_the_settings(seed: int) -> None:
    settings = EscapeSettings(levy_stride_min_m=0.3, levy_stride_max_m=4.0)
    assert 0.3 <= levy_stride(settings, Random(seed)) <= 4.0


def test_new_headings_of_the_stochastic_family_reach_all_around() -> None:
    rng = Random(5)
    angles_deg = [uniform_angle(observation(), EscapeSettings(), rng) for _ in range(2000)]
    assert min(angles_deg) < 2.0
    assert max(angles_deg) > 178.0
    assert sum(angles_deg) / 2000 == pytest.approx(90.0, abs=4.0)
