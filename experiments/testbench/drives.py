"""The benches' drives, from 10 W to 100 kW; every value says where it comes from.

`source` names what is printed; all else is chosen here and marked in `chosen`.  Currents are peak
values.
"""

from typing import NamedTuple

import numpy as np


class Drive(NamedTuple):
    """Nominal data of one drive."""

    name: str
    source: str
    chosen: str
    power: float  # W
    pole_pairs: int
    resistance: float
    magnet: float  # Wb (map: flux at zero current)
    inductance: tuple[float, float]  # H at zero current (map: filled from it)
    # relative terms at rated current: 30, 12, 40, 22, 04
    saturation: tuple[float, float, float, float, float]
    current: float  # A peak, rated
    bias: float  # i_d reference under load over the rated current
    inertia: float
    speed: float  # mech rad/s, rated
    link: float  # V
    period: float  # s
    counter: float  # Hz clock of the PWM counter
    lines: int  # encoder counts a turn
    slots: int
    igbt: bool
    map: str = ""  # file under the folder of maps


DRIVES = (
    Drive(
        name="gimbal_10w",
        source="no single data sheet: what makers state of gimbal motors of the size 2804, "
        "12N14P (7 pole pairs, about "
        "2.8 ohm and 0.86 mH a phase, KV 140 rpm/V; flux = 60 / (2 pi sqrt3 KV 7))",
        chosen="inertia, saturation, drive",
        power=10.0,
        pole_pairs=7,
        resistance=2.8,
        magnet=5.63e-3,
        inductance=(0.86e-3, 0.95e-3),
        saturation=(0.03, 0.04, 0.02, 0.03, 0.03),
        current=1.4,
        bias=0.0,
        inertia=2.2e-6 * 2,
        speed=120.0,
        link=12.0,
        period=50e-6,
        counter=80e6,
        lines=16384,
        slots=12,
        igbt=False,
    ),
    Drive(
        name="flat_30w",
        source="maxon EC 45 flat 30 W, 24 V winding (catalogue): 8 pole pairs, 4.83 ohm and "
        "2.24 mH between terminals, 51 mN m/A, 92.5 g cm^2, 24 V, 4380 rpm without load; a phase "
        "has half, flux = 51e-3 / (sqrt3 8)",
        chosen="saturation, saliency 1.06, drive",
        power=30.0,
        pole_pairs=8,
        resistance=2.41,
        magnet=3.68e-3,
        inductance=(1.10e-3, 1.17e-3),
        saturation=(0.03, 0.03, 0.02, 0.02, 0.03),
        current=1.4,
        bias=0.0,
        inertia=9.25e-6,
        speed=290.0,
        link=24.0,
        period=50e-6,
        counter=84e6,
        lines=4096,
        slots=12,
        igbt=False,
    ),
    Drive(
        name="bly172s_53w",
        source="Anaheim BLY172S-24V-4000, 53 W, 4000 rpm, as Texas Instruments' motor file "
        "states it: 4 pole pairs, 0.411 ohm, 0.709 mH, 0.0328 V/Hz (flux = that / 2 pi), 5 A",
        chosen="saliency 1.12, inertia, saturation, drive",
        power=53.0,
        pole_pairs=4,
        resistance=0.411,
        magnet=5.22e-3,
        inductance=(0.68e-3, 0.76e-3),
        saturation=(0.05, 0.05, 0.03, 0.04, 0.05),
        current=3.5,
        bias=0.0,
        inertia=4.8e-6 * 2,
        speed=300.0,
        link=24.0,
        period=66.6666667e-6,
        counter=60e6,
        lines=4000,
        slots=24,
        igbt=False,
    ),
    Drive(
        name="servo_400w",
        source="Estun EMJ-04APB22, 400 W, as Texas Instruments' motor file states it: 4 pole "
        "pairs, 2.368 ohm, "
        "8.366 mH, 0.3905 V/Hz (flux = that / 2 pi), inertia 3.1e-5 kg m^2, 10 000 counts",
        chosen="saliency 1.1, saturation, drive",
        power=400.0,
        pole_pairs=4,
        resistance=2.368,
        magnet=0.0622,
        inductance=(8.0e-3, 8.8e-3),
        saturation=(0.06, 0.06, 0.04, 0.05, 0.06),
        current=3.9,
        bias=0.0,
        inertia=3.1e-5 * 3,
        speed=314.0,
        link=310.0,
        period=100e-6,
        counter=60e6,
        lines=10000,
        slots=12,
        igbt=True,
    ),
    Drive(
        name="ipm_2kw",
        source="2.2 kW, 1500 rpm, 4.3 A rms: 3 pole pairs, 3.6 ohm, 36 and 51 mH, 0.545 Wb, "
        "0.015 kg m^2 (Harnefors; used in many papers of the Aalto group, e.g. Hinkkan et al., "
        "IEEE Trans. Ind. Appl. 52(4), 2016)",
        chosen="saturation, drive",
        power=2200.0,
        pole_pairs=3,
        resistance=3.6,
        magnet=0.545,
        inductance=(36e-3, 51e-3),
        saturation=(0.06, 0.10, 0.05, 0.06, 0.08),
        current=6.1,
        bias=-0.15,
        inertia=0.015,
        speed=140.0,
        link=540.0,
        period=125e-6,
        counter=100e6,
        lines=4096,
        slots=36,
        igbt=True,
    ),
    Drive(
        name="axial_100kw",
        source="EMRAX 228 medium voltage, combined cooling, 100 kW class (maker's data as a "
        "university drive model repeats them): 10 pole pairs, 76 and 79 uH, 0.0355 Wb, 0.0421 kg "
        "m^2, 470 V, 160 A rms continuous",
        chosen="7.5 mohm cold (the model's 60 mohm includes cables), saturation, drive",
        power=100e3,
        pole_pairs=10,
        resistance=7.5e-3,
        magnet=0.0355,
        inductance=(76e-6, 79e-6),
        saturation=(0.04, 0.06, 0.02, 0.03, 0.05),
        current=226.0,
        bias=0.0,
        inertia=0.0421,
        speed=260.0,
        link=400.0,
        period=50e-6,
        counter=100e6,
        lines=16384,
        slots=18,
        igbt=True,
    ),
    Drive(
        name="pmsyrm_baldor",
        source="Baldor ECS101M0H7EF4, 5.6 kW, 2 pole pairs, 8.8 A rms, 0.63 ohm, 0.05 kg "
        "m^2, 540 V: flux map measured at 400 rpm (motulator's data sets, Aalto University)",
        chosen="drive",
        power=5600.0,
        pole_pairs=2,
        resistance=0.63,
        magnet=0.444,
        inductance=(0.0, 0.0),
        saturation=(0, 0, 0, 0, 0),
        current=12.4,
        bias=-0.35,
        inertia=0.05,
        speed=150.0,
        link=540.0,
        period=125e-6,
        counter=90e6,
        lines=8192,
        slots=36,
        igbt=True,
        map="baldor_pmsyrm/baldor_meas.npz",
    ),
    Drive(
        name="hsm_28kw",
        source="Brusa HSM1.10.18.04, 25-28 kW, 5 pole pairs, 78 A rms, 283 V, 408 Hz, 49 N "
        "m: flux map measured (motulator's data sets)",
        chosen="17 mohm, 0.016 kg m^2, drive",
        power=28e3,
        pole_pairs=5,
        resistance=0.017,
        magnet=0.0426,
        inductance=(0.0, 0.0),
        saturation=(0, 0, 0, 0, 0),
        current=95.0,
        bias=-0.4,
        inertia=0.016,
        speed=330.0,
        link=400.0,
        period=83.3333333e-6,
        counter=75e6,
        lines=4096,
        slots=30,
        igbt=True,
        map="brusa_hsm1/brusa_meas.npz",
    ),
    Drive(
        name="thor_5kw",
        source="THOR, 5 kW PM-assisted synchronous reluctance motor of the SyR-e project: 2 "
        "pole pairs, 0.1967 ohm, "
        "22 A, 310 V, 0.00423 kg m^2; flux maps, core losses and harmonics by finite elements",
        chosen="drive",
        power=5000.0,
        pole_pairs=2,
        resistance=0.1967,
        magnet=0.15,
        inductance=(0.0, 0.0),
        saturation=(0, 0, 0, 0, 0),
        current=22.0,
        bias=-0.4,
        inertia=0.00423 * 2,
        speed=180.0,
        link=310.0,
        period=100e-6,
        counter=100e6,
        lines=8192,
        slots=24,
        igbt=True,
        map="thor_fea/thor_fea.npz",
    ),
)


def alphas(drive: Drive) -> np.ndarray:
    """The five coefficients whose relative terms at rated current are `saturation`: 30, 12, 40, 22,
    04.

    With f = L I: 3 a30 f_d^2, a12 f_q^2 ... over the linear current, e.g. a30 = r30 / (3 L_d^2 I).
    """
    l_d, l_q = drive.inductance
    i = drive.current
    r30, r12, r40, r22, r04 = drive.saturation
    return np.array(
        [
            r30 / (3 * l_d**2 * i),
            r12 / (2 * l_d * l_q * i),
            r40 / (4 * l_d**3 * i**2),
            r22 / (2 * l_d * l_q * max(l_d, l_q) * i**2),
            r04 / (4 * l_q**3 * i**2),
        ]
    )
