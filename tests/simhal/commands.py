"""A command that must succeed, and what a report says of a campaign."""

from __future__ import annotations

from tests.conftest import Run
from wayfarer.experiments.results import Results


def succeed(run: Run, *arguments: object) -> str:
    """Return what it prints."""
    code, out, err = run(*arguments)
    assert code == 0, err
    return out


def facts_of(results: Results) -> dict[str, str]:
    """Return what the head of the report says."""
    from wayfarer.reports.campaign import how_made  # and Bokeh with it

    return dict(how_made(results.plan.base))
