"""Routing between links: the rules of https://mavlink.io/en/guide/routing.html."""

from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from autopilot.comms.routing import Router, target_of
from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.request import MavlinkId

OWN = MavlinkId(1, 1)
LINKS = ("udp", "tcp", "serial")
systems, components = st.integers(0, 4), st.integers(0, 3)
parties = st.builds(MavlinkId, st.integers(1, 4), st.integers(1, 3))
traffic = st.lists(st.tuples(parties, st.sampled_from(LINKS)), max_size=12)


def frame_to(target: MavlinkId, sender: MavlinkId) -> Frame:
    message = mavlink.MAVLink_command_long_message(
        target.system, target.component, 400, 0, 1, 0, 0, 0, 0, 0, 0
    )
    (frame,) = Framer().feed(
        message.pack(mavlink.MAVLink(None, srcSystem=sender.system, srcComponent=sender.component))
    )
    return frame


def routed(received: list[tuple[MavlinkId, str]]) -> Router[str]:
    router: Router[str] = Router(OWN)
    for party, link in received:
        router.learn(party, link)
    return router


@given(traffic, systems, components, parties, st.sampled_from(LINKS))
def test_destinations_follow_mavlink_rules(
    received: list[tuple[MavlinkId, str]],
    system: int,
    component: int,
    sender: MavlinkId,
    arrival: str,
) -> None:
    destinations = routed(received).destinations(
        frame_to(MavlinkId(system, component), sender), arrival, LINKS
    )
    assert arrival not in destinations, "not back to its link"
    assert len(set(destinations)) == len(destinations), "each link once"
    if sender == OWN or (system, component) == OWN:
        assert destinations == []
    elif system == 0:
        assert set(destinations) == set(LINKS) - {arrival}
    else:
        meant = {
            link
            for party, link in received
            if party.system == system and component in (0, party.component)
        }
        assert set(destinations) == meant - {arrival}


def test_forgotten_link_is_no_destination() -> None:
    router = routed([(MavlinkId(9, 1), "udp"), (MavlinkId(9, 1), "tcp")])
    router.forget("udp")
    assert router.destinations(frame_to(MavlinkId(9, 1), MavlinkId(7, 7)), "serial", LINKS) == [
        "tcp"
    ]


def test_signing_keys_and_radio_status_are_not_forwarded() -> None:
    for name in ("SETUP_SIGNING", "RADIO_STATUS"):
        message = dialect.by_name(name)
        (frame,) = Framer().feed(encode(message, message.unpack(b""), 0, 9, 9))
        assert routed([]).destinations(frame, "udp", LINKS) == []


KNOWN = [name for name in dialect.names() if hasattr(mavlink, f"MAVLINK_MSG_ID_{name}")]


@given(st.sampled_from(KNOWN), systems, st.integers(0, 255))
@example("TEST_TYPES", 0, 0)
def test_target_matches_pymavlink(name: str, system: int, component: int) -> None:
    message = dialect.by_name(name)
    fields: dict[str, Any] = message.unpack(b"")._asdict()
    fields |= {
        key: value
        for key, value in (("target_system", system), ("target_component", component))
        if key in fields
    }
    if name == "MANUAL_CONTROL":
        fields["target"] = system
    (frame,) = Framer().feed(encode(message, message.values(**fields), 0, 9, 9))
    decoded = mavlink.MAVLink(None).parse_buffer(frame.raw)[0].to_dict()
    expected = decoded.get(
        "target_system", decoded.get("target", 0) if name == "MANUAL_CONTROL" else 0
    )
    assert target_of(frame) == (expected, decoded.get("target_component", 0))
