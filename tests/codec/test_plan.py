import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.plan import plan
from ahgateway.errors import CodecError

H, C = Table.HOLDING, Table.COIL


def test_the_manual_example_takes_one_request_for_flags_and_two_for_words() -> None:
    spans = [Span(C, n, 1) for n in (1, 2, 3, 4)] + [Span(H, n, 2) for n in range(100, 122, 2)]
    spans += [Span(H, 122, 12), Span(H, 200, 2)]
    assert plan(spans, unit=1) == (Read(1, C, 1, 4), Read(1, H, 100, 34), Read(1, H, 200, 2))


def test_a_gap_is_read_through_up_to_its_limit_and_no_further() -> None:
    assert plan([Span(H, 0, 2), Span(H, 18, 2)], unit=1, gap_max=16) == (Read(1, H, 0, 20),)
    assert plan([Span(H, 0, 2), Span(H, 19, 2)], unit=1, gap_max=16) == (Read(1, H, 0, 2), Read(1, H, 19, 2))


def test_a_request_ends_at_its_limit_without_splitting_a_span() -> None:
    spans = [Span(H, n, 2) for n in range(0, 104, 2)]
    assert plan(spans, unit=1, words_max=99) == (Read(1, H, 0, 98), Read(1, H, 98, 6))


def test_nothing_is_merged_across_a_seam() -> None:
    def exists(span: Span) -> bool:
        return span.end <= 0x2000 or span.address >= 0x2000

    spans = [Span(H, 0x1FFE, 2), Span(H, 0x2000, 2)]
    assert plan(spans, unit=1, exists=exists) == (Read(1, H, 0x1FFE, 2), Read(1, H, 0x2000, 2))


def test_overlapping_spans_are_read_once() -> None:
    assert plan([Span(H, 10, 20), Span(H, 12, 2), Span(H, 28, 4)], unit=7) == (Read(7, H, 10, 22),)


def test_tables_are_never_mixed_and_come_in_the_order_of_the_standard() -> None:
    spans = [Span(Table.INPUT, 1, 1), Span(H, 1, 1), Span(Table.DISCRETE, 1, 1), Span(C, 1, 1)]
    assert [read.table for read in plan(spans, unit=1)] == [C, Table.DISCRETE, H, Table.INPUT]


def test_a_span_longer_than_a_request_is_refused() -> None:
    with pytest.raises(CodecError, match=r"20 from holding register 0x0064 belong together, but a request may hold 16"):
        plan([Span(H, 100, 20)], unit=1, words_max=16)


@settings(max_examples=80)
@given(
    st.lists(st.builds(Span, st.sampled_from([H, C]), st.integers(0, 400), st.integers(1, 20)), max_size=20),
    st.integers(20, 125),
    st.integers(0, 30),
)
def test_every_span_lies_whole_in_a_request_whatever_the_order(spans: list[Span], words_max: int, gap_max: int) -> None:
    reads = plan(spans, unit=1, words_max=words_max, bits_max=words_max, gap_max=gap_max)
    assert reads == plan(reversed(spans), unit=1, words_max=words_max, bits_max=words_max, gap_max=gap_max)
    assert all(read.count <= words_max for read in reads)
    for span in spans:
        assert any(
            read.table is span.table and read.address <= span.address and span.end <= read.address + read.count
            for read in reads
        )
