import numpy as np

from estimator.randomness import Stream, generator


def first(seed: int, stream: Stream, number: int = 0) -> float:
    return float(generator(seed, stream, number).random())


def test_a_stream_depends_on_seed_purpose_and_number_only() -> None:
    assert first(1, Stream.PROGRAMS, 2) == first(1, Stream.PROGRAMS, 2)
    drawn = [
        first(seed, stream, number) for seed in (1, 2) for stream in Stream for number in (0, 1)
    ]
    assert len(set(drawn)) == len(drawn)


def test_the_search_can_save_its_generator() -> None:
    assert isinstance(generator(1, Stream.SEARCH).bit_generator, np.random.PCG64)
