"""The escape handler by itself: another robot's fail-safe, fed by its own compass and its own "I am stuck".

Run it: python examples/escape_handler_alone.py
"""

from wayfarer import Anomaly, Observation, Vehicle, make_handler

PERIOD_S = 0.05
vehicle = Vehicle(length_m=0.4, width_m=0.4, track_m=0.5, max_speed_m_s=1.4)
handler = make_handler("forest-pledge", vehicle=vehicle)

heading_deg, travelled_m = 0.0, 0.0
for tick in range(120):
    seen = Observation(
        t_s=tick * PERIOD_S, heading_deg=heading_deg % 360.0, pitch_deg=0.0, roll_deg=0.0,
        anomalies=(Anomaly.IMMOBILISED,) if tick == 20 else (),  # what the other stack's own stuck detector says
        contact=None, goal_heading_deg=0.0, travelled_m=travelled_m,
    )  # fmt: skip
    decision = handler.decide(seen)
    left, right = decision.wheels  # hand these to your motors; here a rover without mass obeys at once
    heading_deg += (left - right) * vehicle.max_speed_m_s / vehicle.track_m * PERIOD_S * 57.3
    travelled_m += abs(left + right) / 2 * vehicle.max_speed_m_s * PERIOD_S
    if decision.why != decision.phase.value:
        print(f"{seen.t_s:5.2f} s  {decision.why:20} -> {decision.phase.value:10} at {heading_deg:6.1f} deg")
