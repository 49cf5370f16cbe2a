"""A study: TOML (or a dict) in, a checked `Study` out, all mistakes at once. The only room that imports pint.

Others may use
    `read`           read_study, build_study, as_study
    `model`          Study, Axis, Summary
    `kernel_lookup`  load_kernel: a kernel by the name that a study gives it
    `mistakes`       how found, allowed and meant words are told
    `units`          scale, exponents

`study_parser` (the keys), `field_parser` (their entries), `summary` and `spacing` are behind `read`.
"""
