"""Source text of a lane's memory, the same for every driver: rows read, a fresh cell begun, rows written."""

BEGIN = """\
fresh = (stage > 0.5) & (stage < 1.5)
active = fresh | ((stage > 1.5) & (stage < 2.5))
if any_lane(fresh):
    start = begun(flips, parameters)
    {begin}
    endless = not_((flips >= 1.0) & (flips < math.inf))
    unsure = where(start.blur <= {blur}, 0.0, INACCURATE)
    verdict = where(fresh, where(start.beyond | endless, BAD_INPUT, unsure), verdict)
"""


def loaded_rows(rows, names):
    """Statements that read so many of the rows."""
    return "\n".join(f"{name} = memory[{rows.index(name)}][i]" for name in names)


def stored_rows(rows, names):
    """Statements that write them."""
    return "\n".join(f"memory[{rows.index(name)}][i] = {name}" for name in names)


def chosen(lanes, names, record):
    """Statements that give the lanes the entries of a tuple."""
    return [f"{name} = where({lanes}, {record}[{j}], {name})" for j, name in enumerate(names)]


def begun_rows(states, signs, ons, values):
    """Statements that give fresh lanes their state, signs and marks, and further (name, value)."""
    return "\n".join(
        [
            *chosen("fresh", states, "start.state"),
            *chosen("fresh", signs, "start.signs"),
            *chosen("fresh", ons, "start.on"),
            *(f"{name} = where(fresh, {value}, {name})" for name, value in values),
        ]
    )
