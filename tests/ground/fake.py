"""A scripted fake vehicle on a memory transport, with the servers of mavlink_io."""

from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

from mavlink_io.codec import Frame
from mavlink_io.dialect import by_name, constant
from mavlink_io.endpoint import Endpoint
from mavlink_io.mission_items import MavCmd, MissionItem
from mavlink_io.services.mission_server import MissionProgress, MissionResult, MissionServer
from mavlink_io.services.params import ParamServer
from mavlink_io.transport import MemoryTransport, open_transport

ACCEPTED, REJECTED, DENIED = 0, 1, 2
MODES = (("", 6, 67371008), ("MANUAL", 0, 65536))
"""(name, standard mode, custom mode); the first leaves out the name of a standard mode."""
_names = count()


ROOM_BYTES = 1000


class Table:
    """Parameters in a dictionary."""

    def __init__(self, values: dict[str, float]) -> None:
        self.values = values

    def names(self) -> Sequence[str]:
        return sorted(self.values)

    def get(self, name: str) -> float:
        return self.values[name]

    def set(self, name: str, value: float) -> float:
        self.values[name] = value
        return value


class Store:
    """One mission."""

    def __init__(self) -> None:
        self.items: Sequence[MissionItem] = ()
        self.progress = MissionProgress(0, 0, 0, 0)

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        self.items = items
        return MissionResult()

    def set_current(self, sequence: int) -> bool:
        return sequence < len(self.items)

    def go_to(self, item: MissionItem) -> MissionResult:
        raise AssertionError(item)

    def explain(self, text: str) -> None:
        raise AssertionError(text)


class FakeVehicle:
    """Call ``step`` whenever ground waits.

    ``answers`` maps a command to its results; the last one is repeated.
    """

    def __init__(
        self,
        answers: dict[int, list[int]] | None = None,
        parameters: dict[str, float] | None = None,
    ) -> None:
        name = f"memory:fake-{next(_names)}"
        self.ground_end = open_transport(name)
        self._end: MemoryTransport = open_transport(name)  # type: ignore[assignment]
        self._endpoint = Endpoint(self._end, 1, 1)
        self.table = Table({"HDG_P": 0.65, "DPT_P": 0.13, **(parameters or {})})
        self.store = Store()
        self._params = ParamServer(self.table, self._endpoint.send, self.send_text)
        self._missions = MissionServer(self.store)
        self.answers = answers or {}
        self.commands: list[Any] = []
        self.mute = False
        self.modes: tuple[tuple[str, int, int], ...] = MODES
        self.lists_modes, self.enters_modes = True, True
        """Whether it answers requests of AVAILABLE_MODES, and enters an accepted mode."""
        self.after: dict[int, Callable[[], None]] = {}
        """Called after the acknowledgement of a command."""
        self.armed, self.custom_mode = False, 0
        self.prearm: bool | None = None
        """Pre-arm state in a requested SYS_STATUS; None: SYS_STATUS is never sent."""

    def heartbeat(
        self, *, armed: bool | None = None, kind: int = 12, autopilot: int = 0, status: int = 4
    ) -> None:
        self.armed = self.armed if armed is None else armed
        base_mode = 1 | (128 if self.armed else 0)
        fields = {"custom_mode": self.custom_mode, "system_status": status, "mavlink_version": 3}
        self._endpoint.send(
            "HEARTBEAT", type=kind, autopilot=autopilot, base_mode=base_mode, **fields
        )

    def send_high_latency(self) -> None:
        fields = dict.fromkeys((field.name for field in by_name("HIGH_LATENCY2").fields), 0)
        self._endpoint.send("HIGH_LATENCY2", **fields | {"type": 12})

    def send_text(self, text: str, **fields: int) -> None:
        self._endpoint.send("STATUSTEXT", severity=4, text=text, **fields)

    def step(self) -> None:
        for frame in self._endpoint.receive():
            if not self.mute:
                self._serve(frame)
        self._params.poll()

    def close(self) -> None:
        self._end.close()
        self.ground_end.close()

    def _serve(self, frame: Frame) -> None:
        if frame.name == "COMMAND_LONG":
            self._command(frame.decode())
        elif frame.name.startswith("PARAM"):
            self._params.feed(frame, self._endpoint.send, lambda: ROOM_BYTES)
        elif frame.name.startswith("MISSION"):
            self._missions.feed(frame, self._endpoint.send, 0.0)

    def _command(self, message: Any) -> None:
        self.commands.append(message)
        if message.command == MavCmd.REQUEST_MESSAGE:
            if message.param1 == constant("MAVLINK_MSG_ID_SYS_STATUS"):
                self._send_status()
            else:
                self._send_modes()
        results = self.answers.get(message.command, [ACCEPTED])
        result = results.pop(0) if len(results) > 1 else results[0]
        if result == REJECTED:
            self.send_text("Not armed: no sensors")
        addressed = {
            "target_system": 250,
            "target_component": 190,
            "result_param2": 0,
            "progress": 0,
        }
        self._endpoint.send("COMMAND_ACK", command=message.command, result=result, **addressed)
        if message.command == MavCmd.DO_SET_MODE and result == ACCEPTED:
            self.custom_mode = int(message.param2) if self.enters_modes else self.custom_mode
            self.heartbeat()
        if message.command in self.after:
            self.after[message.command]()

    def _send_status(self) -> None:
        if self.prearm is not None:
            prearm = constant("MAV_SYS_STATUS_PREARM_CHECK")
            fields = dict.fromkeys((field.name for field in by_name("SYS_STATUS").fields), 0)
            fields["onboard_control_sensors_present"] = prearm
            fields["onboard_control_sensors_health"] = prearm if self.prearm else 0
            self._endpoint.send("SYS_STATUS", **fields)

    def _send_modes(self) -> None:
        for index, (name, standard, custom) in enumerate(
            self.modes if self.lists_modes else (), start=1
        ):
            self._endpoint.send(
                "AVAILABLE_MODES",
                number_modes=len(self.modes),
                mode_index=index,
                standard_mode=standard,
                custom_mode=custom,
                properties=0,
                mode_name=name,
            )


def step_while_waiting(fake: FakeVehicle) -> Callable[..., None]:
    """A stand-in for ``link.transport.wait`` that lets the fake vehicle answer."""

    def wait(transports: Sequence[Any], timeout_s: float) -> None:
        fake.step()

    return wait
