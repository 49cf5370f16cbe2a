"""The physics: one module a scene, each a `Kernel` that the engine sweeps over columns of cells."""
