"""Source text of the linear equations that a stiff scene's steps solve, with the exact Jacobian of its rates.

The Jacobian's entries are derivatives of the recorded expressions (`tangent`); those that are 0 for every motion are
left out. Rows are brought to triangular form one by one, the row with the larger entry becoming the pivot's (pairwise
pivoting), so that no factor exceeds 1.
Source of the pivoting: Sorensen, IEEE Trans. Comput. C-34:274 (1985).
"""

from kernels.source_text.series import Lines
from kernels.source_text.tangent import Tangents
from kernels.source_text.template import filled, listed

LINEAR = '''
@jit_call
def factored(state, mode, h):
    """I - h J in triangular form: 1 over its diagonal, what is above, the factors, and which rows were swapped."""
    {unpack}
    {lines}
    return ({diagonal}), ({above}), ({factors}), ({swaps})


@jit_call
def solved(factors, right):
    """The solution of these equations."""
    ({diagonal}), ({above}), ({factors}), ({swaps}) = factors
    {unknowns} = right
    {steps}
    return ({unknowns})
'''


class Elimination:
    """Statements that bring a matrix to triangular form, and that solve with it.

    Parameters
    ----------
    entries : dict from (row, column) to the name of an entry; where there is none it is 0
    n : number of rows
    """

    def __init__(self, entries, n):
        self.text, self.forward, self._entries, self._n = [], [], dict(entries), n
        self.pairs = []
        for k in range(n):
            for r in range(k + 1, n):
                if (r, k) in self._entries:
                    self._eliminate(k, r)

    def _eliminate(self, k, r):
        """Row r below row k: the one with the larger entry in column k goes up."""
        self.pairs.append((k, r))
        swap, factor = f"swap_{k}_{r}", f"factor_{k}_{r}"
        self.text.append(f"{swap} = magnitude({self._entries[r, k]}) > magnitude({self._entry(k, k)})")
        for c in range(k, self._n):
            if (k, c) in self._entries or (r, c) in self._entries:
                upper, lower = self._entry(k, c), self._entry(r, c)
                self.text.append(f"up_{c}, down_{c} = where({swap}, {lower}, {upper}), where({swap}, {upper}, {lower})")
                self._entries[k, c], self._entries[r, c] = (f"e_{row}_{c}" for row in (k, r))
                self.text.append(f"e_{k}_{c}, e_{r}_{c} = up_{c}, down_{c}")
        self.text.append(f"{factor} = e_{r}_{k} / e_{k}_{k}")
        below = [c for c in range(k + 1, self._n) if (k, c) in self._entries]
        self.text += [f"e_{r}_{c} = fma(-{factor}, e_{k}_{c}, e_{r}_{c})" for c in below]
        self.forward += [
            f"up_0, down_0 = where({swap}, x_{r}, x_{k}), where({swap}, x_{k}, x_{r})",
            f"x_{k}, x_{r} = up_0, fma(-{factor}, up_0, down_0)",
        ]

    def _entry(self, row, column):
        return self._entries.get((row, column), "0.0 * side")

    def above(self):
        """Places above the diagonal that are not 0."""
        return [(r, c) for r, c in sorted(self._entries) if c > r]

    def named(self, row, column):
        """A statement that gives an entry its own name."""
        return f"e_{row}_{column} = {self._entry(row, column)}"

    def backward(self):
        """Statements of the back substitution."""
        lines = []
        for k in reversed(range(self._n)):
            lines += [f"x_{k} = fma(-e_{k}_{c}, x_{c}, x_{k})" for r, c in self.above() if r == k]
            lines.append(f"x_{k} = x_{k} * over_{k}")
        return lines


def linear(writer):
    """The text of `factored` and `solved`."""
    lines, n = Lines(writer.names), len(writer.states)
    entries = {}
    for c, state in enumerate(writer.scene.states):
        tangents = Tangents.along(writer.recorded.graph, state)
        for r, rate in enumerate(writer.recorded.rates):
            slope = tangents.of(rate)
            one = "1.0 + 0.0 * side" if r == c else "0.0 * side"
            if slope is not None:
                lines.text.append(f"e_{r}_{c} = fma(-h, {lines.value(slope)}, {one})")
                entries[r, c] = f"e_{r}_{c}"
            elif r == c:
                entries[r, c] = one
    found = Elimination(entries, n)
    above, every = found.above(), [(k, k) for k in range(n)]
    last = [found.named(*place) for place in (*above, *every)]
    last += [f"over_{k} = 1.0 / e_{k}_{k}" for k in range(n)]
    return filled(
        LINEAR, unpack=writer.all_unpacked, lines="\n".join([*lines.text, *found.text, *last]),
        diagonal=listed(f"over_{k}" for k in range(n)), above=listed(f"e_{r}_{c}" for r, c in above),
        factors=listed(f"factor_{k}_{r}" for k, r in found.pairs),
        swaps=listed(f"swap_{k}_{r}" for k, r in found.pairs),
        unknowns=listed(f"x_{k}" for k in range(n)), steps="\n".join([*found.forward, *found.backward()]),
    )  # fmt: skip
