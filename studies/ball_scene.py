"""Ball that bounces on a table that goes up and down: its way from even bounces to chaos.

    x'' = -1,    v -> (1 + e) push cos t - e v    where x falls onto the table at push sin t               (1)

in units of the table's angular frequency w and of g/w^2, so that `push` is the table's largest acceleration over g.
"""

from kernels.scene import Field, cos, pi, sin
from kernels.trajectory import section_kernel

KERNEL = section_kernel(
    name="ball_scene",
    doc="ball at its bounces on a table that goes up and down",
    states=(Field("x", "1", "height at the bounce"), Field("v", "1", "speed before the bounce")),
    parameters=(
        Field("push", "1", "largest acceleration of the table over g", lower=0.0),
        Field("e", "1", "coefficient of restitution", default=0.5, lower=0.0, upper=1.0),
    ),
    rates=lambda v: (v, -1.0),
    surface=lambda x, t, push: x - push * sin(t),
    switch=lambda x, v, t, push, e: (x, (1.0 + e) * push * cos(t) - e * v),
    start=lambda: (0.0, pi),
    source="Holmes, J. Sound Vib. 84:173 (1982); Tufillaro and Albano, Am. J. Phys. 54:939 (1986)",
    example={"push": 1.4},
)
