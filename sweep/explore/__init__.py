"""What runs sweeps to learn something: `plan`, `work_precision`, `refine`, `groups` (superfluous axes), `reference`."""
