"""Tables of the paper, against each other.

Axes and symbols are the paper's (x forward, y port, z up).
"""

import math

from sysid.reproduction.discrepancies.record import Discrepancy, Sources
from sysid.reproduction.paper_tables import (
    TABLE_1_ADJUSTED,
    TABLE_1_INITIAL,
    TABLE_3_INITIAL,
)

FIGURE_7_BIAS_RAD = math.radians(6.0)
"""Rudder bias of figure 7 (rad)."""
HALF_LENGTH_M = 1.7715
"""Half of the total length of 3.543 m (m)."""


def places(sources: Sources) -> list[Discrepancy]:
    """Return the places with their evidence.

    Parameters
    ----------
    sources : Sources
        Derivation of Table 1 and search for the tailcone behind Table 4.

    Returns
    -------
    list of Discrepancy
        In the order of the paper.
    """
    return [_lever_arms(), _side_force(sources), _table_4(sources), _integrator_limit()]


def _lever_arms() -> Discrepancy:
    """Check the position of the duct that the adjusted column implies."""
    c = TABLE_1_ADJUSTED
    yaw, pitch = c.N_dr / c.Y_dr, c.M_de / c.Z_de
    initial = TABLE_1_INITIAL.N_dr / TABLE_1_INITIAL.Y_dr
    return Discrepancy(
        place="Table 1: adjusted N_dr / Y_dr and M_de / Z_de",
        printed="-513/264 and -514/-270",
        reading="the adjusted column is an effective model: its duct lies behind the hull's end",
        evidence=(
            f"lever arms {abs(yaw):.3f} and {abs(pitch):.3f} m ({abs(initial):.3f} m initially);"
            f" the hull ends at {HALF_LENGTH_M:.3f} m"
        ),
        values={"yaw_m": abs(yaw), "pitch_m": abs(pitch), "initial_m": abs(initial)},
        confirmed=min(abs(yaw), abs(pitch)) > HALF_LENGTH_M + 0.1 > abs(initial),
    )


def _side_force(sources: Sources) -> Discrepancy:
    """Check Y_v of the initial column."""
    formula, slip = sources.steps["Y_v"].value, sources.steps["Y_v slip"].value
    return Discrepancy(
        place="Table 1: Y_v and Z_w, initial",
        printed="-449",
        reading="the hull's lift was multiplied by U^2 a second time",
        evidence=f"the formulas give {formula:.0f} kg/s, with U^2 twice {slip:.1f}",
        values={"formula_kgps": formula, "twice_kgps": slip},
        confirmed=round(slip) == TABLE_1_INITIAL.Y_v != round(formula),
    )


def _table_4(sources: Sources) -> Discrepancy:
    """Check the consistency of Table 4 with Tables 1 and 3."""
    best = min(sources.readings, key=lambda reading: reading.misfit_radps)
    delays = [row.delay_s for row in sources.alone]
    sd_s = max(row.delay_sd_s for row in sources.alone)
    return Discrepancy(
        place="Table 4 with Tables 1 and 3",
        printed="nine dominant pole pairs",
        reading="contradictory: mass, x_CM and delay of each row are not printed",
        evidence=(
            f"of {len(sources.readings)} readings of the tailcone none explains all nine within"
            f" 10 %; the best one misses by {best.misfit_radps:.2f} rad/s rms. The rows alone imply"
            f" delays of {min(delays):.2f} to {max(delays):.2f} s, each +- {sd_s:.2f} s"
        ),
        values={
            "best_misfit_radps": best.misfit_radps,
            "smallest_delay_s": min(delays),
            "largest_delay_s": max(delays),
        },
        confirmed=all(reading.remain for reading in sources.readings)
        and max(delays) - min(delays) > 3.0 * sd_s,
    )


def _integrator_limit() -> Discrepancy:
    """Check the heading error that the rudder bias leaves with Table 3's first integrator limit."""
    limit, gain = TABLE_3_INITIAL["HDG_IMAX"], TABLE_3_INITIAL["HDG_P"]
    error_deg = math.degrees((FIGURE_7_BIAS_RAD - limit) / gain)
    return Discrepancy(
        place="Table 3: integrator limit 0.01; figure 7: bias of -6 deg; Table 5: +-2.5 deg",
        printed="no units of gains and limits, no trim",
        reading="gains in rad/rad, limits in rad; the vehicle was trimmed before Table 5",
        evidence=(
            f"untrimmed, the bias leaves a heading error of {error_deg:.1f} deg, where Table 5 has"
            " 2.5"
        ),
        values={"untrimmed_error_deg": error_deg},
        confirmed=error_deg > 2.0 * 2.5,
    )
