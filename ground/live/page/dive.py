"""One dive on the live page: history, latest messages, texts, plan and estimate."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ground.client.commands import listed_mode_name
from ground.client.vehicle import StatusText
from ground.live import plausible
from ground.live.page import plan
from ground.live.page.history import History, Row
from ground.live.watch import rows
from ground.live.watch.receiver import MAX_TEXTS, LatestMessage, ReceivedText, after
from ground.live.watch.view import HEARTBEAT_TIMEOUT_S, WARNING
from mavlink_io.clock import wall_s
from mavlink_io.codec import Frame
from mavlink_io.dialect import by_name, constant
from mavlink_io.frames import euler_from_quaternion
from mavlink_io.mission_items import GLOBAL_SCALE, MissionItem
from mavlink_io.vehicle_clock import VehicleClock
from sysid.data.dataset import DEFAULT_TRAVEL_DEG
from sysid.data.readers.servo_channels import FIRST_THREE, PULSE_CENTRE_US, PULSE_HALF_US

ROW_PERIOD_S = 0.1
"""Vehicle time between two rows of the history."""
PANEL_PERIOD_S = 0.5
"""Wall time for which a panel is reused: texts and ages change more slowly than the picture."""
SETPOINT_TIMEOUT_S = 5.0
"""Wall time after which a set-point is no longer shown."""
PULSE_SOURCE = "SERVO_OUTPUT_RAW"
_IGNORE_DEPTH, _IGNORE_ATTITUDE = 1 << 2, 1 << 7
"""Bits of POSITION_TARGET_LOCAL_NED.type_mask and of ATTITUDE_TARGET.type_mask."""
_GENERIC = constant("MAV_AUTOPILOT_GENERIC")
_NAME = {
    by_name(name).message_id: name
    for name in {source for _, _, sources in rows.ROWS for source, _ in sources}
    | {
        "ATTITUDE_TARGET",
        "POSITION_TARGET_LOCAL_NED",
        "ACTUATOR_OUTPUT_STATUS",
        PULSE_SOURCE,
        "AVAILABLE_MODES",
    }
}
"""Names of the messages that the page uses, by number."""


class LinkCounts(NamedTuple):
    """Counts of the link since it was opened."""

    messages: int = 0
    received_bytes: int = 0
    lost: int = 0
    rejected: int = 0


class ShownDive:
    """Everything that the page shows of one dive. It is not safe for threads: `PageState` is.

    Parameters
    ----------
    name : str
        Name of the dive, or address of the link.
    travel_deg : float
        Deflection of the control surfaces at an output of 1 (deg).
    """

    def __init__(self, name: str, travel_deg: float = DEFAULT_TRAVEL_DEG) -> None:
        self.name, self.travel_deg = name, travel_deg
        self.latest: dict[str, LatestMessage] = {}
        """Decoded messages, as `rows` reads them; updated by `panel`."""
        self.modes: dict[int, str] = {}
        self.history = History()
        self.items: Sequence[MissionItem] = ()
        self.counts = LinkCounts()
        self.estimate: Mapping[str, Any] | None = None
        self.trouble, self.ended = "", ""
        self._frames: dict[str, LatestMessage] = {}
        self._texts: deque[ReceivedText] = deque(maxlen=MAX_TEXTS)
        self._origin: plan.Origin | None = None
        self._began_s = self._panel_s = wall_s()
        self._rated = self._began_s, LinkCounts()
        self._rates = 0.0, 0.0
        self._panel: dict[str, Any] | None = None
        self._clock, self._time_s = VehicleClock(), -math.inf
        self._drawn: tuple[object, plan.DrawnPlan] | None = None

    def on_frame(self, frame: Frame) -> None:
        """Store a frame of the vehicle's autopilot; add a row when one is due."""
        name = _NAME.get(frame.message_id)
        if name is None:
            return
        if name == "AVAILABLE_MODES":
            message = frame.decode()
            self.modes[message.custom_mode] = listed_mode_name(message)
            return
        before = self._frames.get(name)
        self._frames[name] = after(before, frame, wall_s())
        has_no_attitude = "ATTITUDE" not in self._frames and before is not None
        if name == "ATTITUDE" or (name in _POSITIONS and has_no_attitude):
            self._sample(int.from_bytes(frame.payload[:4].ljust(4, b"\0"), "little"))

    def on_text(self, text: StatusText) -> None:
        """Store a text of the vehicle."""
        self._texts.append(ReceivedText(wall_s(), text.severity, text.text))
        self._panel = None

    def end(self, reason: str) -> None:
        """Show that the dive or its link has ended."""
        self.ended, self._panel = reason, None

    def plan(self) -> plan.DrawnPlan:
        """Return waypoints and fence in metres."""
        key = self.items, self._origin
        if self._drawn is None or self._drawn[0] != key:
            self._drawn = key, plan.draw(self.items, self._origin)
        return self._drawn[1]

    def panel(self) -> dict[str, Any]:
        """Return mode, rows, link, texts and estimate as JSON values."""
        now_s = wall_s()
        if self._panel is None or now_s - self._panel_s > PANEL_PERIOD_S:
            self._panel, self._panel_s = self._make_panel(now_s), now_s
        return self._panel

    def _make_panel(self, now_s: float) -> dict[str, Any]:
        self.latest = {
            name: LatestMessage(plausible.decode(kept.message), kept.at_s, kept.period_s)
            for name, kept in self._frames.items()
        }
        every = rows.rows(self, now_s)
        heartbeat = self.latest.get("HEARTBEAT")
        return {
            "name": self.name,
            "known": heartbeat is not None,
            "has_surfaces": self._has_surfaces(),
            "rows": [
                {
                    "section": row.section,
                    "label": row.label,
                    "text": row.cell.text,
                    "alarm": row.cell.alarm,
                    "age": f"{row.age_s:.0f} s ago" if row.stale and row.age_s else "",
                }
                for row in every
                if row.cell is not None
            ],
            "sequence": self._current_item(),
            "link": self._link(now_s, heartbeat),
            "texts": [
                {
                    "text": text.text,
                    "age": f"{now_s - text.at_s:.0f} s ago",
                    "level": "alarm"
                    if text.severity < WARNING
                    else "warning"
                    if text.severity == WARNING
                    else "",
                }
                for text in reversed(self._texts)
            ],
            "estimate": self.estimate,
        }

    def _link(self, now_s: float, heartbeat: LatestMessage | None) -> dict[str, Any]:
        """Return the state of the link and its rates over the last panel period."""
        span_s, before = now_s - self._rated[0], self._rated[1]
        if span_s > 2.0 * PANEL_PERIOD_S:
            self._rates = (
                (self.counts.messages - before.messages) / span_s,
                (self.counts.received_bytes - before.received_bytes) / span_s / 1e3,
            )
            self._rated = now_s, self.counts
        silent_s = now_s - (heartbeat.at_s if heartbeat else self._began_s)
        if self.ended:
            state, words = "ended", self.ended
        elif heartbeat is None:
            state, words = "waiting", f"no vehicle yet, after {silent_s:.0f} s"
        elif silent_s > HEARTBEAT_TIMEOUT_S:
            state, words = "silent", f"no heartbeat for {silent_s:.0f} s"
        else:
            state, words = "live", "connected"
        return {
            "state": state,
            "text": f"{words}: {self.trouble}" if self.trouble else words,
            "messages_per_s": round(self._rates[0]),
            "kb_per_s": round(self._rates[1], 1),
            "lost": self.counts.lost,
            "rejected": self.counts.rejected,
        }

    def _current_item(self) -> int | None:
        current = self.latest.get("MISSION_CURRENT")
        if current is None or not math.isfinite(current.message.seq):
            return None
        return int(current.message.seq)

    def _has_surfaces(self) -> bool:
        """Return whether outputs 1 to 3 are rudder, elevator and thrust, as of our autopilot."""
        heartbeat = self._message("HEARTBEAT")
        return heartbeat is not None and heartbeat.autopilot == _GENERIC

    def _message(self, name: str, timeout_s: float = math.inf) -> Any | None:
        """Return the newest message of a name; None without one, or if it is too old."""
        kept = self._frames.get(name)
        if kept is None or wall_s() - kept.at_s > timeout_s:
            return None
        return plausible.decode(kept.message)

    def _sample(self, time_boot_ms: int) -> None:
        """Add a row to the history if one is due; start again after a restart of the clock."""
        reading = self._clock.read(1000 * time_boot_ms)
        time_s = reading.time_us * 1e-6
        if reading.restarted:
            self.history.clear()
            self._origin = None
        elif not reading.valid or time_s < self._time_s + ROW_PERIOD_S - 1e-6:
            return
        self._time_s = time_s
        north_m, east_m, depth_m = self._position()
        attitude = self._message("ATTITUDE")
        angles: list[float | None] = [None] * 3
        if attitude is not None:
            angles = [
                math.degrees(attitude.yaw) % 360.0,
                math.degrees(attitude.pitch),
                math.degrees(attitude.roll),
            ]
        self.history.add(
            _rounded(
                time_s,
                depth_m,
                *angles,
                *self._outputs(),
                *self._setpoints(),
                north_m,
                east_m,
            )
        )

    def _position(self) -> tuple[float | None, float | None, float | None]:
        """Return north, east and depth (m); and learn the place of the local frame's zero."""
        local, place = self._message("LOCAL_POSITION_NED"), self._message("GLOBAL_POSITION_INT")
        if place is not None and not rows.has_position(place):
            place = None
        is_located = local is not None and math.isfinite(local.x) and math.isfinite(local.y)
        if place is not None and self._origin is None and (local is None or is_located):
            here = plan.Origin(place.lat / GLOBAL_SCALE, place.lon / GLOBAL_SCALE)
            self._origin = here.moved(-local.x, -local.y) if local else here
        if local is not None:
            return (local.x, local.y, local.z) if is_located else (None, None, local.z)
        if place is not None and self._origin is not None:
            north_m, east_m = self._origin.local_m(
                place.lat / GLOBAL_SCALE, place.lon / GLOBAL_SCALE
            )
            return north_m, east_m, -place.relative_alt / 1000.0
        hud = self._message("VFR_HUD")
        return None, None, None if hud is None else -hud.alt

    def _outputs(self) -> list[float | None]:
        """Return rudder and elevator (deg) and thrust (%); of other vehicles outputs 1 to 3 (%)."""
        fractions: list[float]
        status, pulses = self._message("ACTUATOR_OUTPUT_STATUS"), self._message(PULSE_SOURCE)
        if status is not None:
            fractions = [status.actuator[number - 1] for number in FIRST_THREE]
        elif pulses is not None:
            values = [getattr(pulses, f"servo{number}_raw") for number in FIRST_THREE]
            fractions = [(us - PULSE_CENTRE_US) / PULSE_HALF_US if us else 0.0 for us in values]
        else:
            return [None] * 3
        angle = self.travel_deg if self._has_surfaces() else 100.0
        return [fractions[0] * angle, fractions[1] * angle, fractions[2] * 100.0]

    def _setpoints(self) -> list[float | None]:
        """Return the set-points of depth (m), heading and pitch (deg)."""
        target = self._message("POSITION_TARGET_LOCAL_NED", SETPOINT_TIMEOUT_S)
        attitude = self._message("ATTITUDE_TARGET", SETPOINT_TIMEOUT_S)
        depth_m = None if target is None or target.type_mask & _IGNORE_DEPTH else target.z
        if attitude is None or attitude.type_mask & _IGNORE_ATTITUDE:
            return [depth_m, None, None]
        if not all(map(math.isfinite, attitude.q)):
            return [depth_m, None, None]
        _, pitch_rad, yaw_rad = euler_from_quaternion(*attitude.q)
        return [depth_m, math.degrees(yaw_rad) % 360.0, math.degrees(pitch_rad)]


_POSITIONS = ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED")


def _rounded(*values: float | None) -> Row:
    """Return the values with three decimals; None instead of infinity and NaN."""
    return tuple(
        round(value, 3) if value is not None and math.isfinite(value) else None for value in values
    )
