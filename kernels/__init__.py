"""The physics: one module per model, each with a `Kernel` that the engine applies to columns of cells."""
