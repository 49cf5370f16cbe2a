"""The polishing machine of the paper, worn over its workpiece."""

PAPER = {
    "b": 62.01, "d": 38.0, "f": 40.5, "e": 10.0, "type": 0.0, "omega": 1.0, "b_angle": -0.66, "L": 50.0, "beta": 0.0,
    "w_x": 50.0, "w_y": 1.0, "Omega": 0.4, "tool_a": 5.0, "tool_b": 5.0, "tool_n": 2.0, "tool_m": 2.0, "preston": 1.0,
    "pressure": 1.0, "load": 0.0, "workpiece_radius": 0.0,
}  # fmt: skip
