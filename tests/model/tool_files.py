"""Configurations of motors as four tools write them."""

VESC = """<?xml version="1.0" encoding="UTF-8"?>
<MCConfiguration><foc_motor_r>0.015</foc_motor_r><foc_motor_l>7e-06</foc_motor_l>
<foc_motor_ld_lq_diff>2e-06</foc_motor_ld_lq_diff><foc_motor_flux_linkage>0.00245</foc_motor_flux_linkage>
<si_motor_poles>14</si_motor_poles><l_current_max>60</l_current_max><foc_f_zv>30000</foc_f_zv>
<si_battery_cells>6</si_battery_cells></MCConfiguration>"""
ODRIVE = {
    "axis0.config.motor.phase_resistance": 0.04,
    "axis0.config.motor.phase_inductance": 2e-5,
    "axis0.config.motor.torque_constant": 0.03,
    "axis0.config.motor.pole_pairs": 7,
    "axis0.config.motor.current_soft_max": 50.0,
}
MOTEUS = (
    "motor.poles 14\nmotor.resistance_ohm 0.05\nmotor.v_per_hz 0.109\nservo.max_current_A 100\n"
)
SIMPLEFOC = "BLDCMotor motor = BLDCMotor(7, 0.1664, 160.0f, 0.00003);\nmotor.current_limit = 5;\n"
