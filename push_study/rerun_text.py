"""What a re-run of a bag amounts to, for people."""

from collections.abc import Iterator

from push_record.compare import COSTS, WALL_TOPICS, Comparison
from push_record.parting import LIMITS, Parting
from push_study.rerun import Rerun

_SHOWN = 12  # bodies, and settings, that are listed


def lines_of(result: Rerun) -> Iterator[str]:
    """Lines for the terminal: how the two runs compare."""
    if result.comparison is not None:
        yield (
            f"not compared: /{', /'.join(WALL_TOPICS)} (sent by wall time), the fields "
            f"{' and '.join(COSTS)} (measured), the stamps of plans (wall time)"
        )
        yield from _compared(result.comparison)
        return
    yield "the bag is of live use: the re-run, in lockstep, need not equal it; how far they part:"
    yield from _parted(result)


def _compared(found: Comparison) -> Iterator[str]:
    if found.equal:
        yield f"equal to the bit: {found.messages} messages on {len(found.topics)} topics"
        return
    for line in found.settings[:_SHOWN]:
        yield f"scenario: {_named(line)}"
    if len(found.settings) > _SHOWN:
        yield f"scenario: and {len(found.settings) - _SHOWN} more values"
    first = found.first
    if first is None:
        yield f"different settings; {found.messages} messages are equal to the bit all the same"
        return
    yield f"first difference: {_named(str(first))}"
    yield f"  {'topic':32s} {'compared':>9s} {'unequal':>9s} {'bag only':>9s} {'re-run only':>12s}"
    for topic, count in sorted(found.topics.items(), key=lambda pair: pair[1].place):
        if not count.equal:
            yield (
                f"  {topic:32s} {count.pairs:9d} {count.unequal:9d} {count.only_first:9d} "
                f"{count.only_second:12d}"
            )
    equal = sum(t.equal for t in found.topics.values())
    yield f"  equal to the bit: the other {equal} of {len(found.topics)} topics"


def _named(text: str) -> str:
    return text.replace("in the first bag", "in the bag").replace("in the second", "in the re-run")


def _parted(result: Rerun) -> Iterator[str]:
    if not result.partings:
        yield "no body was seen in both"
        return
    items = [p for p in result.partings if p.name in result.run.scenario.objects]
    robots = [p for p in result.partings if p.name not in result.run.scenario.objects]
    robots.sort(key=lambda p: -p.largest[0])
    heads = "".join(f"{f'> {1e3 * limit:g} mm at':>14s}" for limit in LIMITS)
    yield f"  {'body':16s} {'largest':>11s} {'at':>9s} {'at the end':>12s}{heads} {'paths':>11s}"
    for parting in (items + robots)[:_SHOWN]:
        yield _row(parting)
    if len(items) + len(robots) > _SHOWN:
        yield f"  and {len(items) + len(robots) - _SHOWN} more robots, nearer than these"
    yield "  (paths: greatest distance from the path of the re-run, whatever the time)"
    if result.states:
        yield f"  {'state':32s} {'bag':>10s} {'re-run':>10s}"
    for name, *times in result.states:
        words = "".join(f"{'-':>11s}" if t is None else f"{t:9.2f} s" for t in times)
        yield f"  {name:32s}{words}"


def _row(parting: Parting) -> str:
    away, when = parting.largest
    times = [parting.beyond(limit) for limit in LIMITS]
    words = "".join(f"{'never':>14s}" if t is None else f"{t:12.2f} s" for t in times)
    return (
        f"  {parting.name:16s} {1e3 * away:8.1f} mm {when:7.2f} s {1e3 * parting.last:9.1f} mm"
        f"{words} {1e3 * parting.path:8.1f} mm"
    )
