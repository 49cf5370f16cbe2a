"""Names of the kernels and where they are; a kernel's module, and with it numba, is imported only when asked for."""

from __future__ import annotations

from kernels.interface import Kernel, load

KERNELS = {
    "foliot": "kernels.foliot:FOLIOT",
    "foliot_motion": "kernels.foliot_motion:FOLIOT_MOTION",
    "foliot_ripple": "kernels.foliot_ripple:FOLIOT_RIPPLE",
    "foliot_start": "kernels.foliot_start:FOLIOT_START",
    "foliot_noise": "kernels.foliot_noise:FOLIOT_NOISE",
    "foliot_design": "kernels.foliot_design:FOLIOT_DESIGN",
    "foliot_steps": "kernels.foliot_steps:FOLIOT_STEPS",
    "balance": "kernels.balance:BALANCE",
    "balance_trace": "kernels.balance_trace:BALANCE_TRACE",
    "balance_driven": "kernels.balance_driven:BALANCE_DRIVEN",
    "impact": "kernels.impact:IMPACT",
    "polisher": "kernels.polisher:POLISHER",
    "polisher_motion": "kernels.polisher_motion:POLISHER_MOTION",
    "polisher_wear": "kernels.polisher_wear:POLISHER_WEAR",
    "drivetrain_frf": "kernels.drivetrain_frf:DRIVETRAIN_FRF",
    "polisher_wear_point": "kernels.polisher_wear_point:POLISHER_WEAR_POINT",
    "drivetrain": "kernels.drivetrain:DRIVETRAIN",
}


def get(name: str) -> Kernel:
    """The kernel of that name. Raises KeyError."""
    kernel: Kernel = load(KERNELS[name])
    return kernel
