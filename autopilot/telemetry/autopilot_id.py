"""Names of the autopilots as which the vehicle can identify itself.

The command line shows them, so this module loads nothing else.
"""

from enum import StrEnum


class AutopilotId(StrEnum):
    """Autopilot that the vehicle identifies as; ``autopilot.identities`` has the records.

    With ``px4`` the mode buttons of QGroundControl work; ``ardupilot`` is for tools that know only
    ArduPilot.
    """

    GENERIC = "generic"
    PX4 = "px4"
    ARDUPILOT = "ardupilot"
