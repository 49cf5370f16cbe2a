"""Source text put together from templates, and modules made of it."""

import re
from textwrap import indent


def listed(names):
    """The names as the inside of a tuple."""
    names = list(names)
    return ", ".join(names) + ("," if len(names) == 1 else "")


def folded(pair, names):
    """pair(pair(a, b), c) ... of the names, `pair` a format of two."""
    first, *rest = names
    for name in rest:
        first = pair.format(first, name)
    return first


def filled(template, **parts):
    """The template with {name} replaced; one alone in a line may be many lines, indented as it is, or none."""

    def block(match):
        text = str(parts[match[2]])
        return indent(text, match[1]) + "\n" if text else ""

    text = re.sub(r"^( *)\{(\w+)\}\n", block, template, flags=re.MULTILINE)
    return re.sub(r"\{(\w+)\}", lambda match: str(parts[match[1]]), text)
