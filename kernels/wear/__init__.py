"""Preston wear of a rotating workpiece under the polisher's tool: `ring` (over the radius), `point` (of one point)."""
