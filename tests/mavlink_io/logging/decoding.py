"""Decode every message of a log with the MCAP project's own decoders."""

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros1.decoder import DecoderFactory as Ros1DecoderFactory


class JsonDecoderFactory(DecoderFactory):
    """Decode the JSON channels; the mcap package has no decoder for them."""

    def decoder_for(self, encoding: str, schema: Schema | None) -> Callable[[bytes], Any] | None:
        return json.loads if encoding == "json" else None


def decode(path: Path) -> tuple[str, int, Counter[str]]:
    """Return profile, number of messages by the statistics, and decoded messages by encoding."""
    counts: Counter[str] = Counter()
    with path.open("rb") as file:
        factories = [Ros1DecoderFactory(), JsonDecoderFactory()]
        reader = make_reader(file, validate_crcs=True, decoder_factories=factories)
        for _, channel, _, decoded in reader.iter_decoded_messages():
            assert decoded is not None
            counts[channel.message_encoding] += 1
        summary = reader.get_summary()
        profile = reader.get_header().profile
    assert summary is not None
    assert summary.statistics is not None
    return profile, summary.statistics.message_count, counts
