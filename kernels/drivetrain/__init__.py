"""Torsional chains of up to 64 inertias: `reduced` (frequencies and reductions), `receptance` (over frequency)."""
