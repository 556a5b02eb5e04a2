"""Vehicles drawn at random, for which nobody chose gains, tests or limits.

Hulls of 0.9 to 6 m with fins at the tail, at a speed that grows with the root of the length, behind
a tailcone whose bandwidth is one to three times that of the turning hull.
"""

import math

import numpy as np

NAME = "drawn_"
"""Start of the name of a drawn vehicle; its number follows."""
GRAVITY_MPS2, DENSITY_KGPM3 = 9.81, 1025.0


def text(number: int, *, is_tailcone_known: bool = True) -> str:
    """Return the vehicle file of a number, always the same.

    Parameters
    ----------
    number : int
        Number of the vehicle, which is the seed of its dimensions.
    is_tailcone_known : bool
        Whether the file states the servo; without it the file has the travel only.

    Returns
    -------
    str
        Vehicle file (TOML); what it leaves out is derived.
    """
    rng = np.random.default_rng(number)
    length_m = math.exp(rng.uniform(math.log(0.9), math.log(6.0)))
    diameter_m = length_m / rng.uniform(5.0, 11.0)
    speed_mps = 0.55 * rng.uniform(0.35, 0.7) * math.sqrt(GRAVITY_MPS2 * length_m)
    volume_m3 = 0.9 * math.pi / 4.0 * diameter_m**2 * length_m
    buoyancy = 0.004 * rng.uniform(0.3, 1.2)
    hull = f"""name = "{NAME}{number}"

[hull]
shape = "cylinder"
length_m = {length_m:.3f}
diameter_m = {diameter_m:.3f}
nose_cap_m = {diameter_m * rng.uniform(0.5, 1.0):.3f}
tail_cap_m = {diameter_m * rng.uniform(0.8, 1.8):.3f}

[ballast]
net_buoyancy_n = {buoyancy * DENSITY_KGPM3 * GRAVITY_MPS2 * volume_m3:.2f}

[fins]
layout = "{rng.choice(["x", "cruciform"])}"
span_m = {diameter_m * rng.uniform(0.5, 0.9):.3f}
root_chord_m = {diameter_m * rng.uniform(0.45, 0.9):.3f}

[operating_point]
speed_mps = {speed_mps:.2f}

[tailcone]
travel_deg = {rng.uniform(12.0, 30.0):.1f}
"""
    servo = f"""\
natural_frequency_radps = {speed_mps / length_m * rng.uniform(3.0, 8.0):.2f}
damping_ratio = {rng.uniform(0.5, 1.0):.2f}
delay_s = {rng.uniform(0.03, 0.2):.3f}
rate_degps = {rng.uniform(12.0, 90.0):.1f}
"""
    return hull + servo if is_tailcone_known else hull
