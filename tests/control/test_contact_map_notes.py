"""What an algorithm remembers is written when it has changed, not too often or too much, and never at a run's cost."""

from __future__ import annotations

from tests.control.bench import Bench, Wanting
from tests.kit.workshop import AHEAD
from wayfarer.control.contact_map_notes import MOST
from wayfarer.escape.api import ContactMap

TRUNK = (2.0, -0.5, 2.0, 0.5, 0.754)


class Remembering(Wanting):
    """A handler with a memory that the test fills, and which counts how often it is asked."""

    def __init__(self) -> None:
        super().__init__()
        self.changes, self.asked = 1, 0
        self.seen_map = ContactMap(1.23456, 0.0, (TRUNK,), ((2.0, 1.0004),), "plan")

    def contact_map(self) -> ContactMap:
        self.asked += 1
        return self.seen_map


async def test_map_is_written_when_it_has_changed_and_at_most_once_a_second() -> None:
    handler = Remembering()
    bench = await Bench(handler).armed()
    await bench.tick(20)
    assert handler.asked == 0, "nothing has changed since the start"
    for _ in range(60):
        handler.changes += 1
        await bench.tick()
    await bench.tick(60)
    assert len(bench.log.named("contact_map")) == handler.asked == 4, "at once, after one, two and three seconds"
    assert bench.log.named("contact_map")[0] == {
        "ahead_m": 1.23, "right_m": 0.0, "trunks": [[2.0, -0.5, 2.0, 0.5, 0.75]], "way": [[2.0, 1.0]], "mode": "plan",
    }  # fmt: skip


async def test_of_many_trunks_the_nearest_are_written() -> None:
    handler = Remembering()
    trunks = tuple((float(ahead), 0.0, float(ahead), 1.0, 1.0) for ahead in range(100, 0, -1))
    handler.seen_map = handler.seen_map._replace(trunks=trunks, way=((3.0, 0.0),) * 100)
    bench = await Bench(handler).armed()
    handler.changes += 1
    await bench.tick()
    (noted,) = bench.log.named("contact_map")
    assert sorted(trunk[0] for trunk in noted["trunks"]) == [float(ahead) for ahead in range(1, MOST + 1)]
    assert len(noted["way"]) == MOST


async def test_map_that_cannot_be_read_ends_the_notes_and_not_the_run() -> None:
    handler = Remembering()
    handler.seen_map = handler.seen_map._replace(trunks=(("here",),))  # type: ignore[arg-type]
    bench = await Bench(handler).armed()
    for _ in range(60):
        handler.changes += 1
        await bench.tick()
    assert (handler.asked, bench.log.named("contact_map"), len(bench.log.named("viewer_failed"))) == (1, [], 1)
    assert (bench.wheels, bench.end) == (AHEAD, None)


async def test_count_of_changes_that_fails_ends_the_notes_and_not_the_run() -> None:
    handler = Remembering()
    bench = await Bench(handler).armed()
    del handler.changes
    await bench.tick(60)
    assert len(bench.log.named("viewer_failed")) == 1
    assert (bench.wheels, bench.end) == (AHEAD, None)


async def test_algorithm_without_a_memory_is_not_asked() -> None:
    bench = await Bench().armed()
    await bench.tick(20)
    assert not {"contact_map", "viewer_failed"} & {name for name, _ in bench.log.events}
