"""Names and places of the kernels; a kernel's module, and with it numba, is imported only when it is used."""

from __future__ import annotations

from kernels.interface import Kernel, load

KERNELS = {
    "foliot": "kernels.foliot.cycle:FOLIOT",
    "foliot_motion": "kernels.foliot.motion:FOLIOT_MOTION",
    "foliot_ripple": "kernels.foliot.ripple:FOLIOT_RIPPLE",
    "foliot_start": "kernels.foliot.start:FOLIOT_START",
    "foliot_noise": "kernels.foliot.noise:FOLIOT_NOISE",
    "foliot_design": "kernels.foliot.design:FOLIOT_DESIGN",
    "foliot_steps": "kernels.foliot.steps:FOLIOT_STEPS",
    "verge": "kernels.foliot.verge:VERGE",
    "balance": "kernels.balance.release:BALANCE",
    "balance_trace": "kernels.balance.trace:BALANCE_TRACE",
    "balance_driven": "kernels.balance.driven:BALANCE_DRIVEN",
    "impact": "kernels.impact.clock:IMPACT",
    "polisher": "kernels.polisher.arm:POLISHER",
    "polisher_motion": "kernels.polisher.motion:POLISHER_MOTION",
    "polisher_wear": "kernels.wear.ring:POLISHER_WEAR",
    "polisher_wear_point": "kernels.wear.point:POLISHER_WEAR_POINT",
    "drivetrain": "kernels.drivetrain.reduced:DRIVETRAIN",
    "drivetrain_frf": "kernels.drivetrain.receptance:DRIVETRAIN_FRF",
}


def get(name: str) -> Kernel:
    """The kernel of that name. Raises KeyError."""
    kernel: Kernel = load(KERNELS[name])
    return kernel
