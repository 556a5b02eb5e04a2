"""What a design must meet, and what it is when it does."""

from pathlib import Path
from typing import NamedTuple

from sysid.control_analysis.margins import Analysis
from sysid.monitor.performance_spec import PerformanceBaseline, encode


class DesignInfeasibleError(Exception):
    """No gains meet the specification on this model; the message says which limit fails and by how
    much."""


class Spec(NamedTuple):
    """Every limit may be set by whoever knows better."""

    damping: float = 0.6
    """Of every pole pair that shows in the motion."""
    gm_db: float = 8.0
    pm_deg: float = 55.0
    ms: float = 1.6
    """Largest sensitivity. Like `gm_db` and `pm_deg` it is asked of the nominal model at four cuts:
    rudder, heading error, elevator and depth error. The pitch error is not limited."""
    least_gm_db: float = 6.0
    least_pm_deg: float = 45.0
    """At the same four cuts on the vehicles that the model allows for, together with `damping`."""
    probability: float = 0.5
    """Of such a vehicle meeting them; below it a design is refused."""
    finish_s: float = 30.0
    finish_left: float = 0.15
    """Share of a constant load's largest error that an integrator may leave after ``finish_s``."""
    heading_step_deg: float = 20.0
    """Change of heading on which the rudder stays within the travel that the bias leaves."""
    travel_deg: float = 15.0
    rate_degps: float = 15.0
    depth_step_m: float = 3.0
    depth_overshoot: float = 0.10
    """Share of that change of depth."""
    pitch_rms_growth: float = 1.25
    """How much more pitch the sea may cause than under the initial gains, in exchange for depth."""
    pitch_per_metre_deg: float = 18.0
    """What a metre of depth may ask of the pitch. Small motion cannot tell much pitch for little
    elevator from the reverse; the pitch limit can."""
    command_noise_deg: float = 0.5
    """What the gyro's noise may move the command by, one standard deviation: it limits how far the
    lag is undone."""


class Response(NamedTuple):
    """Predicted answer to the identified disturbance, one standard deviation."""

    heading_deg: float
    pitch_deg: float
    depth_m: float
    rudder_deg: float
    elevator_deg: float


class DesignRobustness(NamedTuple):
    """How many of the vehicles that a model allows for meet what is asked, as shares of
    ``vehicles``."""

    specification: float
    relaxed: float
    """Damping 0.5, gain margin 5 dB, phase margin 40 degrees."""
    worst: str
    """The limit that most of the others miss; empty where all meet it."""
    vehicles: int


class Design(NamedTuple):
    gains: dict[str, float]
    reasons: dict[str, str]
    analysis: Analysis
    predicted: Response
    initial: Response
    """What the gains of Table 3's initial column would let through on the same model."""
    initial_analysis: Analysis
    spec: Spec
    trust: DesignRobustness | None
    """None for a model that does not say how sure it is."""
    promise: PerformanceBaseline

    def write_params(self, path: str | Path) -> None:
        """Parameter file: ``NAME,VALUE  # reason``, headed by what the gains rest on and promise
        (`sysid.monitor.performance_spec`)."""
        Path(path).write_text(encode(self.promise, self.gains, self.reasons), encoding="utf-8")


class Loads(NamedTuple):
    """Constant loads that the integrators must carry."""

    level_pitch_rad: float
    """Pitch of level flight, nose up."""
    rudder_rad: float
    """Rudder bias, as large as it may be."""
    elevator_rad: float
    """What is unsure about the elevator's trim."""
