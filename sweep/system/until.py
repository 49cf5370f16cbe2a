"""When a run is to stop: `--until 07:00`."""

from __future__ import annotations

from datetime import datetime, time, timedelta

from sweep.system.errors import SweepError


class TimeUp(Exception):
    """The time a run was given is over."""


def deadline(text: str | datetime | None, now: datetime | None = None) -> datetime | None:
    """The time that is meant, with a time zone.

    Parameters
    ----------
    text : str, datetime or None
        "07:00" is the next time it is seven, here; "2027-01-31 07:00" is that moment.

    Raises
    ------
    SweepError
        It is no time.
    """
    if text is None:
        return None
    if isinstance(text, datetime):
        return text.astimezone()
    here = (now or datetime.now()).astimezone()
    try:
        clock = time.fromisoformat(text.strip())
    except (ValueError, AttributeError):
        return _moment(text)
    if clock.tzinfo is not None:
        here = here.astimezone(clock.tzinfo)
    at = datetime.combine(here.date(), clock).astimezone()
    # the next day by its date, for days of 23 and 25 hours
    return at if at > here else datetime.combine(here.date() + timedelta(days=1), clock).astimezone()


def _moment(text: object) -> datetime:
    try:
        if not isinstance(text, str):
            raise ValueError
        return datetime.fromisoformat(text.strip()).astimezone()
    except ValueError:
        raise SweepError(f'until: expected a time like "07:00" or "2027-01-31 07:00", found {text!r}') from None


def passed(until: datetime | None) -> bool:
    """Whether it is time to stop."""
    return until is not None and datetime.now().astimezone() >= until
